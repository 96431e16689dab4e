"""A spring, damper or tyre by its corner and kind."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema


@dataclass(frozen=True, order=True, slots=True)
class Component:
    """A spring, damper or tyre of a vehicle.

    Parameters
    ----------
    corner
        "front_left", "axle2_right" ..., or another owner of elements, such as "mass_1" or "front_axle".
    kind
        "spring", "damper", "tyre", or another component of `sprung.vehicles.structure.PARTS`.

    Examples
    --------
    >>> soft = Component.parse("front_left.spring")
    >>> soft.axle, soft.side, soft.kind
    ('front', 'left', 'spring')
    >>> print(soft)
    front_left.spring
    """

    corner: str
    kind: str

    @classmethod
    def parse(cls, text: str) -> "Component":
        """Return the component written as CORNER.KIND.

        Raises
        ------
        ParameterError
            If the text is not of that form.
        """
        corner, dot, kind = text.partition(".")
        if not (corner and dot and kind) or "." in kind:
            raise ParameterError(f"component {text!r} is not of the form CORNER.KIND: write front_left.spring")
        return cls(corner, kind)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: "GetCoreSchemaHandler") -> "CoreSchema":
        """Return how pydantic reads and writes a component: as its text."""
        from pydantic_core import core_schema

        text = core_schema.no_info_after_validator_function(cls.parse, core_schema.str_schema())
        return core_schema.json_or_python_schema(
            json_schema=text,
            python_schema=core_schema.no_info_before_validator_function(
                lambda value: cls.parse(value) if isinstance(value, str) else value, core_schema.is_instance_schema(cls)
            ),
            serialization=core_schema.to_string_ser_schema(),
        )

    def __str__(self) -> str:
        return f"{self.corner}.{self.kind}"

    @property
    def side(self) -> str | None:
        """Side of the vehicle, "left" or "right"; None if the owner is not a corner."""
        side = self.corner.rpartition("_")[2]
        return side if side in {"left", "right"} else None

    @property
    def axle(self) -> str:
        """Axle of the corner, such as "front" or "axle2"; the owner itself if it is not a corner."""
        return self.corner if self.side is None else self.corner.rpartition("_")[0]
