"""Fit of springs, dampers and tyres of every corner to the spectra of a drive."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sprung._checks import check_number
from sprung.errors import DataError, ParameterError
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.inputs import IndependentInputs, InputModel, RoadInputs
from sprung.likelihood.layout import RigidLayout, rigid_layout
from sprung.likelihood.spectra import ClassSpectra, SegmentSpectra, class_spectra, segment_spectra, speed_classes
from sprung.likelihood.whittle import Component, MassChange, Model
from sprung.preparation import speed_channel, usable
from sprung.recording import Recording
from sprung.vehicles import Outputs, Structure, Vehicle, corner_names, structure, wheel_hop_frequencies

Real = NDArray[np.float64]

#: Half-overlapping Hann windows count every sample about twice: variance over that of independent segments and
#: frequencies, the sum of the squared coherences of all overlapping pairs (19 / 9).
OVERCOUNT = 19 / 9
#: Band over the lowest and highest natural frequency of the nominal vehicle, and its upper end over its lower.
_BELOW, _ABOVE, _WIDEST = 0.4, 1.7, 33.0
#: Highest frequency over the sampling rate.
_HIGHEST = 0.4
#: Periods of the nominal vehicle's slowest mode in a segment.
_PERIODS = 7.5
#: A segment counts at most this many times the median power.
_MOST_POWER = 3.0
#: Relative misfit of the spectra from which on a fit is called imperfect.
_IMPERFECT = 0.1


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
    has_payload
        Fit mass, inertias and centre of gravity of the body too.
    is_rig
        Independent inputs at the wheels instead of a road; None: as the vehicle's kind says.
    """

    band: tuple[float, float] | None = None
    segment: float | None = None
    width: float = 0.7
    has_payload: bool = False
    is_rig: bool | None = None

    def __post_init__(self) -> None:
        check_number("width", self.width, above=0)
        if self.segment is not None:
            check_number("segment", self.segment, above=0)
        if self.band is not None and not 0 < self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from above 0: correct it")


