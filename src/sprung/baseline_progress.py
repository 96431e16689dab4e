"""How much of what a baseline needs its windows have brought, and which drive would bring the rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from sprung._checks import check_each, check_number, check_type
from sprung._display import counted
from sprung.diagnosis import Observation
from sprung.diagnosis.learning import LEARNING_WINDOWS
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit, expected_fit
from sprung.likelihood.spectra import SLOWEST
from sprung.vehicles import Component, Vehicle

__all__ = ["LearningProgress", "learning_progress"]


@dataclass(frozen=True, slots=True)
class ProgressSettings:
    """What counts as enough, and which other drives are considered."""

    #: Share of the information of the windows needed from which nothing more is asked for.
    enough: float = 0.95
    #: Factor by which a window of another drive must bring more than those so far.
    worthwhile: float = 1.3
    #: Lowest and highest speed of a drive over its mean.
    spread: tuple[float, float] = (0.7, 1.3)
    #: Mean speed of a faster drive over that of the windows, and the highest one [m/s].
    faster: float = 1.5
    fastest: float = 20.0
    #: Roughness of a rougher road or track over that of the windows: one class of ISO 8608.
    rougher: float = 4.0
    #: Ordinary drives of rail vehicles, on a track of ERRI B176 low, and the highest mean speed that is asked of them.
    on_rails: ExpectedDrive = field(default_factory=lambda: ExpectedDrive(speed=(15.0, 30.0), roughness=5e-6))
    fastest_on_rails: float = 40.0
    #: Least scatter of healthy windows, ln values: a window that determines a part better than that brings no more.
    scatter: float = 0.005
    #: Largest number of groups of parts that a sentence names.
    n_named: int = 3


SETTINGS = ProgressSettings()


@dataclass(frozen=True, slots=True)
class LearningProgress:
    """What the windows so far have brought of the information that a baseline needs.

    Parameters
    ----------
    shares
        Share of each group of parts, such as "rear dampers", 0 to 1, the smallest first.
    n_needed
        Number of windows of the reference.
    advice
        Drive that would bring the rest; empty if there is enough of all.
    """

    shares: dict[str, float]
    n_needed: int
    advice: str

    def __str__(self) -> str:
        """Return the groups that need more, and the drive that would bring it."""
        few = [name for name, share in self.shares.items() if share < SETTINGS.enough]
        if not few:
            return f"the drives determine all parts as well as {counted(self.n_needed, 'ordinary window')}"
        parts = ", ".join(f"{name}: {100 * self.shares[name]:.0f} %" for name in few[: SETTINGS.n_named])
        if len(few) > SETTINGS.n_named:
            parts += f" and {len(few) - SETTINGS.n_named} others up to {100 * self.shares[few[-1]]:.0f} %"
        return f"{parts} of what {counted(self.n_needed, 'ordinary window')} give; {self.advice}"


def learning_progress(
    observations: Sequence[Observation], vehicle: Vehicle, *, n_needed: int = LEARNING_WINDOWS
) -> LearningProgress:
    """Return how much of what a baseline needs windows have brought, and which drive would bring the rest.

    Parameters
    ----------
    observations
        Windows of one vehicle; those that no baseline is learnt from do not count.
    vehicle
        Vehicle as it was observed.
    n_needed
        Number of ordinary windows that are taken to be enough: ten minutes at 8 to 25 m/s on a road of class B, or at
        15 to 30 m/s on a track of ERRI B176 low.

    Returns
    -------
    LearningProgress

    Raises
    ------
    ParameterError
        If the number of windows needed is below 1, or the vehicle has no sensors of its motion.

    Notes
    -----
    A change shows first in the ratio of left to right, which a fit knows best: information is the inverse of that
    ratio's variance, or of the part's own where it has no other side. The reference is the information that
    `expected_fit` predicts for ordinary windows with the vehicle's sensors. No window counts for more than a standard
    deviation of 0.5 %, as windows of a healthy vehicle scatter by that and more. Whether a faster drive or a rougher
    road or track brings more is predicted the same way from the mean speed and roughness of the windows.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> car = sprung.read_vehicle("zafira")
    >>> parts = tuple(sprung.structure(car).components())
    >>> slow = {"speed": 7.0, "roughness": 64e-6}
    >>> windows = [sprung.Observation(0.0, parts, np.zeros(12), 0.02**2 * np.eye(12), slow, {}, ())] * 6
    >>> learning_progress(windows, car).advice
    'drive faster, about 38 km/h on average'
    """
    check_type("vehicle", vehicle, Vehicle)
    check_number("n_needed", n_needed, at_least=1)
    valid = [each for each in check_each("observations", observations, Observation) if each.is_valid]
    reference = _expected(vehicle, SETTINGS.on_rails if vehicle.kind == "rail" else ExpectedDrive())
    total = dict.fromkeys(reference, 0.0)
    for each in valid:
        own = _information(ExpectedFit(each.components, each.covariance, prior_std=1.0))
        total = {part: value + own.get(part, 0.0) for part, value in total.items()}
    shares: dict[str, float] = {}
    for part, value in total.items():
        share = min(value / (n_needed * reference[part]), 1.0)
        shares[_group(part)] = min(share, shares.get(_group(part), 1.0))
    shares = dict(sorted(shares.items(), key=lambda item: item[1]))
    few = [part for part in reference if shares[_group(part)] < SETTINGS.enough]
    return LearningProgress(shares, n_needed, _advice(valid, vehicle, few) if few else "")


def _group(part: Component) -> str:
    """Return the parts of both sides of an axle in words, such as "rear dampers"."""
    return f"{part.axle or part.corner} {part.kind}s".replace("_", " ")


def _information(fit: ExpectedFit) -> dict[Component, float]:
    """Return the inverse variance of the ratio of each part to its other side, or of the part itself, up to scatter."""
    return {part: 1 / max(std, SETTINGS.scatter) ** 2 for part, std in (fit.std | fit.contrast_std).items()}


def _advice(windows: Sequence[Observation], vehicle: Vehicle, few: Sequence[Component]) -> str:
    """Return the drive that would bring more of some parts."""
    met = {name: [one.conditions[name] for one in windows if name in one.conditions] for name in ("speed", "roughness")}
    surface, fastest = ("track", SETTINGS.fastest_on_rails) if vehicle.kind == "rail" else ("road", SETTINGS.fastest)
    if not all(met.values()):
        return f"drive on an ordinary {surface} with the speed recorded"
    speed = float(round(np.mean(met["speed"])))  # whole m/s and powers of 2, so that predictions are kept
    roughness = float(2 ** round(np.log2(np.median(met["roughness"]))))
    faster = min(SETTINGS.faster * speed, max(speed, fastest))
    present = _precision(vehicle, few, speed, roughness)
    gains = {
        f"drive faster, about {3.6 * faster:.0f} km/h on average": _precision(vehicle, few, faster, roughness),
        f"drive on a rougher {surface}": _precision(vehicle, few, speed, SETTINGS.rougher * roughness),
    }
    best = max(gains, key=gains.__getitem__)
    return best if gains[best] > SETTINGS.worthwhile * present else "drive on as before"


def _precision(vehicle: Vehicle, parts: Sequence[Component], speed: float, roughness: float) -> float:
    """Return the geometric mean of the information about parts that a window is expected to bring."""
    slowest, fastest = SETTINGS.spread
    speeds = max(slowest * speed, SLOWEST), max(fastest * speed, 2 * SLOWEST)
    information = _expected(vehicle, ExpectedDrive(speed=speeds, roughness=roughness))
    return float(np.exp(np.mean([np.log(information[part]) for part in parts])))


@lru_cache(maxsize=64)
def _expected(vehicle: Vehicle, drive: ExpectedDrive) -> Mapping[Component, float]:
    """Return the information that a window of a drive is expected to bring; kept, as each window of learning asks."""
    return MappingProxyType(_information(expected_fit(vehicle, drive)))
