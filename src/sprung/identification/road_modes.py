"""Modes of a vehicle on its road, from the likelihood of its springs, dampers and tyres."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import freeze
from sprung.errors import DataError, ParameterError
from sprung.identification.records import CorrelatedRecords, Progress
from sprung.identification.settings import IdentificationSettings
from sprung.identification.stabilisation import StabilityCriteria
from sprung.modal import Modes, join_modes, mac, unit_shapes
from sprung.recording import Channel, Recording
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles import Vehicle
from sprung.vehicles.labels import MOTIONS, body_range, rigid_body_participation
from sprung.vehicles.sensor_layout import AnyVehicle
from sprung.vehicles.window import Window, window_of

if TYPE_CHECKING:
    from sprung.likelihood.corners import CornerFit


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of what a drive determines, and of what SSI adds to it."""

    #: Most values that are kept of recordings that can be read only once.
    max_values: int = 2**25
    #: Prior standard deviation of ln(value / nominal value): less than `sprung corners` has, so that modes that a drive
    #: hardly determines stay near those of the file.
    prior_std: float = 0.35
    #: Share of the prior deviation of its frequency below which a mode is determined.
    determined: float = 0.75
    #: Factor of both springs of an axle beyond which a fit with a model error is that of another vehicle.
    other_springs: float = 2.0
    #: Largest physical damping ratio of a mode of the body.
    max_damping: float = StabilityCriteria().max_damping
    #: Model error above which the fitted vehicle is not used.
    unlike: float = 0.5
    #: Model error above which a note names it.
    imperfect: float = 0.1
    #: Relative deviations of frequency and damping of the body by friction, valves and bump stops.
    nonlinear_body: tuple[float, float] = (0.015, 0.06)
    #: The same of wheel hop, whose smaller motion depends more on friction.
    nonlinear_hop: tuple[float, float] = (0.015, 0.12)
    #: Power at a mode over that beside it, less 1, in measured over fitted spectra: the fitted vehicle lacks the mode.
    unexplained: float = 0.25
    #: The same in measured spectra alone: a resonance.
    prominent: float = 2.0
    #: Largest damping ratio of such a mode.
    max_light: float = 0.15
    #: Share of its shape that the rigid body explains below which a mode is one of a flexible body.
    rigid: float = 0.7
    #: Frequency over that of the highest mode of the body below which SSI adds none.
    over_body: float = 1.5
    #: Variance of the mean power of n half-overlapping segments, times n.
    chance: float = 1.06
    #: Relative difference of frequency up to which a mode of SSI is one of the fitted vehicle ...
    nearby: float = 0.2
    #: ... and least MAC.
    alike: float = 0.8


_RULES = _Rules()


@dataclass(frozen=True, eq=False, slots=True)
class CombinedModes:
    """Modes of the fitted vehicle, and those of SSI that it does not explain.

    Parameters
    ----------
    modes
        Modes by rising frequency.
    replaced
        Index of the mode of SSI that each mode is or replaces, -1 for none; shape (modes,).
    sources
        "road_likelihood" or "ssi" for each mode.
    """

    modes: Modes
    replaced: Indices
    sources: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, replaced=1, dtype=np.intp)


def kept_records(
    recordings: Iterable[Recording], *, is_keeping: bool
) -> tuple[Iterable[Recording], Sequence[Recording]]:
    """Return recordings to read once, and those that are still at hand afterwards.

    Parameters
    ----------
    recordings
        Recordings; `is_keeping`: whether the first of an iterator, up to 2^25 values, are kept as they are read.
    """
    if isinstance(recordings, Sequence):
        return recordings, recordings
    kept: list[Recording] = []
    return (_keeping(recordings, kept) if is_keeping else recordings), kept


def _keeping(recordings: Iterable[Recording], kept: list[Recording]) -> Iterator[Recording]:
    """Yield recordings and put them into a list as long as there is room."""
    room = _RULES.max_values
    for recording in recordings:
        room -= recording.samples.size
        if room >= 0:
            kept.append(recording)
        yield recording


def has_road(vehicle: AnyVehicle | None, settings: IdentificationSettings) -> bool:
    """Return whether modes may be those of a vehicle on its road: with tyres and sensors, if the settings agree."""
    if not settings.has_road_modes or not isinstance(vehicle, Vehicle) or vehicle.kind != "road":
        return False
    return bool(vehicle.sensor) and all(axle.tyre_stiffness is not None for axle in vehicle.axle)


