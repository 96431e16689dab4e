"""Ride comfort: frequency weightings, ISO 2631-1, EN 12299, Sperling, EN 14363, travel of suspensions."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy import ndimage
from scipy.fft import next_fast_len

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_one_of
from sprung._display import counted
from sprung.errors import DataError
from sprung.recording import Channel, Recording, each_recording

__all__ = [
    "STANDARDS",
    "WEIGHTINGS",
    "Ride",
    "RidePoint",
    "Travel",
    "Weighting",
    "assess_ride",
    "mean_comfort_in_words",
    "response_of",
    "weighted",
]


@dataclass(frozen=True, slots=True)
class Weighting:
    """Corner frequencies [Hz] and quality factors of a weighting; None: that step is left out.

    Parameters
    ----------
    low, high
        Band limits, second-order Butterworth filters.
    transition
        Zero, pole and quality factor of the transition from acceleration to velocity.
    step
        Zero, its quality factor, pole and its quality factor of the upward step.
    gain
        Factor.
    """

    low: float
    high: float
    transition: tuple[float | None, float, float] | None = None
    step: tuple[float, float, float, float] | None = None
    gain: float = 1.0

    def response(self, frequencies: Real) -> Complex:
        """Return the complex response at frequencies [Hz]."""
        s = 2j * np.pi * np.asarray(frequencies, dtype=np.float64)
        w1, w2 = 2 * np.pi * self.low, 2 * np.pi * self.high
        high_pass = s**2 / (s**2 + np.sqrt(2) * w1 * s + w1**2)
        total = self.gain * high_pass * w2**2 / (s**2 + np.sqrt(2) * w2 * s + w2**2)
        if self.transition is not None:
            zero, pole, quality = self.transition
            w4 = 2 * np.pi * pole
            numerator = 1.0 if zero is None else 1 + s / (2 * np.pi * zero)
            total = total * numerator * w4**2 / (s**2 + w4 / quality * s + w4**2)
        if self.step is not None:
            zero, q5, pole, q6 = self.step
            w5, w6 = 2 * np.pi * zero, 2 * np.pi * pole
            total = total * (s**2 + w5 / q5 * s + w5**2) / (s**2 + w6 / q6 * s + w6**2)
        return np.asarray(total, dtype=np.complex128)


class _Weightings(Enum):
    """Weightings of ISO 2631-1 and ISO 2631-4 (Wb), with the constants of ISO 8041-1, table 3."""

    Wk = Weighting(0.4, 100.0, (12.5, 12.5, 0.63), (2.37, 0.91, 3.35, 0.91))
    Wd = Weighting(0.4, 100.0, (2.0, 2.0, 0.63))
    Wf = Weighting(0.08, 0.63, (None, 0.25, 0.86), (0.0625, 0.80, 0.1, 0.80))
    Wc = Weighting(0.4, 100.0, (8.0, 8.0, 0.63))
    We = Weighting(0.4, 100.0, (1.0, 1.0, 0.63))
    Wj = Weighting(0.4, 100.0, None, (3.75, 0.91, 5.32, 0.91))
    Wb = Weighting(0.4, 100.0, (16.0, 16.0, 0.55), (2.5, 0.90, 4.0, 0.95), gain=1.024)


#: Weightings by name.
WEIGHTINGS = MappingProxyType({weighting.name: weighting.value for weighting in _Weightings})


def weighted(samples: Real, *, sampling_rate: float, weighting: str) -> Real:
    """Return weighted accelerations.

    Parameters
    ----------
    samples
        Accelerations without missing values, time last.
    sampling_rate
        Sampling rate [Hz], above 0.
    weighting
        A key of `WEIGHTINGS`, or "Sperling vertical", "Sperling lateral".

    Returns
    -------
    ndarray
        Shape of `samples`.

    Notes
    -----
    The response is exact at every frequency: the transform of the padded samples is multiplied by it. A bilinear filter
    would be wrong by several per cent near half the sampling rate.

    References
    ----------
    ISO 2631-1:1997, annex A; ISO 8041-1:2017, 5.6.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(4000) / 200
    >>> heard = weighted(np.sin(2 * np.pi * 5 * time), sampling_rate=200.0, weighting="Wk")
    >>> round(float(np.abs(heard[2000:]).max()), 2)
    1.04
    """
    check_number("sampling_rate", sampling_rate, above=0)
    n = samples.shape[-1]
    padded = next_fast_len(n + round(20 * sampling_rate), real=True)
    frequencies = np.asarray(np.fft.rfftfreq(padded, 1 / sampling_rate), dtype=np.float64)
    spectrum = np.fft.rfft(samples - samples.mean(axis=-1, keepdims=True), padded)
    spectrum = np.multiply(spectrum, response_of(weighting, frequencies))
    return np.asarray(np.fft.irfft(spectrum, padded)[..., :n])


def response_of(weighting: str, frequencies: Real) -> Complex:
    """Return the response of a weighting by name at frequencies [Hz]."""
    check_one_of("weighting", weighting, (*WEIGHTINGS, *SPERLING))
    if weighting in WEIGHTINGS:
        return WEIGHTINGS[weighting].response(frequencies)
    return np.asarray(SPERLING[weighting] * _sperling(frequencies), dtype=np.complex128)


#: Factor of Sperling's weighting by direction.
SPERLING = MappingProxyType({"Sperling vertical": 0.588, "Sperling lateral": 0.737})


def _sperling(frequencies: Real) -> Real:
    """Return Sperling's weighting without its factor, for accelerations in m/s^2."""
    f = np.asarray(frequencies, dtype=np.float64)
    above = 1.911 * f**2 + (0.25 * f**2) ** 2
    below = (1 - 0.277 * f**2) ** 2 + (1.563 * f - 0.0368 * f**3) ** 2
    return np.asarray(np.sqrt(above / below))


