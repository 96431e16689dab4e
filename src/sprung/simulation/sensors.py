"""Imperfections of sensors and recorders: noise, resolution, range, and faults."""

import math
from collections.abc import Callable, Iterable
from functools import partial
from inspect import signature

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.excitation import noise
from sprung.recording import Recording

#: Imperfection of a sensor or recorder: a function of this module with its options bound by `functools.partial`. A
#: random one keeps its parameter `generator` free.
Imperfection = Callable[..., Recording]


def with_imperfections(
    recording: Recording, imperfections: Iterable[Imperfection], *, seed: int | np.random.Generator = 0
) -> Recording:
    """Return the recording with imperfections, one after the other.

    Parameters
    ----------
    recording
        Recording of ideal sensors.
    imperfections
        Functions that return a changed recording, in the order in which they act: those of the sensor before those
        of the recorder. Functions with a parameter `generator` draw from one common generator.
    seed
        Seed of the generator, or the generator itself.

    Examples
    --------
    >>> from functools import partial
    >>> from sprung.recording import Channel, Recording
    >>> run = Recording(np.ones((1, 4)), 100.0, (Channel("acc", "acceleration"),))
    >>> with_imperfections(run, [partial(clipped, channel="acc", limit=0.5)]).samples.tolist()
    [[0.5, 0.5, 0.5, 0.5]]
    """
    generator = np.random.default_rng(seed)
    for imperfection in imperfections:
        options = {"generator": generator} if "generator" in signature(imperfection).parameters else {}
        recording = imperfection(recording, **options)
    return recording


def with_noise(
    recording: Recording,
    *,
    snr: float,
    generator: np.random.Generator,
    band: tuple[float, float] | None = None,
) -> Recording:
    """Return the recording with sensor noise at a signal-to-noise ratio, independent between channels.

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

    Raises
    ------
    ParameterError
        If the ratio is not above 0, or the band is not valid.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([np.sin(np.arange(1000.0))], 100.0, (Channel("acc", "acceleration"),))
    >>> added = with_noise(run, snr=10.0, generator=np.random.default_rng(1)).samples - run.samples
    >>> round(float(np.linalg.norm(run.samples) / np.linalg.norm(added)), 6)
    10.0
    """
    check_number("snr", snr, above=0)
    added = noise(recording.samples.shape, band=band, sampling_rate=recording.sampling_rate, generator=generator)
    added[np.isnan(recording.samples)] = np.nan
    scale = _rms(recording.samples) / (snr * _rms(added))
    where = "white" if band is None else f"in {band[0]:g} to {band[1]:g} Hz"
    return recording.changed(
        f"added sensor noise, {where}, at SNR {snr:g}", samples=recording.samples + scale[:, None] * added
    )


def noisy(
    recording: Recording,
    *,
    standard_deviation: float,
    generator: np.random.Generator,
    channel: str | None = None,
    quantity: str = "acceleration",
    band: tuple[float, float] | None = None,
) -> Recording:
    """Return the recording with noise of a given size on one channel, or on all channels of a quantity.

    Parameters
    ----------
    recording
        Signals without the noise.
    standard_deviation
        Standard deviation of the noise, in the unit of the samples.
    generator
        Source of the randomness.
    channel
        Name of the channel; None: all channels of `quantity`.
    quantity
        Quantity of the channels if `channel` is None.
    band
        Lower and upper edge of the noise [Hz]; None for white noise.

    Raises
    ------
    ParameterError
        If the standard deviation is negative, or the channel does not exist.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording(np.zeros((1, 10_000)), 200.0, (Channel("acc", "acceleration"),))
    >>> print(f"{np.std(noisy(run, standard_deviation=0.3, generator=np.random.default_rng(1)).samples):.1f}")
    0.3
    """
    check_number("standard_deviation", standard_deviation, at_least=0)
    rows = _rows(recording, quantity) if channel is None else [recording.index(channel)]
    samples = recording.samples.copy()
    shape = (len(rows), recording.n_samples)
    added = noise(shape, band=band, sampling_rate=recording.sampling_rate, generator=generator)
    samples[rows] += standard_deviation * added
    return recording.changed(f"added noise of {standard_deviation:g}", samples=samples)


