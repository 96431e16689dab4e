"""What sensors and recorders do to signals: noise, resolution, range, and the ways in which they fail."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation import noise
from sprung.recording import Gap, Recording


class Imperfection(Protocol):
    """Something that a sensor or recorder does to a recording."""

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with it."""


def with_imperfections(
    recording: Recording, imperfections: Iterable[Imperfection], *, seed: int | np.random.Generator = 0
) -> Recording:
    """Return the recording with imperfections, one after the other.

    Parameters
    ----------
    recording
        As the vehicle moved.
    imperfections
        In the order in which they act: those of the sensor before those of the recorder.
    seed
        A seed, or a generator to draw from.
    """
    generator = np.random.default_rng(seed)
    for imperfection in imperfections:
        recording = imperfection.applied(recording, generator=generator)
    return recording


def with_noise(
    recording: Recording,
    *,
    snr: float,
    generator: np.random.Generator,
    band: tuple[float, float] | None = None,
) -> Recording:
    """Return the recording with sensor noise, independent between channels.

    Parameters
    ----------
    recording
        Signals without noise.
    snr
        RMS(signal) / RMS(noise) of every channel, an amplitude ratio, above 0; met exactly.
    generator
        Source of the randomness.
    band
        Lower and upper edge of the noise [Hz]; None for white noise. See `sprung.excitation.noise`.
    """
    check_number("snr", snr, above=0)
    added = noise(recording.samples.shape, band=band, sampling_rate=recording.sampling_rate, generator=generator)
    missing = np.isnan(recording.samples)
    added[missing] = np.nan
    scale = _rms(recording.samples) / (snr * _rms(added))
    where = "white" if band is None else f"in {band[0]:g} to {band[1]:g} Hz"
    return recording.changed(
        f"added sensor noise, {where}, at SNR {snr:g}", samples=recording.samples + scale[:, None] * added
    )


@dataclass(frozen=True, slots=True)
class Noisy:
    """Noise of a given size on one channel, or on all of a quantity.

    Parameters
    ----------
    standard_deviation
        In the unit of the samples.
    channel
        Name; None: all channels of `quantity`.
    quantity
        Of the channels that get it.
    band
        Lower and upper edge [Hz]; None: white.
    """

    standard_deviation: float
    channel: str | None = None
    quantity: str = "acceleration"
    band: tuple[float, float] | None = None

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the noise."""
        check_number("standard_deviation", self.standard_deviation, at_least=0)
        rows = _rows(recording, self.channel, self.quantity)
        samples = recording.samples.copy()
        shape = (len(rows), recording.n_samples)
        added = noise(shape, band=self.band, sampling_rate=recording.sampling_rate, generator=generator)
        samples[rows] += self.standard_deviation * added
        return recording.changed(f"added noise of {self.standard_deviation:g}", samples=samples)


@dataclass(frozen=True, slots=True)
class Quantised:
    """Resolution and range of a recorder.

    Parameters
    ----------
    full_scale
        Range is -full_scale to full_scale, in the unit of the samples.
    bits
        1 to 32: steps of 2 full_scale / 2^bits.
    quantity
        Of the channels that it applies to.
    """

    full_scale: float
    bits: int = 16
    quantity: str = "acceleration"

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording in steps, clipped at the ends of the range."""
        del generator  # rounding is no chance
        check_number("full_scale", self.full_scale, above=0)
        check_number("bits", self.bits, at_least=1, at_most=32)
        rows = _rows(recording, None, self.quantity)
        step = 2 * self.full_scale / 2**self.bits
        samples = recording.samples.copy()
        highest = 2 ** (self.bits - 1)
        samples[rows] = np.clip(np.rint(samples[rows] / step), -highest, highest - 1) * step
        return recording.changed(f"quantised to {self.bits} bits of +-{self.full_scale:g}", samples=samples)


@dataclass(frozen=True, slots=True)
class Clipped:
    """A channel that ends at a limit, in the unit of the samples."""

    channel: str
    limit: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the channel clipped."""
        del generator
        check_number("limit", self.limit, above=0)
        clipped = np.clip(_row(recording, self.channel), -self.limit, self.limit)
        return _changed(recording, self.channel, clipped, f"clipped at +-{self.limit:g}")


@dataclass(frozen=True, slots=True)
class Drifting:
    """A channel with a random walk, whose standard deviation after an hour is `per_hour`."""

    channel: str
    per_hour: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the drift."""
        check_number("per_hour", self.per_hour, at_least=0)
        steps = generator.standard_normal(recording.n_samples)
        walk = np.cumsum(steps) * self.per_hour / math.sqrt(3600 * recording.sampling_rate)
        return _changed(
            recording, self.channel, _row(recording, self.channel) + walk, f"drift {self.per_hour:g} per hour"
        )


@dataclass(frozen=True, slots=True)
class Dead:
    """A channel that reads a constant from `onset` [s] on, with no trace of motion."""

    channel: str
    onset: float = 0.0
    value: float = 0.0

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the channel dead."""
        del generator
        samples = _row(recording, self.channel).copy()
        samples[_onset(recording, self.onset) :] = self.value
        return _changed(recording, self.channel, samples, f"dead from {self.onset:g} s on")


@dataclass(frozen=True, slots=True)
class Stuck:
    """A channel that stays at its last value from `onset` [s] on."""

    channel: str
    onset: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the channel stuck."""
        del generator
        samples = _row(recording, self.channel).copy()
        first = _onset(recording, self.onset)
        samples[first:] = samples[max(first - 1, 0)]
        return _changed(recording, self.channel, samples, f"stuck from {self.onset:g} s on")


