"""YAML text into a pydantic model, with every failure as one line: where, which field, its value, what is accepted."""

import difflib
import io
import json
import os
import re
import warnings
from functools import cache, lru_cache
from math import radians
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent
from ruamel.yaml.scanner import Scanner, ScannerError

from ..base.inputs import LONGEST_TEXT, MOST_ROWS, InputError, check_ending, file_path, printable, shown
from ..base.reading import read_bytes
from ..base.text import counted
from ..base.writing import whole_file

ENDINGS = (".yaml", ".yml")
MOST_BRACKETS = 50  # inside each other; no file of towline needs more than three
MOST_ITEMS = 30_000  # values and keys, some 50 us each; a file with the covariance of 24 cables has 29 200
LARGE = 200_000  # characters of JSON, which takes ruamel seconds to write as other YAML
NAMES = 'must have only letters, digits, ".", "_" and "-", and begin with a letter or digit'  # `part.Name`
TITLES = NAMES.replace('"_" and "-"', '"_", "-" and spaces inside')  # `part.Title`
Model = TypeVar("Model", bound=BaseModel)


@cache
def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of a model, computed once; another kind of carrier empties the cache."""
    return model.model_json_schema()


def to_yaml(model: BaseModel) -> str:
    """Return the YAML text of a model, which `parse_yaml` reads back to an equal one.

    A large model, such as a task with the points of a slicer's file, is written as JSON, which is also valid YAML.
    """
    content = json.dumps(model.model_dump(mode="json", exclude_none=True))
    return _yaml_of(content) if len(content) < LARGE else content


@lru_cache(maxsize=16)  # writing takes milliseconds, and the same robot is in each of its plans and simulations
def _yaml_of(content: str) -> str:
    stream = io.StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.dump(json.loads(content), stream)
    return stream.getvalue()


def save_yaml(model: BaseModel, file: str | os.PathLike[str], argument: str = "file") -> Path:
    """Save the YAML text of a model atomically, and return the path; errors name the `argument`.

    Raises `InputError` if the file cannot be written, or its name does not end in .yaml or .yml.
    """
    path = check_ending(argument, file_path(argument, file), *ENDINGS)
    with whole_file(path) as temporary:
        temporary.write_text(to_yaml(model), encoding="utf-8")
    return path


def read_yaml(path: Path, model: type[Model]) -> Model:
    """Read a YAML file as a `model`.

    Raises `InputError` if the file cannot be read, is too large, is not YAML or is not a valid `model`: one line
    that names the file.
    """
    where = printable(str(path))
    try:
        text = read_bytes(path, "a YAML file").decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{where} must be a YAML file in UTF-8, got another text (byte {error.start})") from None
    return parse_yaml(text, model, where, path.parent)


def parse_yaml(text: str, model: type[Model], where: str, folder: Path | None = None) -> Model:
    """Check YAML text as a `model`, or raise InputError in one line; `where` names the text in it.

    Files that it names are relative to `folder`; default: the working directory.
    """
    try:
        data = json.loads(text) if len(text) >= LARGE and text.startswith("{") else _loaded(text)
    except (YAMLError, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise InputError(f"{where}: text is not YAML ({_problem(error)}); it must be a plain YAML mapping") from None
    if not isinstance(data, dict):
        got = "nothing" if data is None else shown(data)
        raise InputError(f"{where}: must hold a mapping with {_keys(json_schema(model))}, got {got}")
    return validate(data, model, where, folder)


def _loaded(text: str) -> Any:
    reader = YAML(typ="safe", pure=True)
    reader.Composer = _PlainComposer
    reader.Scanner = _ShallowScanner
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # ruamel warns of what YAML 1.1 would have made of a number
        return reader.load(text)


def validate(data: dict[str, Any], model: type[Model], where: str, folder: Path | None = None) -> Model:
    """Check a mapping as a `model`, or raise InputError in one line; `where` names the mapping in it.

    Files that it names are relative to `folder`; default: the working directory.
    """
    try:
        return model.__pydantic_validator__.validate_python(data, context={"folder": folder or Path()})
    except ValidationError as error:
        raise InputError(one_line(error, where, model)) from None


def one_line(error: ValidationError, where: str, model: type[BaseModel]) -> str:
    """Return one line for a failed check: where, field, what is accepted, the value, and which others are wrong.

    A key that is not known comes before a missing one: it usually is the missing one, misspelt.
    """
    details = _without_lengths(_without_branches(error.errors(include_url=False)))
    details = [_misspelt_kind(detail, model) for detail in details]
    details.sort(key=lambda detail: detail["type"] != "extra_forbidden")
    # A list whose items are wrong is counted by pydantic once more as too short.
    others = [other for other in details[1:] if other["type"] != "too_short"]
    line = printable(_sentence(details[0], model))
    if others:
        named = dict.fromkeys(_walk(other["loc"], json_schema(model))[0] for other in others[:3])
        named = [printable(name, LONGEST_TEXT // 4) for name in named]
        more = len(others) - len(others[:3])
        line += f"; also wrong: {', '.join(named)}" + (f" and {more} more" if more else "")
    return f"{where}: {line}" if where else line


def _sentence(detail: Any, model: type[BaseModel]) -> str:
    """Return "field must be ..., got ..." for one complaint of pydantic."""
    place, kind, value, context = detail["loc"], detail["type"], detail["input"], detail.get("ctx", {})
    field, holder, node = _walk(place, json_schema(model))
    tags = sorted(node.get("discriminator", {}).get("mapping", {}))
    key = str(place[-1]) if place else ""
    field = printable(field, LONGEST_TEXT // 2)  # leaves enough of the line for what is wrong with it
    if kind == "extra_forbidden":
        meant = _close(key, _known(holder)) or _elsewhere(key, place, json_schema(model))
        return f"{field} is not a known key{meant} (known keys: {_keys(holder)})"
    if kind == "missing":
        description = holder.get("properties", {}).get(key, {}).get("description")
        return f"{field} is missing" + (f": {description}" if description else "")
    if kind == "union_tag_invalid":
        meant = _close(str(context["tag"]), tags)
        return f"{field}.kind must be one of {', '.join(tags)}, got {shown(context['tag'])}{meant}"
    if kind == "union_tag_not_found":
        return f"{field}.kind is missing: one of {', '.join(tags)}"
    if kind == "too_short":
        least = counted(context["min_length"], "item")
        return f"{field} must have at least {least}, got {context['actual_length']}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        kinds = f", one of {', '.join(tags)}" if tags else ""
        message = f"must be a mapping with {_keys(node)}{kinds}, got {shown(value)}"
    else:
        message = detail["msg"]
        if message == "must be a list" and (items := node.get("prefixItems")):
            message += f" of {len(items)} {items[0].get('type', 'item')}s"
        if kind == "string_pattern_mismatch":
            message = TITLES if " " in context["pattern"] else NAMES
        if kind != "value_error" or not isinstance(value, dict):
            message += f", got {shown(value)}"
        described = holder.get("properties", {}).get(key, {}).get("description", "")
        if kind in ("less_than", "less_than_equal") and "[rad]" in described and value <= 360:
            message += f" (in radians; {value:g} degrees are {radians(value):.4g})"
    if not field:
        return message
    if message.partition(" ")[0] in _known(node):  # a part's own check names one of its fields
        return f"{field}.{message}"
    return f"{field} {message}" if message.startswith("must ") else f"{field}: {message}"


def _misspelt_kind(detail: Any, model: type[BaseModel]) -> Any:
    """Return the complaint that a union's tag is missing as one of a misspelt key, where a key looks like the tag."""
    if detail["type"] != "union_tag_not_found" or not isinstance(detail["input"], dict):
        return detail
    for key in detail["input"]:
        if isinstance(key, str) and difflib.get_close_matches(key.lower(), ["kind"], n=1):
            return detail | {"type": "extra_forbidden", "loc": (*detail["loc"], key)}
    return detail