def fit_of_road(recordings: Sequence[Recording], vehicle: Vehicle) -> "CornerFit":
    """Return the vehicle that explains the spectra of drives on a road best.

    Parameters
    ----------
    recordings
        Drives of one condition, with the speed; sensors of the vehicle file that they lack are left out.
    vehicle
        Vehicle with its sensors.

    Raises
    ------
    DataError
        If there is no speed, too little steady driving, or the drives are not consistent with the vehicle file.
    ParameterError
        If the recordings have none of the sensors of the vehicle file, or one with another quantity.
    """
    from sprung.likelihood.fitting import fit_windows
    from sprung.likelihood.vehicle import CornerSettings

    windows = [window for record in recordings for window in _windows(record, vehicle)]
    if not windows:
        raise DataError("no recording has the speed of the vehicle: record it")
    fit = fit_windows(windows, settings=CornerSettings(prior_std=_RULES.prior_std))
    doubt = doubts(fit)
    if doubt:
        raise DataError(f"{doubt}: correct the vehicle file, or calibrate it on healthy drives")
    return fit


def doubts(fit: "CornerFit") -> str:
    """Return why a fitted vehicle is not that of the file; empty if it may be.

    Parameters
    ----------
    fit
        Vehicle fitted to drives.

    Notes
    -----
    Another vehicle has spectra that deviate by more than 50 %; or by more than 10 %, with springs of an axle that are
    more than a factor of 2 off; or modes of the body beyond `labels.body_range`, or more than 60 % damped.
    """
    if fit.model_error > _RULES.unlike:
        return f"the spectra deviate {100 * fit.model_error:.0f} % from those of the fitted vehicle"
    unlike = [
        f"{name} {ratio:.2g} times the file's"
        for name, ratio in fit.implausible_axles.items()
        if "springs" in name and abs(np.log(ratio)) > np.log(_RULES.other_springs)
    ]
    if fit.model_error > _RULES.imperfect and unlike:
        return f"the fitted vehicle has implausible values ({', '.join(unlike)})"
    lowest, highest = body_range(fit.model.structure.modes())
    exact = fit.modes()
    for f, x, label in zip(exact.natural_frequency, exact.damping_ratio, exact.labels, strict=True):
        if label in MOTIONS and not (lowest <= f <= highest and x <= _RULES.max_damping):
            return f"the {label} of the fitted vehicle is implausible ({f:.2g} Hz, {100 * x:.0f} % damped)"
    return ""


def _windows(recording: Recording, vehicle: Vehicle) -> Iterator[Window]:
    """Yield a recording as a window of its vehicle, if it has the speed and moves."""
    window = window_of(recording, vehicle, allow_missing=True)
    try:
        is_usable = window.speed is not None and window.motion.n_samples > 0
    except DataError:
        return
    if is_usable:
        yield window


def modes_of_fit(fit: "CornerFit", channels: Sequence[str]) -> Modes:
    """Return the modes of a fitted vehicle on channels, as far as the drives determine them.

    Parameters
    ----------
    fit
        Vehicle fitted to drives.
    channels
        Names of the channels of the mode shapes, sensors of the vehicle file.

    Returns
    -------
    Modes
        Bounce, pitch, roll and wheel hops that the channels observe and whose frequency the drives make more certain
        than the prior, to three quarters of its standard deviation; no wheel hops where the spectra deviate by more
        than 10 % from the fitted ones, as a mass on mounts near them would distort them. `stable_rate` is 0.

    Notes
    -----
    Deviations of frequency f and damping ratio x are those of the fit by the delta method (`CornerFit.modes_std`), to
    which are added in squares

    - the error d of the model, the RMS of measured over fitted spectra less 1 beyond chance: the spectrum at a
      resonance is in proportion to 1 / x^2, but other parts compensate; drives with an engine on mounts that the
      vehicle file lacks scatter by d x, and by d x f / 4 in frequency;
    - what is not linear in a suspension: 1.5 % of f and 6 % of x (12 % for wheel hop), which covers the modes of
      the linear vehicle of the same forces, whether loud or quiet parts of a drive define it.
    """
    exact = fit.modes()
    frequency_std, damping_std = fit.modes_std()
    prior_std = np.sqrt(np.einsum("im,i->m", fit.modes_derivatives()[0] ** 2, fit.model.prior_std**2))
    shapes = exact.mode_shapes[:, [exact.channels.index(name) for name in channels]]
    wanted = MOTIONS if fit.model_error > _RULES.imperfect else (*MOTIONS, "wheel_hop")
    is_named = np.array([label in wanted for label in exact.labels], dtype=np.bool_)
    chosen = np.flatnonzero(is_named & shapes.any(axis=1) & (frequency_std < _RULES.determined * prior_std))
    error = fit.model_error
    nonlinear = np.array(
        [_RULES.nonlinear_body if label in MOTIONS else _RULES.nonlinear_hop for label in exact.labels]
    )
    f, x = exact.natural_frequency, exact.damping_ratio
    modes = Modes(
        poles=exact.poles,
        mode_shapes=unit_shapes(shapes),
        channels=tuple(channels),
        natural_frequency_std=np.hypot(frequency_std, f * np.hypot(nonlinear[:, 0], error * x / 4)),
        damping_ratio_std=np.hypot(damping_std, x * np.hypot(nonlinear[:, 1], error)),
        stable_rate=np.zeros(len(f)),
        labels=exact.labels,
    )
    return modes.take(chosen)