Axis = Literal["x", "y", "z"]
_AXES: tuple[Axis, ...] = ("x", "y", "z")
Standard = Literal["iso2631", "en12299", "sperling", "en14363"]
#: Standards by name.
STANDARDS: tuple[Standard, ...] = ("iso2631", "en12299", "sperling", "en14363")


@dataclass(frozen=True, slots=True)
class _Settings:
    """Numbers of the standards."""

    running: float = 1.0  # integration time of the running RMS [s]
    block: float = 5.0  # length of a block of EN 12299 [s]
    stability_length: float = 100.0  # distance over which the running RMS of EN 14363 is taken [m]
    stability_band: float = 2.0  # half width of its band around the peak [Hz]
    peaks: tuple[float, float] = (3.0, 9.0)  # where that peak may lie [Hz]
    heaviest: float = 50e3  # largest mass of a bogie; at 60 t its limit would be 0 [kg]
    bins: int = 30  # of histograms
    comfort: tuple[tuple[float, float, str], ...] = (  # overlapping ranges of ISO 2631-1 [m/s^2]
        (0.0, 0.315, "not uncomfortable"),
        (0.315, 0.63, "a little uncomfortable"),
        (0.5, 1.0, "fairly uncomfortable"),
        (0.8, 1.6, "uncomfortable"),
        (1.25, 2.5, "very uncomfortable"),
        (2.0, np.inf, "extremely uncomfortable"),
    )
    sperling: tuple[tuple[float, str], ...] = (  # words with the end of their range
        (1.0, "not noticeable"),
        (2.0, "just noticeable"),
        (2.5, "clearly noticeable"),
        (3.0, "more pronounced but not unpleasant"),
        (3.25, "strong, irregular, but still tolerable"),
        (3.5, "very irregular"),
        (4.0, "extremely irregular, unpleasant"),
        (np.inf, "extremely unpleasant"),
    )
    continuous: tuple[tuple[float, str], ...] = (  # the same of the 5-s values of EN 12299 [m/s^2]
        (0.2, "very comfortable"),
        (0.3, "comfortable"),
        (0.4, "medium"),
        (np.inf, "less comfortable"),
    )
    mean: tuple[tuple[float, str], ...] = (  # and of its mean comfort N_MV
        (1.5, "very comfortable"),
        (2.5, "comfortable"),
        (3.5, "medium"),
        (4.5, "uncomfortable"),
        (np.inf, "very uncomfortable"),
    )


