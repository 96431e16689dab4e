"""Joint fit of windows, rough and then full, and what its misfit asks for: masses on mounts and flexible modes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from sprung._arrays import Real
from sprung.calibration.draft import Draft, VehicleNumber
from sprung.calibration.joint import JointModel, WindowSpectra, fitted, joint_of, scaled_start, window_model
from sprung.likelihood import (
    ClassSpectra,
    CornerSettings,
    RigidLayout,
    SpectralLine,
    class_spectra,
    residual_lines,
)
from sprung.likelihood.masked_lines import without_lines
from sprung.likelihood.spectra import OVERCOUNT
from sprung.likelihood.uncertainty import Optimum, excess_power, segment_weights, tempering
from sprung.likelihood.vehicle import lowest_of_lines
from sprung.vehicles import MountedMass, body_row
from sprung.vehicles.models import modal_mass
from sprung.vehicles.sections import FlexibleMode


@dataclass(frozen=True, slots=True)
class JointSettings:
    """Settings of a joint fit."""

    #: Tempering of the first fit.
    first: float = 0.1
    #: Number of fits after it.
    full_fits: int = 2
    #: Width of the speed classes: what is learnt of a vehicle needs none as narrow as a fit of the corners.
    width: float = 0.1
    #: Largest ln of the roughness of a class over the common one at the start.
    roughest: float = 7.0
    #: Smallest tempering: below it a window would say nothing.
    weakest: float = 0.01


SETTINGS = JointSettings()


@dataclass(frozen=True, eq=False, slots=True)
class Weighting:
    """How much the parts of a window count in its likelihood.

    Parameters
    ----------
    amplitudes
        Factor of the spectra of each segment, shape (segments,): less than 1 for potholes.
    lines
        Lines that are left out.
    tempering
        Power of the likelihood.
    """

    amplitudes: Real
    lines: tuple[SpectralLine, ...]
    tempering: float


@dataclass(frozen=True, eq=False, slots=True)
class FreeVehicle:
    """Windows of a vehicle, and what of its file is free.

    Parameters
    ----------
    windows
        Spectra of the windows.
    draft
        Vehicle as given.
    numbers
        Numbers of the file that are free.
    settings
        Choices of the fit.
    """

    windows: tuple[WindowSpectra, ...]
    draft: Draft
    numbers: tuple[VehicleNumber, ...]
    settings: CornerSettings


@dataclass(frozen=True, eq=False, slots=True)
class JointFit:
    """Windows fitted together.

    Parameters
    ----------
    free
        Windows, vehicle and its free numbers.
    joint
        Windows with their data.
    parameters
        Joint parameters at the optimum.
    weighting
        Weights of the last fit, window by window.
    """

    free: FreeVehicle
    joint: JointModel
    parameters: Real
    weighting: tuple[Weighting, ...]

    def values(self) -> dict[str, float]:
        """Return the joint parameters by name."""
        return dict(zip(self.joint.names, self.parameters.tolist(), strict=True))


def joint_fit(free: FreeVehicle, *, start: Mapping[str, float] | None = None) -> JointFit:
    """Fit numbers of a vehicle file to windows.

    Parameters
    ----------
    free
        Windows, vehicle and its free numbers.
    start
        Joint parameters by name at which the search starts; those that are absent start at the given values.

    Notes
    -----
    As `sprung.likelihood.fit_segments`: a first fit with a tenth of the weight, then full ones, each with the lines,
    amplitudes and tempering that follow from the one before.
    """
    weighting = tuple(Weighting(np.ones(window.segments.speeds.size), (), SETTINGS.first) for window in free.windows)
    joint = _joint(free, weighting)
    fit = JointFit(free, joint, fitted(joint, _with_roughness(joint, _started(joint, start or {}))), weighting)
    for _ in range(SETTINGS.full_fits):
        weighting = _weightings(fit)
        joint = _joint(free, weighting)
        fit = JointFit(free, joint, fitted(joint, fit.parameters), weighting)
    return fit


def extended_fit(fit: JointFit, free: FreeVehicle) -> JointFit:
    """Fit the same windows with more that is free, or with another part, from the end of a fit.

    Parameters
    ----------
    fit
        Fit with which the search starts.
    free
        The same windows, and all that is free of the vehicle.

    Notes
    -----
    First under the weights of `fit`, then under those that follow.
    """
    joint = _joint(free, fit.weighting)
    rough = JointFit(free, joint, fitted(joint, _started(joint, fit.values())), fit.weighting)
    return reweighted(rough, _weightings(rough))


def reweighted(fit: JointFit, weighting: tuple[Weighting, ...]) -> JointFit:
    """Repeat a fit with the weights of another one, so that their likelihoods compare.

    Parameters
    ----------
    fit
        Fit whose parameters are the start.
    weighting
        Weights of the windows.
    """
    joint = _joint(fit.free, weighting)
    return JointFit(fit.free, joint, fitted(joint, fit.parameters), weighting)


def _joint(free: FreeVehicle, weighting: Sequence[Weighting]) -> JointModel:
    """Return the joint model of weighted windows in usual speed classes."""
    models = []
    for window, weights in zip(free.windows, weighting, strict=True):
        spectra = _weighted(window, weights)
        models.append(window_model(spectra, window, free.draft, free.numbers, free.settings))
    return joint_of(models)


def _weighted(window: WindowSpectra, weights: Weighting) -> ClassSpectra:
    """Return the mean spectra of a window with its weights."""
    limited = replace(window.segments, values=window.segments.values * weights.amplitudes[:, None, None])
    spectra = class_spectra(limited, width=SETTINGS.width)
    counted = weights.tempering * spectra.weights * without_lines(spectra, weights.lines)
    return replace(spectra, weights=counted)


def _weightings(fit: JointFit) -> tuple[Weighting, ...]:
    """Return the weights of the windows that follow from a fit."""
    settings, weighting = fit.free.settings, []
    vehicle = fit.free.draft.structure()
    for number, (window, model) in enumerate(zip(fit.free.windows, fit.joint.models, strict=True)):
        parameters = fit.joint.of_window(number, fit.parameters)
        amplitudes = np.sqrt(segment_weights(model, parameters, window.segments, width=SETTINGS.width))
        lowest = lowest_of_lines(vehicle, window.kind)
        lines = residual_lines(model, parameters, lowest=lowest) if settings.has_lines_masked else ()
        untempered = Weighting(amplitudes, lines, 1.0)
        power = tempering(replace(model, spectra=_weighted(window, untempered)), parameters)
        weighting.append(replace(untempered, tempering=max(SETTINGS.weakest, power)))
    return tuple(weighting)


def _started(joint: JointModel, known: Mapping[str, float]) -> Real:
    """Return the start of a search with the parameters that are known."""
    start = scaled_start(joint)
    for number, name in enumerate(joint.names):
        start[number] = known.get(name, start[number])
    return start


def _with_roughness(joint: JointModel, parameters: Real) -> Real:
    """Return the parameters with the roughness of each speed class at the power of its data."""
    parameters = parameters.copy()
    for number, (model, rows) in enumerate(zip(joint.models, joint.rows, strict=True)):
        levels = model.rows("class_roughness")
        if levels.size:
            mean = model.relative_power(joint.of_window(number, parameters)).mean(axis=1)
            parameters[rows[levels]] = np.clip(np.log(np.maximum(mean, 1e-9)), -SETTINGS.roughest, SETTINGS.roughest)
    return parameters


def evaluated(free: FreeVehicle, fit: JointFit) -> float:
    """Return the objective of windows at the parameters and weights of a fit, further parameters at their start."""
    joint = _joint(free, fit.weighting)
    return joint.objective(_started(joint, fit.values()))[0]


def expected_steps(free: FreeVehicle, fit: JointFit) -> tuple[dict[str, float], float]:
    """Return what one Newton step of the parameters beyond those of a fit would change, and its gain.

    Parameters
    ----------
    free
        The windows of the fit, with more that is free.
    fit
        Fit at whose end the step is taken.

    Returns
    -------
    dict, float
        Step of each number of the vehicle file, and gain in ln of the likelihood, corrected for overlap.

    Notes
    -----
    The score test: with the gradient g and the information J, prior included, the step is -J^-1 g and gains
    g^T J^-1 g / 2. No fit with the further parameters is needed.

    References
    ----------
    C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with applications to problems
    of estimation, Proceedings of the Cambridge Philosophical Society 44 (1948), 50-57.
    """
    joint = _joint(free, fit.weighting)
    parameters = _started(joint, fit.values())
    gradient = joint.objective(parameters)[1]
    known = np.isin(joint.names, fit.joint.names)
    gradient[known] = 0.0  # the fit is at its optimum
    precision = joint.information(parameters) + np.diag(1 / joint.prior_std**2)
    step = -np.linalg.solve(precision, gradient)
    names = {number.name for number in free.numbers}
    steps = {name: float(own) for name, own in zip(joint.names, step, strict=True) if name in names}
    return steps, float(-gradient @ step) / 2 / OVERCOUNT


def misfit_in(fit: JointFit, number: int, layout: RigidLayout) -> tuple[Real, float]:
    """Return measured over fitted power of a window less 1 in the coordinates of a layout, and the model error.

    Parameters
    ----------
    fit
        Joint fit, in all channels.
    number
        Number of the window.
    layout
        Combinations of the same channels.

    Returns
    -------
    ndarray, float
        Misfit averaged over the classes, shape (coordinates, frequencies); RMS of it in excess of chance.
    """
    model = fit.joint.models[number]
    to_layout = layout.reduction @ np.linalg.inv(model.layout.reduction)
    fitted_matrices = to_layout @ model.matrix(fit.joint.of_window(number, fit.parameters)) @ to_layout.T
    spectra = replace(model.spectra, matrices=to_layout @ model.spectra.matrices @ to_layout.T)
    misfit, excess = excess_power(fitted_matrices, spectra)
    return misfit, float(np.sqrt(max(0.0, excess)))


@dataclass(frozen=True, slots=True)
class MountSettings:
    """Masses on mounts that are tried."""

    #: Lowest and highest frequency [Hz]: engines are at 6 to 16 Hz, exhausts and tanks above.
    frequencies: tuple[float, float] = (5.0, 25.0)
    #: Number of frequencies.
    n_frequencies: int = 14
    #: Damping ratio.
    damping_ratio: float = 0.08
    #: Smallest and largest mass over that of the body.
    masses: tuple[float, float] = (0.02, 0.2)
    #: Largest share of the body's pitch inertia that the mass takes along.
    max_inertia: float = 0.4


MOUNTS = MountSettings()


def likely_mount(fit: JointFit) -> tuple[MountedMass | None, float]:
    """Return the mass on mounts that would lower the misfit of a fit most, and by how much; None if none would.

    Parameters
    ----------
    fit
        Fit of a vehicle without it.

    Notes
    -----
    A mass m on mounts of frequency f0 and damping ratio z at a place of the body loads it like the dynamic mass
    m T(f), T = (1 + 2 i z f/f0) / (1 - (f/f0)^2 + 2 i z f/f0). For each of a grid of places and frequencies: the score
    u, derivative of the objective with respect to m at m = 0 while the body gives up the mass m, and its information
    J, what all other parameters explain taken off. A Newton step is m = -u / J and gains u^2 / (2 J) in ln of the
    likelihood, which is corrected for the overlap of the segments.

    References
    ----------
    C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters with applications to problems
    of estimation, Proceedings of the Cambridge Philosophical Society 44 (1948), 50-57 (score test).
    J. P. Den Hartog, Mechanical Vibrations, 4th edition, McGraw-Hill, 1956, section 3.3 (vibration absorber).
    """
    joint, vehicle = fit.joint, fit.free.draft.vehicle
    windows = [Optimum(model, joint.of_window(number, fit.parameters)) for number, model in enumerate(joint.models)]
    precision = joint.information(fit.parameters) + np.diag(1 / joint.prior_std**2)
    best, most = None, 0.0
    places = (vehicle.axle[0].x, 0.0, vehicle.axle[-1].x)
    frequencies = np.geomspace(*MOUNTS.frequencies, MOUNTS.n_frequencies).tolist()
    for frequency, place in product(frequencies, places):
        candidate = MountedMass(mass=1.0, x=place, frequency=frequency, damping_ratio=MOUNTS.damping_ratio)
        score, own, cross = 0.0, 0.0, np.zeros(fit.parameters.size)
        for window, rows in zip(windows, joint.rows, strict=True):
            derivative = _derivative(window, candidate)
            score += float(window.excess @ derivative)
            own += float(derivative @ derivative)
            np.add.at(cross, rows, window.derivatives @ derivative)
        left = own - float(cross @ np.linalg.solve(precision, cross))
        if left > 0 and score < 0 and score**2 / left > most:
            lightest, heaviest = MOUNTS.masses
            mass = float(np.clip(-score / left, lightest * vehicle.body.mass, heaviest * vehicle.body.mass))
            best, most = candidate.model_copy(update={"mass": mass}), score**2 / left
    return best, most / 2 / OVERCOUNT


def with_mount(draft: Draft, mount: MountedMass) -> Draft:
    """Return the draft with a mass on mounts that was part of the body: the sums of mass and inertias stay."""
    body = draft.vehicle.body
    left = body.mass - mount.mass
    centre = -mount.mass * mount.x / left  # of the body that is left
    taken = mount.mass * mount.x**2 + left * centre**2
    pitch = (body.pitch_inertia or 0.0) - min(taken, MOUNTS.max_inertia * (body.pitch_inertia or 0.0))
    mounted = draft.with_fields(mounted_mass=(*draft.vehicle.mounted_mass, mount))
    ahead = mounted.ahead(centre)
    return ahead.with_fields(body=body.model_copy(update={"mass": left, "pitch_inertia": pitch}))


def with_mode(draft: Draft, mode: FlexibleMode) -> Draft:
    """Return the draft with a flexible mode of the body, its modal mass stated."""
    complete = mode.model_copy(update={"mass": mode.mass or modal_mass(draft.vehicle, mode)})
    return draft.with_fields(flexible_mode=(*draft.vehicle.flexible_mode, complete))


def _derivative(window: Optimum, mount: MountedMass) -> Real:
    """Return the whitened derivative of a window's spectral matrix with respect to the mass, in real coordinates."""
    response, model = window.response, window.model
    f = response.terms.frequencies
    ratio, damping = f / mount.frequency, 2j * mount.damping_ratio * f / mount.frequency
    dynamic = (1 + damping) / (1 - ratio**2 + damping) - 1  # the mass itself leaves the body
    row = body_row(model.structure.coordinates, x=mount.x, y=mount.y, shapes=model.structure.shapes)
    load = (2 * np.pi * f) ** 2 * dynamic
    change = load[:, None, None] * (response.force_response @ np.outer(row, row) @ response.displacements)
    return window.whitened(response.change_by_transfer(change))