_TYPE = re.compile(r"(function-(after|before|plain|wrap)|literal|tuple|constrained-\w+)\[.*\]$")  # as pydantic names it


def _without_branches(details: list[Any]) -> list[Any]:
    """Return pydantic's complaints with one for each choice of types instead of one for each type.

    It names the types in the place. A mapping is meant for a type that takes one, and so is a list; of a plain value
    all types report what they accept.
    """
    words = {
        "Value error, ": "",
        "Input should ": "must ",
        "a valid tuple": "a list",
        "a valid dictionary": "a mapping",
        "a valid string": "text",
        "a valid integer": "a whole number",
        "a valid boolean": "true or false",
        ", got a number with a fractional part": "",
        ", unable to parse string as an integer": "",
        ", unable to interpret input": "",
    }
    for old, new in words.items():
        details = [detail | {"msg": detail["msg"].replace(old, new)} for detail in details]
    details = [detail | {"msg": detail["msg"][:1].lower() + detail["msg"][1:]} for detail in details]
    types = (next((i for i, key in enumerate(detail["loc"]) if _TYPE.match(str(key))), None) for detail in details)
    places = {detail["loc"][:at] for detail, at in zip(details, types, strict=True) if at is not None}
    groups: dict[Any, list[Any]] = {}  # by the place of the choice, or by number where there is none
    for number, detail in enumerate(details):
        starts = (detail["loc"][:i] for i in range(len(detail["loc"])))
        groups.setdefault(next((start for start in starts if start in places), number), []).append(detail)
    result: list[Any] = []
    for place, branches in groups.items():
        if isinstance(place, int):
            result += branches
            continue
        first, at = branches[0], len(place)
        taking = [one for one in branches if one["type"] not in ("float_type", "literal_error", "tuple_type")]
        listed = [one for one in branches if str(one["loc"][at]).startswith("tuple[") and one["type"] != "tuple_type"]
        if isinstance(first["input"], dict) and taking:
            types = sorted({one["loc"][at] for one in taking})
            if len(types) > 1:  # the mapping is meant for the one that it fits best, whose name stays in the place
                best = min(([one for one in taking if one["loc"][at] == its] for its in types), key=len)
                name = re.findall(r"\w+", best[0]["loc"][at])[-1]  # of function-after[check(), Name]
                result += [one | {"loc": (*one["loc"][:at], name, *one["loc"][at + 1 :])} for one in best]
                continue
            result += [one | {"loc": one["loc"][:at] + one["loc"][at + 1 :]} for one in taking]
        elif listed:
            result += [one | {"loc": one["loc"][:at] + one["loc"][at + 1 :]} for one in listed]
        else:
            plain = [one["msg"] for one in branches if not one["type"].startswith("model")]
            # Last the text that has an "or" of its own.
            first_one, *rest = sorted(dict.fromkeys(plain), key=lambda text: "than or equal" in text)
            rest = [text.removeprefix("must be ") for text in rest]
            result.append(first | {"loc": place, "msg": " or ".join([first_one, *rest])})
    return result