def with_road_modes(
    modes: Modes,
    fit: "CornerFit",
    channels: Sequence[Channel],
    spectra: SpectralMatrix,
    *,
    band: tuple[float, float] | None = None,
) -> CombinedModes:
    """Return the modes of a fitted vehicle, and those of SSI that the vehicle does not explain.

    Parameters
    ----------
    modes
        Modes by SSI from the same recordings.
    fit
        Vehicle fitted to the recordings.
    channels
        Channels of `modes`.
    spectra
        Spectral matrix of the channels.
    band
        Band of interest [Hz]; None: all modes are.
    """
    road = modes_of_fit(fit, modes.channels)
    if band is not None:
        road = road.take(np.flatnonzero((road.natural_frequency >= band[0]) & (road.natural_frequency <= band[1])))
    is_kept = unexplained(modes, fit, channels, spectra)
    replaced = _replaced(road, modes, np.flatnonzero(~is_kept))
    rate = np.where(replaced >= 0, np.append(modes.stable_rate, 0.0)[replaced], 0.0)
    kept = modes.take(np.flatnonzero(is_kept))
    labels = tuple(None if label in road.labels else label for label in kept.labels)
    together = join_modes([replace(road, stable_rate=rate), replace(kept, labels=labels)])
    sources = np.repeat(["road_likelihood", "ssi"], [len(road), len(kept)])
    order = np.argsort(together.natural_frequency, kind="stable")
    return CombinedModes(
        together.take(order),
        np.concatenate([replaced, np.flatnonzero(is_kept)])[order],
        tuple(sources[order].tolist()),
    )


def unexplained(modes: Modes, fit: "CornerFit", channels: Sequence[Channel], spectra: SpectralMatrix) -> Booleans:
    """Return which modes by SSI are none of a fitted vehicle on its road, shape (modes,).

    Parameters
    ----------
    modes, fit, channels, spectra
        As for `with_road_modes`.

    Notes
    -----
    SSI takes the excitation for white; the delay between the axles puts poles between its nulls. A mode of SSI is real
    if the body bends or twists in it. Above the modes of the body it is also real if it is lightly damped and a peak,
    with twice the power on either side: of the measured over the fitted spectra of a motion (there 25 % and three
    standard deviations of chance are enough); beyond the fitted band, or where the spectra deviate by more than 10 %,
    of the measured power in its shape.
    """
    shares, explained = rigid_body_participation(modes, channels)
    is_flexible = (explained < _RULES.rigid) & np.isfinite(shares).any()
    exact = fit.modes()
    is_body = np.array([label in MOTIONS for label in exact.labels])
    lowest = _RULES.over_body * float(exact.natural_frequency[is_body].max(initial=0.0))
    highest = float(fit.model.spectra.frequencies[-1])
    is_real = []
    for f, x, shape in zip(modes.natural_frequency, modes.damping_ratio, modes.mode_shapes, strict=True):
        counts_alone = f > highest or fit.model_error > _RULES.imperfect
        is_peak = (counts_alone and _is_resonance(f, x, shape, spectra)) or (f < highest and _exceeds(f, x, fit))
        is_real.append(bool(lowest < f and x < _RULES.max_light and is_peak))
    return np.asarray(is_flexible | np.array(is_real, dtype=np.bool_))


def _exceeds(frequency: float, damping: float, fit: "CornerFit") -> bool:
    """Return whether measured over fitted power of a motion has a peak at a mode."""
    frequencies = fit.model.spectra.frequencies
    ratios = [_over_sides(frequency, damping, frequencies, 1 + misfit) for misfit in fit.misfit]
    n_about = max(1, int(np.count_nonzero(np.abs(frequencies - frequency) <= damping * frequency)))
    chance = float(np.sqrt(_RULES.chance / (fit.n_segments * n_about)))
    return max(ratios) > 1 + max(_RULES.unexplained, 3 * chance)


