"""Fit of springs, dampers and tyres of every corner to the spectra of a drive."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_type, settings_of
from sprung._threads import one_thread
from sprung.errors import DataError
from sprung.likelihood.components import free_components
from sprung.likelihood.coordinates import RigidLayout, rigid_layout
from sprung.likelihood.corners import CornerFit, corners_from_modes
from sprung.likelihood.joints import repetitions
from sprung.likelihood.masked_lines import SpectralLine, lines_of_turns, residual_lines, with_lines, without_lines
from sprung.likelihood.rig import RigInputs
from sprung.likelihood.search import TOO_FAR, DescentSettings, minimised
from sprung.likelihood.spectra import (
    CLASS_WIDTH,
    ClassSpectra,
    SegmentSpectra,
    class_spectra,
    delayed_speeds,
    segment_spectra,
    segment_speeds,
    steady_segments,
)
from sprung.likelihood.speed_delay import DELAYS, FINE, SpeedDelay, speed_delay, speed_grid, with_estimated_speeds
from sprung.likelihood.surface import RailInputs
from sprung.likelihood.suspension_forces import DrivenSegments, beyond
from sprung.likelihood.uncertainty import parameter_covariance, power_misfit, segment_weights, tempering
from sprung.likelihood.vehicle import (
    CornerSettings,
    Expected,
    Kind,
    default_choices,
    lowest_of_lines,
    vehicle_model,
    with_sensors,
)
from sprung.likelihood.whittle import Model, minus_log_likelihood
from sprung.modal import Modes
from sprung.recording import Recording, each_recording
from sprung.vehicles import Structure, Vehicle, structure
from sprung.vehicles.labels import MOTIONS
from sprung.vehicles.sensor_checks import refuse_wrong_sensors
from sprung.vehicles.structure import SPRINGS
from sprung.vehicles.window import Window, window_of


@dataclass(frozen=True, slots=True)
class FitRules:
    """Order and ends of the fits to a drive, and what their notes state."""

    #: Width of the speed classes of the first fit.
    coarse: float = 0.1
    #: Tempering of the first fit.
    first: float = 0.1
    #: Tempering below which the first fit may be a local minimum.
    doubtful: float = 0.3
    #: The same by the error of the model over that of other windows of the vehicle, where it is known.
    worse: float = 1.5
    #: ln of the broken spring with which the search then starts again.
    broken: float = -1.2
    #: Largest number of fits after the first one, each with the lines and the tempering of the one before.
    max_fits: int = 4
    #: Relative change of the tempering at which they end.
    settled: float = 0.1
    #: Smallest roughness of a class over the common one at the start; its inverse is the largest.
    min_level: float = 1e-3
    #: Ends of the first search and of later ones of a window whose vehicle is known, and which therefore begins near
    #: its end: no part is left farther from it than a twentieth of a standard deviation.
    first_of_known: DescentSettings = field(
        default_factory=lambda: DescentSettings(slope=0.2, gain=1e-4, has_last_step=True)
    )
    of_known: DescentSettings = field(default_factory=lambda: DescentSettings(slope=0.15, has_last_step=True))
    #: Those of a search from a broken spring, whose result is compared and at most the start of the full fits.
    from_broken: DescentSettings = field(default_factory=lambda: DescentSettings(slope=0.1, gain=1e-4))
    #: Number of offsets of the joints of one rail from those of the other that are compared.
    offsets: int = 64
    #: Steps by which the distance of joints, relative to it, and this offset are then refined.
    finer: tuple[float, ...] = (0.004, 0.002, 0.001, 0.0005)
    #: Number of alternating fits and estimates of the speed, if it is missing; one more on a track, for its joints.
    rounds: int = 3
    #: Relative misfit of the spectra above which a note states an error of the model.
    imperfect: float = 0.1
    #: Median density of the channels' noise, over the usual variance of the layout [1/Hz], below which they have none.
    noiseless: float = 1e-5
    #: Largest number of lines that a note names.
    max_named: int = 6


RULES = FitRules()


@dataclass(frozen=True, eq=False, slots=True)
class FitSetup:
    """What all fits of a vehicle to its recordings have in common.

    Parameters
    ----------
    vehicle
        Vehicle as its file describes it: geometry, masses, nominal components.
    nominal
        Nominal structure of the vehicle.
    layout
        Coordinates of the motion that the recorded sensors observe.
    settings
        Choices of the fit.
    kind
        Excitation of the wheels: "road", "rail" or "rig".
    joint_pitch
        Distance between the joints of a track [m]; None: none were found.
    joint_offset
        Distance over the pitch by which those of the right rail are ahead of the left one's.
    """

    vehicle: Vehicle
    nominal: Structure
    layout: RigidLayout
    settings: CornerSettings
    kind: Kind
    joint_pitch: float | None = None
    joint_offset: float = 0.0

    def model(self, spectra: ClassSpectra) -> Model:
        """Return the model of the vehicle with the spectra that it is to explain."""
        return vehicle_model(
            spectra,
            self.layout,
            self.vehicle,
            self.nominal,
            settings=self.settings,
            kind=self.kind,
            joint_pitch=self.joint_pitch,
            joint_offset=self.joint_offset,
        )

    def at_classes(self, segments: SegmentSpectra, *, width: float) -> Model:
        """Return the model with segments averaged in speed classes of a relative width."""
        return self.model(class_spectra(segments, width=width))

    def at_speeds(self, segments: SegmentSpectra, speeds: Real) -> Model:
        """Return the model at the frequencies of segments with a class of each speed [m/s] and no data."""
        frequencies, size = segments.frequencies, len(self.layout.rows)
        empty = ClassSpectra(
            frequencies=frequencies,
            counts=np.ones(speeds.size),
            speeds=speeds,
            spreads=np.full(speeds.size, (speeds[1] / speeds[0] - 1) / 2),
            matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (speeds.size, frequencies.size, size, size)),
            segment_length=segments.segment_length,
            weights=np.ones((speeds.size, frequencies.size)),
        )
        return self.model(empty)

    def components_of(self, modes: Modes) -> Real | None:
        """Return ln(value / nominal value) of the components that identified body modes imply; None without any."""
        body = [k for k, label in enumerate(modes.labels) if label in MOTIONS]
        if not body or not set(self.layout.names) <= set(modes.channels):
            return None
        components = free_components(self.nominal, self.vehicle, self.settings.free, kind=self.kind)
        return corners_from_modes(
            modes.take(np.array(body)), self.nominal, self.layout, components, prior_std=self.settings.prior_std
        )


def fit_corners(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    settings: CornerSettings | None = None,
    modes: Modes | None = None,
    allow_missing: bool = False,
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to a drive on a road or track or a run on a rig.

    Parameters
    ----------
    recordings
        Recordings of one condition, in SI units or in those of the vehicle's sensors; with the speed channel for a road
        or track.
    vehicle
        Geometry, masses, nominal components (starting values and weak prior), sensors.
    settings
        Choices of the fit; None: all from the vehicle.
    modes
        Modes identified in the same recordings, as a check, and another start of the search where the first fit is
        doubtful (see `corners_from_modes`).
    allow_missing
        Whether the recordings may lack sensors of the vehicle file; a note then says which.

    Returns
    -------
    CornerFit

    Raises
    ------
    DataError
        If no segment is long, fast and steady enough, the speed is missing and cannot be estimated from the delay
        between the axles, or the recordings are not consistent with the vehicle file: a sensor is inverted, or two are
        swapped.
    ParameterError
        If the recordings lack a sensor of the vehicle file, or have one with another quantity.

    Notes
    -----
    Whittle likelihood of the segments' spectral matrices, averaged by speed class; see `sprung.likelihood.whittle` and,
    for the order of the fits, `fit_segments`. The covariance is that of the information, corrected for overlap, and by
    the scores of the segments (sandwich) where those scatter more than the model predicts.

    References
    ----------
    P. Whittle, The analysis of multiple stationary time series, Journal of the Royal Statistical Society B 15 (1953)
    125-139.
    H. White, Maximum likelihood estimation of misspecified models, Econometrica 50 (1982) 1-25.

    Examples
    --------
    A minute of a simulated drive with a spring that has lost 30 % of its stiffness:

    >>> import numpy as np
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import parse_fault, read_vehicle
    >>> vehicle, soft = read_vehicle("zafira"), parse_fault("front_left.spring=-0.3")
    >>> settings = RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0, faults=(soft,))
    >>> fit = fit_corners(simulate_drive(vehicle, settings, seed=2).recording, vehicle)
    >>> str(fit.components[0]), round(float(np.expm1(fit.log_ratios[0])), 1), round(float(fit.log_ratios_std[0]), 1)
    ('front_left.spring', -0.3, 0.1)
    """
    check_type("vehicle", vehicle, Vehicle)
    records = each_recording(recordings)
    windows = [window_of(record, vehicle, allow_missing=allow_missing) for record in records]
    notes = refuse_wrong_sensors(windows)
    fit = fit_windows(windows, settings=settings, modes=modes)
    return replace(fit, notes=(*notes, *fit.notes))


