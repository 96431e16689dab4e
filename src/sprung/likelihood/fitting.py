"""Fit of springs, dampers and tyres of every corner to the spectra of a drive."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError
from sprung.labels import MOTIONS
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.inputs import InputModel, RailInputs, RigInputs, RoadInputs
from sprung.likelihood.layout import RigidLayout, rigid_layout
from sprung.likelihood.lines import SpectralLine, residual_lines, without_lines
from sprung.likelihood.modal import corners_from_modes
from sprung.likelihood.spectra import (
    CLASS_WIDTH,
    OVERCOUNT,
    ClassSpectra,
    SegmentSpectra,
    class_spectra,
    segment_spectra,
    speed_classes,
)
from sprung.likelihood.speeds import with_estimated_speeds
from sprung.likelihood.whittle import TOO_FAR, Component, MassChange, Model, SensorChange
from sprung.modal import Modes
from sprung.preparation import speed_channel, usable
from sprung.recording import Recording
from sprung.vehicles import Outputs, Structure, Vehicle, corner_names, structure, wheel_hop_frequencies

Real = NDArray[np.float64]
Kind = Literal["road", "rail", "rig"]

#: Band over the lowest and highest natural frequency of the nominal vehicle, and its upper end over its lower.
_BELOW, _ABOVE, _WIDEST = 0.4, 1.7, 33.0
#: Highest frequency over the sampling rate.
_HIGHEST = 0.4
#: Periods of the nominal vehicle's slowest mode in a segment.
_PERIODS = 7.5
#: On a road or track lines are looked for from this many times the highest mode of the body on: what does not fit
#: below it may be the body's own motion.
_OVER_BODY = 1.5
#: Usual error of a sensor's place [m] and of its time [s].
_PLACE, _LAG = 0.1, 2e-3
#: Fits and estimates of the speed in turn, where it is missing.
_ROUNDS = 3
#: The search ends with a step that gains less than this share of all that was gained, or where the slope is less than
#: this in standard deviations.
_TOLERANCE, _SLOPE = 1e-8, 1e-2
#: Lines that a note names.
_MOST_NAMED = 6
#: A segment counts at most this many times the median power.
_MOST_POWER = 3.0
#: Relative misfit of the spectra from which on a fit is called imperfect.
_IMPERFECT = 0.1
#: Variance of the mean of n half-overlapping segments' relative power, times n.
_CHANCE = 1.06
#: Correlation of the misfit below which two frequencies tell different things.
_UNLIKE = 0.1
#: Credibility of the first fit below which it may be a local minimum, and ln of a broken spring to start again from.
_DOUBTFUL, _BROKEN = 0.3, -1.2
#: Width of the speed classes of the first fit.
_COARSE = 0.1
#: Credibility of the segments in the first fit; fits after it, each with the lines and the credibility that the last
#: one shows; and relative change of the credibility below which there are no more.
_FIRST, _MOST_FITS, _SETTLED = 0.1, 4, 0.1


@dataclass(frozen=True, slots=True)
class CornerSettings:
    """How to fit; None means chosen from the vehicle.

    Parameters
    ----------
    band
        Lowest and highest frequency [Hz].
    segment
        Length of a segment [s].
    width
        Standard deviation of ln(value / nominal value) before any data.
    free
        Components to fit, such as ("spring", "rear_left.damper"); the others keep the vehicle file's values. None: all.
    has_payload
        Fit the body's mass, moments and inertias too: without, a payload is taken for soft springs. None: not on a
        rig.
    has_free_sensors
        Fit places and lags of the sensors too.
    has_lines_masked
        Leave frequencies out where lines of wheels, engine or mains stand out of a first fit.
    kind
        What drives the wheels: "road", "rail" (both repeat the front wheels' input at the rear ones and need the speed)
        or "rig" (rollers); None: as the vehicle file says.
    """

    band: tuple[float, float] | None = None
    segment: float | None = None
    width: float = 0.7
    free: tuple[str, ...] | None = None
    has_payload: bool | None = None
    has_free_sensors: bool = False
    has_lines_masked: bool = True
    kind: Kind | None = None

    def __post_init__(self) -> None:
        check_number("width", self.width, above=0)
        if self.kind is not None:
            check_one_of("kind", self.kind, ("road", "rail", "rig"))
        if self.segment is not None:
            check_number("segment", self.segment, above=0)
        if self.band is not None and not 0 < self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from above 0: correct it")


def fit_corners(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    settings: CornerSettings | None = None,
    modes: Modes | None = None,
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to a drive on a road or track or a run on a rig.

    Parameters
    ----------
    recordings
        Of one condition, in SI units or as the vehicle's sensors say; with the speed channel for a road or track.
    vehicle
        Geometry, masses, nominal components (starting values and weak prior), sensors.
    settings
        Default: everything chosen from the vehicle.
    modes
        Identified in the same recordings: another start of the search (see `corners_from_modes`).

    Returns
    -------
    CornerFit

    Raises
    ------
    DataError
        Where no segment is long, fast and steady enough, or the speed is missing and the delay does not tell it.

    Notes
    -----
    Whittle likelihood of the segments' spectral matrices, averaged by speed class; see `sprung.likelihood.whittle`.
    The minimum is found by L-BFGS in coordinates in which the Fisher information at the start is the unit matrix.
    Segments count less where the model fits worse than chance allows (see `credibility`), so that the prior holds what
    an imperfect model would carry away. The covariance is that of the information, corrected for overlap, and by the
    scores of the segments (sandwich) where those scatter more than the model says.
    """
    settings = settings or CornerSettings()
    records = [recordings] if isinstance(recordings, Recording) else list(recordings)
    fitter = _Fitter(vehicle, settings, [usable(record, vehicle=vehicle) for record in records])
    segments = fitter.segments
    check = None if modes is None else fitter.from_modes(modes)
    starts = [] if check is None else [check]
    if fitter.has_speed:
        return replace(fitter.fit(segments, starts=starts), from_modes=check)
    known = with_estimated_speeds(segments, fitter.at_speeds)
    for _ in range(_ROUNDS - 1):
        fit = fitter.fit(known, starts=starts)
        known = with_estimated_speeds(segments, fitter.at_speeds, fit.parameters)
    fit = fitter.fit(known, starts=starts)
    low, high = known.speeds.min(), known.speeds.max()
    note = f"the speed was not recorded: {low:.3g} to {high:.3g} m/s, from the delay between the axles"
    return replace(fit, notes=(*fit.notes, note), from_modes=check)


class _Fitter:
    """What the fits of one set of recordings have in common."""

    def __init__(self, vehicle: Vehicle, settings: CornerSettings, records: Sequence[Recording]) -> None:
        self.vehicle, self.settings = vehicle, settings
        self.kind: Kind = settings.kind or vehicle.kind
        self.nominal = structure(vehicle)
        self.layout = rigid_layout(_seen(self.nominal, records[0].names))
        self.components = _free(self.nominal, vehicle, settings.free)
        speed = None if self.kind == "rig" else speed_channel(records[0], vehicle)
        self.has_speed = self.kind == "rig" or speed is not None
        band, length = _choices(vehicle, self.nominal, settings, records[0].sampling_rate)
        self.segments = segment_spectra(records, self.layout, speed=speed, band=band, segment_length=length)

    def fit(self, segments: SegmentSpectra, *, starts: Sequence[Real] = ()) -> CornerFit:
        """Return the fit to segments."""
        return fit_segments(segments, self.layout, self.vehicle, settings=self.settings, kind=self.kind, starts=starts)

    def at_speeds(self, speeds: Real) -> Model:
        """Return the model with a class of each speed and no data."""
        frequencies, length = self.segments.frequencies, self.segments.segment_length
        size = len(self.layout.rows)
        matrices = np.broadcast_to(np.eye(size, dtype=np.complex128), (speeds.size, frequencies.size, size, size))
        empty = ClassSpectra(
            frequencies=frequencies,
            counts=np.ones(speeds.size),
            speeds=speeds,
            spreads=np.full(speeds.size, 0.01),
            matrices=matrices,
            segment_length=length,
            weights=np.ones((speeds.size, frequencies.size)),
        )
        return vehicle_model(empty, self.layout, self.vehicle, self.settings, self.kind)

    def from_modes(self, modes: Modes) -> Real | None:
        """Return the components that the body's modes tell, or None where there are none."""
        body = [k for k, label in enumerate(modes.labels) if label in MOTIONS]
        if not body or not set(self.layout.names) <= set(modes.channels):
            return None
        taken = modes.take(np.array(body))
        return corners_from_modes(taken, self.nominal, self.layout, self.components, width=self.settings.width)


def fit_segments(
    segments: SegmentSpectra,
    layout: RigidLayout,
    vehicle: Vehicle,
    *,
    settings: CornerSettings,
    kind: Kind = "road",
    starts: Sequence[Real] = (),
) -> CornerFit:
    """Fit springs, dampers and tyres to the spectra of segments.

    Parameters
    ----------
    segments
        Of one condition.
    layout
        Whose coordinates they are in.
    vehicle, settings
        As for `fit_corners`.
    kind
        What drives the wheels.
    starts
        Values of the components, ln(value / nominal value), to start from beside the nominal ones; the best is taken.
    """

    def model_of(data: SegmentSpectra, lines: tuple[SpectralLine, ...], trust: float, width: float) -> Model:
        spectra = class_spectra(data, width=width)
        weights = trust * spectra.weights * without_lines(spectra, lines)
        return vehicle_model(replace(spectra, weights=weights), layout, vehicle, settings, kind)

    lines: tuple[SpectralLine, ...] = ()
    trust, limited = _FIRST, segments
    rough = model_of(limited, lines, trust, _COARSE)
    begin = min((rough.scaled_start(start) for start in (None, *starts)), key=lambda start: rough.objective(start)[0])
    factor = preconditioner(rough, rough.information(begin))
    found = minimised(rough, begin, factor)
    if credibility(model_of(limited, lines, 1.0, _COARSE), found) < _DOUBTFUL:
        others = (minimised(rough, rough.scaled_start(start), factor) for start in _broken_springs(rough))
        found = min((found, *others), key=lambda parameters: rough.objective(parameters)[0])
    model = model_of(limited, lines, trust, CLASS_WIDTH)
    parameters = _carried_over(rough, found, model)
    information = model.information(parameters) / trust
    lowest = 0.0 if kind == "rig" else _OVER_BODY * _highest_of_body(model.structure)
    for _ in range(_MOST_FITS):
        before = trust, lines
        limits = np.sqrt(_weights(model, parameters, segments))[:, None, None]
        limited = replace(segments, values=segments.values * limits)
        if settings.has_lines_masked:
            lines = residual_lines(model, parameters, lowest=lowest)
        trust = credibility(model_of(limited, lines, 1.0, CLASS_WIDTH), parameters)
        model = model_of(limited, lines, trust, CLASS_WIDTH)
        if lines == before[1] and abs(trust - before[0]) < _SETTLED * before[0]:
            break
        parameters = minimised(model, parameters, preconditioner(model, trust * information))
    return _result(model, parameters, limited, lines)


def _broken_springs(model: Model) -> list[Real]:
    """Return components, ln(value / nominal value), with one spring each far softer: where else a search may start."""
    springs = [row for row, component in enumerate(model.components) if component.name == "spring"]
    return [_BROKEN * np.eye(len(model.components))[row] for row in springs]


def _carried_over(coarse: Model, parameters: Real, model: Model) -> Real:
    """Return the parameters of a model with coarse speed classes as those of one with finer classes."""
    known = dict(zip(coarse.names, parameters, strict=True))
    found = np.array([0.0 if name.startswith("class_") else known[name] for name in model.names])
    levels = [row for row, name in enumerate(model.names) if name.startswith("class_")]
    if levels:
        ratio = np.einsum("cfij,cfji->c", np.linalg.inv(model.matrix(found)), model.spectra.matrices).real
        found[levels] = np.log(ratio / (model.spectra.frequencies.size * len(model.layout.rows)))
    return found


def _highest_of_body(nominal: Structure) -> float:
    """Return the highest natural frequency of bounce, pitch and roll [Hz]."""
    modes = nominal.modes()
    body = [f for f, label in zip(modes.natural_frequency, modes.labels, strict=True) if label in MOTIONS]
    return float(max(body, default=0.0))


def preconditioner(model: Model, information: Real) -> Real:
    """Return the factor that makes the information about the parameters, prior included, the unit matrix."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(information + np.diag(1 / model.widths**2))).T)


def minimised(model: Model, start: Real, factor: Real) -> Real:
    """Return the parameters at which the likelihood is largest, searched from `start` in whitened steps."""
    first, slope = model.objective(start)
    hill = float(np.sum((factor.T @ slope) ** 2)) / 2  # what a Newton step would gain

    def whitened(step: Real) -> tuple[float, Real]:
        value, gradient = model.objective(start + factor @ step)
        if value == TOO_FAR:  # a hill of the size of things: one without end would make the next step vanish
            return hill, np.zeros_like(step)
        return value - first, factor.T @ gradient  # so that the tolerance is relative to what is gained

    found = minimize(
        whitened,
        np.zeros(start.size),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 300, "maxcor": 20, "ftol": _TOLERANCE, "gtol": _SLOPE},
    )
    return np.asarray(start + factor @ found.x)


def _seen(nominal: Structure, names: tuple[str, ...]) -> Structure:
    """Return the structure with only those sensors that were recorded."""
    outputs = nominal.outputs
    rows = [row for row, name in enumerate(outputs.names) if name in names]
    kept = Outputs(
        tuple(outputs.channels[row] for row in rows),
        outputs.acceleration[rows],
        outputs.velocity[rows],
        outputs.displacement[rows],
    )
    return replace(nominal, outputs=kept)


def _choices(
    vehicle: Vehicle, nominal: Structure, settings: CornerSettings, sampling_rate: float
) -> tuple[tuple[float, float], float]:
    """Return band and segment length."""
    slowest = float(nominal.modes().natural_frequency[0])
    low = _BELOW * slowest
    high = min(_ABOVE * float(np.nanmax(wheel_hop_frequencies(vehicle))), _WIDEST * low, _HIGHEST * sampling_rate)
    return settings.band or (low, high), settings.segment or _PERIODS / slowest


def vehicle_model(
    spectra: ClassSpectra, layout: RigidLayout, vehicle: Vehicle, settings: CornerSettings, kind: Kind
) -> Model:
    """Return the model of a vehicle with the components, masses and sensors free that the settings name."""
    nominal = structure(vehicle)
    has_payload = kind != "rig" if settings.has_payload is None else settings.has_payload
    inputs: InputModel
    if kind == "rig":
        inputs = RigInputs(spectra, nominal.inputs)
    else:
        positions, sides = np.repeat([axle.x for axle in vehicle.axle], 2), np.tile([1.0, -1.0], len(vehicle.axle))
        inputs = (
            RoadInputs(spectra, positions, sides)
            if kind == "road"
            else RailInputs(spectra, positions, sides, contact_length=0.01)
        )
    return Model(
        nominal,
        layout,
        spectra,
        inputs,
        _free(nominal, vehicle, settings.free),
        masses=_payload(nominal) if has_payload else (),
        sensors=_sensors(nominal, layout) if settings.has_free_sensors else (),
        width=settings.width,
    )


def _free(nominal: Structure, vehicle: Vehicle, names: tuple[str, ...] | None) -> tuple[Component, ...]:
    """Return the free components of the corners."""
    corners = corner_names(len(vehicle.axle))
    every = tuple(
        Component(owner, name)
        for owner, owned in nominal.components().items()
        if owner in corners
        for name in owned
        if owned[name] > 0
    )
    if names is None:
        return every
    for name in names:
        if not any(name in {one.name, f"{one.owner}.{one.name}"} for one in every):
            known = ", ".join(f"{one.owner}.{one.name}" for one in every)
            raise ParameterError(f"free component {name!r} is none of spring, damper, tyre, {known}")
    return tuple(one for one in every if {one.name, f"{one.owner}.{one.name}"} & set(names))


def _sensors(nominal: Structure, layout: RigidLayout) -> tuple[SensorChange, ...]:
    """Return places of accelerometers on the body and lags of all channels, each with its width."""
    found = []
    shape = layout.motion.shape
    known = {channel.name: channel for channel in nominal.outputs.channels}
    for row, name in enumerate(layout.names):
        channel = known[name]
        found.append(SensorChange(f"{name}_lag", _LAG, channel=row))
        if layout.orders[row] < 2 or channel.position is None or channel.direction is None:
            continue
        for axis, motion, sign in (("x", "pitch", -1.0), ("y", "roll", 1.0)):
            change = np.zeros(shape)
            change[row, nominal.coordinates.index(motion)] = sign * channel.direction[2]
            found.append(SensorChange(f"{name}_{axis}", _PLACE, motion=change))
    return tuple(found)


def _payload(nominal: Structure) -> tuple[MassChange, ...]:
    """Return mass, moments and inertias of a payload on the body, each with a width of a fifth of the body's."""
    n = len(nominal.coordinates)
    names = MOTIONS
    rows = [nominal.coordinates.index(name) for name in names]
    sizes = np.sqrt(np.diag(nominal.mass)[rows])
    found = []
    for first, second, name in (
        (0, 0, "payload_mass"),
        (0, 1, "payload_x_moment"),
        (0, 2, "payload_y_moment"),
        (1, 1, "payload_pitch_inertia"),
        (2, 2, "payload_roll_inertia"),
    ):
        matrix = np.zeros((n, n))
        matrix[rows[first], rows[second]] = matrix[rows[second], rows[first]] = 1.0
        size = float(sizes[first] * sizes[second])
        found.append(MassChange(name, matrix * size, 0.2 if first == second else 0.1, unit=size))
    return tuple(found)


def _weights(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the weight of each segment: 1, or less where a pothole makes it far more powerful than the others."""
    squares = np.mean(np.abs(_whitened_segments(model, parameters, segments)) ** 2, axis=2)
    is_used = model.spectra.weights[speed_classes(segments.speeds)] > 0
    power = np.sum(squares * is_used, axis=1) / np.maximum(is_used.sum(axis=1), 1)
    return np.asarray(np.minimum(1.0, _MOST_POWER * np.median(power) / power))


def _whitened_segments(model: Model, parameters: Real, segments: SegmentSpectra) -> NDArray[np.complex128]:
    """Return L^-1 y of each segment, S = L L^H the model's spectral matrix of its class."""
    factor = np.linalg.inv(np.linalg.cholesky(model.matrix(parameters)))
    numbers = speed_classes(segments.speeds)
    return np.asarray(np.einsum("sfij,sfj->sfi", factor[numbers], segments.values))


def _scores(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the gradient of each segment's minus log likelihood, shape (segments, parameters)."""
    spectra = model.spectra
    whitened = (
        model.whitened_derivatives(parameters) * (np.sqrt(spectra.weights) / spectra.counts[:, None])[..., None, None]
    )
    values = _whitened_segments(model, parameters, segments)
    numbers = speed_classes(segments.speeds)
    scores = np.empty((values.shape[0], len(parameters)))
    for number in range(model.spectra.counts.size):
        members = np.flatnonzero(numbers == number)
        derivative = whitened[:, number]
        trace = np.einsum("pfii->p", derivative).real
        quadratic = np.einsum("sfi,pfij,sfj->sp", values[members].conj(), derivative, values[members], optimize=True)
        scores[members] = trace - quadratic.real
    return scores


def _covariance(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the covariance of the parameters: from the information, and from the scores where these scatter more."""
    information = model.information(parameters)
    bread = np.linalg.inv(information + np.diag(1 / model.widths**2))
    expected = bread @ (OVERCOUNT * information + np.diag(1 / model.widths**2)) @ bread
    scores = _scores(model, parameters, segments)
    scores = scores - scores.mean(axis=0)
    meat = scores.T @ scores
    neighbours = scores[1:].T @ scores[:-1] / 2
    observed = bread @ (meat + neighbours + neighbours.T) @ bread
    n, p = scores.shape
    share = n / (n + 2.0 * p)
    scale = np.sqrt(np.maximum(1.0, share * np.diag(observed) / np.diag(expected) + (1 - share)))
    return np.asarray(expected * np.outer(scale, scale))


def _result(
    model: Model, parameters: Real, segments: SegmentSpectra, lines: tuple[SpectralLine, ...] = ()
) -> CornerFit:
    """Return the fit with what is to be said about it."""
    covariance = _covariance(model, parameters, segments)
    misfit, excess = _misfit(model, parameters)
    imperfection = float(np.sqrt(max(0.0, excess)))
    fit = CornerFit(
        model, parameters, covariance, misfit, imperfection, model.spectra.n_segments, segments.n_rejected, notes=()
    )
    return replace(fit, notes=_notes(fit, lines))


def _misfit(model: Model, parameters: Real) -> tuple[Real, float]:
    """Return measured over fitted power less 1, (coordinates, frequencies), and its mean square beyond chance."""
    fitted = np.einsum("cfii->cif", model.matrix(parameters)).real
    measured = np.einsum("cfii->cif", model.spectra.matrices).real
    counts = (model.spectra.counts[:, None] * (model.spectra.weights > 0))[:, None, :]
    total = counts.sum(axis=0)
    misfit = np.sum(counts * (measured / fitted - 1), axis=0) / np.maximum(total, 1.0)
    return misfit, float(np.mean(misfit[:, total[0] > 0] ** 2) - np.mean(_CHANCE / total[total > 0]))


def credibility(model: Model, parameters: Real) -> float:
    """Return by how much the segments count less where the model fits worse than chance allows: 0 to 1.

    Notes
    -----
    With a relative error of the model's spectra of variance d^2, the mean of n segments is no more certain than
    1 / n + d^2; an error that reaches over L neighbouring frequencies counts L times. So 1 / (1 + n d^2 L): with
    segments that count less the prior holds what an imperfect model would carry away.
    """
    misfit, excess = _misfit(model, parameters)
    if excess <= 0:
        return 1.0
    is_used = model.spectra.weights.sum(axis=0) > 0
    rows = misfit[:, is_used]
    reach = 1.0
    for lag in range(1, rows.shape[1] // 2):
        likeness = float(np.sum(rows[:, lag:] * rows[:, :-lag]) / np.sum(rows**2))
        if likeness < _UNLIKE:
            break
        reach += 2 * likeness
    return 1 / (1 + model.spectra.n_segments / OVERCOUNT * excess * reach)


def _notes(fit: CornerFit, lines: tuple[SpectralLine, ...]) -> tuple[str, ...]:
    """Say what cannot be told and how well the model fits."""
    notes = []
    untold = [f"{c.owner}.{c.name}" for c, told in zip(fit.components, fit.is_told, strict=True) if not told]
    if untold:
        notes.append(
            f"this run and these sensors cannot tell {', '.join(untold)}: they stay near the vehicle file's values"
        )
    if fit.imperfection > _IMPERFECT:
        notes.append(
            f"the fitted spectra are off by {100 * fit.imperfection:.0f} % beyond chance: something moves that the "
            "vehicle file does not have; trust contrasts between corners and against a baseline more than the values"
        )
    if lines:
        places = ", ".join(
            f"{line.place:.3g} {'per m' if line.follows_speed else 'Hz'}" for line in lines[:_MOST_NAMED]
        )
        more = f" and {len(lines) - _MOST_NAMED} more" if len(lines) > _MOST_NAMED else ""
        notes.append(f"left out for lines of wheels, engine or mains: {places}{more}")
    if fit.n_rejected:
        notes.append(
            f"{fit.n_rejected} of {fit.n_rejected + fit.n_segments} segments were too slow or of changing speed"
        )
    return tuple(notes)