def quantised(recording: Recording, *, full_scale: float, bits: int = 16, quantity: str = "acceleration") -> Recording:
    """Return the recording with the resolution and range of a recorder.

    Parameters
    ----------
    recording
        Signals of unlimited resolution.
    full_scale
        Half the range, which is -full_scale to full_scale, in the unit of the samples.
    bits
        Number of bits, 1 to 32: steps of 2 full_scale / 2^bits.
    quantity
        Quantity of the quantised channels.

    Raises
    ------
    ParameterError
        If the range or the number of bits is out of range.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.1, 0.9, 5.0]], 100.0, (Channel("acc", "acceleration"),))
    >>> quantised(run, full_scale=2.0, bits=3).samples.tolist()
    [[0.0, 1.0, 1.5]]
    """
    check_number("full_scale", full_scale, above=0)
    check_number("bits", bits, at_least=1, at_most=32)
    rows = _rows(recording, quantity)
    step, highest = 2 * full_scale / 2**bits, 2 ** (bits - 1)
    samples = recording.samples.copy()
    samples[rows] = np.clip(np.rint(samples[rows] / step), -highest, highest - 1) * step
    return recording.changed(f"quantised to {bits} bits of +-{full_scale:g}", samples=samples)


def mems_accelerometers(
    *, noise_density: float = 1.5e-3, full_scale: float = 19.62, bits: int = 12
) -> tuple[Imperfection, ...]:
    """Return the noise, the resolution and the range of MEMS accelerometers, in the order in which they act.

    Parameters
    ----------
    noise_density
        One-sided spectral density of the white noise, its square root [m/s^2 / sqrt(Hz)]; 1.5e-3 are 150 ug/sqrt(Hz).
    full_scale
        Half the range [m/s^2].
    bits
        Number of bits over the range.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording(np.zeros((1, 10_000)), 200.0, (Channel("acc", "acceleration"),))
    >>> noise_only = with_imperfections(run, mems_accelerometers(noise_density=0.01, bits=16))
    >>> print(f"{np.std(noise_only.samples):.2f}")  # 0.01 times the square root of 100 Hz
    0.10
    """
    check_number("noise_density", noise_density, at_least=0)
    check_number("full_scale", full_scale, above=0)
    check_number("bits", bits, at_least=1, at_most=32)
    return (partial(_with_density, density=noise_density), partial(quantised, full_scale=full_scale, bits=bits))


def _with_density(recording: Recording, *, density: float, generator: np.random.Generator) -> Recording:
    """Return the recording with white noise of a density [1/sqrt(Hz)] on its accelerations."""
    standard_deviation = density * math.sqrt(recording.sampling_rate / 2)
    return noisy(recording, standard_deviation=standard_deviation, generator=generator)


def held(recording: Recording, *, channel: str, rate: float, delay: float = 0.0) -> Recording:
    """Return the recording with a channel that is updated at a rate, late, and held between updates, as speed by GPS.

    Parameters
    ----------
    recording
        Signals without gaps.
    channel
        Name of the channel.
    rate
        Updates per second [Hz], above 0; the first is at the first sample.
    delay
        Age of a value at its update [s], at least 0; before the first sample the channel is taken as constant.

    Raises
    ------
    ParameterError
        If the channel does not exist, or a number is out of range.

    Notes
    -----
    The mean delay is `delay` + 1 / (2 rate).

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([np.arange(6.0)], 10.0, (Channel("speed", "speed"),))
    >>> held(run, channel="speed", rate=5.0).samples.round(6).tolist()
    [[0.0, 0.0, 2.0, 2.0, 4.0, 4.0]]
    """
    check_number("rate of updates", rate, above=0)
    check_number("delay", delay, at_least=0)
    time = np.arange(recording.n_samples) / recording.sampling_rate
    # the smallest part of a sample is added, or an update on a sample would be lost to rounding
    updated = np.floor((time + 1e-6 / recording.sampling_rate) * rate) / rate
    values = np.interp(updated - delay, time, _row(recording, channel))
    return _changed(recording, channel, values, f"updated at {rate:g} Hz, {delay:g} s late")


