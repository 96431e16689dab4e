"""Ride comfort: frequency weightings, ISO 2631-1, EN 12299, Sperling, EN 14363, travel of suspensions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
import scipy
from scipy.fft import next_fast_len

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_one_of
from sprung._display import counted
from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording, each_recording

__all__ = [
    "STANDARDS",
    "WEIGHTINGS",
    "Ride",
    "RidePoint",
    "Travel",
    "Weighting",
    "assess_ride",
    "comfort_in_words",
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


def weighted(samples: Real, *, sampling_rate: float, weighting: str, are_velocities: bool = False) -> Real:
    """Return weighted accelerations.

    Parameters
    ----------
    samples
        Accelerations without missing values, time last.
    sampling_rate
        Sampling rate [Hz], above 0.
    weighting
        A key of `WEIGHTINGS`, or "Sperling vertical", "Sperling lateral".
    are_velocities
        Whether the samples are velocities, such as angular ones, whose derivative is weighted.

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
    if are_velocities:
        spectrum = 2j * np.pi * frequencies * spectrum
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
Weight = Literal["Wk", "Wd", "Wf", "Wc", "We", "Wj"]
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
    doses: tuple[float, float] = (8.5, 17.0)  # VDV of a day between which ISO 2631-1, B.3.1, advises caution
    on_health: float = 1.4  # factor of horizontal vibration on health (7.2.3); on comfort it is 1
    of_sick: float = 1 / 3  # per cent of people who may vomit, per m/s^1.5 of the motion sickness dose (annex D)
    of_rotation: tuple[float, ...] = (0.63, 0.4, 0.2)  # factors of rotation about x, y and z on comfort [m]
    of_back: float = 0.8  # factor of the backrest (8.2.2.1)
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
        Value that the rating is about: RMS of ISO 2631-1 times the factor of its axis, or the motion sickness dose
        [m/s^1.5]; 95 % of the 5-s values of EN 12299 [m/s^2]; Wz of Sperling; largest running RMS of EN 14363 [m/s^2].
    rating
        The standard's words; None where it has none for this axis.
    n_exceedances
        Number of times that the running RMS of EN 14363 rose above its limit; None where that is not known.
    health
        Hours a day of such vibration until ISO 2631-1 advises caution, and until risks are likely, in words; None by
        other standards and weightings.
    continuous
        Weighted RMS of each 5 s [m/s^2], the continuous comfort of EN 12299; parts without values are left out.
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
    health: str | None = None
    continuous: tuple[float, ...] = ()


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
    vibration_total
        The same of ISO 2631-1, the root of the sum of the squares [m/s^2].
    """

    points: tuple[RidePoint, ...]
    travel: tuple[Travel, ...]
    mean_comfort: float | None
    notes: tuple[str, ...]
    vibration_total: float | None = None


def assess_ride(
    recordings: Recording | Sequence[Recording],
    *,
    standards: Sequence[Standard] = ("iso2631",),
    channels: Sequence[str] | None = None,
    weighting: Weight | None = None,
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
    weighting
        Weighting of ISO 2631-1; None: Wk vertical and Wd horizontal, on a seat. "Wc": x on a backrest; "We": rotation
        [rad/s]; "Wj": under the head of a person who lies; "Wf": vertical, motion sickness.
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
        If no channel is one that the standards judge, or the recordings are too short.
    ParameterError
        If a standard or the weighting is unknown.

    Notes
    -----
    Axes follow from the direction of a channel, or the last letter of its name, and are vertical without either.
    ISO 2631-1: MTVV by a running RMS over 1 s, VDV = (integral of a_w^4)^(1/4). A crest
    factor above 9, MTVV above 1.5 RMS, or VDV above 1.75 RMS T^(1/4) mean that RMS alone understates the vibration.
    Comfort by the RMS, times 0.8 on a backrest, and 0.63, 0.4 and 0.2 m/rad for rotation about x, y and z. Health:
    the VDV, times 1.4 if horizontal, is 8.5 to 17 m/s^1.75 in a day where caution is advised. Motion sickness:
    RMS T^(1/2) / 3 per cent may vomit.
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
    >>> point.weighting, round(point.rms, 2), point.rating, point.health
    ('Wk', 0.52, 'a little to fairly uncomfortable', 'caution after 13 h a day')
    """
    if bogie_mass is not None:
        check_number("bogie_mass", bogie_mass, above=0, at_most=_SETTINGS.heaviest)
    for standard in standards:
        check_one_of("standard", standard, STANDARDS)
    if weighting is not None:
        check_one_of("weighting", weighting, tuple(_WEIGHTED))
        if "iso2631" not in standards:
            raise ParameterError(f"weighting {weighting!r} is of iso2631: leave it out, or judge by that standard")
    parts = [
        record.part(stretch.start, stretch.stop)
        for record in each_recording(recordings)
        for stretch in record.stretches()
    ]
    known: dict[str, Channel] = {}
    for channel in (channel for part in parts for channel in part.channels):
        known.setdefault(channel.name, channel)
    for name in channels or ():
        check_one_of("channel", name, tuple(known))
    judged = [channel for name, channel in known.items() if channels is None or name in channels]
    shaken = "angular_velocity" if weighting == "We" else "acceleration"
    moving = [channel for channel in judged if channel.quantity in {shaken, "displacement"}]
    if not moving:
        measured = ", ".join(f"{channel.name}: {channel.quantity}" for channel in judged)
        raise DataError(
            f"no channel is of {shaken.replace('_', ' ')} or travel ({measured}): give the vehicle file, whose sensors"
            " state it, or the units in the recording"
        )
    pieces = {channel.name: list(_pieces(parts, channel.name)) for channel in moving}
    if not any(pieces.values()):
        raise DataError(f"no part without a gap is {_SETTINGS.block:g} s long: give a longer recording")
    usable = [(channel, pieces[channel.name]) for channel in moving if pieces[channel.name]]
    points = [
        point
        for standard in standards
        for channel, own in usable
        if channel.quantity == shaken
        if (point := _point(own, channel, standard, weighting, bogie_mass)) is not None
    ]
    travel = [_travel(own, channel, available_travel) for channel, own in usable if channel.quantity == "displacement"]
    if not points and not travel:
        axes = ", ".join(f"{channel.name} is {axis_of(channel)}" for channel in moving)
        raise DataError(
            f"{weighting or standards[0]} judges none of these axes ({axes}): record the axis, or state the directions"
            " in the vehicle file"
        )
    return Ride(
        tuple(points),
        tuple(travel),
        None if (norm := _of_three_axes(points, "en12299")) is None else 6 * norm,
        tuple(_notes(parts, points, pieces)),
        _of_three_axes(points, "iso2631") if weighting is None else None,
    )


