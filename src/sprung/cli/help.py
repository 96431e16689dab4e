"""Help without the type of flags, which take no value."""

from typing import Any

from typer.core import TyperCommand, TyperGroup


def _without_types_of_flags(parameters: list[Any]) -> list[Any]:
    """Return parameters whose flags have no placeholder for a value."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
    return parameters


class Command(TyperCommand):
    """A command."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, flags without a placeholder."""
        return _without_types_of_flags(super().get_params(ctx))


class Group(TyperGroup):
    """A command with sub-commands."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, flags without a placeholder."""
        return _without_types_of_flags(super().get_params(ctx))
