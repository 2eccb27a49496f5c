"""YAML text into a pydantic model, with every failure as one line: where, which field, its value, what is accepted."""

from __future__ import annotations

import difflib
import io
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent

from ..errors import InputError

LARGEST_FILE = 1_000_000  # [bytes]; the largest robot of the library has a few kB
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
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(
                f"{path}: the file has {size / 1e6:.1f} MB; accepted: a YAML file of at most {LARGEST_FILE / 1e6:g} MB"
            )
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); accepted: the path of a readable file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text (byte {error.start} is not UTF-8); accepted: a YAML file") from None
    return parse_yaml(text, model, where=str(path))


def parse_yaml(text: str, model: type[Model], where: str) -> Model:
    """Check YAML text as a `model`; `where` names it in errors. Raises `InputError` in one line."""
    try:
        # An alias is a few bytes that stand for a whole tree: nested ones make a small file explode.
        if any(isinstance(event, AliasEvent) for event in _reader().parse(io.StringIO(text))):
            raise InputError(f"{where}: has a YAML alias (*name); accepted: plain YAML without aliases")
        data = _reader().load(text)
    except InputError:
        raise
    except (YAMLError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{where}: is not YAML ({_problem(error)}); accepted: a YAML mapping") from None
    if not isinstance(data, dict):
        raise InputError(f"{where}: holds {_brief(data)}; accepted: a mapping with {_keys(model.model_json_schema())}")
    return validate(data, model, where)


def validate(data: dict[str, Any], model: type[Model], where: str) -> Model:
    """Check a mapping as a `model`; `where` names it in errors. Raises `InputError` in one line."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(one_line(error, where, model)) from None


def one_line(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    """One line for pydantic's first complaint: where, field, what is accepted, the value, and how many follow."""
    details = error.errors(include_url=False)
    first = details[0]
    field, holder = _walk(first["loc"], model.model_json_schema())
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
    else:
        message = message[:1].lower() + message[1:]
        if first["type"] != "value_error" or not isinstance(first["input"], dict):
            message += f", got {_brief(first['input'])}"
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    return ": ".join(part for part in (where, field, message) if part).replace("\n", " ") + more


def _reader() -> YAML:
    return YAML(typ="safe", pure=True)


def _problem(error: Exception) -> str:
    """What is wrong and where, in one line, from a YAML error of several."""
    problem = getattr(error, "problem", None) or str(error) or type(error).__name__
    mark = getattr(error, "problem_mark", None)
    place = f", line {mark.line + 1}" if mark is not None else ""
    return f"{str(problem).splitlines()[0]}{place}"


def _brief(value: Any) -> str:
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


def _walk(location: tuple[int | str, ...], schema: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The dotted name of a place in the data, and the schema of the object that holds it.

    Pydantic puts a union's tag into the place (carriers, 0, prescribed, home); a user's file has no such level.
    """
    field = ""
    node, holder = schema, schema
    for part in location:
        variants = node.get("discriminator", {}).get("mapping", {})
        if part in variants:
            node = _resolve({"$ref": variants[part]}, schema)
            continue
        holder = node
        if isinstance(part, int):
            field += f"[{part}]"
            node = _resolve(node.get("items", {}), schema)
        else:
            field += f".{part}" if field else part
            node = _resolve(node.get("properties", {}).get(part, {}), schema)
    return field, holder


def _tags(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Tags of the union at a place."""
    schema = model.model_json_schema()
    node = schema
    for part in location:
        node = _resolve(node.get("items", {}) if isinstance(part, int) else node.get("properties", {})[part], schema)
    return sorted(node.get("discriminator", {}).get("mapping", {}))
