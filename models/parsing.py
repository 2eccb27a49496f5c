"""YAML text into a pydantic model, with every failure as one line: where, which field, its value, what is accepted."""

from __future__ import annotations

import difflib
import io
import re
import stat
import warnings
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent

from ..errors import InputError

LARGEST_FILE = 1_000_000  # [bytes]; the largest robot of the library has a few kB
LONGEST_PART = 400  # [characters] of an error's line
Model = TypeVar("Model", bound=BaseModel)


def to_yaml(model: BaseModel) -> str:
    """The YAML text of a model, which `parse_yaml` reads back to an equal one."""
    stream = io.StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.dump(model.model_dump(mode="json", exclude_none=True), stream)
    return stream.getvalue()


def read_yaml(path: Path, model: type[Model]) -> Model:
    """Read a YAML file as a `model`.

    Raises
    ------
    InputError
        If the file cannot be read, is too large, is not YAML or is not a valid `model`: one line that names the file.
    """
    try:
        text = read_bytes(path, "a YAML file").decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text (byte {error.start} is not UTF-8); accepted: a YAML file") from None
    return parse_yaml(text, model, where=str(path))


def read_bytes(path: Path, what: str) -> bytes:
    """The content of `path`, which ought to be `what`. Raises `InputError` if it cannot be read or is too large."""
    try:
        if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():
            raise InputError(f"{path}: is a device or a pipe; accepted: {what}")
        with path.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            size = max(len(content), path.stat().st_size)
            raise InputError(
                f"{path}: the file has {size / 1e6:.1f} MB; accepted: {what} of at most {LARGEST_FILE / 1e6:g} MB"
            )
        return content
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: cannot be read ({reason}); accepted: the path of a readable file") from None


