"""Messages: MCAP files, and bags of ROS 1 and ROS 2, as topics whose fields are read when they are asked for."""

from __future__ import annotations

import io
import json
import os
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import TypeIs

from ...base.errors import InputError
from .recording import Recording, Samples, Topic, plain

BLOCK = 1_000_000  # [bytes]
LARGEST_CHUNK = 64_000_000  # [bytes] of messages that are compressed together
MOST_MESSAGES = 20_000_000
MOST_TOPICS = 2000
MOST_LISTED = 64  # numbers of a list that may be quantities; a picture has more
MOST_ELEMENTS = 100_000  # of a list in a message
DEEPEST = 8  # structures inside each other
LOOKED_AT = 50  # messages of a topic whose fields are listed, because messages of TF differ
NAMED = ("name", "child_frame_id", "frame_id", "id")  # what an element of a list is called by
CLOCKS = ("header", "timestamp", "stamp")  # parts of messages that are no quantities
STAMPS = ("header.stamp", "timestamp", "stamp", "transforms[0].header.stamp")
INSTALL = "pip install 'towline[logs]'"
Decoder = Callable[[bytes], Any]


class Message(NamedTuple):
    """A message as it was recorded: its time [ns], its bytes, and a decoder of these if one is known."""

    topic: str
    kind: str
    time: int
    data: bytes
    decoder: Decoder | None


class _BoundedFile(io.BufferedReader):
    def read(self, size: int | None = -1, /) -> bytes:
        """Return no more bytes than there are, without memory for as many as a damaged record declares."""
        if size is not None and size > BLOCK:
            size = min(size, os.fstat(self.fileno()).st_size - self.tell())
        return super().read(size)


class _Bounded(type(Path())):
    """A path of a file that is opened as `_BoundedFile`."""

    def open(self, *_: Any, **__: Any) -> Any:
        """Open the file."""
        return _BoundedFile(io.FileIO(self))


@dataclass
class _Scan:
    """A topic as the first reading of a file finds it."""

    kind: str
    times: array[int]
    decoder: Decoder | None
    looked: list[bytes]


def from_mcap(path: Path, where: str) -> Recording:
    """Return the topics of an MCAP file."""
    return _recording(where, "MCAP", lambda wanted: _mcap(path, wanted))


def from_bag(path: Path, where: str, kind: str) -> Recording:
    """Return the topics of a bag of ROS 1 (.bag) or ROS 2 (.db3)."""
    return _recording(where, kind, lambda wanted: _bag(path, wanted))


def _recording(where: str, kind: str, messages: Callable[[set[str] | None], Iterator[Message]]) -> Recording:
    scans: dict[str, _Scan] = {}
    notes: list[str] = []
    count = 0
    with _refused(kind):
        for message in _until_cut(messages(None), notes):
            count += 1
            scan = scans.get(message.topic)
            if scan is None:
                scan = scans[message.topic] = _Scan(message.kind, array("q"), message.decoder, [])
            if count > MOST_MESSAGES or len(scans) > MOST_TOPICS:
                raise InputError(f"must have at most {MOST_MESSAGES} messages of {MOST_TOPICS} topics, got more")
            scan.times.append(min(message.time, 2**63 - 1))
            if len(scan.looked) < LOOKED_AT:
                scan.looked.append(message.data)
        topics = {name: _topic(name, scan, messages, kind) for name, scan in scans.items()}
    if not topics:
        raise InputError(f"must be {kind} with messages, got none")
    return Recording(where, kind, topics, notes=notes)


def _topic(name: str, scan: _Scan, messages: Callable[[set[str] | None], Iterator[Message]], kind: str) -> Topic:
    decoder = scan.decoder
    samples = [] if decoder is None else [decoder(data) for data in scan.looked]
    fields: dict[str, str] = {}
    for sample in samples:
        fields.update(dict.fromkeys(_numbers(sample, "", DEEPEST), ""))
    stamp = next((path for path in STAMPS if samples and _stamp_of(samples[0], path) > 0), None)

    def read(names: Sequence[str]) -> Samples:
        assert decoder is not None
        with _refused(kind):
            order, getters = _getters(names)
            values, times = array("d"), array("d")
            for message in _until_cut(messages({name}), []):
                content = decoder(message.data)
                for get in getters:
                    values.extend(get(content))
                times.append(_stamp_of(content, stamp) if stamp else 1e-9 * message.time)
        table = np.frombuffer(values).reshape(-1, len(names)) if values else np.empty((0, len(names)))
        return Samples(np.frombuffer(times) if times else np.empty(0), table[:, np.argsort(order)])

    return Topic(name, scan.kind, len(scan.times), 1e-9 * np.array(scan.times, dtype=float), fields, read)


