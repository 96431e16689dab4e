"""Faults: springs, dampers or tyres that become softer or stiffer, suddenly or gradually."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.vehicles.components import Component
from sprung.vehicles.structure import Structure

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


def with_faults(structure: Structure, faults: Iterable[Fault], *, time: float = math.inf) -> Structure:
    """Return a structure with faults as they are at a time [s]; default: at their full size.

    Raises
    ------
    ParameterError
        If the structure has no such component.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> zafira = structure(read_vehicle("zafira"))
    >>> soft = with_faults(zafira, [parse_fault("front_left.spring=-0.2")])
    >>> spring = Component("front_left", "spring")
    >>> round(soft.components()[spring] / zafira.components()[spring], 6)
    0.8
    """
    factors: dict[Component, float] = {}
    for fault in faults:
        factors[fault.component] = factors.get(fault.component, 1.0) * float(fault.factor(time))
    return structure.changed(factors)