class _Piece(NamedTuple):
    """Values of a channel without a gap, their sampling rate [Hz], and the mean speed if it is known [m/s]."""

    values: Real
    rate: float
    speed: float | None

    @property
    def duration(self) -> float:
        return self.values.size / self.rate


def _pieces(parts: Sequence[Recording], name: str) -> Iterator[_Piece]:
    """Yield the values of a channel in pieces without a gap that are at least as long as a block."""
    for part in parts:
        if name not in part.names:
            continue
        row, rate = part.samples[part.index(name)], part.sampling_rate
        speeds = [part.samples[k] for k, each in enumerate(part.channels) if each.quantity == "speed"]
        speed = float(np.nanmean(speeds[0])) if speeds and np.isfinite(speeds[0]).any() else None
        ends = np.flatnonzero(np.diff(np.isfinite(row), prepend=False, append=False))
        for first, last in ends.reshape(-1, 2).tolist():
            if last - first >= _SETTINGS.block * rate:
                yield _Piece(row[first:last], rate, speed)


def axis_of(channel: Channel) -> Axis:
    """Return the axis of a channel, "x", "y" or "z"."""
    if channel.direction is not None:
        return _AXES[int(np.argmax(np.abs(channel.direction)))]
    ending = channel.name[-2:].lower()
    return next((axis for axis in _AXES if ending in {f"_{axis}", f"-{axis}", f" {axis}"}), "z")


