"""Dry friction of suspensions beside their viscous damping, which a linear fit takes together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Booleans, Real
from sprung._checks import check_each, check_type, freeze
from sprung.errors import ParameterError
from sprung.likelihood.corners import IDENTIFIABLE, CornerFit
from sprung.likelihood.spectra import OVERCOUNT
from sprung.likelihood.surface import RoadInputs
from sprung.likelihood.suspension_forces import SuspensionForces, elongation_spectrum, friction_forces
from sprung.likelihood.uncertainty import Optimum, expected_covariance
from sprung.vehicles import Structure


@dataclass(frozen=True, slots=True)
class FrictionPrior:
    """Friction of a suspension before any data."""

    #: Usual force over the static load: 20 to 40 N of the strut of a car.
    share: float = 0.007
    #: Standard deviation of a corner's force over its usual one.
    std: float = 1.0
    #: Correlation of the corners.
    alike: float = 0.8
    #: Standard deviation of ln of a common factor of all dampers from drive to drive: the temperature of their oil.
    warmth: float = 0.06
    #: Standard deviation of ln of each damper by unlike valves, over the square of their force |v| over the damping's:
    #: 4 % where rebound has twice the damping of bump.
    law: float = 0.5
    #: That force over the damping's where it is not known.
    uneven: float = 0.3
    #: Standard deviation of ln of the forces of several drives together: velocities are not Gaussian.
    linearised: float = 0.15
    #: Ratio of the variances of a friction by bands of frequencies and by chance, up to which it is chance: one linear
    #: car in ten is above. Multibody cars, whose response is not that of the model, have 3 to 6.
    chance: float = 1.5
    #: Variance by the error of the model, over that of chance and over what is beyond `chance`.
    unlike: float = 4.0
    #: Friction by segments over the usual one, beyond which it may be valves that open.
    valves: float = 1.5
    #: Smallest viscous damping over that of the linear fit.
    smallest: float = 0.05


PRIOR = FrictionPrior()


@dataclass(frozen=True, eq=False, slots=True)
class Friction:
    """Coulomb friction of the suspension of each corner.

    Parameters
    ----------
    corners
        Names of the corners.
    forces
        Friction force at the wheel [N], shape (corners,).
    covariance
        Their covariance, shape (corners, corners).
    prior_std
        Standard deviation before any data, shape (corners,).
    """

    corners: tuple[str, ...]
    forces: Real
    covariance: Real
    prior_std: Real

    def __post_init__(self) -> None:
        freeze(self, forces=1, covariance=2, prior_std=1)

    @property
    def std(self) -> Real:
        """Standard deviations [N]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def is_identifiable(self) -> Booleans:
        """Whether data determine each force, as `CornerFit.is_identifiable`; the others stay near the usual one."""
        return self.std < IDENTIFIABLE * self.prior_std


@dataclass(frozen=True, eq=False, slots=True)
class DampingAndFriction:
    """A fit whose dampers are viscous alone, and the friction beside them.

    Parameters
    ----------
    fit
        Linear fit, whose dampers contain the friction.
    friction
        Friction of the corners.
    velocities
        RMS velocity of the suspension of each corner, averaged over the segments [m/s], shape (corners,).
    parameters
        Parameters of the fit beside friction.
    covariance
        Covariance of `parameters`, and of the forces after them.
    uneven
        Half of what dampers have more in rebound than in bump [N s/m], shape (corners,); 0 where it is not known.
    """

    fit: CornerFit
    friction: Friction
    velocities: Real
    parameters: Real
    covariance: Real
    uneven: Real

    def __post_init__(self) -> None:
        freeze(self, velocities=1, parameters=1, covariance=2, uneven=1)


def static_loads(structure: Structure) -> dict[str, float]:
    """Return the static force under the tyre of each corner on the road [N]."""
    loads = zip(structure.elements, structure.static_loads.tolist(), strict=True)
    return {element.owner: load for element, load in loads if element.part == "tyre" and element.foot}


def has_loads(fit: CornerFit) -> bool:
    """Whether a vehicle of known masses was driven on a road, so that its tyres have loads and its wheels a level."""
    is_on_road = any(isinstance(block, RoadInputs) for block in fit.model.blocks)
    structure = fit.model.structure
    return is_on_road and structure.mass[0, 0] > 1 and any(e.part == "tyre" and e.foot for e in structure.elements)