def parse_yaml(text: str, model: type[Model], where: str) -> Model:
    """Check YAML text as a `model`; `where` names it in errors. Raises `InputError` in one line."""
    reader = YAML(typ="safe", pure=True)
    reader.Composer = _PlainComposer
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # ruamel warns of what YAML 1.1 would have made of a number
            data = reader.load(text)
    except (YAMLError, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise InputError(f"{where}: is not YAML ({_problem(error)}); accepted: a plain YAML mapping") from None
    if not isinstance(data, dict):
        raise InputError(f"{where}: holds {brief(data)}; accepted: a mapping with {_keys(_schema(model))}")
    return validate(data, model, where)


def validate(data: dict[str, Any], model: type[Model], where: str) -> Model:
    """Check a mapping as a `model`; `where` names it in errors. Raises `InputError` in one line."""
    try:
        return model.__pydantic_validator__.validate_python(data)
    except ValidationError as error:
        raise InputError(one_line(error, where, model)) from None


def one_line(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    """One line for pydantic's first complaint: where, field, what is accepted, the value, and how many follow."""
    # A misspelt key is why another one is missing: it comes first.
    details = _without_branches(error.errors(include_url=False))
    details.sort(key=lambda one: one["type"] != "extra_forbidden")
    first = details[0]
    field, holder = _walk(first["loc"], _schema(model))
    key = str(first["loc"][-1]) if first["loc"] else ""
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        message = f"is not a known key{_close(key, holder)}; accepted: {_keys(holder)}"
    elif first["type"] == "missing":
        description = holder.get("properties", {}).get(key, {}).get("description")
        message = "is missing; accepted: " + (description or "a value")
    elif first["type"] == "union_tag_invalid":
        context = first.get("ctx", {})
        field, message = f"{field}.kind", f"{context['tag']!r} is unknown; accepted: {context['expected_tags']}"
    elif first["type"] == "union_tag_not_found":
        field, message = f"{field}.kind", "is missing; accepted: one of " + ", ".join(_tags(first["loc"], model))
    elif first["type"] == "too_short":
        context = first.get("ctx", {})
        message = f"has {context['actual_length']} items; accepted: at least {context['min_length']}"
    elif first["type"] in ("model_type", "model_attributes_type", "dict_type"):
        message = f"is {brief(first['input'])}; accepted: a mapping with {_keys(_schema_at(first['loc'], model))}"
    else:
        message = message[:1].lower() + message[1:]
        if first["type"] != "value_error" or not isinstance(first["input"], dict):
            message += f", got {brief(first['input'])}"
    # A list whose items are wrong is counted by pydantic once more as too short.
    others = [other for other in details[1:] if other["type"] != "too_short"]
    more = f" (and {len(others)} more)" if others else ""
    return ": ".join(part for part in (where, _printable(field), _printable(message)) if part) + more


_TYPE = re.compile(r"(function-(after|before|plain|wrap)|literal|tuple|constrained-\w+)\[.*\]$")  # as pydantic names it


def _without_branches(details: list[Any]) -> list[Any]:
    """Pydantic's complaints with one for each choice of types instead of one for each type.

    It names the types in the place. A mapping is meant for the type that takes one, and so is a list; of a plain value
    all types say what they would have.
    """
    told: list[Any] = []
    while details:
        first = details[0]
        place = first["loc"]
        at = next((i for i, key in enumerate(place) if _TYPE.match(str(key))), None)
        if at is None:
            told.append(first)
            details = details[1:]
            continue
        branches = [one for one in details if one["loc"][:at] == place[:at]]
        details = [one for one in details if one["loc"][:at] != place[:at]]
        taking = [one for one in branches if one["type"] not in ("float_type", "literal_error", "tuple_type")]
        listed = [one for one in branches if str(one["loc"][at]).startswith("tuple[") and one["type"] != "tuple_type"]
        if isinstance(first["input"], dict) and taking:
            told += [one | {"loc": one["loc"][:at] + one["loc"][at + 1 :]} for one in taking]
        elif listed:
            told += [one | {"loc": one["loc"][:at] + one["loc"][at + 1 :]} for one in listed]
        else:
            plain = [
                one["msg"].removeprefix("Value error, ") for one in branches if not one["type"].startswith("model")
            ]
            plain = [text[:1].lower() + text[1:] for text in plain]
            told.append(first | {"loc": place[:at], "msg": ", or ".join(dict.fromkeys(plain))})
    return told


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


class _PlainComposer(Composer):
    """Refuses aliases and tags, which no file of towline needs.

    An alias is a few bytes that stand for a whole tree: nested ones make a small file explode. A tag makes sets,
    bytes and dates of what reads like numbers.
    """

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        if isinstance(event, AliasEvent):
            raise ComposerError(problem="has a YAML alias (*name)", problem_mark=event.start_mark)
        if getattr(event, "tag", None) is not None:
            raise ComposerError(
                problem=f"has a YAML tag ({brief(str(event.tag))[1:-1]})", problem_mark=event.start_mark
            )
        return super().compose_node(parent, index)


def _problem(error: Exception) -> str:
    """What is wrong and where, in one line, from a YAML error of several."""
    problem = getattr(error, "problem", None) or str(error) or type(error).__name__
    mark = getattr(error, "problem_mark", None)
    place = f", line {mark.line + 1}" if mark is not None else ""
    return f"{_printable(str(problem).splitlines()[0])}{place}"


def _printable(text: str) -> str:
    """One line that a terminal shows as it is: a file's own words may hold line breaks and escape sequences."""
    shown = "".join(char if char.isprintable() else repr(char)[1:-1] for char in " ".join(text.splitlines()))
    return shown if len(shown) <= LONGEST_PART else f"{shown[: LONGEST_PART - 3]}..."


def brief(value: Any) -> str:
    """`repr` of a value, cut to 60 characters; it is one line whatever the value is."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _keys(schema: dict[str, Any]) -> str:
    return ", ".join(schema.get("properties", {})) or "its own keys"


def _close(key: str, holder: dict[str, Any]) -> str:
    close = difflib.get_close_matches(key, holder.get("properties", {}), n=1)
    return f", did you mean {close[0]!r}?" if close else ""


def _resolve(node: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    """Follow references, and the one object among alternatives, to the schema that has the properties."""
    for option in node.get("anyOf", []):
        if "$ref" in option:
            node = option
    if "$ref" in node:
        return schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    """The schema one level down: of a union's variant, a list's item, a key, or any key of a mapping."""
    variants = node.get("discriminator", {}).get("mapping", {})
    if part in variants:
        return _resolve({"$ref": variants[part]}, schema)
    if isinstance(part, int):
        return _resolve(node.get("items", {}), schema)
    any_key = next(iter(node.get("patternProperties", {}).values()), node.get("additionalProperties", {}))
    below = node.get("properties", {}).get(part, any_key)
    return _resolve(below if isinstance(below, dict) else {}, schema)


def _walk(location: tuple[int | str, ...], schema: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The dotted name of a place in the data, and the schema of the object that holds it.

    Pydantic puts a union's tag into the place (carriers, 0, prescribed, home); a user's file has no such level.
    """
    field = ""
    node, holder = schema, schema
    for part in location:
        if part not in node.get("discriminator", {}).get("mapping", {}):
            holder = node
            field += f"[{part}]" if isinstance(part, int) else f".{part}" if field else str(part)
        node = _step(node, part, schema)
    return field, holder


def _schema_at(location: tuple[int | str, ...], model: type[BaseModel]) -> dict[str, Any]:
    """The schema of what stands at a place."""
    node = _schema(model)
    for part in location:
        node = _step(node, part, _schema(model))
    return node


def _tags(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Tags of the union at a place."""
    return sorted(_schema_at(location, model).get("discriminator", {}).get("mapping", {}))