#: Axes that each weighting of ISO 2631-1 is for.
_WEIGHTED = MappingProxyType({"Wk": "xyz", "Wd": "xyz", "Wf": "z", "Wc": "x", "We": "xyz", "Wj": "xyz"})


def _point(
    pieces: Sequence[_Piece], channel: Channel, standard: Standard, weighting: Weight | None, bogie_mass: float | None
) -> RidePoint | None:
    """Return the vibration of a channel by a standard; None where it does not concern the axis."""
    axis = axis_of(channel)
    if standard == "en14363":
        return _stability(pieces, channel, bogie_mass) if axis == "y" else None
    if standard == "iso2631" and weighting is not None and axis not in _WEIGHTED[weighting]:
        return None
    name = {
        "iso2631": weighting or ("Wk" if axis == "z" else "Wd"),
        "en12299": "Wb" if axis == "z" else "Wd",
        "sperling": "Sperling vertical" if axis == "z" else "Sperling lateral",
    }[standard]
    are_velocities = channel.quantity == "angular_velocity"
    shaken = [
        each._replace(
            values=weighted(each.values, sampling_rate=each.rate, weighting=name, are_velocities=are_velocities)
        )
        for each in pieces
    ]
    point = _measured(shaken, RidePoint(channel.name, axis, standard, name, *(float("nan"),) * 5, rating=None))
    if standard == "iso2631":
        return _by_iso2631(point, sum(each.duration for each in pieces))
    if standard == "sperling":
        value = 4.42 * point.rms**0.3
        return replace(point, value=value, rating=_words(value, _SETTINGS.sperling))
    value = float(np.quantile(point.continuous, 0.95))
    return replace(point, value=value, rating=_words(value, _SETTINGS.continuous) if axis != "x" else None)


