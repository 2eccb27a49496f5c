"""The pages of all keys of robot files and task files, from their JSON Schemas."""

import json
import re
from typing import Any

from towline import Robot, Task
from towline.figures.style import typeset
from towline.models.part import LARGEST

from .markup import escaped, table

Schema = dict[str, Any]
UNIT = re.compile(r" ?\[((?:-|1|rad|m|kg|s|N|Hz|W|J|deg|%)(?:[ /^,]|\d|m|kg|s|N|rad)*)\]")
ROBOT = """# Keys of robot files

A robot is a YAML file with these keys. [Describe your robot](../howto/robot-file.md) is a guide, and `towline new`
writes a file to edit. Units are SI; [Units, frames and numbering](conventions.md) explains the frames and angles. An
unknown key is an error. `towline robots --schema` prints these keys as a JSON Schema, which editors can use.

"""
TASK = """# Keys of task files

A task is a YAML file with these keys. [Write task files](../howto/task-files.md) is a guide, and `towline new` writes
a file to edit. In Python, `plan(robot, task)` accepts a dictionary with the same keys. Either `path` or `phases` is
required. Units are SI; [Units, frames and numbering](conventions.md) explains the frames and angles. An unknown key is
an error. `towline plan --schema` prints these keys as a JSON Schema, which editors can use.

"""


def robot_keys() -> str:
    """Return the page of robot files."""
    return ROBOT + _Keys(Robot.model_json_schema(), "robot").page()


def task_keys() -> str:
    """Return the page of task files."""
    return TASK + _Keys(Task.model_json_schema(), "task").page()


class _Keys:
    """The sections of one page: the file itself, then every part that a key refers to."""

    def __init__(self, schema: Schema, name: str):
        self.parts: dict[str, Schema] = schema.get("$defs", {})
        self.root = schema
        self.name = name
        self.uses: dict[str, list[str]] = {}  # of each part: the keys that may hold it, by their paths
        self._follow(schema, "")

    def page(self) -> str:
        """Return all sections."""
        sections = [f"## The file {{ #{self.name}-file }}\n\n{self._table(self.root)}"]
        for part, paths in self.uses.items():
            schema = self.parts[part]
            title, used = self._title(part), [f"`{path}`" for path in dict.fromkeys(paths)]
            where = "" if [title] == used else f"Used in: {', '.join(used)}.\n\n"
            text = escaped(re.split(r"\n\s*(?:Attributes|Args):\n", schema.get("description", ""))[0])
            sections.append(f"## {title} {{ #{part.lower()} }}\n\n{text}\n\n{where}{self._table(schema)}")
        return "\n".join(sections)

    def _follow(self, schema: Schema, path: str) -> None:
        """Note which parts the keys of a part refer to, and the parts that those refer to."""
        for key, field in schema.get("properties", {}).items():
            here = f"{path}.{key}" if path else key
            if any("items" in each for each in (field, *field.get("anyOf", []))):
                here += "[]"
            for part in _referred(field):
                known = part in self.uses
                self.uses.setdefault(part, []).append(here)
                if not known:
                    self._follow(self.parts[part], here)

    def _title(self, part: str) -> str:
        paths = list(dict.fromkeys(self.uses[part]))
        kind = self.parts[part].get("properties", {}).get("kind", {}).get("const")
        if kind is not None:
            return f"`{paths[0]}` of kind `{kind}`"
        if len(paths) == 1:
            return f"`{paths[0]}`"
        return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", part).capitalize()

    def _table(self, schema: Schema) -> str:
        required = schema.get("required", [])
        rows = []
        for key, field in schema.get("properties", {}).items():
            description = field.get("description") or self._description_of_part(field)
            if "const" in field and not description:
                description = "selects this kind"
            unit = UNIT.search(description)
            text = escaped(UNIT.sub("", description, count=1).strip(" ;,"))
            default = "required" if key in required else _default(field)
            rows.append([f"`{key}`", self._type(field), typeset(unit[1]) if unit else "", default, text])
        return table(["key", "type", "unit", "default", "description"], rows)

    def _description_of_part(self, field: Schema) -> str:
        parts = _referred(field)
        return self.parts[parts[0]].get("description", "").split("\n")[0] if len(parts) == 1 else ""

    def _type(self, field: Schema) -> str:
        """Return what a key accepts, as Markdown."""
        if "$ref" in field:
            part = field["$ref"].rpartition("/")[2]
            return f"[{self.parts[part].get('properties', {}).get('kind', {}).get('const', part)}](#{part.lower()})"
        several = field.get("anyOf") or field.get("oneOf")
        if several:
            without = "default" in field and field["default"] is None
            shown = [self._type(each) for each in several if not (without and each.get("type") == "null")]
            return " or ".join(dict.fromkeys(shown))
        if "const" in field:
            return f"`{field['const']}`"
        if "enum" in field:
            return " or ".join(f"`{value}`" for value in field["enum"])
        kind = field.get("type", "")
        if kind == "array":
            items = field.get("prefixItems")
            return f"{len(items)} numbers{_bounds(items[0])}" if items else f"list of: {self._type(field['items'])}"
        if kind == "object":
            inner = next(iter(field.get("patternProperties", {}).values()), None) or field["additionalProperties"]
            return f"mapping of names to: {self._type(inner)}"
        names = {"string": "text", "boolean": "`true` or `false`", "null": "`null`", "integer": "whole number"}
        return names.get(kind, "number") + _bounds(field)


def _referred(field: Any) -> list[str]:
    """Return the parts that a field refers to, wherever they are in it."""
    if isinstance(field, list):
        return [part for each in field for part in _referred(each)]
    if not isinstance(field, dict):
        return []
    found = [field["$ref"].rpartition("/")[2]] if "$ref" in field else []
    inner = [each for key, each in field.items() if key not in ("discriminator", "default")]
    return found + _referred(inner)


def _bounds(field: Schema) -> str:
    """Return the range of a number; the bounds of all numbers in files are left out."""
    words = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    bounds = [
        f"{sign.replace('>', '&gt;').replace('<', '&lt;')} {round(field[key], 3):.10g}"
        for key, sign in words.items()
        if key in field and abs(field[key]) != LARGEST
    ]
    return f" {', '.join(bounds)}" if bounds else ""


def _default(field: Schema) -> str:
    """Return the default of a key; defaults of parts are left out, because their own keys have defaults."""
    value = field.get("default")
    if value is None or isinstance(value, dict) or value == []:
        return ""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        return f"`{json.dumps(value).replace('.0', '')}`"
    return f"`{value}`" if isinstance(value, str) else json.dumps(value)
