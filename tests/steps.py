"""What the tests of exported control steps share."""

import shutil

import numpy as np
import pytest

from towline import load
from towline.benchmarks.step_states import twelve_cables


def required(*commands):
    """Skip the test if one of the commands is not there."""
    for command in commands:
        if shutil.which(command) is None:
            pytest.skip(f"there is no command {command}")


def robot_named(name):
    """Return a robot of the library, or that of twelve cables."""
    return twelve_cables() if name == "twelve" else load(name)


def line(*parts):
    """Return a line of input of the example program."""
    return " ".join(f"{number:.17g}" for part in parts for number in np.ravel(part)) + "\n"