def _measured(pieces: Sequence[_Piece], point: RidePoint) -> RidePoint:
    """Return a point with RMS, MTVV, VDV, crest factor and the RMS of each block of weighted accelerations."""
    duration = sum(each.duration for each in pieces)
    rms = float(np.sqrt(sum(np.sum(each.values**2) / each.rate for each in pieces) / duration))
    blocks = []
    for each in pieces:
        n = round(_SETTINGS.block * each.rate)
        rows = each.values[: each.values.size // n * n].reshape(-1, n)
        blocks += np.sqrt(np.mean(rows**2, axis=1)).tolist()
    return replace(
        point,
        rms=rms,
        mtvv=max(float(_running(each, _SETTINGS.running, mode="constant").max()) for each in pieces),
        vdv=float(sum(np.sum(each.values**4) / each.rate for each in pieces)) ** 0.25,
        crest_factor=max(float(np.abs(each.values).max()) for each in pieces) / max(rms, 1e-300),
        continuous=tuple(blocks),
    )


def _running(piece: _Piece, length: float, *, mode: Literal["constant", "reflect"] = "reflect") -> Real:
    """Return the running RMS over a length of time [s]."""
    n = max(1, round(length * piece.rate))
    return np.asarray(np.sqrt(np.maximum(scipy.ndimage.uniform_filter1d(piece.values**2, n, mode=mode), 0.0)))


def _by_iso2631(point: RidePoint, duration: float) -> RidePoint:
    """Return a point with what ISO 2631-1 says on comfort and health, or on motion sickness."""
    if point.weighting == "Wf":
        dose = point.rms * duration**0.5
        return replace(point, value=dose, rating=f"{_SETTINGS.of_sick * dose:.2g} % may vomit")
    factors = {"Wc": _SETTINGS.of_back, "We": _SETTINGS.of_rotation[_AXES.index(point.axis)]}
    value = point.rms * factors.get(point.weighting, 1.0)
    point = replace(point, value=value, rating=comfort_in_words(value))
    if point.weighting not in {"Wk", "Wd"}:
        return point
    caution, likely = (duration / 3600 * (limit / health_dose(point)) ** 4 for limit in _SETTINGS.doses)
    words = f"caution after {_time(caution)} a day" if caution < 24 else "no caution within a day"
    return replace(point, health=words + f", risk likely after {_time(likely)}" * (likely < 24))


def health_dose(point: RidePoint) -> float:
    """Return the vibration dose of a point for health by ISO 2631-1 [m/s^1.75]: that of horizontal axes counts more."""
    return max(point.vdv * (1.0 if point.axis == "z" else _SETTINGS.on_health), 1e-12)


def _time(hours: float) -> str:
    return f"{60 * hours:.2g} min" if hours < 1 else f"{hours:.2g} h"


def _stability(pieces: Sequence[_Piece], channel: Channel, bogie_mass: float | None) -> RidePoint:
    """Return the running RMS of a lateral acceleration around its largest peak, and how often it exceeds the limit."""
    longest = max(pieces, key=lambda each: each.duration)
    frequencies = np.fft.rfftfreq(longest.values.size, 1 / longest.rate)
    spectrum = np.abs(np.fft.rfft(longest.values - longest.values.mean())) ** 2
    low, high = _SETTINGS.peaks
    smooth = scipy.ndimage.gaussian_filter1d(spectrum, 0.2 * longest.duration)
    peak = float(frequencies[np.argmax(np.where((frequencies >= low) & (frequencies <= high), smooth, 0.0))])
    passed = []
    for each in pieces:
        transform = np.fft.rfft(each.values - each.values.mean())
        inside = np.abs(np.fft.rfftfreq(each.values.size, 1 / each.rate) - peak) <= _SETTINGS.stability_band
        passed.append(each._replace(values=np.fft.irfft(transform * inside, each.values.size)))
    length = _SETTINGS.stability_length
    levels = [_running(each, 1.0 if each.speed is None else length / max(each.speed, 1.0)) for each in passed]
    words, count = None, None
    if bogie_mass is not None:
        limit = (12 - bogie_mass / 5000) / 2
        count = sum(int(np.count_nonzero(np.diff(level > limit, prepend=False) & (level > limit))) for level in levels)
        words = f"{'unstable' if count else 'stable'}: {counted(count, 'time')} above {limit:.3g} m/s²"
    name = f"{max(peak - _SETTINGS.stability_band, 0):.1f} to {peak + _SETTINGS.stability_band:.1f} Hz"
    value = max(float(level.max()) for level in levels)
    point = RidePoint(channel.name, "y", "en14363", name, *(float("nan"),) * 4, value, words, count)
    return _measured(passed, point)


def _travel(pieces: Sequence[_Piece], channel: Channel, available: float | None) -> Travel:
    """Return the use of the travel of a suspension."""
    values = np.concatenate([each.values for each in pieces])
    speeds = np.concatenate([np.gradient(each.values, 1 / each.rate) for each in pieces])
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


def _of_three_axes(points: Sequence[RidePoint], standard: Standard) -> float | None:
    """Return the root of the sum of squares of the first channel of each axis; None without all three."""
    by_axis = {point.axis: point.value for point in reversed(points) if point.standard == standard}
    return float(np.sqrt(sum(value**2 for value in by_axis.values()))) if len(by_axis) == 3 else None


def _notes(
    parts: Sequence[Recording], points: Sequence[RidePoint], pieces: Mapping[str, Sequence[_Piece]]
) -> list[str]:
    """Return a note on channels whose RMS understates shocks, and on each without values for a tenth of the time."""
    covered = {name: sum(each.duration for each in own) for name, own in pieces.items()}
    total = sum(part.duration for part in parts)
    shocks = [
        point.channel
        for point in points
        if point.standard == "iso2631" and point.weighting != "Wf"
        if point.crest_factor > 9
        or point.mtvv > 1.5 * point.rms
        or point.vdv > 1.75 * point.rms * covered[point.channel] ** 0.25
    ]
    words = f"shocks or changes of the vibration, which RMS understates: see MTVV and VDV of {', '.join(shocks)}"
    gaps = [
        f"{name} has values for {own:.0f} of {total:.0f} s" if own else f"{name} has no values and is left out"
        for name, own in covered.items()
        if own < 0.9 * total
    ]
    return [words, *gaps] if shocks else gaps


def comfort_in_words(value: float) -> str:
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
