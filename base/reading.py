"""Read files of strangers: only regular files, and no more of them than is accepted."""

import stat
from collections import deque
from pathlib import Path

from .inputs import InputError, printable

LARGEST_FILE = 1_000_000  # [bytes]; the largest robot of the library has a few kB
BLOCK = 2**20  # [bytes]
files_read: deque[Path] = deque(maxlen=1000)  # the last ones: a command must not overwrite what it reads


def check_file(path: Path, what: str, largest: int) -> int:
    """Return the size of a regular file [bytes]; `what` describes it in the message.

    Raises `InputError` if there is no such file, it is a folder, a device or a pipe, from which reading may never
    end, or too large.
    """
    where = printable(str(path))
    try:
        found = path.stat()
    except FileNotFoundError:
        raise InputError(f"{where}: no such file") from None
    except (OSError, ValueError) as error:
        raise _unreadable(where, error) from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{where} is a folder, not a file")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{where} must be {what}, got a device or a pipe")
    if found.st_size > largest:
        raise _too_large(where, what, largest, found.st_size)
    files_read.append(path)
    return found.st_size


def read_bytes(path: Path, what: str, largest: int = LARGEST_FILE) -> bytes:
    """Return the content of `path`, or raise InputError if it cannot be read or is too large; `what` describes it."""
    size = check_file(path, what, largest)
    where = printable(str(path))
    try:
        with path.open("rb") as stream:
            content = stream.read(size)
            while len(content) <= largest and (more := stream.read(BLOCK)):  # files of /proc have no size
                content += more
    except (OSError, ValueError) as error:
        raise _unreadable(where, error) from None
    if len(content) > largest:
        raise _too_large(where, what, largest, len(content))
    return content


def _too_large(where: str, what: str, largest: int, size: int) -> InputError:
    return InputError(f"{where} must be {what} of at most {largest / 1e6:g} MB, got {size / 1e6:.1f} MB")


def _unreadable(where: str, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"{where}: cannot be read ({reason})")
