"""The robots that ship with towline, one YAML file each, with their sources."""

import json
from pathlib import Path
from typing import Any

__all__ = ["FOLDER", "available", "contents"]

FOLDER = Path(__file__).parent


def available() -> list[str]:
    """Return the names of the robots in the library, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def contents() -> list[dict[str, Any]]:
    """Return name, cables, carriers of each kind, mass [kg] and source of each robot, without reading their files."""
    return json.loads((FOLDER / "contents.json").read_text(encoding="utf-8"))