def usual_friction(fit: CornerFit) -> Friction:
    """Return the friction of the suspensions of a vehicle before any data.

    Parameters
    ----------
    fit
        Fit to a drive on a road, with masses in kilograms.

    Raises
    ------
    ParameterError
        If the vehicle is not on a road, or its masses are not known.

    Notes
    -----
    0.7 % of the static load of the file, give or take as much, alike at all corners with a correlation of 0.8.
    """
    if not has_loads(fit):
        raise ParameterError(
            "friction needs a fit on a road of a vehicle with tyres and masses in kg: give them in the vehicle file"
        )
    loads = static_loads(fit.model.structure)
    rows = fit.model.names
    corners = tuple(corner for corner in loads if f"{corner}.damper" in rows)
    forces = PRIOR.share * np.maximum([loads[corner] for corner in corners], 0.0)
    std = PRIOR.std * forces
    alike = PRIOR.alike + (1 - PRIOR.alike) * np.eye(len(corners))
    return Friction(corners, forces, alike * np.outer(std, std), std)


def separate_friction(fit: CornerFit, *, prior: Friction | None = None) -> DampingAndFriction:
    """Return viscous damping and dry friction of the suspensions of a drive.

    Parameters
    ----------
    fit
        Fit to a drive on a road, with masses in kilograms.
    prior
        What is known of the friction without this drive, such as `common_friction` of earlier ones; None: usual
        friction.

    Raises
    ------
    ParameterError
        If the vehicle is not on a road, its masses are not known, or the prior is that of other corners.

    Notes
    -----
    Stochastic linearisation: Coulomb friction F at a Gaussian velocity of standard deviation s acts as the damping F
    sqrt(2/pi) / s. The linear fit has c + F sqrt(2/pi) / s on the average of its speed classes; each class has an s of
    its own, from the fitted model's spectrum. One step of Fisher scoring from F = 0 with the derivatives of all
    classes, which the parameters of the fit follow, so that the covariance holds how friction and damping make up for
    each other; the dampers have 4 % more for valves and stops. No force is negative. What identifies friction in
    spectra is the spread of s: between 8 and 25 m/s on a road of class C ten minutes give 30 N per corner, on class B
    16 N, one drive on each of A, B, C and D together 2 N. What is known without this drive includes what its segments
    say beside their spectra (`suspension_forces.friction_forces`): 2 to 4 N on class C, 1 N on class A.

    References
    ----------
    J. B. Roberts, P. D. Spanos, Random Vibration and Statistical Linearization, Dover, 2003, chapter 5.
    C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with applications to problems
    of estimation, Proceedings of the Cambridge Philosophical Society 44 (1948), 50-57.
    """
    check_type("fit", fit, CornerFit)
    usual = usual_friction(fit)
    prior = usual if prior is None else prior
    if prior.corners != usual.corners:
        raise ParameterError(
            f"prior is of {', '.join(prior.corners)}, but the fit has {', '.join(usual.corners)}: give one of it"
        )
    of_segments = _of_segments(fit, usual.corners)
    prior = _together(prior, usual, of_segments)
    evidence = _Evidence(fit, usual.corners)
    n = fit.parameters.size
    # The score counts overlapping segments about twice, and they may scatter more than the model expects: the prior of
    # the forces must weigh against it as much.
    weight = OVERCOUNT * evidence.scale**2
    precision = np.zeros_like(evidence.information)
    precision[:n, :n] = np.diag(1 / fit.model.prior_std**2)
    of_forces = np.linalg.inv(prior.covariance)
    precision[n:, n:] = weight * of_forces
    bread = np.linalg.inv(evidence.information + precision)
    pull = np.concatenate([evidence.pull, evidence.score[n:] + weight * of_forces @ prior.forces])
    spread = weight * evidence.information + precision
    spread[n:, n:] += (weight**2 - weight) * of_forces
    step, covariance = bread @ pull, bread @ spread @ bread
    step = _not_negative(step, covariance, first=n)
    dampers = evidence.dampers
    left = np.maximum(1 + step[dampers], PRIOR.smallest)
    parameters = fit.parameters + step[:n]
    parameters[dampers] = fit.parameters[dampers] + np.log(left)
    stretch = np.ones(len(bread))
    stretch[dampers] = 1 / left
    covariance = covariance * np.outer(stretch, stretch)
    uneven = np.zeros(len(dampers)) if of_segments is None else of_segments.uneven
    covariance[dampers, dampers] += _law(fit, dampers, of_segments) ** 2
    friction = Friction(usual.corners, step[n:], covariance[n:, n:], usual.prior_std)
    return DampingAndFriction(fit, friction, evidence.velocities, parameters, covariance, uneven)


