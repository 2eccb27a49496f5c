"""The page of all commands, with what `--help` prints of each."""

from typing import Any

import typer

from towline.cli.main import COMMANDS, app

from .markup import escaped, with_options

HEAD = """# Commands

{intro}

`towline COMMAND --help` prints the same text in a terminal. All commands have the same
[exit codes](status.md#exit-codes): 0 if the result is positive, 1 if it is negative, 2 for wrong input.

"""


def commands() -> str:
    """Return the page of commands."""
    group = typer.main.get_command(app)
    context = typer.Context(group, info_name="towline")
    lines = [f"- [`towline {name}`](#{name}): {escaped(meaning)}" for name, meaning in COMMANDS.items()]
    sections = [section for name in COMMANDS for section in _sections(group.get_command(context, name), name, context)]
    intro = escaped((group.help or "").split("\n\n")[0])
    return HEAD.format(intro=intro) + "\n".join(lines) + "\n\n" + "\n".join(sections)


def _sections(command: Any, name: str, above: Any) -> list[str]:
    """Return the section of a command, or those of the commands of a group."""
    context = typer.Context(command, info_name=name, parent=above)
    path = context.command_path.removeprefix("towline ")
    heading = f"## towline {path} {{ #{path.replace(' ', '-')} }}\n\n"
    text = "\n\n".join(with_options(paragraph) for paragraph in (command.help or "").split("\n\n"))
    if hasattr(command, "list_commands"):
        names = command.list_commands(context)
        inner = [section for sub in names for section in _sections(command.get_command(context, sub), sub, context)]
        return [f"{heading}{text}\n", *inner]
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
    options = "\n".join(f"`{record[0]}`\n:   {with_options(record[1])}\n" for record in records if record)
    return [f"{heading}{text}\n\n    {usage}\n\n{options}"]