_SETTINGS = _Settings()


@dataclass(frozen=True, slots=True)
class RidePoint:
    """Vibration at one place and axis by one standard.

    Parameters
    ----------
    channel, axis
        Name of the channel and its axis, "x", "y" or "z".
    standard, weighting
        Standard, and frequency weighting such as "Wk".
    rms
        Weighted RMS [m/s^2].
    mtvv
        Maximum transient vibration value, the largest running RMS over 1 s [m/s^2].
    vdv
        Vibration dose value [m/s^1.75].
    crest_factor
        Largest weighted acceleration over the RMS.
    value
        Value that the rating is about: RMS of ISO 2631-1; 95 % of the 5-s values of EN 12299 [m/s^2]; Wz of Sperling;
        largest running RMS of EN 14363 [m/s^2].
    rating
        The standard's words; None where it has none for this axis.
    n_exceedances
        Number of times that the running RMS of EN 14363 rose above its limit; None where that is not known.
    """

    channel: str
    axis: Axis
    standard: str
    weighting: str
    rms: float
    mtvv: float
    vdv: float
    crest_factor: float
    value: float
    rating: str | None
    n_exceedances: int | None = None


@dataclass(frozen=True, slots=True)
class Histogram:
    """Share of the time in bins of equal width.

    Parameters
    ----------
    edges
        Ends of the bins, rising; one more than there are bins.
    shares
        Share of the time in each bin; they add up to 1.
    """

    edges: tuple[float, ...]
    shares: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Travel:
    """Use of the travel of one suspension.

    Parameters
    ----------
    channel
        Name of the channel.
    lowest, highest
        Smallest and largest travel [m], positive in extension.
    share_used
        99.8 % of the travel over all of it that is available; NaN where this is not known.
    n_bottomed
        Number of times the travel reached the available end.
    quantiles
        Travel at 5, 25, 50, 75 and 95 % of the time [m].
    rebound_speed, bump_speed
        95 % of the speeds in extension and compression [m/s].
    travel_histogram, speed_histogram
        Time over the travel [m], and over its speed [m/s], which is positive in rebound and negative in bump.
    """

    channel: str
    lowest: float
    highest: float
    share_used: float
    n_bottomed: int
    quantiles: tuple[float, ...]
    rebound_speed: float
    bump_speed: float
    travel_histogram: Histogram
    speed_histogram: Histogram


@dataclass(frozen=True, slots=True)
class Ride:
    """Ride of a vehicle.

    Parameters
    ----------
    points
        Vibration by channel and standard.
    travel
        Use of the suspensions' travel.
    mean_comfort
        N_MV of EN 12299 by the place of three axes; None without vertical and two horizontal channels at one place.
    notes
        Limits, one sentence each.
    """

    points: tuple[RidePoint, ...]
    travel: tuple[Travel, ...]
    mean_comfort: float | None
    notes: tuple[str, ...]


