"""What identification does to recordings first."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sprung._checks import check_number
from sprung.cepstrum import Lifter, edit
from sprung.conditioning import band_pass, decimate, detrend, scale, while_moving, without_missing
from sprung.errors import DataError, ParameterError
from sprung.harmonics import Harmonic, find_harmonics
from sprung.layout import with_layout
from sprung.recording import Recording
from sprung.spectrum import SpectralMatrix, spectral_matrix
from sprung.stabilisation import StabilityCriteria
from sprung.vehicles import Chain, Quarter, Vehicle

#: Rates of records within this share of each other are one: those of one logger, by different clocks.
_SAME_RATE = 5e-4
#: Quantities that are conditions of the motion, not outputs.
_CONDITIONS = ("speed", "temperature")
_SLOWEST = 3.0
#: Chance of finding any line in a record without one.
_FALSE_LINES = 1e-4
#: Lines of wheels and engines are searched for below half of this rate [Hz], also where modes are sought far lower.
_RATE_FOR_LINES = 200.0
#: A mode has at least this many periods in the lags, and lies below this share of the sampling rate (where
#: decimation passes everything).
_LEAST_PERIODS, _HIGHEST_MODE = 1.2, 0.4

AnyVehicle = Vehicle | Quarter | Chain


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """How to identify; None means chosen from the data.

    Parameters
    ----------
    band
        Lowest and highest natural frequency wanted [Hz]; slower motion is filtered off.
    decimate_to
        Sampling rate for the identification [Hz].
    segment
        Length of the segments [s].
    n_subsets
        J of CoSS-SSI.
    has_equal_counts
        Subsets of CoSS-SSI hold equally many segments, instead of spanning equal ranges of level (thesis).
    is_biased
        Correlations are divided by the number of samples (thesis), not of products: see `sprung.correlation.average`.
    block_rows
        i: block rows of the block matrix.
    max_order
        Largest model order of the ladder, which takes every even order.
    lifter
        For cepstrum editing; None: none. The damping that an `Exponential` lifter adds is subtracted again.
    references
        Names of the reference channels; None: all.
    has_disjoint_references
        Take outputs and references from disjoint sets of channels, in several splits: for sensor noise that fills
        the modes' own band.
    row_ladder
        First and last number of block rows: the thesis' ladder instead of that over orders.
    is_hankel
        Correlations as data in block Hankel matrices (thesis) instead of directly in the block Toeplitz matrix.
    is_weighted
        Canonical variates (see `sprung.subspace.realise`).
    criteria
        For stable poles and modes.
    harmonics
        Lines that are known to be no modes; None: sought, which takes most of the time of an identification.
    """

    band: tuple[float, float] | None = None
    decimate_to: float | None = None
    segment: float | None = None
    n_subsets: int = 3
    has_equal_counts: bool = False
    is_biased: bool = False
    block_rows: int | None = None
    max_order: int | None = None
    lifter: Lifter | None = None
    references: tuple[str, ...] | None = None
    has_disjoint_references: bool = False
    row_ladder: tuple[int, int] | None = None
    is_hankel: bool = False
    is_weighted: bool = True
    criteria: StabilityCriteria = field(default_factory=StabilityCriteria)
    harmonics: tuple[Harmonic, ...] | None = None

    def __post_init__(self) -> None:
        if self.band is not None and not 0 <= self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from 0 or more")
        for name in ("decimate_to", "segment"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0)
        for name in ("block_rows", "max_order"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), at_least=2)
        check_number("n_subsets", self.n_subsets, at_least=1, at_most=50)
        if self.row_ladder is not None and not 2 <= self.row_ladder[0] <= self.row_ladder[1]:
            raise ParameterError(f"row_ladder {self.row_ladder[0]} to {self.row_ladder[1]} must rise from 2 or more")
        if self.references == ():
            raise ParameterError("references are empty: name at least one channel, or leave them out to use all")
        if self.references is not None and self.has_disjoint_references:
            raise ParameterError("references are chosen by the splits when they are disjoint: leave out one of both")


@dataclass(frozen=True, slots=True)
class Plan:
    """What is chosen once and done to every record.

    Parameters
    ----------
    channels
        Names of the outputs.
    speed
        Name of the speed channel, None without.
    factors
        For each output what makes its RMS 1.
    sampling_rate
        Of the first record before decimation [Hz].
    settings
        With the choices made.
    band
        In which motion is expected [Hz], given or chosen.
    spectrum_segment
        Length of the segments of spectra [s].
    notes
        The choices, in words.
    """

    channels: tuple[str, ...]
    speed: str | None
    factors: dict[str, float]
    sampling_rate: float
    settings: IdentificationSettings
    band: tuple[float, float]
    spectrum_segment: float
    notes: tuple[str, ...]

    @property
    def mode_band(self) -> tuple[float, float]:
        """Natural frequencies that the settings want and that lags and sampling rate can tell [Hz]."""
        rate = self.settings.decimate_to or 0.0
        low, high = self.settings.band or (0.0, np.inf)
        return max(low, _LEAST_PERIODS * rate / self.n_lags), min(high, _HIGHEST_MODE * rate)

    @property
    def n_lags(self) -> int:
        """Lags that the largest block matrix needs."""
        rows = self.settings.row_ladder[1] if self.settings.row_ladder else self.settings.block_rows
        return (3 if self.settings.is_hankel else 2) * int(rows or 0)


def usable(recording: Recording, *, vehicle: AnyVehicle | None = None) -> Recording:
    """Return the outputs (and the speed) of a recording, in SI units, where the vehicle moves and nothing is missing.

    Parameters
    ----------
    recording
        As read.
    vehicle
        Its sensors, where it has any, are the outputs; otherwise every channel that is no condition.

    Raises
    ------
    DataError
        If an output is dead, or nothing is left.
    """
    speed = speed_channel(recording, vehicle)
    if vehicle is not None and vehicle.sensor:
        recording = with_layout(recording, vehicle.sensor)
        wanted = [sensor.channel for sensor in vehicle.sensor if sensor.quantity not in _CONDITIONS]
        outputs = [name for name in wanted if name in recording.names]
    else:
        outputs = [c.name for c in recording.channels if c.quantity not in _CONDITIONS and c.name != speed]
    recording = recording.select([*outputs, speed] if speed and speed not in outputs else outputs)
    _check_alive(recording, outputs)
    recording = without_missing(recording)
    return while_moving(recording, speed, minimum_speed=_SLOWEST) if speed else recording


def speed_channel(recording: Recording, vehicle: AnyVehicle | None = None) -> str | None:
    """Return the name of the channel with the vehicle's speed, in any case of letters; None where there is none."""
    name = "speed" if vehicle is None else vehicle.speed_channel
    if name in recording.names:
        return name
    alike = [other for other in recording.names if other.casefold() == name.casefold()]
    return alike[0] if len(alike) == 1 else None