def _without_lengths(details: list[Any]) -> list[Any]:
    """Return pydantic's complaints with one for each list of numbers of the wrong length, not one for each number."""
    result: dict[Any, Any] = {}
    for number, detail in enumerate(details):
        place, length = detail["loc"], None
        if detail["type"] == "missing" and isinstance(place[-1], int):
            place, length = place[:-1], place[-1] + 1
        elif detail["type"] == "too_long":
            length = detail["ctx"]["max_length"]
        if length is None:
            result[number] = detail
        else:  # of missing numbers the last one has the largest index
            accepted = f"{length} numbers" if length < MOST_ROWS else f"a list of at most {length} items"
            result[place] = detail | {"type": "length", "loc": place, "msg": f"must be {accepted}"}
    return list(result.values())


class _PlainComposer(Composer):
    """Refuses aliases and tags, which no file of towline needs, and more items than one of its files has.

    An alias is a few bytes that stand for a whole tree: nested ones make a small file explode. A tag makes sets,
    bytes and dates of what reads like numbers.
    """

    _items = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        self._items += 1
        if self._items > MOST_ITEMS:
            raise ComposerError(problem=f"has more than {MOST_ITEMS} values and keys", problem_mark=event.start_mark)
        if isinstance(event, AliasEvent):
            raise ComposerError(problem="has a YAML alias (*name)", problem_mark=event.start_mark)
        if getattr(event, "tag", None) is not None:
            raise ComposerError(
                problem=f"has a YAML tag ({shown(str(event.tag))[1:-1]})", problem_mark=event.start_mark
            )
        return super().compose_node(parent, index)