@contextmanager
def _refused(kind: str) -> Iterator[None]:
    """Raise InputError in place of whatever a damaged file makes a reader raise."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        reason = plain(f"{type(error).__name__}: {error}")
        raise InputError(f"must be {kind} that can be read, got a damaged file ({reason})") from None


def _until_cut(messages: Iterator[Message], notes: list[str]) -> Iterator[Message]:
    """Yield messages up to the end of a file that was not closed, as of a computer that was switched off."""
    some = False
    try:
        for message in messages:
            some = True
            yield message
    except EOFError:
        if not some:
            raise
        notes.append("the end of the file is missing: everything before it is read")


def _mcap(path: Path, wanted: set[str] | None) -> Iterator[Message]:
    try:
        from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
        from mcap.records import Channel, Chunk, Message as Record, Schema
        from mcap.stream_reader import StreamReader, breakup_chunk
    except ImportError:
        raise InputError(f"is MCAP, for which the extra logs must be installed: {INSTALL}") from None
    schemas: dict[int, Any] = {}
    channels: dict[int, tuple[str, str, Decoder | None]] = {}
    with _Bounded(path).open() as file:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=path.stat().st_size)
        try:
            for outer in reader.records:
                records: Sequence[Any] = [outer]
                if isinstance(outer, Chunk):
                    outer.data, outer.compression = _unpacked(outer.compression, outer.data), ""
                    records = breakup_chunk(outer, validate_crc=True)
                for record in records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        schema = schemas.get(record.schema_id)
                        if record.id not in channels:
                            decoder = _decoder(record.message_encoding, schema)
                            channels[record.id] = record.topic, schema.name if schema else "", decoder
                    elif isinstance(record, Record):
                        topic, kind, decoder = channels[record.channel_id]
                        if wanted is None or topic in wanted:
                            yield Message(topic, kind, record.log_time, record.data, decoder)
        except (EndOfFile, RecordLengthLimitExceeded):
            raise EOFError("it ends within a record") from None


def _bag(path: Path, wanted: set[str] | None) -> Iterator[Message]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(f"is a bag of ROS, for which the extra logs must be installed: {INSTALL}") from None
    with AnyReader([_Bounded(path)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        store = reader.typestore  # which is the reader's no longer when it is closed
        store.max_sequence_length = MOST_ELEMENTS
        decode = store.deserialize_cdr if reader.is2 else store.deserialize_ros1
        for part in reader.readers:
            parts = getattr(part, "chunks", {})  # of ROS 1
            for place, chunk in parts.items():
                kind = next((kind for kind in ("bz2", "lz4") if kind in chunk.decompressor.__module__), "")
                if kind:
                    parts[place] = chunk._replace(decompressor=lambda data, kind=kind: _unpacked(kind, data))
        chosen = [one for one in reader.connections if wanted is None or one.topic in wanted]
        decoders: dict[str, Decoder] = {one.msgtype: partial(decode, typename=one.msgtype) for one in chosen}
        for connection, time, data in reader.messages(chosen) if chosen else ():
            yield Message(connection.topic, connection.msgtype, time, data, decoders[connection.msgtype])


def _unpacked(kind: str, data: bytes) -> bytes:
    """Return what is compressed, or raise InputError if it is larger than a chunk may be."""
    if kind == "zstd":
        from zstandard import ZstdDecompressor

        with ZstdDecompressor().stream_reader(data) as stream:
            result = stream.read(LARGEST_CHUNK + 1)
    elif kind == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        result = LZ4FrameDecompressor().decompress(data, LARGEST_CHUNK + 1)
    elif kind == "bz2":
        from bz2 import BZ2Decompressor

        result = BZ2Decompressor().decompress(data, LARGEST_CHUNK + 1)
    elif kind == "":
        result = data
    else:
        raise InputError(f"must be compressed by zstd, lz4 or bz2, got {plain(kind)!r}")
    if len(result) > LARGEST_CHUNK:
        raise InputError(f"must have at most {LARGEST_CHUNK / 1e6:g} MB in a chunk, got more")
    return result


def _decoder(encoding: str, schema: Any) -> Decoder | None:
    """Return what decodes the messages of a channel, or None if nothing here does."""
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda parts: SimpleNamespace(**parts))
    if encoding == "protobuf" and schema is not None:
        try:
            from mcap_protobuf.decoder import DecoderFactory  # pyrefly: ignore[missing-import]
        except ImportError:
            return None
        return DecoderFactory().decoder_for(encoding, schema)
    languages = {"cdr": ("ros2msg", "ros2idl"), "ros1": ("ros1msg",)}
    if schema is None or schema.encoding not in languages.get(encoding, ()):
        return None
    try:
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
        from rosbags.typesys.msg import normalize_msgtype
    except ImportError:
        raise InputError(f"has messages of ROS, for which the extra logs must be installed: {INSTALL}") from None
    store, text = get_typestore(Stores.EMPTY), schema.data.decode()
    store.max_sequence_length = MOST_ELEMENTS
    if schema.encoding == "ros2idl":
        for part in re.split(r"={80}\nIDL: .*\n", text):
            store.register(get_types_from_idl(part) if part.strip() else {})
    else:
        store.register(get_types_from_msg(text, schema.name))
    name, decode = normalize_msgtype(schema.name), store.deserialize_cdr
    if encoding == "ros1":
        decode = store.deserialize_ros1
    return partial(decode, typename=name)


def _parts(content: Any) -> dict[str, Any]:
    """Return the named parts of a structure, none of anything else."""
    if is_dataclass(content):
        return {name: getattr(content, name) for name in content.__dataclass_fields__ if not name.startswith("__")}
    if isinstance(content, SimpleNamespace):
        return {name: part for name, part in vars(content).items() if not set(name) & set(".[]")}
    described = getattr(content, "DESCRIPTOR", None)
    return {} if described is None else {field.name: getattr(content, field.name) for field in described.fields}


def _numbers(content: Any, path: str, deepest: int) -> Iterator[str]:
    """Yield the paths of the numbers in a message, such as pose.position.x, position[winch_1]."""
    for name, part in _parts(content).items():
        here = f"{path}.{name}" if path else name
        if name in CLOCKS:
            continue
        if isinstance(part, int | float) and not isinstance(part, bool):
            yield here
        elif isinstance(part, str | bytes) or not deepest:
            continue
        elif _is_list(part):
            if not 0 < len(part) <= MOST_LISTED:
                continue
            keys = _keys(content, part)
            if isinstance(part[0], int | float | np.number):
                yield from (f"{here}[{key}]" for key in keys)
            else:
                for key, element in zip(keys, part, strict=True):
                    yield from _numbers(element, f"{here}[{key}]", deepest - 1)
        else:
            yield from _numbers(part, here, deepest - 1)


def _is_list(part: Any) -> TypeIs[Sequence]:
    return isinstance(part, Sequence | np.ndarray) or type(part).__name__.startswith("Repeated")


def _keys(owner: Any, part: Any) -> list[str]:
    """Return what the elements of a list are called by: their names, or numbers from 0."""
    names = getattr(owner, "name", None)  # of JointState, beside its lists
    if not isinstance(names, Sequence) or isinstance(names, str) or len(names) != len(part):
        names = [next((text for key in NAMED if (text := getattr(one, key, None))), None) for one in part]
    names = [name if isinstance(name, str) and not set(name) & set("[]") else "" for name in names]
    return names if all(names) and len(set(names)) == len(names) else [str(i) for i in range(len(part))]


def _getters(paths: Sequence[str]) -> tuple[list[int], list[Callable[[Any], Sequence[float]]]]:
    """Return functions that return some of the numbers at paths in a message, and the order of what they return."""
    lists: dict[str, list[int]] = {}
    for i, path in enumerate(paths):
        lists.setdefault(path.rpartition("[")[0] if path.endswith("]") and path.count("[") == 1 else path, []).append(i)
    getters: list[Callable[[Any], Sequence[float]]] = []
    for head, members in lists.items():
        keys = [paths[i].rpartition("[")[2][:-1] for i in members]
        getters.append(_single(head) if paths[members[0]] == head else _elements(head, keys))
    return [i for members in lists.values() for i in members], getters


def _elements(head: str, keys: Sequence[str]) -> Callable[[Any], Sequence[float]]:
    """Return a function that returns elements of a list in a message, nan where it has none of that name."""
    part_of, owner_of = attrgetter(head), attrgetter(head.rpartition(".")[0]) if "." in head else _itself
    known: list[Any] = [None, -1, None]  # names and size of the last message's list, and where the keys were in it

    def get(content: Any) -> Sequence[float]:
        part, owner = part_of(content), owner_of(content)
        names = getattr(owner, "name", None)
        if len(part) != known[1] or names != known[0]:
            found = _keys(owner, part)
            known[:] = names, len(part), [found.index(key) if key in found else -1 for key in keys]
        return [part[i] if i >= 0 else np.nan for i in known[2]]

    return get


def _itself(content: Any) -> Any:
    return content


def _single(path: str) -> Callable[[Any], Sequence[float]]:
    """Return a function that returns the number at a path, nan where an element of a list on the way is missing."""
    steps = [step.rstrip("]") for step in re.split(r"\.(?![^\[]*\])|\[", path)]
    if "[" not in path:
        value_of = attrgetter(path)
        return lambda content: (value_of(content),)

    def get(content: Any) -> Sequence[float]:
        for step in steps:
            if _is_list(content):
                keys = _keys(None, content)
                if step not in keys:
                    return (np.nan,)
                content = content[keys.index(step)]
            else:
                content = getattr(content, step)
        return (content,)

    return get


def _stamp_of(content: Any, path: str | None) -> float:
    """Return the time of a stamp in a message [s], 0 if there is none."""
    try:
        for name in re.findall(r"[^.\[\]]+", path or ""):
            content = content[int(name)] if name.isdigit() else getattr(content, name)
        if isinstance(content, int | float):
            return float(content)
        return content.sec + 1e-9 * getattr(content, "nanosec", getattr(content, "nsec", 0))
    except (AttributeError, IndexError, TypeError):
        return 0.0