@dataclass(frozen=True, slots=True)
class Gained:
    """A channel whose gain is wrong by a factor."""

    channel: str
    factor: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the wrong gain."""
        del generator
        return _changed(recording, self.channel, self.factor * _row(recording, self.channel), f"gain {self.factor:g}")


@dataclass(frozen=True, slots=True)
class Inverted:
    """A channel with the wrong sign."""

    channel: str

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the channel inverted."""
        del generator
        return _changed(recording, self.channel, -_row(recording, self.channel), "inverted")


@dataclass(frozen=True, slots=True)
class Swapped:
    """Two channels whose cables are exchanged."""

    first: str
    second: str

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the samples of the two channels exchanged."""
        del generator
        rows = [recording.index(self.first), recording.index(self.second)]
        samples = recording.samples.copy()
        samples[rows] = samples[rows[::-1]]
        return recording.changed(f"{self.first} and {self.second} swapped", samples=samples)


@dataclass(frozen=True, slots=True)
class Spiking:
    """A channel with spikes of one sample at random times: `rate` per second, `height` in the unit of the samples."""

    channel: str
    rate: float
    height: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the spikes, up and down."""
        check_number("rate", self.rate, at_least=0, at_most=recording.sampling_rate)
        samples = _row(recording, self.channel).copy()
        places = generator.random(samples.size) < self.rate / recording.sampling_rate
        samples[places] += self.height * generator.choice([-1.0, 1.0], size=int(places.sum()))
        return _changed(recording, self.channel, samples, f"{self.rate:g} spikes per second")


@dataclass(frozen=True, slots=True)
class Hum:
    """A channel with mains hum of an amplitude and a frequency [Hz]."""

    channel: str
    amplitude: float
    frequency: float = 50.0

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the hum, at a random phase."""
        phase = 2 * np.pi * self.frequency * np.arange(recording.n_samples) / recording.sampling_rate
        hum = self.amplitude * np.sin(phase + generator.uniform(0, 2 * np.pi))
        return _changed(recording, self.channel, _row(recording, self.channel) + hum, f"hum of {self.frequency:g} Hz")


@dataclass(frozen=True, slots=True)
class Delayed:
    """A channel that comes late, as wireless ones do: `delay` in s, negative for early."""

    channel: str
    delay: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording with the channel moved in time, by its Fourier transform over each stretch."""
        del generator
        moved = _row(recording, self.channel).copy()
        for stretch in recording.stretches():
            n = stretch.stop - stretch.start
            padded = np.pad(moved[stretch], (n, n), mode="reflect", reflect_type="odd") if n > 1 else moved[stretch]
            phase = np.exp(-2j * np.pi * np.fft.rfftfreq(padded.size, 1 / recording.sampling_rate) * self.delay)
            shifted = np.fft.irfft(np.fft.rfft(padded) * phase, n=padded.size)
            moved[stretch] = shifted[(padded.size - n) // 2 :][:n]
        return _changed(recording, self.channel, moved, f"delayed by {self.delay:g} s")


@dataclass(frozen=True, slots=True)
class Jittered:
    """Samples of all channels at times that scatter by `standard_deviation` [s] about the even ones."""

    standard_deviation: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording as read at the jittered times, by a cubic spline over each stretch."""
        from scipy.interpolate import CubicSpline

        check_number("standard_deviation", self.standard_deviation, at_least=0)
        samples = recording.samples.copy()
        for stretch in recording.stretches():
            n = stretch.stop - stretch.start
            if n < 4:
                continue
            time = np.arange(n) + recording.sampling_rate * self.standard_deviation * generator.standard_normal(n)
            samples[:, stretch] = CubicSpline(np.arange(n), samples[:, stretch], axis=1)(np.clip(time, 0, n - 1))
        return recording.changed(f"jitter of {self.standard_deviation:g} s", samples=samples)


@dataclass(frozen=True, slots=True)
class WithGap:
    """Samples lost for `duration` [s] from `onset` [s] on, in all channels."""

    onset: float
    duration: float

    def applied(self, recording: Recording, *, generator: np.random.Generator) -> Recording:
        """Return the recording without the samples, with the gap marked."""
        del generator
        first, last = (_onset(recording, t) for t in (self.onset, self.onset + self.duration))
        if recording.gaps:
            raise ParameterError("the recording has gaps already: add them from the last to the first")
        if first == 0 or last >= recording.n_samples or last == first:
            raise ParameterError(f"a gap from {self.onset:g} s for {self.duration:g} s must lie inside the recording")
        samples = np.delete(recording.samples, slice(first, last), axis=1)
        gap = Gap(first, (last - first) / recording.sampling_rate)
        return recording.changed(f"lost {self.duration:g} s at {self.onset:g} s", samples=samples, gaps=(gap,))


def _rows(recording: Recording, channel: str | None, quantity: str) -> list[int]:
    """Rows of one channel, or of all channels of a quantity."""
    if channel is not None:
        return [recording.index(channel)]
    return [row for row, one in enumerate(recording.channels) if one.quantity == quantity]


def _row(recording: Recording, channel: str) -> Real:
    """Samples of a channel."""
    return recording.samples[recording.index(channel)]


def _changed(recording: Recording, channel: str, samples: Real, what: str) -> Recording:
    """Return the recording with other samples of one channel."""
    every = recording.samples.copy()
    every[recording.index(channel)] = samples
    return recording.changed(f"{channel}: {what}", samples=every)


def _onset(recording: Recording, time: float) -> int:
    """Sample at a time [s], within the recording."""
    check_number("onset", time, at_least=0)
    return min(round(time * recording.sampling_rate), recording.n_samples)


def _rms(samples: Real) -> Real:
    """RMS of each channel over the samples that are there."""
    return np.sqrt(np.nanmean(samples**2, axis=1))