def assess_ride(
    recordings: Recording | Sequence[Recording],
    *,
    standards: Sequence[Standard] = ("iso2631",),
    channels: Sequence[str] | None = None,
    available_travel: float | None = None,
    bogie_mass: float | None = None,
) -> Ride:
    """Return the ride of a vehicle by standards.

    Parameters
    ----------
    recordings
        Recordings of one condition in SI units; parts without gaps are joined.
    standards
        "iso2631" (ISO 2631-1, seated, comfort), "en12299" (floor), "sperling", "en14363" (lateral, of bogie frames).
    channels
        Accelerations and travel to judge; None: all of them.
    available_travel
        Travel of a suspension between its stops [m], above 0; None: not known.
    bogie_mass
        Mass of the bogie with its wheelsets [kg], above 0 and up to 50 t, for the limit of EN 14363; None: not judged.

    Returns
    -------
    Ride

    Raises
    ------
    DataError
        If no channel is an acceleration or a displacement, or the recordings are too short.
    ParameterError
        If a standard is unknown.

    Notes
    -----
    Axes follow from the direction of a channel, or the last letter of its name, and are vertical without either.
    ISO 2631-1: Wk vertical, Wd horizontal; MTVV by a running RMS over 1 s, VDV = (integral of a_w^4)^(1/4). A crest
    factor above 9, MTVV above 1.5 RMS, or VDV above 1.75 RMS T^(1/4) mean that RMS alone understates the vibration.
    EN 12299: 95 % of RMS over blocks of 5 s, Wb vertical, Wd horizontal; N_MV = 6 sqrt(a_x^2 + a_y^2 + a_z^2).
    Sperling: Wz = 4.42 a_w^0.3. EN 14363: RMS over 100 m (1 s without the speed) in 2 Hz to either side of the largest
    peak from 3 to 9 Hz; its limit is (12 - m / 5) / 2 m/s^2 with the mass of the bogie m in t.

    References
    ----------
    ISO 2631-1:1997 and Amd 1:2010. EN 12299:2009. C. Sperling, C. Betzhold, Beitrag zur Beurteilung des Fahrkomforts in
    Schienenfahrzeugen, Glasers Annalen 80 (1956) 314-320. EN 14363:2016, annex on instability.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> shaking = 0.5 * np.sqrt(2) * np.sin(2 * np.pi * 5 * np.arange(12000) / 200)
    >>> seat = Recording(shaking[None], 200.0, (Channel("seat_z", "acceleration", direction=(0.0, 0.0, 1.0)),))
    >>> point = assess_ride(seat).points[0]
    >>> point.weighting, round(point.rms, 2), point.rating
    ('Wk', 0.52, 'a little to fairly uncomfortable')
    """
    if bogie_mass is not None:
        check_number("bogie_mass", bogie_mass, above=0, at_most=_SETTINGS.heaviest)
    for standard in standards:
        check_one_of("standard", standard, STANDARDS)
    parts = [
        record.part(stretch.start, stretch.stop)
        for record in each_recording(recordings)
        for stretch in record.stretches()
    ]
    first = max(parts, key=lambda part: part.n_samples)
    names = list(first.names if channels is None else channels)
    judged = [first.channels[first.index(name)] for name in names]
    accelerations = [channel for channel in judged if channel.quantity == "acceleration"]
    displacements = [channel for channel in judged if channel.quantity == "displacement"]
    if not accelerations and not displacements:
        raise DataError("no channel is an acceleration or a travel: name the channels, and state their units")
    long = [part for part in parts if part.duration >= _SETTINGS.block]
    if not long:
        raise DataError(f"no part without a gap is {_SETTINGS.block:g} s long: give a longer recording")
    points = [
        point
        for standard in standards
        for channel in accelerations
        if (point := _point(long, channel, standard, bogie_mass)) is not None
    ]
    notes = _shock_notes(points, sum(part.duration for part in long))
    return Ride(
        tuple(points),
        tuple(_travel(long, channel, available_travel) for channel in displacements),
        _mean_comfort(points) if "en12299" in standards else None,
        tuple(notes),
    )


def axis_of(channel: Channel) -> Axis:
    """Return the axis of a channel, "x", "y" or "z"."""
    if channel.direction is not None:
        return _AXES[int(np.argmax(np.abs(channel.direction)))]
    ending = channel.name[-2:].lower()
    return next((axis for axis in _AXES if ending in {f"_{axis}", f"-{axis}", f" {axis}"}), "z")


