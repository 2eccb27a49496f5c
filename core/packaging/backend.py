"""The build backend: setuptools, plus a C compiler from the package index if the machine has none.

The core needs a compiler. If the machine has none, the package ziglang provides one (`compiler.py`). It is large, so it
is requested only then.
"""

from typing import Any

import compiler  # pyrefly: ignore[missing-import]
from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return the requirements to build a wheel, including a compiler if the machine has none."""
    wanted = compiler.required()  # first: what follows runs setup.py, in this process
    return wanted + build_meta.get_requires_for_build_wheel(config_settings)


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return the same for an editable installation."""
    wanted = compiler.required()
    return wanted + build_meta.get_requires_for_build_editable(config_settings)