def common_friction(fits: Sequence[CornerFit]) -> Friction:
    """Return the friction of a vehicle from several drives, best on roads of different roughness.

    Parameters
    ----------
    fits
        Fits to drives of one vehicle between which its suspension did not change, at least one.

    Raises
    ------
    ParameterError
        If there is no fit, they are not of one vehicle, or it is not on a road or its masses are not known.

    Notes
    -----
    All drives have the viscous damping and the friction of the corners in common, but for a factor of all dampers of 6
    % from drive to drive, the temperature of their oil, and one of each of 4 %, valves and stops; the forces have 15 %
    more of stochastic linearisation. The information of each drive on both, the rest of its parameters averaged over,
    adds up.

    References
    ----------
    As for `separate_friction`.

    Examples
    --------
    Drives on a smooth and a rough road know the friction better than one drive does:

    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> car, roads = read_vehicle("zafira"), [RoadConditions("A"), RoadConditions("D")]
    >>> drives = [RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0, road=road) for road in roads]
    >>> fits = [fit_corners(simulate_drive(car, drive, seed=1).recording, car) for drive in drives]
    >>> both, one = common_friction(fits), separate_friction(fits[1]).friction
    >>> bool(both.std[0] < one.std[0] / 2), bool(both.forces[0] < 3 * both.std[0])
    (True, True)
    """
    fits = list(check_each("fits", fits, CornerFit))
    if not fits:
        raise ParameterError("fits is empty: give at least one")
    usual = usual_friction(fits[0])
    size, known = len(usual.corners), usual
    precision, pull = np.zeros((2 * size, 2 * size)), np.zeros(2 * size)
    for fit in fits:
        if usual_friction(fit).corners != usual.corners:
            raise ParameterError("fits are of different vehicles: give those of one")
        of_segments = _of_segments(fit, usual.corners)
        own, weight = _Evidence(fit, usual.corners).of_dampers(of_segments)
        precision += own
        pull += weight
        known = _together(known, usual, of_segments)
    before = np.linalg.inv(known.covariance)
    precision[size:, size:] += before
    pull[size:] += before @ known.forces
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    forces = _not_negative(covariance @ pull, covariance, first=size)[size:]
    linearised = PRIOR.linearised**2 * np.outer(forces, forces)
    return Friction(usual.corners, forces, covariance[size:, size:] + linearised, usual.prior_std)


class _Evidence:
    """Information and score of the parameters of a fit and of the friction of its corners, at no friction."""

    def __init__(self, fit: CornerFit, corners: tuple[str, ...]) -> None:
        model = fit.model
        self._fit = fit
        #: Rows of the dampers among the parameters.
        self.dampers = [model.names.index(f"{corner}.damper") for corner in corners]
        optimum = Optimum(model, fit.parameters)
        response, spectra = optimum.response, model.spectra
        numbers = {
            element.owner: n for n, element in enumerate(model.structure.elements) if element.part == "suspension"
        }
        variances = np.reshape(
            [
                np.trapezoid(
                    elongation_spectrum(response, numbers[corner]) * response.terms.squared, response.terms.frequencies
                )
                for corner in corners
            ],
            (-1, spectra.counts.size),
        )
        gains = np.sqrt(2 / np.pi / variances)
        further = [
            optimum.whitened(response.change_by_element(numbers[corner], response.terms.s) * gains[row][:, None, None])
            for row, corner in enumerate(corners)
        ]
        rows = np.concatenate([optimum.derivatives, np.reshape(further, (-1, optimum.excess.size))])
        #: RMS velocity of each corner.
        self.velocities = np.sqrt(np.average(variances, axis=1, weights=spectra.counts))
        self.information = rows @ rows.T
        #: Derivative of ln of the likelihood.
        self.score = -rows @ optimum.excess
        #: That of the parameters of the fit with their prior; a fit ends near its optimum.
        n = fit.parameters.size
        self.pull = self.score[:n] - (fit.parameters - model.start) / model.prior_std**2
        expected = expected_covariance(self.information[:n, :n], model.prior_std)
        #: Standard deviation of the dampers over that by the model, where segments scatter more than it expects.
        ratios = (np.diag(fit.covariance) / np.diag(expected))[self.dampers]
        self.scale = float(np.sqrt(np.mean(ratios))) if corners else 1.0

    def of_dampers(self, of_segments: SuspensionForces | None) -> tuple[Real, Real]:
        """Return precision, and precision times estimate, of viscous damping over nominal and friction forces."""
        fit, size = self._fit, len(self.dampers)
        n = fit.parameters.size
        kept = np.r_[self.dampers, n : n + size]
        rest = np.setdiff1d(np.arange(n), self.dampers)
        cross = self.information[np.ix_(rest, kept)]
        precision = self.information[np.ix_(rest, rest)] + np.diag(1 / fit.model.prior_std[rest] ** 2)
        followed = np.linalg.solve(precision, cross).T
        values = np.exp(fit.parameters[self.dampers])
        to_values = np.r_[1 / values, np.ones(size)]
        variance = OVERCOUNT * self.scale**2
        own = (self.information[np.ix_(kept, kept)] - followed @ cross) * np.outer(to_values, to_values) / variance
        at = np.r_[values, np.zeros(size)]
        weight = own @ at + to_values * (self.score[kept] - followed @ self.pull[rest]) / variance
        scatter = PRIOR.warmth**2 + np.diag(_law(fit, self.dampers, of_segments) ** 2)
        own_of_dampers = own[:, :size] * values
        middle = np.linalg.inv(scatter) + values[:, None] * own_of_dampers[:size]
        shrunk = np.linalg.solve(middle, own_of_dampers.T).T
        return own - shrunk @ own_of_dampers.T, weight - shrunk @ (values * weight[:size])


