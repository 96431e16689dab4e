"""Fit of springs, dampers and tyres of every corner to the spectra of a drive."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from sprung._arrays import Real
from sprung.errors import DataError
from sprung.likelihood.components import free_components
from sprung.likelihood.coordinates import RigidLayout, rigid_layout
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.from_modes import corners_from_modes
from sprung.likelihood.masked_lines import SpectralLine, residual_lines, without_lines
from sprung.likelihood.missing_speed import with_estimated_speeds
from sprung.likelihood.spectra import (
    CLASS_WIDTH,
    ClassSpectra,
    SegmentSpectra,
    class_spectra,
    segment_spectra,
)
from sprung.likelihood.uncertainty import parameter_covariance, power_misfit, segment_weights, tempering
from sprung.likelihood.vehicle import (
    CornerSettings,
    Kind,
    highest_of_body,
    usual_choices,
    vehicle_model,
    with_sensors,
)
from sprung.likelihood.whittle import TOO_FAR, Model
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.vehicles import Vehicle, structure
from sprung.vehicles.labels import MOTIONS
from sprung.vehicles.usable import speed_channel, usable

#: On a road or track lines are looked for from this many times the highest mode of the body on: what does not fit
#: below it may be the body's own motion.
_OVER_BODY = 1.5
#: Fits and estimates of the speed in turn, where it is missing.
_ROUNDS = 3
#: The search ends with a step that gains less than this share of all that was gained, or where the slope is less than
#: this in standard deviations.
_TOLERANCE, _SLOPE = 1e-8, 1e-2
#: Most steps before the coordinates of the search are chosen anew: the information changes on the way.
_STEPS = (25, 25, 50, 300)
#: Lines that a note names.
_MOST_NAMED = 6
#: Relative misfit of the spectra from which on a fit is called imperfect.
_IMPERFECT = 0.1
#: Credibility of the first fit below which it may be a local minimum, and ln of a broken spring to start again from.
_DOUBTFUL, _BROKEN = 0.3, -1.2
#: A class' level over the common one, or under it, at most.
_LEAST_LEVEL = 1e-3
#: Width of the speed classes of the first fit.
_COARSE = 0.1
#: Credibility of the segments in the first fit; fits after it, each with the lines and the credibility that the last
#: one shows; and relative change of the credibility below which there are no more.
_FIRST, _MOST_FITS, _SETTLED = 0.1, 4, 0.1


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
    The minimum is found by L-BFGS in coordinates in which the Fisher information is the unit matrix, chosen anew on the
    way.
    Segments count less where the model fits worse than chance allows (see `tempering`), so that the prior holds what
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


def nominal_misfit(recording: Recording, vehicle: Vehicle, *, settings: CornerSettings | None = None) -> float:
    """Return minus the log likelihood of the vehicle as its file says, on a road as rough as the recording shows.

    Nothing is fitted: two layouts of the same sensors can be compared at the cost of one step of a fit.

    Parameters
    ----------
    recording, vehicle, settings
        As for `fit_corners`.

    Raises
    ------
    DataError
        As from `fit_corners`.
    """
    fitter = _Fitter(vehicle, settings or CornerSettings(), [usable(recording, vehicle=vehicle)])
    segments = fitter.segments
    if not fitter.has_speed:
        segments = with_estimated_speeds(segments, fitter.at_speeds)
    spectra = class_spectra(segments, width=_COARSE)
    model = vehicle_model(spectra, fitter.layout, vehicle, fitter.nominal, settings=fitter.settings, kind=fitter.kind)
    return model.objective(model.scaled_start())[0]


class _Fitter:
    """What the fits of one set of recordings have in common."""

    def __init__(self, vehicle: Vehicle, settings: CornerSettings, records: Sequence[Recording]) -> None:
        self.vehicle, self.settings = vehicle, settings
        self.kind: Kind = settings.kind or vehicle.kind
        self.nominal = structure(vehicle)
        self.layout = rigid_layout(with_sensors(self.nominal, records[0].names))
        self.components = free_components(self.nominal, vehicle, settings.free)
        speed = None if self.kind == "rig" else speed_channel(records[0], vehicle)
        self.has_speed = self.kind == "rig" or speed is not None
        band, length = usual_choices(vehicle, self.nominal, settings, records[0].sampling_rate)
        self.segments = segment_spectra(records, self.layout, speed=speed, band=band, segment_length=length)

    def fit(self, segments: SegmentSpectra, *, starts: Sequence[Real] = ()) -> CornerFit:
        """Return the fit to segments."""
        try:
            return fit_segments(
                segments, self.layout, self.vehicle, settings=self.settings, kind=self.kind, starts=starts
            )
        except np.linalg.LinAlgError:
            raise DataError(
                "no vehicle like the file's moves as this recording does: check signs, places and units of the sensors"
            ) from None

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
        return vehicle_model(empty, self.layout, self.vehicle, self.nominal, settings=self.settings, kind=self.kind)

    def from_modes(self, modes: Modes) -> Real | None:
        """Return the components that the body's modes tell, or None where there are none."""
        body = [k for k, label in enumerate(modes.labels) if label in MOTIONS]
        if not body or not set(self.layout.names) <= set(modes.channels):
            return None
        taken = modes.take(np.array(body))
        return corners_from_modes(taken, self.nominal, self.layout, self.components, prior_std=self.settings.prior_std)


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

    nominal = structure(vehicle)

    def model_of(data: SegmentSpectra, lines: tuple[SpectralLine, ...], trust: float, width: float) -> Model:
        spectra = class_spectra(data, width=width)
        weights = trust * spectra.weights * without_lines(spectra, lines)
        return vehicle_model(replace(spectra, weights=weights), layout, vehicle, nominal, settings=settings, kind=kind)

    lines: tuple[SpectralLine, ...] = ()
    trust, limited = _FIRST, segments
    rough = model_of(limited, lines, trust, _COARSE)
    begin = min((rough.scaled_start(start) for start in (None, *starts)), key=lambda start: rough.objective(start)[0])
    found = minimised(rough, begin)
    if tempering(model_of(limited, lines, 1.0, _COARSE), found) < _DOUBTFUL:
        others = (minimised(rough, rough.scaled_start(start)) for start in _broken_springs(rough))
        found = min((found, *others), key=lambda parameters: rough.objective(parameters)[0])
    model = model_of(limited, lines, trust, CLASS_WIDTH)
    parameters = _carried_over(rough, found, model)
    if model.objective(parameters)[0] == TOO_FAR:
        parameters = model.scaled_start()
    lowest = 0.0 if kind == "rig" else _OVER_BODY * highest_of_body(model.structure)
    for _ in range(_MOST_FITS):
        before = trust, lines
        limits = np.sqrt(segment_weights(model, parameters, segments))[:, None, None]
        limited = replace(segments, values=segments.values * limits)
        if settings.has_lines_masked:
            lines = residual_lines(model, parameters, lowest=lowest)
        trust = tempering(model_of(limited, lines, 1.0, CLASS_WIDTH), parameters)
        model = model_of(limited, lines, trust, CLASS_WIDTH)
        if lines == before[1] and abs(trust - before[0]) < _SETTLED * before[0]:
            break
        parameters = minimised(model, parameters)
    return _result(model, parameters, limited, lines)


