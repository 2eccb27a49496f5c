"""Text of the code as Markdown."""

import html
import re

CODE = re.compile(r"(`[^`]+`)")
OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]*)")
SPECIAL = re.compile(r"([*_|$\\])")


def escaped(text: str) -> str:
    """Return a text in which no character is taken for Markdown or HTML, in one line; code in backticks stays code."""
    parts = CODE.split(" ".join(text.split()))
    return "".join(part.replace("|", "&#124;") if part.startswith("`") else _plain(part) for part in parts)


def with_options(text: str) -> str:
    """Return the help of a command, escaped, with the names of options as code."""
    return OPTION.sub(r"`\1`", escaped(text))


def table(headings: list[str], rows: list[list[str]]) -> str:
    """Return a table; the cells are Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def _plain(text: str) -> str:
    text = SPECIAL.sub(r"\\\1", html.escape(text, quote=False))
    return text.replace("\\|", "&#124;").replace("{", "&#123;").replace("}", "&#125;")
