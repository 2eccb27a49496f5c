"""`claim`: a statement of paper C, from `claims.yaml`."""

from pathlib import Path

from ..accounts.claim import Statement, statements


def claim(name: str) -> Statement:
    """Return what the paper states, by its name in the file."""
    return statements(Path(__file__).with_name("claims.yaml"))[name]