def fit_corners(
    recordings: Recording | Iterable[Recording], vehicle: Vehicle, *, settings: CornerSettings | None = None
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to a drive on a road or a run on a rig.

    Parameters
    ----------
    recordings
        Of one condition, in SI units or as the vehicle's sensors say; with the speed channel for a road.
    vehicle
        Geometry, masses, nominal components (starting values and weak prior), sensors.
    settings
        Default: everything chosen from the vehicle.

    Returns
    -------
    CornerFit

    Raises
    ------
    DataError
        Where the speed is missing, or no segment is long, fast and steady enough.

    Notes
    -----
    Whittle likelihood of the segments' spectral matrices, averaged by speed class; see `sprung.likelihood.whittle`.
    The minimum is found by L-BFGS in coordinates in which the Fisher information at the start is the unit matrix.
    The covariance is that of the information, corrected for overlap, and by the scores of the segments (sandwich)
    where those scatter more than the model says.
    """
    settings = settings or CornerSettings()
    records = [recordings] if isinstance(recordings, Recording) else list(recordings)
    is_rig = vehicle.kind != "road" if settings.is_rig is None else settings.is_rig
    ready = [usable(record, vehicle=vehicle) for record in records]
    speed = None if is_rig else _speed(ready, vehicle)
    nominal = structure(vehicle)
    layout = rigid_layout(_seen(nominal, ready[0].names))
    band, segment = _choices(vehicle, nominal, settings, ready[0].sampling_rate)
    segments = segment_spectra(ready, layout, speed=speed, band=band, segment_length=segment)
    return fit_segments(segments, layout, vehicle, settings=settings, is_rig=is_rig)


def fit_segments(
    segments: SegmentSpectra,
    layout: RigidLayout,
    vehicle: Vehicle,
    *,
    settings: CornerSettings,
    is_rig: bool = False,
    start: Real | None = None,
) -> CornerFit:
    """Fit springs, dampers and tyres to the spectra of segments; parameters as for `fit_corners`."""
    model = _model(class_spectra(segments), layout, vehicle, settings, is_rig)
    begin = model.scaled_start() if start is None else start
    factor = preconditioner(model, begin)
    parameters = minimised(model, begin, factor)
    weights = _weights(model, parameters, segments)
    if np.all(weights == 1):
        return _result(model, parameters, segments)
    limited = replace(segments, values=segments.values * np.sqrt(weights)[:, None, None])
    model = _model(class_spectra(limited), layout, vehicle, settings, is_rig)
    return _result(model, minimised(model, parameters, factor), limited)


def preconditioner(model: Model, parameters: Real) -> Real:
    """Return the factor that makes the information about the parameters, prior included, the unit matrix."""
    information = model.information(parameters) + np.diag(1 / model.widths**2)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(information)).T)


def minimised(model: Model, start: Real, factor: Real) -> Real:
    """Return the parameters at which the likelihood is largest, searched from `start` in whitened steps."""

    def whitened(step: Real) -> tuple[float, Real]:
        value, gradient = model.objective(start + factor @ step)
        return value, factor.T @ gradient

    found = minimize(
        whitened,
        np.zeros(start.size),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": 300, "maxcor": 20, "ftol": 1e-10},
    )
    return np.asarray(start + factor @ found.x)


def _speed(records: list[Recording], vehicle: Vehicle) -> str:
    """Return the name of the speed channel, or say what to do without one."""
    name = speed_channel(records[0], vehicle)
    if name is None:
        raise DataError(
            f"the recording has no speed channel {vehicle.speed_channel!r}: add one [m/s], or name it as speed_channel "
            "in the vehicle file"
        )
    return name


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


def _model(
    spectra: ClassSpectra, layout: RigidLayout, vehicle: Vehicle, settings: CornerSettings, is_rig: bool
) -> Model:
    """Return the model of the vehicle with its corners free."""
    nominal = structure(vehicle)
    corners = corner_names(len(vehicle.axle))
    free = tuple(
        Component(owner, name)
        for owner, owned in nominal.components().items()
        if owner in corners
        for name in owned
        if owned[name] > 0
    )
    inputs: InputModel
    if is_rig:
        inputs = IndependentInputs(spectra, nominal.inputs)
    else:
        positions = np.repeat([axle.x for axle in vehicle.axle], 2)
        inputs = RoadInputs(spectra, positions, np.tile([1.0, -1.0], len(vehicle.axle)))
    masses = _payload(nominal) if settings.has_payload else ()
    return Model(nominal, layout, spectra, inputs, free, masses=masses, width=settings.width)


def _payload(nominal: Structure) -> tuple[MassChange, ...]:
    """Return mass, moments and inertias of a payload on the body, each with a width of a fifth of the body's."""
    n = len(nominal.coordinates)
    names = ("bounce", "pitch", "roll")
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
        found.append(MassChange(name, matrix * sizes[first] * sizes[second], 0.2 if first == second else 0.1))
    return tuple(found)


def _weights(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the weight of each segment: 1, or less where a pothole makes it far more powerful than the others."""
    power = np.mean(np.abs(_whitened_segments(model, parameters, segments)) ** 2, axis=(1, 2))
    return np.asarray(np.minimum(1.0, _MOST_POWER * np.median(power) / power))


def _whitened_segments(model: Model, parameters: Real, segments: SegmentSpectra) -> NDArray[np.complex128]:
    """Return L^-1 y of each segment, S = L L^H the model's spectral matrix of its class."""
    factor = np.linalg.inv(np.linalg.cholesky(model.matrix(parameters)))
    numbers = speed_classes(segments.speeds)
    return np.asarray(np.einsum("sfij,sfj->sfi", factor[numbers], segments.values))


def _scores(model: Model, parameters: Real, segments: SegmentSpectra) -> Real:
    """Return the gradient of each segment's minus log likelihood, shape (segments, parameters)."""
    counts = np.sqrt(model.spectra.counts)[:, None, None, None]
    whitened = model.whitened_derivatives(parameters) / counts
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


def _result(model: Model, parameters: Real, segments: SegmentSpectra) -> CornerFit:
    """Return the fit with what is to be said about it."""
    fitted = np.einsum("cfii->cif", model.matrix(parameters)).real
    measured = np.einsum("cfii->cif", model.spectra.matrices).real
    share = model.spectra.counts[:, None, None] / model.spectra.counts.sum()
    misfit = np.sum(share * (measured / fitted - 1), axis=0)
    chance = 1.06 / model.spectra.counts.sum()
    imperfection = float(np.sqrt(max(0.0, np.mean(misfit**2) - chance)))
    covariance = _covariance(model, parameters, segments)
    fit = CornerFit(
        model, parameters, covariance, misfit, imperfection, model.spectra.n_segments, segments.n_rejected, notes=()
    )
    return replace(fit, notes=_notes(fit))


def _notes(fit: CornerFit) -> tuple[str, ...]:
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
    if fit.n_rejected:
        notes.append(
            f"{fit.n_rejected} of {fit.n_rejected + fit.n_segments} segments were too slow or of changing speed"
        )
    return tuple(notes)
