"""Write files and folders atomically: complete or not at all."""

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .inputs import InputError, printable

_unfinished: dict[Path, list[Path]] = {}  # with the folders made for them, the deepest first
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary file beside `path`; it is renamed to `path` when the block ends without an exception.

    A link is followed to its file; missing folders are created. Raises `InputError` if the file cannot be written.
    An existing file is not changed.
    """
    target = check_writable(path)

    def make() -> str:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".", suffix=target.suffix)
        os.close(handle)
        return name

    with _beside(path, target, make, 0o666) as temporary:
        yield temporary


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path`; it is renamed to `path` when the block ends without an exception.

    Raises `InputError` if `path` exists already, or cannot be written.
    """
    try:
        there = path.exists() or path.is_symlink()
    except OSError as error:  # too long for a file name
        raise _refusal(path, error) from None
    if there:
        raise InputError(f"{printable(str(path))} must be a new path, got one that exists")
    target = check_writable(path)
    with _beside(path, target, lambda: tempfile.mkdtemp(dir=target.parent, prefix="."), 0o777) as temporary:
        yield temporary


@contextmanager
def _beside(path: Path, target: Path, make: Callable[[], str], mode: int) -> Iterator[Path]:
    """Yield what `make` makes; it becomes `target` when the block ends, with the permissions of what it replaces."""
    new = [folder for folder in target.parents if not folder.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(make())
    except (OSError, ValueError) as error:
        _remove_empty(new)
        raise _refusal(path, error) from None
    _unfinished[temporary] = new
    try:
        yield temporary
        temporary.chmod(_mode(target, mode))
        temporary.replace(target)
    except BaseException as error:
        _remove(temporary)
        _remove_empty(new)
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            raise _refusal(path, error) from None
        raise
    finally:
        _unfinished.pop(temporary, None)


def remove_unfinished() -> None:
    """Remove unfinished files, for a process that ends without unwinding its blocks."""
    for temporary, new in tuple(_unfinished.items()):
        with suppress(OSError):
            _remove(temporary)
        _remove_empty(new)


def _remove(temporary: Path) -> None:
    if temporary.is_dir():
        shutil.rmtree(temporary, ignore_errors=True)
    else:
        temporary.unlink(missing_ok=True)


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders that are still empty, the deepest first."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def check_writable(path: Path) -> Path:
    """Return the file that `path` leads to; call this before computing its contents, and before writing anything.

    Raises `InputError` if it is a folder, a device or a pipe, or its folder cannot be written or created.
    """
    where = printable(str(path))
    try:
        target = path.resolve()
        if not path.name or target.is_dir():
            raise InputError(f"{where} must be the path of a file, got a folder")
        if target.exists() and not stat.S_ISREG(target.stat().st_mode):
            raise InputError(f"{where} must be the path of a file, got a device or a pipe")
        # A command that is refused later must leave no empty folder behind: none is created here.
        nearest = next(folder for folder in target.parents if folder.exists())
        if not nearest.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        with tempfile.TemporaryFile(dir=nearest):  # permissions do not suffice: root has all, even in /proc
            pass
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:
        raise _refusal(path, error) from None
    return target


def _refusal(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"{printable(str(path))}: cannot be written ({reason})")


def _mode(target: Path, new: int) -> int:
    """Return the permissions of the file to replace, or those that this process gives to `new` ones."""
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return new & ~mask
