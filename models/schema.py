"""`json_schema`: the JSON Schema of what a file describes."""

from functools import cache
from typing import Any

from pydantic import BaseModel


@cache
def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of a model, computed once; another kind of carrier empties the cache."""
    return model.model_json_schema()
