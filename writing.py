"""Files and folders that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError

_unfinished: set[Path] = set()
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary place beside `path` to write to; it takes the name `path` when the block ends without an exception.

    A link is followed to the file that it stands for; folders that are missing are made.

    Raises
    ------
    InputError
        If the place cannot be written to. A file that was there before is left as it was.
    """
    target = check_writable(path)
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".", suffix=target.suffix)
        os.close(handle)
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        temporary.chmod(_mode(target))
        os.replace(temporary, target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            raise _refusal(path, error) from None
        raise
    finally:
        _unfinished.discard(temporary)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` to fill; it takes the name `path` when the block ends without an exception.

    Raises
    ------
    InputError
        If something is there already, which is left as it is, or the place cannot be written to.
    """
    if path.exists() or path.is_symlink():
        raise InputError(f"{path}: is there already; accepted: a new path")
    target = check_writable(path)
    try:
        temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix="."))
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    _unfinished.add(temporary)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o777 & ~mask)
        temporary.rename(target)
    except BaseException as error:
        shutil.rmtree(temporary, ignore_errors=True)
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            raise _refusal(path, error) from None
        raise
    finally:
        _unfinished.discard(temporary)


def remove_unfinished() -> None:
    """Remove what is being written now, for a process that ends without unwinding its blocks."""
    for temporary in tuple(_unfinished):
        with suppress(OSError):
            if temporary.is_dir():
                shutil.rmtree(temporary, ignore_errors=True)
            else:
                temporary.unlink(missing_ok=True)


def check_writable(path: Path) -> Path:
    """The file that `path` stands for, its folder made, before any work is done for it.

    Raises
    ------
    InputError
        If it is a folder, a device or a pipe, or its folder cannot be written to.
    """
    try:
        target = path.resolve()
        if not path.name or target.is_dir():
            raise InputError(f"{path}: is a folder; accepted: the path of a file")
        if target.exists() and not stat.S_ISREG(target.stat().st_mode):
            raise InputError(f"{path}: is a device or a pipe; accepted: the path of a file")
        target.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(target.parent, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:
        raise _refusal(path, error) from None
    return target


def _refusal(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"{path}: cannot be written ({reason}); accepted: a writable place")


def _mode(target: Path) -> int:
    """Permissions of the file that is replaced, or what this process gives to new files."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