def _broken_springs(model: Model) -> list[Real]:
    """Return components, ln(value / nominal value), with one spring each far softer: where else a search may start."""
    springs = [row for row, component in enumerate(model.components) if component.kind == "spring"]
    return [_BROKEN * np.eye(len(model.components))[row] for row in springs]


def _carried_over(coarse: Model, parameters: Real, model: Model) -> Real:
    """Return the parameters of a model with coarse speed classes as those of one with finer classes."""
    known = dict(zip(coarse.names, parameters, strict=True))
    found = np.array([known.get(name, 0.0) for name in model.names])
    levels = model.rows("class_roughness")
    found[levels] = 0.0
    if levels.size:
        ratio = np.einsum("cfij,cfji->c", np.linalg.inv(model.matrix(found)), model.spectra.matrices).real
        mean = ratio / (model.spectra.frequencies.size * len(model.layout.rows))
        found[levels] = np.log(np.clip(np.nan_to_num(mean, nan=1.0), _LEAST_LEVEL, 1 / _LEAST_LEVEL))
    return found


def minimised(model: Model, start: Real) -> Real:
    """Return the parameters at which the likelihood is largest, searched from `start`."""
    found, is_settled = start, False
    for most in _STEPS:
        if not is_settled:
            found, is_settled = _searched(model, found, most)
    return found


def _searched(model: Model, start: Real, most: int) -> tuple[Real, bool]:
    """Return where so many steps lead, whitened by the information at the start, and whether the search ended there."""
    factor = preconditioner(model, start)
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
        options={"maxiter": most, "maxcor": 20, "ftol": _TOLERANCE, "gtol": _SLOPE},
    )
    return np.asarray(start + factor @ found.x), found.status == 0


def preconditioner(model: Model, parameters: Real) -> Real:
    """Return the factor that makes the information about the parameters, prior included, the unit matrix."""
    information = model.information(parameters) + np.diag(1 / model.prior_std**2)
    return np.linalg.inv(np.linalg.cholesky(information)).T


def _result(
    model: Model, parameters: Real, segments: SegmentSpectra, lines: tuple[SpectralLine, ...] = ()
) -> CornerFit:
    """Return the fit with what is to be said about it."""
    covariance = parameter_covariance(model, parameters, segments)
    misfit, excess = power_misfit(model, parameters)
    model_error = float(np.sqrt(max(0.0, excess)))
    fit = CornerFit(
        model, parameters, covariance, misfit, model_error, model.spectra.n_segments, segments.n_rejected, notes=()
    )
    return replace(fit, notes=_notes(fit, lines))


def _notes(fit: CornerFit, lines: tuple[SpectralLine, ...]) -> tuple[str, ...]:
    """Say what cannot be told and how well the model fits."""
    notes = []
    untold = [str(component) for component, told in zip(fit.components, fit.is_identifiable, strict=True) if not told]
    if untold:
        notes.append(
            f"this run and these sensors cannot tell {', '.join(untold)}: they stay near the vehicle file's values"
        )
    if fit.model_error > _IMPERFECT:
        notes.append(
            f"the fitted spectra are off by {100 * fit.model_error:.0f} % beyond chance: something moves that the "
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
