"""`identity`: a text that identifies objects in a later process, for checkpoints."""

import hashlib
import inspect
import io
import pickle
from typing import Any

from pydantic import BaseModel
from typing_extensions import override


class _Pickler(pickle.Pickler):
    """Pickle to bytes that are the same in each process, which are never read again."""

    @override
    def persistent_id(self, obj: Any) -> Any:
        # Sets of names are iterated in another order in each process; models have one of the keys in their file.
        if isinstance(obj, BaseModel):
            return type(obj).__name__, obj.model_dump_json()
        if isinstance(obj, set | frozenset):
            return sorted(map(repr, obj))
        return None


def identity(something: Any) -> str:
    """Return a hash of an object's content and of the source of its class or function, as far as there is one.

    Raises `pickle.PicklingError`, `AttributeError` or `TypeError` if the object cannot be pickled.
    """
    stream = io.BytesIO()
    _Pickler(stream).dump(something)
    code = something if inspect.isroutine(something) else type(something)
    try:
        source = inspect.getsource(code)
    except (OSError, TypeError):  # built in, or typed into a console
        source = ""
    return hashlib.sha256(stream.getvalue() + source.encode()).hexdigest()[:16]