def clipped(recording: Recording, *, channel: str, limit: float) -> Recording:
    """Return the recording with a channel clipped at +-limit, in the unit of the samples.

    Raises
    ------
    ParameterError
        If the channel does not exist, or the limit is not above 0.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.2, -3.0, 1.5]], 100.0, (Channel("acc", "acceleration"),))
    >>> clipped(run, channel="acc", limit=1.0).samples.tolist()
    [[0.2, -1.0, 1.0]]
    """
    check_number("limit", limit, above=0)
    return _changed(recording, channel, np.clip(_row(recording, channel), -limit, limit), f"clipped at +-{limit:g}")


def drifting(recording: Recording, *, channel: str, per_hour: float, generator: np.random.Generator) -> Recording:
    """Return the recording with a random walk on a channel, whose standard deviation after an hour is `per_hour`.

    Raises
    ------
    ParameterError
        If the channel does not exist, or the drift is out of range.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording(np.zeros((1, 3600)), 1.0, (Channel("acc", "acceleration"),))
    >>> generator = np.random.default_rng(1)
    >>> walks = [drifting(run, channel="acc", per_hour=0.5, generator=generator) for _ in range(500)]
    >>> print(f"{np.std([walk.samples[0, -1] for walk in walks]):.1f}")
    0.5
    """
    check_number("per_hour", per_hour, at_least=0)
    steps = generator.standard_normal(recording.n_samples)
    walk = np.cumsum(steps) * per_hour / math.sqrt(3600 * recording.sampling_rate)
    return _changed(recording, channel, _row(recording, channel) + walk, f"drift {per_hour:g} per hour")


def dead(recording: Recording, *, channel: str, onset: float = 0.0, value: float = 0.0) -> Recording:
    """Return the recording with a channel that reads a constant `value` from `onset` [s] on.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.2, -3.0, 1.5, 0.4]], 100.0, (Channel("acc", "acceleration"),))
    >>> dead(run, channel="acc", onset=0.02).samples.tolist()
    [[0.2, -3.0, 0.0, 0.0]]
    """
    samples = _row(recording, channel).copy()
    samples[_sample(recording, onset) :] = value
    return _changed(recording, channel, samples, f"dead from {onset:g} s on")


def stuck(recording: Recording, *, channel: str, onset: float) -> Recording:
    """Return the recording with a channel that stays at its last value from `onset` [s] on.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.2, -3.0, 1.5, 0.4]], 100.0, (Channel("acc", "acceleration"),))
    >>> stuck(run, channel="acc", onset=0.02).samples.tolist()
    [[0.2, -3.0, -3.0, -3.0]]
    """
    samples = _row(recording, channel).copy()
    first = _sample(recording, onset)
    samples[first:] = samples[max(first - 1, 0)]
    return _changed(recording, channel, samples, f"stuck from {onset:g} s on")


def scaled(recording: Recording, *, channel: str, factor: float) -> Recording:
    """Return the recording with the gain of a channel wrong by a factor.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.5, -3.0]], 100.0, (Channel("acc", "acceleration"),))
    >>> scaled(run, channel="acc", factor=1.5).samples.tolist()
    [[0.75, -4.5]]
    """
    return _changed(recording, channel, factor * _row(recording, channel), f"gain {factor:g}")


def inverted(recording: Recording, *, channel: str) -> Recording:
    """Return the recording with the sign of a channel reversed.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([[0.2, -3.0]], 100.0, (Channel("acc", "acceleration"),))
    >>> inverted(run, channel="acc").samples.tolist()
    [[-0.2, 3.0]]
    """
    return _changed(recording, channel, -_row(recording, channel), "inverted")


def swapped(recording: Recording, *, first: str, second: str) -> Recording:
    """Return the recording with the cables of two channels exchanged.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> channels = Channel("left", "acceleration"), Channel("right", "acceleration")
    >>> run = Recording([[1.0, 2.0], [3.0, 4.0]], 100.0, channels)
    >>> swapped(run, first="left", second="right").samples.tolist()
    [[3.0, 4.0], [1.0, 2.0]]
    """
    rows = [recording.index(first), recording.index(second)]
    samples = recording.samples.copy()
    samples[rows] = samples[rows[::-1]]
    return recording.changed(f"{first} and {second} swapped", samples=samples)


