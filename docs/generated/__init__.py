"""Pages that are made from the code when the site is built, so that they cannot go out of date."""

from .commands import commands
from .keys import robot_keys, task_keys
from .notebooks import notebooks
from .robots import live_pages, robots

__all__ = ["pages"]


def pages() -> dict[str, str | bytes]:
    """Return all pages and their pictures by their paths inside docs/."""
    return {
        "reference/commands.md": commands(),
        "reference/robot-keys.md": robot_keys(),
        "reference/task-keys.md": task_keys(),
        "reference/robots.md": robots(),
        **live_pages(),
        **notebooks(),
    }
