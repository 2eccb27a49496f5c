"""`claim`: a statement of paper F, from `claims.yaml`."""

from __future__ import annotations

from pathlib import Path

from ..accounts.claim import Statement, statements


def claim(name: str) -> Statement:
    """Return what the paper states, by its name in the file."""
    return statements(Path(__file__).with_name("claims.yaml"))[name]