def _is_resonance(frequency: float, damping: float, shape: Complex, spectra: SpectralMatrix) -> bool:
    """Return whether the power in a shape has a peak at a mode."""
    power = np.einsum("i,ijf,j->f", shape.conj(), spectra.matrix, shape).real
    return _over_sides(frequency, damping, spectra.frequencies, power) > _RULES.prominent


def _over_sides(frequency: float, damping: float, frequencies: Real, power: Real) -> float:
    """Return the mean power in the bandwidth of a mode over the median of the stronger side; 0 if a side is missing."""
    width = max(damping * frequency, 2 * float(frequencies[1] - frequencies[0]))
    offset = (frequencies - frequency) / width
    within, below, above = (
        power[(offset >= low) & (offset <= high)] for low, high in ((-1.0, 1.0), (-4.0, -2.0), (2.0, 4.0))
    )
    if not (within.size and below.size and above.size):
        return 0.0
    return float(within.mean() / max(np.median(below), np.median(above)))


def _replaced(road: Modes, modes: Modes, candidates: Indices) -> Indices:
    """Return for each mode of the fitted vehicle the mode by SSI that estimates it, each once; -1 for none."""
    replaced = np.full(len(road), -1)
    if not candidates.size or not len(road):
        return replaced
    likeness = mac(road.mode_shapes, modes.mode_shapes[candidates])
    distance = np.abs(np.log(modes.natural_frequency[candidates] / road.natural_frequency[:, None]))
    cost = np.where((likeness >= _RULES.alike) & (distance <= _RULES.nearby), distance + 1 - likeness, np.inf)
    while np.isfinite(cost.min()):
        row, column = np.unravel_index(int(np.argmin(cost)), cost.shape)
        replaced[row] = candidates[column]
        cost[row], cost[:, column] = np.inf, np.inf
    return replaced


def note_on_road(modes: CombinedModes, fit: "CornerFit", *, n_ssi: int) -> str:
    """Return which modes are those of the fitted vehicle, in a sentence.

    Parameters
    ----------
    modes
        Modes of both sources.
    fit
        Fitted vehicle.
    n_ssi
        Number of modes by SSI before.
    """
    labels = [label for label, source in zip(modes.modes.labels, modes.sources, strict=True) if source != "ssi"]
    n_hops = labels.count("wheel_hop")
    names = [label for label in MOTIONS if label in labels] + ([f"{n_hops} of wheel hop"] if n_hops else [])
    n_left_out = n_ssi - modes.sources.count("ssi")
    sentence = (
        f"{' and '.join([', '.join(names[:-1]), names[-1]] if len(names) > 1 else names)}: modes of the vehicle file"
        " fitted to the spectra on the road (likelihood), whose damping depends on the amplitude by some 6 %;"
        f" {n_left_out} of {n_ssi} modes by SSI were left out: the same modes, or effects of the axle delay"
    )
    if fit.model_error <= _RULES.imperfect:
        return sentence
    return f"{sentence}; the spectra deviate {100 * fit.model_error:.0f} % from those of the fitted vehicle"


def combined_modes(
    modes: Modes,
    recordings: Sequence[Recording],
    records: CorrelatedRecords,
    *,
    vehicle: AnyVehicle | None,
    band: tuple[float, float] | None,
    report: Progress,
) -> tuple[CombinedModes, tuple[str, ...]]:
    """Return modes by SSI with those of the vehicle on its road in their place, and notes.

    Parameters
    ----------
    modes
        Modes by SSI, with labels.
    recordings
        Recordings from `kept_records`; none if `has_road` says no.
    records
        Channels and spectra of the recordings.
    vehicle
        Vehicle of the recordings.
    band
        Band of interest [Hz]; None: all modes are.
    report
        Function called before the fit.

    Returns
    -------
    CombinedModes
        Where the vehicle cannot be fitted, the modes by SSI.
    notes
        Which modes are those of the fitted vehicle, or why none is.
    """
    as_they_are = CombinedModes(modes, np.arange(len(modes)), ("ssi",) * len(modes))
    if not recordings or not isinstance(vehicle, Vehicle):
        return as_they_are, ()
    report("fitting the vehicle to its road", 0.98)
    try:
        fit = fit_of_road(recordings, vehicle)
    except (DataError, ParameterError) as error:
        return as_they_are, (
            f"all modes are by SSI, which on a road misses modes of the body and adds others: {error}",
        )
    combined = with_road_modes(modes, fit, records.channels, records.spectra, band=band)
    if "road_likelihood" not in combined.sources:
        return as_they_are, ("all modes are by SSI: the drive does not determine those of the vehicle file",)
    return combined, (note_on_road(combined, fit, n_ssi=len(modes)),)
