"""A spring, damper or tyre by its corner and kind, and faults: it becomes softer or stiffer."""

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number
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


_FORM = re.compile(r"(?P<owner>\w+)\.(?P<component>\w+)=(?P<change>[^@]+)(@(?P<onset>[^+]+)(\+(?P<growth>.+))?)?")


@dataclass(frozen=True, slots=True)
class Fault:
    """Change of one component.

    Parameters
    ----------
    component
        Spring, damper or tyre that changes.
    change
        Relative change, above -1: -0.2 is 20 % less.
    onset
        Time at which the change begins [s], at least 0.
    growth
        Time over which the change grows linearly to its full size [s], at least 0; 0: sudden.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    component: Component
    change: float
    onset: float = 0.0
    growth: float = 0.0

    def __post_init__(self) -> None:
        check_number(f"change of {self.component}", self.change, above=-1, advice="-0.2 means 20 % less")
        check_number(f"onset of {self.component}", self.onset, at_least=0)
        check_number(f"growth of {self.component}", self.growth, at_least=0)

    @property
    def is_constant(self) -> bool:
        """Whether the fault exists from the start and does not grow."""
        return self.onset == 0 and self.growth == 0

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which the slope of the change jumps [s]; two equal times are a step."""
        return (self.onset, self.onset + self.growth)

    def factor(self, time: ArrayLike) -> Real:
        """Return the ratio of the component's value to its nominal value at times [s], same shape."""
        t = np.asarray(time, dtype=np.float64)
        if self.growth == 0:
            return np.where(t >= self.onset, 1 + self.change, 1.0)
        return 1 + self.change * np.clip((t - self.onset) / self.growth, 0, 1)


def parse_fault(text: str) -> Fault:
    """Return the fault written as CORNER.COMPONENT=CHANGE, with @ONSET and +GROWTH in seconds if it is not constant.

    Raises
    ------
    ParameterError
        If the text does not have this form, or a number is out of range.

    Examples
    --------
    >>> parse_fault("front_left.spring=-0.2")
    Fault(component=Component(corner='front_left', kind='spring'), change=-0.2, onset=0.0, growth=0.0)
    >>> parse_fault("rear_right.damper=-0.3@120+60").factor([0, 150, 180]).tolist()
    [1.0, 0.85, 0.7]
    """
    match = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
    numbers = [match[name] for name in ("change", "onset", "growth")] if match else []
    try:
        if match is None:
            raise ValueError
        change, onset, growth = (float(number) if number else 0.0 for number in numbers)
        if not all(map(math.isfinite, (change, onset, growth))):
            raise ValueError
    except ValueError:
        raise ParameterError(
            f"fault {text!r} is not of the form CORNER.COMPONENT=CHANGE, such as front_left.spring=-0.2, with "
            "@ONSET+GROWTH in seconds if it begins later or grows: correct it"
        ) from None
    return Fault(Component(match["owner"], match["component"]), change, onset, growth)
