"""Files are written whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from towline.base.errors import InputError
from towline.base.writing import check_writable, remove_unfinished, whole_file, whole_folder


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


def test_folders_devices_and_pipes_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, kind in (
        (tmp_path, "folder"),
        (Path("/dev/null"), "device"),
        (tmp_path / "pipe", "pipe"),
        (Path(), "folder"),
    ):
        with pytest.raises(InputError, match=kind):
            check_writable(path)
        with pytest.raises(InputError, match=kind), whole_file(path):
            pass
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_check_creates_no_folder_and_a_failure_leaves_none(tmp_path):
    file = tmp_path / "new" / "deep" / "robot.yaml"
    assert check_writable(file) == file
    assert not os.listdir(tmp_path)
    with pytest.raises(ZeroDivisionError), whole_file(file) as temporary:
        temporary.write_text(f"{1 / 0}")
    assert not os.listdir(tmp_path)
    with whole_file(file) as temporary:  # what a command does that ends without unwinding
        remove_unfinished()
        assert not os.listdir(tmp_path)
        temporary.parent.mkdir(parents=True)
        temporary.write_text("robot")
    assert file.read_text() == "robot"


def test_a_folder_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file/new/robot\.yaml: cannot be written \(Not a directory\)"):
        check_writable(tmp_path / "file" / "new" / "robot.yaml")


def test_a_name_that_is_too_long_is_refused(tmp_path):
    for write in (whole_file, whole_folder):
        with pytest.raises(InputError, match="cannot be written"), write(tmp_path / ("x" * 5000)):
            pass


def test_links_are_followed_and_permissions_kept(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("before")
    real.chmod(0o640)
    link.symlink_to(real)
    with whole_file(link) as temporary:
        temporary.write_text("after")
    assert link.is_symlink()
    assert real.read_text() == "after"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640


def test_a_folder_comes_whole_or_not_at_all(tmp_path):
    with whole_folder(tmp_path / "new") as temporary:
        (temporary / "part").write_text("a")
        assert not (tmp_path / "new").exists()
    assert (tmp_path / "new" / "part").read_text() == "a"
    with pytest.raises(InputError, match="must be a new path, got one that exists"), whole_folder(tmp_path / "new"):
        pass
    with pytest.raises(RuntimeError), whole_folder(tmp_path / "other"):
        raise RuntimeError("in the middle")
    assert os.listdir(tmp_path) == ["new"]
