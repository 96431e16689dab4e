"""Laws of springs and dampers that are not linear."""

import math
from dataclasses import dataclass
from types import MappingProxyType

from sprung._checks import check_number


@dataclass(frozen=True, slots=True)
class Law:
    """How a spring with a damper departs from k e + c e', with the elongation e.

    Parameters
    ----------
    asymmetry
        The damper has c (1 + asymmetry) in rebound (e' > 0) and c (1 - asymmetry) in bump; -1 to 1.
    asymmetry_velocity
        Over which it passes from one to the other [m/s].
    knee, knee_slope
        Beyond the speed `knee` [m/s] the damper's force rises with knee_slope times its slope (digressive).
    friction, friction_velocity
        Dry friction [N] e' / sqrt(e'^2 + friction_velocity^2).
    cubic
        The spring has k (e + cubic e^3); in 1/m^2.
    gap, stop_stiffness
        Bump stops: beyond |e| = gap [m] a stiffness [N/m] is added.
    rubber_stiffness, rubber_force
        A friction element in parallel whose force r follows r' = rubber_stiffness e' (1 - sign(e') r / rubber_force):
        stiff at small amplitudes, soft at large ones (Dahl) [N/m, N].

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
        """The fields in their order."""
        return tuple(float(getattr(self, name)) for name in self.__slots__)

    @property
    def steepest(self) -> tuple[float, float]:
        """Stiffness [N/m] and damping [N s/m] that it can add at most near rest."""
        return self.rubber_stiffness + self.stop_stiffness, self.friction / self.friction_velocity

    @property
    def fastest(self) -> float:
        """Rate [rad/s] at which the rubber's force follows a motion of 1 m/s, the fastest that is expected."""
        return self.rubber_stiffness / self.rubber_force


def damping_factor(temperature: float) -> float:
    """Return damping over that at 20 degrees Celsius of a damper whose oil is at a temperature [degrees Celsius].

    Notes
    -----
    exp(-0.005 (T - 20)): half a percent per degree, of the size that tests of car dampers give.
    """
    check_number("temperature", temperature, at_least=-60, at_most=200)
    return math.exp(-0.005 * (temperature - 20))


#: A car's suspension: rebound 35 % stiffer and bump 35 % softer, 25 N of friction, springs that harden by 10 % at
#: 5 cm, stops at 7 cm.
REALISTIC_LAWS = MappingProxyType(
    {"suspension": Law(asymmetry=0.35, friction=25.0, cubic=40.0, gap=0.07, stop_stiffness=100e3)}
)