def _check_alive(recording: Recording, outputs: Sequence[str]) -> None:
    """Refuse dead outputs."""
    if not outputs:
        raise DataError("the recording has no channel of motion: give accelerations or angular velocities")
    if recording.n_samples < 2:
        raise DataError(f"the recording has {recording.n_samples} sample(s): record at least a minute")
    dead = []
    for name in outputs:
        samples = recording.samples[recording.index(name)]
        finite = samples[np.isfinite(samples)]
        if finite.size < 2:
            dead.append((name, "has no values"))
        elif np.ptp(finite) <= 1e-12 * np.abs(finite).max():
            dead.append((name, f"is constant at {finite[0]:g}"))
    if dead:
        left = [name for name in outputs if name not in dict(dead)]
        advice = f"leave it out with --channels {','.join(left)}" if left else "check the sensors and their wiring"
        raise DataError(f"channel {dead[0][0]!r} {dead[0][1]}: {advice}")


@dataclass(frozen=True, eq=False, slots=True)
class Prepared:
    """A record ready for correlation.

    Parameters
    ----------
    motion
        Outputs: edited, decimated, without motion below the band, RMS about 1.
    spectra, edited_spectra
        Of the decimated outputs before and after cepstrum editing (None without).
    harmonics
        Lines of the excitation in the decimated record before editing.
    """

    motion: Recording
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    harmonics: tuple[Harmonic, ...]


def prepare(recording: Recording, plan: Plan) -> Prepared:
    """Do to one record what the plan says.

    Parameters
    ----------
    recording
        From `usable`, with the plan's channels.
    plan
        From `make_plan`.
    """
    settings = plan.settings
    if abs(recording.sampling_rate / plan.sampling_rate - 1) <= _SAME_RATE:
        recording = replace(recording, sampling_rate=plan.sampling_rate)
    rate = min(settings.decimate_to or recording.sampling_rate, recording.sampling_rate)
    centred = detrend(recording.select(plan.channels))
    harmonics = settings.harmonics
    if harmonics is None:
        searched = _decimated(recording, max(rate, _RATE_FOR_LINES))
        harmonics = find_harmonics(searched, speed=plan.speed, false_alarm_rate=_FALSE_LINES)
    slow = _decimated(recording, rate)
    spectra = spectral_matrix(slow.select(plan.channels), segment_length=plan.spectrum_segment)
    motion, edited_spectra = detrend(slow.select(plan.channels)), None
    if settings.lifter is not None:
        motion = _decimated(edit(centred, settings.lifter), rate)
        edited_spectra = spectral_matrix(motion, segment_length=plan.spectrum_segment)
    if settings.band is not None and settings.band[0] > 0:
        motion = band_pass(motion, settings.band[0] / 2, None)
    return Prepared(scale(motion, plan.factors), spectra, edited_spectra, harmonics)


def _decimated(recording: Recording, rate: float) -> Recording:
    """Return the recording at the rate."""
    return recording if rate >= recording.sampling_rate else decimate(recording, rate)
