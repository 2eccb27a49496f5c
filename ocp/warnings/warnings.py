"""`warnings`: all warnings of a motion."""

from .inside_bodies import into_each_other
from .instants import Instants
from .outside_frame import outside_frame
from .short_cables import short_cables


def warnings(seen: Instants) -> tuple[str, ...]:
    """Return facts to know before a robot follows a motion, a sentence each."""
    return (*outside_frame(seen), *short_cables(seen), *into_each_other(seen))