def _of_segments(fit: CornerFit, corners: tuple[str, ...]) -> SuspensionForces | None:
    """Return what the segments of a drive say of forces that are not linear, beside their spectra."""
    if fit.driven is None or not corners:
        return None
    parts = [(element.owner, element.part) for element in fit.model.structure.elements]
    numbers = [parts.index((corner, "suspension")) for corner in corners]
    return friction_forces(fit.driven, fit.model, fit.parameters, numbers, model_error=fit.model_error)


def _together(known: Friction, usual: Friction, found: SuspensionForces | None) -> Friction:
    """Return what is known of friction with what the segments of a drive say of it.

    What is far beyond usual friction may be valves that open, and is as uncertain as large: 25 N with valves that open
    to 0.4 of their damping at 0.05 to 0.2 m/s read 80 to 110 N: a drive does not distinguish them.
    """
    if found is None:
        return known
    of_valves = np.maximum(found.friction - PRIOR.valves * usual.forces, 0.0)
    by_bands = PRIOR.unlike * max(0.0, found.excess - PRIOR.chance) * np.diag(found.covariance)
    unlike = np.sqrt(by_bands + of_valves**2)
    alike = PRIOR.alike + (1 - PRIOR.alike) * np.eye(unlike.size)
    precisions = [
        np.linalg.inv(each) for each in (known.covariance, found.covariance + alike * np.outer(unlike, unlike))
    ]
    covariance = np.linalg.inv(precisions[0] + precisions[1])
    forces = covariance @ (precisions[0] @ known.forces + precisions[1] @ found.friction)
    return replace(known, forces=forces, covariance=covariance)


def _law(fit: CornerFit, dampers: list[int], found: SuspensionForces | None) -> Real:
    """Return the standard deviations of ln of the dampers by unlike valves."""
    if found is None:
        return np.full(len(dampers), PRIOR.law * PRIOR.uneven**2)
    known = fit.model.structure.components()
    dampings = [known[fit.components[row]] * np.exp(fit.parameters[row]) for row in dampers]
    return np.asarray(PRIOR.law * np.minimum(found.uneven / dampings, 1.0) ** 2, dtype=np.float64)


def _not_negative(estimate: Real, covariance: Real, *, first: int) -> Real:
    """Return an estimate under the condition that those of its entries from `first` on that are negative are 0."""
    held: list[int] = []
    found = estimate
    while np.any(found[first:] < -1e-9):
        held += (first + np.flatnonzero(found[first:] < -1e-9)).tolist()
        found = estimate - covariance[:, held] @ np.linalg.solve(covariance[np.ix_(held, held)], estimate[held])
        found[held] = 0.0
    return np.asarray(found, dtype=np.float64)
