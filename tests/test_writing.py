"""Files are written whole or not at all."""

from pathlib import Path

import pytest

from towline.errors import InputError
from towline.writing import whole_file


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    file = tmp_path / "robot.yaml"
    with whole_file(file) as temporary:
        temporary.write_text("before")
    with pytest.raises(ZeroDivisionError), whole_file(file) as temporary:
        temporary.write_text(f"after {1 / 0}")
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


def test_a_place_that_cannot_be_written_to_is_named():
    with (
        pytest.raises(InputError, match=r"/proc/nowhere/robot\.yaml: cannot be written"),
        whole_file(Path("/proc/nowhere/robot.yaml")),
    ):
        pass