def _point(
    parts: Sequence[Recording], channel: Channel, standard: Standard, bogie_mass: float | None
) -> RidePoint | None:
    """Return the vibration of a channel by a standard; None where it does not concern the axis."""
    axis = axis_of(channel)
    if standard == "en14363":
        return _stability(parts, channel, bogie_mass) if axis == "y" else None
    weighting = {
        "iso2631": "Wk" if axis == "z" else "Wd",
        "en12299": "Wb" if axis == "z" else "Wd",
        "sperling": "Sperling vertical" if axis == "z" else "Sperling lateral",
    }[standard]
    rate = parts[0].sampling_rate
    rating: str | None
    pieces = [
        weighted(part.samples[part.index(channel.name)], sampling_rate=rate, weighting=weighting) for part in parts
    ]
    values = np.concatenate(pieces)
    rms = float(np.sqrt(np.mean(values**2)))
    if standard == "iso2631":
        value, rating = rms, _comfort(rms)
    elif standard == "sperling":
        value = 4.42 * rms**0.3
        rating = _words(value, _SETTINGS.sperling)
    else:
        value = _ninety_five(pieces, rate)
        rating = _words(value, _SETTINGS.continuous) if axis != "x" else None
    return RidePoint(channel.name, axis, standard, weighting, rms, *_peaks(pieces, rms, rate), value, rating)


def _peaks(pieces: Sequence[Real], rms: float, rate: float) -> tuple[float, float, float]:
    """Return MTVV, VDV and crest factor."""
    n = max(1, round(_SETTINGS.running * rate))
    running = [np.sqrt(np.maximum(ndimage.uniform_filter1d(piece**2, n, mode="constant"), 0.0)) for piece in pieces]
    dose = float(sum(np.sum(piece**4) for piece in pieces) / rate) ** 0.25
    crest = max(float(np.abs(piece).max()) for piece in pieces) / max(rms, 1e-300)
    return max(float(each.max()) for each in running), dose, crest


