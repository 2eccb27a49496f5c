"""Checkpoints: the results so far in an SQLite file, so that a run that was stopped can be resumed.

Each result is committed as it comes, to SQLite's write-ahead log FILE-wal, and so survives the end of the process; once
a second the disk has it, and so it survives a power cut. The log is gone after a run that ended normally or with an
error; after a kill it belongs to the file, and the next run takes it in.

The table `record` has numbered results with the CRC-32 of both, and as number -1 the header: everything that the
results depend on, as JSON. The database's `application_id` is the kind of results. One process at a time has the file.
"""

import json
import sqlite3
import time
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from .errors import InputError
from .writing import check_writable

ACCEPTED = "a checkpoint of this run"
HEADER = -1  # its number
PAGE = 16_384  # [bytes]; holds seven chunks of a workspace, where a page of the usual 4096 holds one
SAFE_EVERY = 1.0  # [s] between writes that survive a power cut
TABLE = "CREATE TABLE record (number INTEGER PRIMARY KEY, content BLOB NOT NULL, crc INTEGER NOT NULL)"
WRITE = "INSERT OR IGNORE INTO record VALUES (?1, ?2, crc32(?2, ?1))"


class Kind(NamedTuple):
    """The kind of results in a checkpoint."""

    what: str  # what computes them, such as "workspace"
    unit: str  # what a result is called in messages, such as "chunk"


class Checkpoint:
    """The numbered results in an open checkpoint."""

    def __init__(self, path: Path, kind: Kind, database: sqlite3.Connection):
        self._path, self._kind, self._database = path, kind, database
        # how many there are
        self.stored: int = database.execute("SELECT count(*) FROM record WHERE number >= 0").fetchone()[0]
        self._safe_at = time.monotonic()

    def get(self, number: int) -> bytes | None:
        """Return the content of a result, or None if there is none of this number."""
        found = self._database.execute("SELECT content FROM record WHERE number = ?", (number,)).fetchone()
        return found and found[0]

    def items(self) -> Iterator[tuple[int, bytes]]:
        """Yield the number and the content of each result, by number."""
        yield from self._database.execute("SELECT number, content FROM record WHERE number >= 0 ORDER BY number")

    def put(self, number: int, content: bytes) -> None:
        """Store a result unless there is one of this number.

        Raises `InputError` if it cannot be written, as on a full disk. The file can be resumed.
        """
        try:
            self.stored += self._database.execute(WRITE, (number, content)).rowcount
            if time.monotonic() - self._safe_at > SAFE_EVERY:
                self._database.execute("PRAGMA wal_checkpoint")
                self._safe_at = time.monotonic()
        except sqlite3.Error as error:
            where = f"{self._path} cannot be written after {self._kind.unit} {self.stored}"
            raise InputError(f"checkpoint {where} ({error}); it can be resumed") from None


@contextmanager
def open_checkpoint(path: Path, kind: Kind, header: dict[str, Any], resume: bool) -> Iterator[Checkpoint]:
    """Open a checkpoint for a run that `header` describes.

    - `path`: the file.
    - `kind`: what it holds.
    - `header`: everything that the results depend on, by names for messages; ready for JSON.
    - `resume`: False: create a new file. True: continue the file, or create it if there is none or an empty one.

    Raises `InputError` if the file cannot be written; if it exists and `resume` is False; if it is no checkpoint, of
    another run, damaged, or in use. The file is not changed then.
    """
    target = check_writable(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if not resume:
            target.touch(exist_ok=False)
    except FileExistsError:
        raise InputError(f"checkpoint must be a new file unless it is resumed, got {path}, which exists") from None
    except OSError as error:
        raise InputError(f"checkpoint must be a file that can be written, got {path} ({error.strerror})") from None
    with closing(sqlite3.connect(target, timeout=0, isolation_level=None)) as database:
        try:
            _begin(path, kind, database, header)
            checkpoint = Checkpoint(path, kind, database)
        except sqlite3.Error as error:
            raise _refusal(path, kind, error) from None
        yield checkpoint


def _begin(path: Path, kind: Kind, database: sqlite3.Connection, header: dict[str, Any]) -> None:
    """Lock the database; create its table, or check what it has."""
    kind_id = zlib.crc32(f"towline {kind.what}".encode()) >> 1
    database.create_function("crc32", 2, zlib.crc32, deterministic=True)
    database.execute("PRAGMA locking_mode = EXCLUSIVE")
    database.execute(f"PRAGMA page_size = {PAGE}")
    database.execute("BEGIN EXCLUSIVE")
    (found,) = database.execute("PRAGMA application_id").fetchone()
    if found == 0 and not database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        database.execute(f"PRAGMA application_id = {kind_id}")
        database.execute(TABLE)
        database.execute(WRITE, (HEADER, json.dumps(header, sort_keys=True).encode()))
    elif found != kind_id:
        raise _foreign(path, kind)
    else:
        _check(path, database, header)
    database.execute("COMMIT")
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA synchronous = NORMAL")


def _check(path: Path, database: sqlite3.Connection, header: dict[str, Any]) -> None:
    """Raise InputError if the database is damaged, or its header belongs to another run."""
    whole = database.execute("PRAGMA quick_check(1)").fetchone() == ("ok",)
    broken = "SELECT count(*) FROM record WHERE crc32(CAST(content AS BLOB), number) IS NOT crc"
    content = database.execute("SELECT content FROM record WHERE number = ?", (HEADER,)).fetchone()
    if not whole or database.execute(broken).fetchone()[0] or content is None:
        raise InputError(f"checkpoint must be {ACCEPTED}, got {path}, which is damaged")
    stored = json.loads(content[0])
    for name in {**header, **stored}:
        if header.get(name) != stored.get(name):
            ours, theirs = (_brief(values.get(name)) for values in (header, stored))
            raise InputError(
                f"checkpoint must be {ACCEPTED}, got {path} of another run, with {name} {theirs}, not {ours}"
            )


def _foreign(path: Path, kind: Kind) -> InputError:
    what = f"towline's {kind.what}"
    return InputError(f"checkpoint must be {ACCEPTED} or a new file, got {path}, which is not a checkpoint of {what}")


def _refusal(path: Path, kind: Kind, error: sqlite3.Error) -> InputError:
    """Return the message for an error of SQLite while a checkpoint is opened."""
    name = getattr(error, "sqlite_errorname", "")
    if name == "SQLITE_NOTADB":
        return _foreign(path, kind)
    if name.startswith("SQLITE_BUSY"):
        return InputError(f"checkpoint must not be in use, got {path}, to which another run is writing")
    if name.startswith("SQLITE_CORRUPT"):
        return InputError(f"checkpoint must be {ACCEPTED}, got {path}, which is damaged")
    return InputError(f"checkpoint must be a file that can be written, got {path} ({error})")


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
