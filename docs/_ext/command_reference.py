"""Help of all commands, from the command line itself: the directive `commands`."""

from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.main import get_command

from sprung.cli import _application, _hide_types


def _row(parameter: Any, context: typer.Context) -> str:
    """Return the row of an argument or option, as the help shows it."""
    if parameter.param_type_name == "argument":
        names, meaning = parameter.metavar or parameter.name.upper(), parameter.help or ""
    else:
        names, meaning = parameter.get_help_record(context)
    cells = (f"`{names.strip()}`", " ".join(meaning.split()).replace("<", r"\<"))
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _panels(command: Any) -> dict[str, list[Any]]:
    """Return the parameters by the panels of the help."""
    panels: dict[str, list[Any]] = {}
    for parameter in command.params:
        if getattr(parameter, "hidden", False):
            continue
        usual = "Arguments" if parameter.param_type_name == "argument" else "Options"
        panels.setdefault(getattr(parameter, "rich_help_panel", None) or usual, []).append(parameter)
    return panels


def described(name: str, command: Any, depth: int = 2) -> list[str]:
    """Return the paragraphs about a command and its sub-commands, in MyST."""
    context = typer.Context(command, info_name=name)
    anchor = name.replace(" ", "-")
    help_text = "\n".join(line.strip() for line in (command.help or "").splitlines()).strip()
    paragraphs = [f"({anchor})=\n{'#' * depth} `{name}`", help_text]
    subcommands = getattr(command, "commands", {})
    for panel, parameters in _panels(command).items():
        rows = "\n".join(_row(parameter, context) for parameter in parameters)
        paragraphs.append(f"| {panel} | |\n|---|---|\n{rows}")
    for word, subcommand in subcommands.items():
        paragraphs += described(f"{name} {word}", subcommand, depth + 1)
    return paragraphs


class Commands(SphinxDirective):
    """Sections of all commands."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        application = get_command(_application())
        _hide_types(application)
        text = [part for word, command in application.commands.items() for part in described(f"sprung {word}", command)]  # type: ignore[attr-defined]
        return self.parse_text_to_nodes("\n\n".join(text), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