def _ninety_five(pieces: Sequence[Real], rate: float) -> float:
    """Return 95 % of the RMS over blocks."""
    n = round(_SETTINGS.block * rate)
    blocks = np.concatenate([piece[: piece.size // n * n].reshape(-1, n) for piece in pieces])
    return float(np.quantile(np.sqrt(np.mean(blocks**2, axis=1)), 0.95))


def _stability(parts: Sequence[Recording], channel: Channel, bogie_mass: float | None) -> RidePoint:
    """Return the running RMS of a lateral acceleration around its largest peak, and how often it exceeds the limit."""
    rate = parts[0].sampling_rate
    rows = [part.samples[part.index(channel.name)] for part in parts]
    longest = max(rows, key=len)
    frequencies = np.fft.rfftfreq(longest.size, 1 / rate)
    spectrum = np.abs(np.fft.rfft(longest - longest.mean())) ** 2
    low, high = _SETTINGS.peaks
    smooth = ndimage.gaussian_filter1d(spectrum, 0.2 * longest.size / rate)
    peak = float(frequencies[np.argmax(np.where((frequencies >= low) & (frequencies <= high), smooth, 0.0))])
    pieces = []
    for row in rows:
        transform = np.fft.rfft(row - row.mean())
        inside = np.abs(np.fft.rfftfreq(row.size, 1 / rate) - peak) <= _SETTINGS.stability_band
        pieces.append(np.fft.irfft(transform * inside, row.size))
    speeds = [part.samples[k] for part in parts for k, each in enumerate(part.channels) if each.quantity == "speed"]
    mean = float(np.mean([np.mean(speed) for speed in speeds])) if speeds else _SETTINGS.stability_length
    n = max(1, round(_SETTINGS.stability_length / max(mean, 1.0) * rate))
    levels = [np.sqrt(np.maximum(ndimage.uniform_filter1d(piece**2, n), 0.0)) for piece in pieces]
    running = max(float(level.max()) for level in levels)
    words, count = None, None
    if bogie_mass is not None:
        limit = (12 - bogie_mass / 5000) / 2
        count = sum(int(np.count_nonzero(np.diff(level > limit, prepend=False) & (level > limit))) for level in levels)
        words = f"{'unstable' if count else 'stable'}: {counted(count, 'time')} above {limit:.3g} m/s²"
    rms = float(np.sqrt(np.mean(np.concatenate(pieces) ** 2)))
    name = f"{max(peak - _SETTINGS.stability_band, 0):.1f} to {peak + _SETTINGS.stability_band:.1f} Hz"
    return RidePoint(channel.name, "y", "en14363", name, rms, *_peaks(pieces, rms, rate), running, words, count)


def _travel(parts: Sequence[Recording], channel: Channel, available: float | None) -> Travel:
    """Return the use of the travel of a suspension."""
    rate = parts[0].sampling_rate
    rows = [part.samples[part.index(channel.name)] for part in parts]
    values = np.concatenate(rows)
    speeds = np.concatenate([np.gradient(row, 1 / rate) for row in rows])
    low, high = float(values.min()), float(values.max())
    share, n_bottomed = float("nan"), 0
    if available is not None:
        check_number("available_travel", available, above=0)
        share = float(np.diff(np.quantile(values, [0.001, 0.999]))[0] / available)
        at_end = values <= high - 0.98 * available
        n_bottomed = int(np.count_nonzero(at_end[1:] & ~at_end[:-1]))
    rebound, bump = (
        float(np.quantile(each, 0.95)) if each.size else 0.0 for each in (speeds[speeds > 0], -speeds[speeds < 0])
    )
    return Travel(
        channel.name,
        low,
        high,
        share,
        n_bottomed,
        tuple(np.quantile(values, [0.05, 0.25, 0.5, 0.75, 0.95]).tolist()),
        rebound,
        bump,
        _histogram(values),
        _histogram(speeds),
    )


def _histogram(values: Real) -> Histogram:
    """Return the shares of values in bins over 99.8 % of them; the others are in the first and last bin."""
    low, high = np.quantile(values, [0.001, 0.999])
    counts, edges = np.histogram(np.clip(values, low, high), bins=_SETTINGS.bins)
    return Histogram(tuple(edges.tolist()), tuple((counts / values.size).tolist()))


def _mean_comfort(points: Sequence[RidePoint]) -> float | None:
    """Return N_MV of the first channel of each axis; None without all three."""
    by_axis = {point.axis: point.value for point in reversed(points) if point.standard == "en12299"}
    return 6 * float(np.sqrt(sum(value**2 for value in by_axis.values()))) if len(by_axis) == 3 else None


def _shock_notes(points: Sequence[RidePoint], duration: float) -> list[str]:
    """Return a note on the channels whose RMS understates shocks or changes of the vibration."""
    names = [
        point.channel
        for point in points
        if point.standard == "iso2631"
        and (point.crest_factor > 9 or point.mtvv > 1.5 * point.rms or point.vdv > 1.75 * point.rms * duration**0.25)
    ]
    if not names:
        return []
    return [f"{', '.join(names)}: shocks or changes of the vibration that RMS understates: see MTVV and VDV"]


def _comfort(value: float) -> str:
    """Return the words of ISO 2631-1 for an RMS; those of two overlapping ranges as one."""
    words = [word for low, high, word in _SETTINGS.comfort if low <= value < high]
    if len(words) < 2:
        return words[-1]
    return f"{words[0].removesuffix('uncomfortable').strip() or words[0]} to {words[-1]}"


def _words(value: float, ends: Sequence[tuple[float, str]]) -> str:
    """Return the words for a value, given those of each range with its end."""
    return next(word for end, word in ends if value < end)


def mean_comfort_in_words(value: float) -> str:
    """Return the words of EN 12299 for a mean comfort."""
    return _words(value, _SETTINGS.mean)
