"""Nonlinear force laws of springs and dampers."""

import math
from dataclasses import dataclass
from types import MappingProxyType

from sprung._checks import check_number

#: Gauge pressure of a tyre at 20 degrees Celsius [Pa], that of the air outside [Pa], and the share of a tyre's
#: stiffness that is in proportion to the gauge pressure.
TYRE_PRESSURE, _ATMOSPHERE, _OF_PRESSURE = 2.2e5, 1.013e5, 0.8


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """Departure of a spring and damper from the linear force k e + c e', with the elongation e.

    Parameters
    ----------
    asymmetry
        Relative asymmetry of the damper, -1 to 1: c (1 + asymmetry) in rebound (e' > 0), c (1 - asymmetry) in bump.
    asymmetry_velocity
        Velocity scale of the transition between the two [m/s].
    knee, knee_slope
        Speed [m/s] beyond which the damper's force rises with `knee_slope` times its slope; below 1: digressive.
    friction, friction_velocity
        Dry friction force [N] and its velocity scale [m/s]: friction e' / sqrt(e'^2 + friction_velocity^2).
    cubic
        Cubic hardening of the spring [1/m^2]: k (e + cubic e^3).
    gap, stop_stiffness
        Free travel [m] and stiffness [N/m] of the bump stops; the stiffness is added where abs(e) exceeds gap.
    rubber_stiffness, rubber_force
        Stiffness [N/m] and limit force [N] of a friction element in parallel (Dahl), stiff at small and soft at large
        amplitudes: its force r follows r' = rubber_stiffness e' (1 - sign(e') r / rubber_force).

    Raises
    ------
    ParameterError
        If a number is out of range.

    References
    ----------
    P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14 (1976), 1675-1682.
    """

    asymmetry: float = 0.0
    asymmetry_velocity: float = 0.02
    knee: float = math.inf
    knee_slope: float = 1.0
    friction: float = 0.0
    friction_velocity: float = 0.005
    cubic: float = 0.0
    gap: float = math.inf
    stop_stiffness: float = 0.0
    rubber_stiffness: float = 0.0
    rubber_force: float = 1.0

    def __post_init__(self) -> None:
        check_number("asymmetry", self.asymmetry, at_least=-1, at_most=1)
        for name in ("asymmetry_velocity", "friction_velocity", "rubber_force"):
            check_number(name, getattr(self, name), above=0)
        for name in ("knee_slope", "friction", "stop_stiffness", "rubber_stiffness"):
            check_number(name, getattr(self, name), at_least=0)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of the fields in their order."""
        return tuple(float(getattr(self, name)) for name in self.__slots__)

    @property
    def steepest(self) -> tuple[float, float]:
        """Largest stiffness [N/m] and damping [N s/m] that the law adds near rest."""
        return self.rubber_stiffness + self.stop_stiffness, self.friction / self.friction_velocity

    @property
    def fastest(self) -> float:
        """Rate [rad/s] at which the rubber's force follows a motion of 1 m/s, the fastest expected."""
        return self.rubber_stiffness / self.rubber_force


def damping_factor(temperature: float) -> float:
    """Return the damping at an oil temperature [degrees Celsius] over that at 20 degrees Celsius.

    Raises
    ------
    ParameterError
        If the temperature is not within -60 to 200 degrees Celsius.

    Notes
    -----
    exp(-0.005 (T - 20)): half a percent per degree, the order of magnitude of tests on car dampers.

    Examples
    --------
    >>> [round(damping_factor(temperature), 2) for temperature in (-20, 20, 60)]
    [1.22, 1.0, 0.82]
    """
    check_number("temperature", temperature, at_least=-60, at_most=200)
    return math.exp(-0.005 * (temperature - 20))


def tyre_factor(temperature: float) -> float:
    """Return the stiffness of a tyre at an air temperature [degrees Celsius] over that at 20 degrees Celsius.

    Raises
    ------
    ParameterError
        If the temperature is not within -60 to 200 degrees Celsius.

    Notes
    -----
    The air in the tyre keeps its volume: the absolute pressure follows the absolute temperature. Four fifths of the
    stiffness are in proportion to the gauge pressure, here 2.2 bar at 20 degrees: 0.4 % per degree.

    Examples
    --------
    >>> [round(tyre_factor(temperature), 2) for temperature in (-20, 20, 60)]
    [0.84, 1.0, 1.16]
    """
    check_number("temperature", temperature, at_least=-60, at_most=200)
    warmer = (temperature - 20) / (20 + 273.15)
    return 1 + _OF_PRESSURE * warmer * (TYRE_PRESSURE + _ATMOSPHERE) / TYRE_PRESSURE


def pressure_of(factor: float) -> float:
    """Return the gauge pressure of a tyre [Pa] whose stiffness is `factor` times that at 2.2 bar; at least 0."""
    return max(0.0, TYRE_PRESSURE * (1 + (factor - 1) / _OF_PRESSURE))


#: A car's suspension: damping 35 % higher in rebound and 35 % lower in bump, 25 N of friction, springs that harden
#: by 10 % at 5 cm, bump stops at 7 cm.
REALISTIC_FORCE_LAWS = MappingProxyType(
    {"suspension": ForceLaw(asymmetry=0.35, friction=25.0, cubic=40.0, gap=0.07, stop_stiffness=100e3)}
)