@one_thread
def fit_windows(
    windows: Sequence[Window],
    *,
    settings: CornerSettings | None = None,
    modes: Modes | Callable[[], Modes | None] | None = None,
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to windows of one vehicle.

    Parameters
    ----------
    windows
        Windows of one condition and one vehicle, at least one, with the same channels.
    settings
        As for `fit_corners`.
    modes
        As for `fit_corners`, or a function that identifies them where the first fit is doubtful.

    Raises
    ------
    DataError, ParameterError
        As raised by `fit_corners`.

    References
    ----------
    As for `fit_corners`.
    """
    setup, segments, has_speed, delay = _prepare(windows, settings_of(CornerSettings, settings))
    checks: list[Real | None] = []

    @cache
    def starts() -> Sequence[Real]:
        found = modes() if callable(modes) else modes
        checks.append(None if found is None else setup.components_of(found))
        return [check for check in checks if check is not None]

    if not callable(modes):
        starts()
    layout = dict.fromkeys(note for window in windows for note in window.notes)
    if has_speed:
        fit = _fit(segments, setup, starts)
        late: tuple[str, ...] = ()
        if delay is not None and delay.value:
            direction = "late" if delay.value > 0 else "early"
            late = (
                f"the speed channel is {abs(delay.value):.1f} s {direction} (± {delay.std:.1f} s), which is corrected",
            )
        return replace(fit, from_modes=next(iter(checks), None), speed_delay=delay, notes=(*layout, *fit.notes, *late))
    parameters = None
    speeds = speed_grid()
    for _ in range(RULES.rounds + (setup.kind == "rail")):
        at_speeds, is_tentative = partial(setup.at_speeds, segments), parameters is None
        known = with_estimated_speeds(segments, at_speeds, parameters, speeds=speeds, is_tentative=is_tentative)
        setup = replace(setup, nominal=structure(setup.vehicle, speed=float(known.speeds.mean())))
        fit = _fit(known, replace(setup, joint_pitch=None, joint_offset=0.0), starts)
        parameters = fit.parameters
        for track in fit.model.blocks:
            if isinstance(track, RailInputs):
                setup = replace(setup, joint_pitch=track.pitch, joint_offset=track.offset)
                speeds = speed_grid((known.speeds.min(), known.speeds.max()), step=FINE)
    low, high = known.speeds.min(), known.speeds.max()
    note = f"the speed was not recorded: {low:.3g} to {high:.3g} m/s, from the delay between the axles"
    return replace(fit, notes=(*layout, *fit.notes, note), from_modes=next(iter(checks), None))


def _prepare(
    windows: Sequence[Window], settings: CornerSettings
) -> tuple[FitSetup, SegmentSpectra, bool, SpeedDelay | None]:
    """Return the set-up of all fits, the segments, whether their speeds are known or not needed, and the delay."""
    first = windows[0]
    kind: Kind = settings.kind or first.vehicle.kind
    layout = rigid_layout(with_sensors(first.structure, first.outputs))
    records = [window.motion_of(layout.names) for window in windows]
    speed = None if kind == "rig" else first.speed
    band, length = default_choices(first.vehicle, first.structure, settings, records[0].sampling_rate)
    segments = segment_spectra(records, layout, speed=None, band=band, segment_length=length)
    setup = FitSetup(first.vehicle, first.structure, layout, settings, kind)
    if speed is None:
        return setup, segments, kind == "rig", None
    means, variations = delayed_speeds(records, speed, length, DELAYS)
    delay = speed_delay(segments, means, variations, lambda speeds: setup.at_speeds(segments, speeds))
    speeds, spreads = segment_speeds(records, speed, length, delay=delay.value)
    return setup, steady_segments(segments, speeds, spreads), True, delay


def _fit(segments: SegmentSpectra, setup: FitSetup, starts: Callable[[], Sequence[Real]]) -> CornerFit:
    """Return the fit to segments; singular matrices in the search mean a recording of another vehicle."""
    try:
        return fit_segments(segments, setup, starts=starts)
    except np.linalg.LinAlgError:
        raise DataError(
            "this recording is not consistent with the vehicle file: check signs, places and units of the sensors"
        ) from None


def fit_segments(
    segments: SegmentSpectra, setup: FitSetup, *, starts: Callable[[], Sequence[Real]] = tuple
) -> CornerFit:
    """Fit springs, dampers and tyres to the spectra of segments.

    Parameters
    ----------
    segments
        Spectra of segments of one condition, in the coordinates of the set-up's layout.
    setup
        Vehicle, layout and settings.
    starts
        Function that returns further starts of the search where the first fit is doubtful: ln(value / nominal value) of
        each component.

    Returns
    -------
    CornerFit
        Estimates with their covariance, and the quality of the fit.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a matrix of the search is singular.

    Notes
    -----
    One rough fit, then up to four full ones, in this order:

    1. *Rough*: speed classes twice as wide and a likelihood to the power of 0.1 (tempering), which flattens local
       minima. If its error is so large that its own tempering is below 0.3, and larger than in other windows of
       the vehicle, the search is repeated from the most likely of the further starts and of the vehicles with one
       spring broken, to a rougher end, and the better result is taken. Where other windows of the vehicle are known,
       its searches and those of the full fits end earlier.
    2. *Full*: classes 5 % wide. Each fit is followed by three choices for the next one, until they no longer change:

       - the amplitude of a segment is limited to that at 1.2 times the median power, a winsorised residual as
         Huber's, so that a pothole affects one segment only (`segment_weights`);
       - frequencies are left out at which lines of wheels, engine or mains stand out of the fit (`residual_lines`);
       - the likelihood is raised to a power eta between 0 and 1, as large as the misfit beyond chance allows
         (`tempering`). The likelihood of a wrong model grows without bound with the amount of data, and it would
         override the prior with the model's error; raised to eta, a Gibbs posterior, it does not.

    Alternating weights and fits is iteratively reweighted estimation: the weights belong to the fit before.

    References
    ----------
    P. J. Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics 35 (1964) 73-101.
    P. W. Holland, R. E. Welsch, Robust regression using iteratively reweighted least-squares, Communications in
    Statistics - Theory and Methods 6 (1977) 813-827.
    W. Jiang, M. A. Tanner, Gibbs posterior for variable selection in high-dimensional classification and data mining,
    Annals of Statistics 36 (2008) 2207-2231.
    P. G. Bissiri, C. C. Holmes, S. G. Walker, A general framework for updating belief distributions, Journal of the
    Royal Statistical Society B 78 (2016) 1103-1130.

    Examples
    --------
    The estimates of a drive of the nominal vehicle differ from nominal by less than three standard deviations:

    >>> import numpy as np
    >>> from sprung.likelihood import CornerSettings, rigid_layout, segment_spectra
    >>> from sprung.likelihood.fitting import FitSetup
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle, structure
    >>> vehicle = read_vehicle("zafira")
    >>> nominal, layout = structure(vehicle), rigid_layout(structure(vehicle))
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> segments = segment_spectra([drive], layout, speed="speed", band=(0.5, 20.0))
    >>> fit = fit_segments(segments, FitSetup(vehicle, nominal, layout, CornerSettings(), "road"))
    >>> fit.n_segments, bool(np.all(np.abs(fit.log_ratios) < 3 * fit.log_ratios_std))
    (22, True)
    """
    lines: tuple[SpectralLine, ...] = ()
    of_wheels = lines
    if setup.kind == "rail" and setup.joint_pitch is None:
        smooth = setup.at_classes(segments, width=RULES.coarse)
        turn, pitch = repetitions(smooth, smooth.scaled_start(), segments, width=RULES.coarse)
        setup = replace(setup, joint_pitch=np.inf if pitch is None else pitch)
        lines = of_wheels = () if turn is None else lines_of_turns(turn, smooth.spectra)
    setup, model, parameters = _start(segments, setup, starts, lines)
    limited, power, lowest = segments, RULES.first, lowest_of_lines(setup.nominal, setup.kind)
    for _ in range(RULES.max_fits):
        last_lines, last_power = lines, power
        limits = np.sqrt(segment_weights(model, parameters, segments))[:, None, None]
        limited = replace(segments, values=segments.values * limits)
        if setup.settings.has_lines_masked:
            lines = with_lines(of_wheels, residual_lines(model, parameters, lowest=lowest))
        untempered = _weighted(model, class_spectra(limited, width=CLASS_WIDTH), tempering=1.0, lines=lines)
        power = tempering(untempered, parameters)
        model = _weighted(model, untempered.spectra, tempering=power, lines=lines)
        if lines == last_lines and abs(power - last_power) < RULES.settled * last_power:
            break
        parameters = _end(model, parameters, None if setup.settings.expected is None else RULES.of_known)
    covariance = parameter_covariance(model, parameters, limited)
    misfit, excess = power_misfit(model, parameters)
    counts, error = (model.spectra.n_segments, segments.n_rejected), float(np.sqrt(max(0.0, excess)))
    driven = DrivenSegments(setup.model(beyond(model.spectra)), limited) if setup.kind == "road" else None
    fit = CornerFit(model, parameters, covariance, misfit, error, *counts, notes=(), driven=driven, lines=lines)
    pitch = np.inf if setup.joint_pitch is None else setup.joint_pitch
    joints = (f"rail joints every {pitch:.1f} m are part of the fit",) if np.isfinite(pitch) else ()
    return replace(fit, notes=(*_notes(fit), *joints))


def _start(
    segments: SegmentSpectra,
    setup: FitSetup,
    starts: Callable[[], Sequence[Real]],
    lines: tuple[SpectralLine, ...],
) -> tuple[FitSetup, Model, Real]:
    """Return the set-up, its model with speed classes of full width, tempered, and where its search starts."""
    coarse = setup.at_classes(segments, width=RULES.coarse)
    rough = _weighted(coarse, coarse.spectra, tempering=RULES.first, lines=lines)
    untempered = _weighted(coarse, coarse.spectra, tempering=1.0, lines=lines)
    end = _rough_fit(rough, untempered, starts, setup.settings.expected)
    if setup.joint_pitch is not None and np.isfinite(setup.joint_pitch):
        setup, rough, end = _with_offset(setup, rough, end)
    fine = setup.at_classes(segments, width=CLASS_WIDTH)
    model = _weighted(fine, fine.spectra, tempering=RULES.first)
    parameters = _carried_over(rough, end, model)
    return setup, model, model.scaled_start() if model.objective(parameters)[0] == TOO_FAR else parameters


def _with_offset(setup: FitSetup, rough: Model, end: Real) -> tuple[FitSetup, Model, Real]:
    """Return set-up, model and end of its search with another offset of the rails' joints, where that is more likely.

    It is sought where the joints of both rails look less coherent than before any data; and joints every p of both
    together may be those of two rails that alternate, every 2 p of each.
    """
    coherent = np.where(np.equal(rough.names, "joint_loss"), rough.start, end)

    def model(place: tuple[float, float]) -> Model:
        return replace(setup, joint_pitch=place[0], joint_offset=place[1] % 1).model(rough.spectra)

    @cache
    def misfit(place: tuple[float, float]) -> float:
        trial = model(place)
        return minus_log_likelihood(trial.matrix(coherent), trial.spectra)[0]

    pitch = setup.joint_pitch or np.inf
    offsets = np.arange(1, RULES.offsets if np.any(end > coherent) else 1) / RULES.offsets
    place = min([(2 * pitch, 0.5), *((pitch, offset) for offset in offsets.tolist())], key=misfit)
    is_other = misfit(place) < minus_log_likelihood(rough.matrix(end), rough.spectra)[0]
    place = place if is_other else (pitch, 0.0)
    for finer in RULES.finer:
        place = min(((place[0] * (1 + sign * finer), place[1]) for sign in (0, -1, 1)), key=misfit)
        if is_other:
            place = min(((place[0], place[1] + sign * finer) for sign in (0, -1, 1)), key=misfit)
    setup = replace(setup, joint_pitch=place[0], joint_offset=place[1] % 1)
    if not is_other:
        return setup, rough, end
    return setup, model(place), _end(model(place), coherent, None)


def _rough_fit(
    rough: Model, untempered: Model, starts: Callable[[], Sequence[Real]], expected: Expected | None
) -> Real:
    """Return the parameters of the first fit; if it is doubtful, a search from another start is compared."""
    usual: list[Real | None] = [None]
    if expected is not None:
        usual.append(np.array([expected.log_ratios.get(part, 0.0) for part in rough.components]))

    def misfit(parameters: Real) -> float:
        return rough.objective(parameters)[0]

    start = min((rough.scaled_start(start) for start in usual), key=misfit)
    end = _end(rough, start, None if expected is None else RULES.first_of_known)
    if tempering(untempered, end) >= RULES.doubtful:
        return end
    if expected is not None and power_misfit(untempered, end)[1] <= (RULES.worse * expected.model_error) ** 2:
        return end
    broken = RULES.broken * np.eye(len(rough.components))
    springs = [broken[row] for row, component in enumerate(rough.components) if component.kind in SPRINGS]
    start = min((rough.scaled_start(start) for start in (*springs, *starts())), key=misfit)
    return min((end, minimised(rough.searched, start, RULES.from_broken)), key=misfit)


def _end(model: Model, start: Real, known: DescentSettings | None) -> Real:
    """Return the end of a search; with the ends for a known vehicle in a rougher metric, and noise by its power."""
    if known is None:
        return minimised(model.searched, start)
    return minimised(replace(model, every=3), start, known, model.powers)


def _weighted(model: Model, spectra: ClassSpectra, *, tempering: float, lines: tuple[SpectralLine, ...] = ()) -> Model:
    """Return the model with spectra of the same classes, tempered and without lines; its blocks depend on no more."""
    weights = tempering * spectra.counts[:, None] * without_lines(spectra, lines)
    return replace(model, spectra=replace(spectra, weights=weights))


def _carried_over(coarse: Model, parameters: Real, model: Model) -> Real:
    """Return the parameters of a model with coarse speed classes as those of one with finer classes."""
    known = dict(zip(coarse.names, parameters, strict=True))
    carried = np.array([known.get(name, 0.0) for name in model.names])
    levels = model.rows("class_roughness")
    carried[levels] = 0.0
    if levels.size:
        mean = model.relative_power(carried).mean(axis=1)
        carried[levels] = np.log(np.clip(np.nan_to_num(mean, nan=1.0), RULES.min_level, 1 / RULES.min_level))
    return carried


def _notes(fit: CornerFit) -> tuple[str, ...]:
    """Return notes on unidentifiable components and on the fit of the model, one sentence each."""
    notes = []
    weak = [str(component) for component, is_ in zip(fit.components, fit.is_identifiable, strict=True) if not is_]
    if weak:
        verb, stay = ("is", "its estimate stays") if len(weak) == 1 else ("are", "their estimates stay")
        notes.append(f"{', '.join(weak)} {verb} not identifiable from this run and these sensors; {stay} near nominal")
    if fit.model_error > RULES.imperfect:
        causes = ["a moving part that the vehicle file lacks"]
        if fit.parameters[fit.model.rows("noise")].size > len(fit.model.layout.coordinates):
            causes.append("leakage between frequencies, which channels beyond the motions show")
        if any(isinstance(block, RailInputs) for block in fit.model.blocks):
            causes.append("joints at distances that vary or are not found")
        elif any(isinstance(block, RigInputs) for block in fit.model.blocks):
            causes.append('a track, and not a rig as its kind = "rig" states')
        cause = ", or ".join(causes) + ("," if causes[1:] else "") + " may be why"
        if _is_noiseless(fit):
            cause = "its channels have no noise, as simulated ones, so that leakage between frequencies counts"
        notes.append(
            f"the fitted spectra deviate {100 * fit.model_error:.0f} % more than chance allows: {cause}; differences "
            "between corners and from a baseline are more reliable than the values"
        )
    notes += _implausibility_notes(fit)
    if lines := fit.lines:
        places = ", ".join(
            f"{line.place:.3g} {'per m' if line.follows_speed else 'Hz'}" for line in lines[: RULES.max_named]
        )
        more = f" and {len(lines) - RULES.max_named} more" if len(lines) > RULES.max_named else ""
        notes.append(f"left out for lines of wheels, engine or mains: {places}{more}")
    if fit.n_rejected:
        notes.append(
            f"{fit.n_rejected} of {fit.n_rejected + fit.n_segments} segments were too slow or of changing speed"
        )
    return tuple(notes)


def _is_noiseless(fit: CornerFit) -> bool:
    """Return whether more channels than the motion has coordinates are free of noise."""
    noise = fit.parameters[fit.model.rows("noise")]
    return len(noise) > len(fit.model.layout.coordinates) and bool(np.median(noise) < np.log(RULES.noiseless))


def _implausibility_notes(fit: CornerFit) -> list[str]:
    """Return notes on values that no vehicle of the file has; left and right count where the model is imperfect."""
    notes = []
    if fit.implausible_axles:
        values = ", ".join(f"{name} {ratio:.2g} times the file's" for name, ratio in fit.implausible_axles.items())
        notes.append(
            f"implausible values: {values} on both sides; calibrate the vehicle file on healthy drives, or complete it"
        )
    if fit.uneven_axles and fit.model_error > RULES.imperfect:
        values = ", ".join(f"{name} {ratio:.2g}" for name, ratio in fit.uneven_axles.items())
        notes.append(
            f"left over right beyond production scatter: {values}; a fault, or what the vehicle file lacks: compare "
            "with a baseline"
        )
    return notes