def spiking(
    recording: Recording, *, channel: str, rate: float, height: float, generator: np.random.Generator
) -> Recording:
    """Return the recording with spikes of one sample, up and down, at random times on a channel.

    Parameters
    ----------
    recording
        Signals without spikes.
    channel
        Name of the channel.
    rate
        Mean number of spikes per second, at most the sampling rate.
    height
        Height of a spike, in the unit of the samples.
    generator
        Source of the randomness.

    Raises
    ------
    ParameterError
        If the channel does not exist, or the rate is out of range.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording(np.zeros((1, 10_000)), 100.0, (Channel("acc", "acceleration"),))
    >>> spikes = spiking(run, channel="acc", rate=0.5, height=20.0, generator=np.random.default_rng(1))
    >>> sorted(set(spikes.samples[0].tolist()))
    [-20.0, 0.0, 20.0]
    """
    check_number("rate", rate, at_least=0, at_most=recording.sampling_rate)
    samples = _row(recording, channel).copy()
    places = generator.random(samples.size) < rate / recording.sampling_rate
    samples[places] += height * generator.choice([-1.0, 1.0], size=int(places.sum()))
    return _changed(recording, channel, samples, f"{rate:g} spikes per second")


def with_hum(
    recording: Recording, *, channel: str, amplitude: float, generator: np.random.Generator, frequency: float = 50.0
) -> Recording:
    """Return the recording with mains hum of a frequency [Hz] and a random phase on a channel.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording(np.zeros((1, 1000)), 500.0, (Channel("acc", "acceleration"),))
    >>> hum = with_hum(run, channel="acc", amplitude=0.2, generator=np.random.default_rng(1))
    >>> int(np.argmax(np.abs(np.fft.rfft(hum.samples[0])))) * 0.5  # Hz
    50.0
    """
    phase = 2 * np.pi * frequency * np.arange(recording.n_samples) / recording.sampling_rate
    hum = amplitude * np.sin(phase + generator.uniform(0, 2 * np.pi))
    return _changed(recording, channel, _row(recording, channel) + hum, f"hum of {frequency:g} Hz")


def delayed(recording: Recording, *, channel: str, delay: float) -> Recording:
    """Return the recording with a channel late by `delay` [s], negative for early, as wireless channels are.

    Notes
    -----
    Each stretch between gaps is shifted by the phase of its Fourier transform, continued by its odd reflection at
    both ends.

    Examples
    --------
    >>> from sprung.recording import Channel
    >>> run = Recording([np.sin(2 * np.pi * 2.0 * np.arange(1000) / 100.0)], 100.0, (Channel("acc", "acceleration"),))
    >>> late = delayed(run, channel="acc", delay=0.05)
    >>> np.allclose(late.samples[0, 200:800], run.samples[0, 195:795], atol=0.01)
    True
    """
    shifted = _row(recording, channel).copy()
    for stretch in recording.stretches():
        n = stretch.stop - stretch.start
        padded = np.pad(shifted[stretch], (n, n), mode="reflect", reflect_type="odd") if n > 1 else shifted[stretch]
        phase = np.exp(-2j * np.pi * np.fft.rfftfreq(padded.size, 1 / recording.sampling_rate) * delay)
        late = np.fft.irfft(np.fft.rfft(padded) * phase, n=padded.size)
        shifted[stretch] = late[(padded.size - n) // 2 :][:n]
    return _changed(recording, channel, shifted, f"delayed by {delay:g} s")


def _rows(recording: Recording, quantity: str) -> list[int]:
    """Return the rows of all channels of a quantity."""
    return [row for row, channel in enumerate(recording.channels) if channel.quantity == quantity]


def _row(recording: Recording, channel: str) -> Real:
    return recording.samples[recording.index(channel)]


def _changed(recording: Recording, channel: str, values: Real, what: str) -> Recording:
    """Return the recording with other samples of one channel, and a line in its history."""
    samples = recording.samples.copy()
    samples[recording.index(channel)] = values
    return recording.changed(f"{channel}: {what}", samples=samples)


def _sample(recording: Recording, time: float) -> int:
    """Return the index of the sample at a time [s], at most the number of samples."""
    check_number("onset", time, at_least=0)
    return min(round(time * recording.sampling_rate), recording.n_samples)


def _rms(samples: Real) -> Real:
    """Return the RMS of each channel over the samples that are not missing."""
    return np.sqrt(np.nanmean(samples**2, axis=1))