class _ShallowScanner(Scanner):
    """Refuses brackets in brackets without end: for each that opens, the scanner goes through all that are open."""

    def fetch_flow_collection_start(self, *arguments: Any, **named: Any) -> None:
        if self.flow_level >= MOST_BRACKETS:
            raise ScannerError(
                problem=f"has brackets more than {MOST_BRACKETS} deep", problem_mark=self.reader.get_mark()
            )
        super().fetch_flow_collection_start(*arguments, **named)


def _problem(error: Exception) -> str:
    """Return what is wrong and where, in one line, from a YAML error of several."""
    problem = getattr(error, "problem", None) or str(error) or type(error).__name__
    mark = getattr(error, "problem_mark", None)
    place = f", line {mark.line + 1}" if mark is not None else ""
    return f"{printable(str(problem).splitlines()[0])}{place}"


def _keys(schema: dict[str, Any]) -> str:
    return ", ".join(_known(schema)) or "keys of its own"


def _known(schema: dict[str, Any]) -> list[str]:
    return [*schema.get("properties", {}), *(["kind"] if "discriminator" in schema else [])]


def _close(text: str, known: list[str]) -> str:
    close = difflib.get_close_matches(text, known, n=1) or difflib.get_close_matches(text.lower(), known, n=1)
    return f", did you mean {close[0]!r}?" if close else ""


def _elsewhere(key: str, place: tuple[int | str, ...], schema: dict[str, Any]) -> str:
    """Return a hint at the mapping in which a key belongs: one inside that which contains it, or the whole file."""
    nodes = [("", _walk(place, schema)[1])]
    for name, node in nodes:  # grows while it is walked: nearer mappings first
        variants = node.get("discriminator", {}).get("mapping", {})
        kinds = [node, *(_step(node, kind, schema) for kind in variants)]
        if name and any(key in kind.get("properties", {}) for kind in kinds):
            return f", did you mean '{name}.{key}'?"
        if name.count(".") < 2:
            below = {part: _step(kind, part, schema) for kind in kinds for part in kind.get("properties", {})}
            nodes += [(f"{name}.{part}" if name else part, each) for part, each in below.items()]
    return f", did you mean {key!r} at the top level?" if len(place) > 1 and key in _known(schema) else ""


def _resolve(node: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    """Follow references, and the one object among alternatives, to the schema that has the properties or the kinds."""
    for option in node.get("anyOf", []):
        if "$ref" in option or "discriminator" in option:
            node = option
    if "$ref" in node:
        return schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema one level down: of a union's variant, a list's item, a key, or any key of a mapping."""
    variants = node.get("discriminator", {}).get("mapping", {})
    if part in variants:
        return _resolve({"$ref": variants[part]}, schema)
    if isinstance(part, int):
        lists = [node, *node.get("anyOf", [])]
        return _resolve(next((each["items"] for each in lists if "items" in each), {}), schema)
    any_key = next(iter(node.get("patternProperties", {}).values()), node.get("additionalProperties", {}))
    below = node.get("properties", {}).get(part, any_key)
    return _resolve(below if isinstance(below, dict) else {}, schema)


def _walk(location: tuple[int | str, ...], schema: dict[str, Any]) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Return the dotted name of a place in the data, the schema of the object that holds it, and its own.

    Pydantic puts a union's tag into the place (carriers, 0, prescribed, home), or the name of a type (wind, WindBox,
    min); a user's file has no such level.
    """
    field, types = "", schema.get("$defs", {})
    node, holder = schema, schema
    for part in location:
        if part in types:
            node = types[part]
            continue
        if part not in node.get("discriminator", {}).get("mapping", {}):
            holder = node
            field += f"[{part}]" if isinstance(part, int) else f".{part}" if field else str(part)
        node = _step(node, part, schema)
    return field, holder, node
