"""`claim`: a statement of paper F by its name in `claims.yaml`."""

from pathlib import Path

from ..accounts.claim import statements

claim = statements(Path(__file__).with_name("claims.yaml")).__getitem__
