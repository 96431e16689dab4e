"""Faults that show in a channel alone, or in comparison with others of its quantity.

A check takes channels and yields their faults.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.fft import dct

from sprung._arrays import Booleans, Real
from sprung.recording import Recording
from sprung.signals import data_faults
from sprung.signals.spectrum import SpectralMatrix, spectral_matrix
from sprung.vehicles.system import Outputs
from sprung.vehicles.window import Window, with_implied_values

#: Kind of a sensor whose channel the samples lack, which only the monitor takes for a fault.
MISSING = "missing"


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault of a channel.

    Parameters
    ----------
    channel
        Name of the channel.
    kind
        One of `KINDS`, or `MISSING`.
    detail
        Size of the fault, in words.
    """

    channel: str
    kind: str
    detail: str

    @property
    def statement(self) -> str:
        """Channel and kind, such as "acc_fl is wrong gain" or "acc_fl has hum"."""
        return f"{self.channel} {'has' if self.kind == 'hum' else 'is'} {self.kind.replace('_', ' ')}"


@dataclass(frozen=True, slots=True)
class ChannelLimits:
    """Limits of the checks of single channels."""

    #: Length of segments of spectra [s].
    segment: float = 2.048
    #: Smallest number of segments for checks of spectra.
    min_segments: int = 4
    #: Share of missing values up to which a channel's spectrum means something.
    missing: float = 0.5
    #: Jump and return within a sample that matters where other channels do not jump, in standard deviations.
    spike: float = 2.0
    #: Mains frequencies [Hz].
    mains: tuple[float, ...] = (50.0, 60.0)
    #: Power of a mains line over the median of its neighbourhood.
    hum: float = 12.0
    #: Lowest frequency of a line that is no motion of the body and no drift [Hz].
    lowest_line: float = 4.0
    #: Power of a line over that of the rest of its channel.
    line_of_channel: float = 0.5
    #: Its power over that of the same line in the loudest peer: no wheel or engine shakes one corner alone.
    line_of_peers: float = 30.0
    #: Half width of a line [Hz].
    line: float = 0.8
    #: Inner and outer half width of the neighbourhood of a line [Hz].
    neighbourhood: tuple[float, float] = (1.5, 8.0)
    #: Power of a channel's top band over that of its loudest peer.
    noise: float = 12.0
    #: Edges of the top band over half the sampling rate.
    top: tuple[float, float] = (0.6, 0.9)
    #: Standard deviation of a channel's mean over blocks, relative to its peers, over its own standard deviation.
    drift: float = 0.08
    #: The same over that of the peers.
    drift_of_peers: float = 2.5
    #: Common directions of the means of peers: along and across the vehicle.
    common_directions: int = 2
    #: Standard deviation of the mean over that of the channel, without peers: the slopes of the road move it too.
    drift_alone: float = 0.5
    #: Cosines over a window that count as slow.
    slow_terms: int = 4
    #: Smallest share of them in the variance of a drift: a random walk has 87 %, what a tilted accelerometer reads in
    #: bends 5 to 30 %.
    slow_share: float = 0.5
    #: Smallest length of a block [s].
    block: float = 5.0
    #: Largest number of blocks.
    max_blocks: int = 60
    #: Smallest number of blocks.
    min_blocks: int = 6


LIMITS = ChannelLimits()


@dataclass(frozen=True, eq=False)
class Channels:
    """Channels of motion of a window.

    Parameters
    ----------
    recording
        All samples of the channels, in SI units; missing values are NaN.
    is_moving
        Whether the vehicle moves at each sample, shape (samples,).
    carriers
        What each channel is on: "body", "wheel", "suspension" or another part.
    outputs
        Output matrices of the vehicle's structure, by which other channels imply missing values.
    has_impacts
        Whether joints of rails or rollers hit one wheelset after another, and so some sensors before others.
    """

    recording: Recording
    is_moving: Booleans
    carriers: tuple[str, ...]
    outputs: Outputs
    has_impacts: bool = False

    @classmethod
    def of(cls, window: Window) -> "Channels":
        """Return the channels of motion of a window; all samples count if the vehicle never moves."""
        recording = window.recording
        is_moving = np.ones(recording.n_samples, dtype=np.bool_)
        if window.speed is not None:
            is_fast = recording.samples[recording.index(window.speed)] > data_faults.MOVING
            is_moving = is_fast if is_fast.any() else is_moving
        sensors = {sensor.channel: sensor for sensor in window.vehicle.sensor}
        carriers = tuple(
            "suspension" if sensor.between else "wheel" if sensor.on.startswith("wheel") else sensor.on
            for sensor in (sensors[name] for name in window.outputs)
        )
        has_impacts = window.vehicle.kind in {"rail", "rig"}
        return cls(recording.select(window.outputs), is_moving, carriers, window.structure.outputs, has_impacts)

    def fault(self, row: int, kind: str, detail: str) -> SensorFault:
        """Return a fault of a channel."""
        return SensorFault(self.recording.names[row], kind, detail)

    def take(self, rows: Sequence[int]) -> "Channels":
        """Return only some rows."""
        names = [self.recording.names[row] for row in rows]
        carriers = tuple(self.carriers[row] for row in rows)
        return replace(self, recording=self.recording.select(names), carriers=carriers)

    @cached_property
    def rows_with_runs(self) -> list[int]:
        """Rows that may be stuck or clipped, or have missing values."""
        return [row for row, values in enumerate(self.recording.samples) if data_faults.has_runs(values)]

    @cached_property
    def breaks(self) -> list[int]:
        """Indices of the first samples after gaps."""
        return [gap.index for gap in self.recording.gaps]

    @cached_property
    def samples(self) -> Real:
        """Samples on the move, gaps closed, shape (channels, samples)."""
        return self.recording.samples if self.is_moving.all() else self.recording.samples[:, self.is_moving]

    @cached_property
    def complete(self) -> Real:
        """Samples on the move with missing values as others imply them or on a straight line, 0 without any values."""
        if np.isfinite(self.samples).all():
            return self.samples
        samples = with_implied_values(self.recording, self.outputs).samples[:, self.is_moving]
        is_known = np.isfinite(samples)
        complete = np.where(is_known, samples, 0.0)
        for values, known in zip(complete, is_known, strict=True):
            if known.any():
                values[~known] = np.interp(np.flatnonzero(~known), np.flatnonzero(known), values[known])
        return complete

    @cached_property
    def spectra(self) -> SpectralMatrix:
        """Spectral matrix of the samples on the move."""
        moving = replace(self.recording, samples=self.complete, gaps=())
        return spectral_matrix(moving, segment_length=LIMITS.segment)

    @property
    def has_spectra(self) -> bool:
        """Whether there are channels, and enough samples on the move for spectra."""
        enough = LIMITS.min_segments * LIMITS.segment * self.recording.sampling_rate
        return bool(self.carriers) and self.samples.shape[1] >= enough

    @cached_property
    def peers(self) -> list[list[int]]:
        """Rows of the other channels of the same quantity on the same kind of part, for each channel."""
        kinds = [(c.quantity, carrier) for c, carrier in zip(self.recording.channels, self.carriers, strict=True)]
        return [[k for k, kind in enumerate(kinds) if kind == own and k != row] for row, own in enumerate(kinds)]

    @cached_property
    def rests(self) -> dict[int, tuple[str, bool]]:
        """Rows that rest for a second or more on the move: where, in words, and whether at 0 to rounding."""
        rests, rate = {}, self.recording.sampling_rate
        for row in self.rows_with_runs:
            own, values = self.recording.samples[row], self.samples[row]
            rest = data_faults.rest_of(own, rate, breaks=self.breaks, is_moving=self.is_moving)
            if rest.is_fault(rate):
                share = 100 * rest.share
                how_long = "throughout" if share >= 99.5 else f"for {share:.0f} % of the time"
                is_zero = rest.is_at_zero(float(np.std(values[np.isfinite(values)])))
                rests[row] = f"stays at {rest.value:.4g} {how_long}", is_zero
        return rests


def dead(channels: Channels) -> Iterator[SensorFault]:
    """Find channels of which nearly all values are missing, or that rest at 0."""
    for row, values in enumerate(channels.samples):
        missing = data_faults.missing_share(values)
        rest, is_zero = channels.rests.get(row, ("", False))
        if missing > data_faults.DEAD_SHARE:
            yield channels.fault(row, "dead", f"{100 * missing:.0f} % of its values are missing")
        elif is_zero:
            yield channels.fault(row, "dead", rest)


def stuck(channels: Channels) -> Iterator[SensorFault]:
    """Find channels that rest at a value other than 0."""
    for row, (rest, is_zero) in channels.rests.items():
        if not is_zero:
            yield channels.fault(row, "stuck", rest)


def clipped(channels: Channels) -> Iterator[SensorFault]:
    """Find channels that are cut off at their limits, also while the vehicle stands."""
    for row in channels.rows_with_runs:
        share = data_faults.clipped_share(channels.recording.samples[row], breaks=channels.breaks)
        if share > data_faults.CLIPPED_SHARE:
            yield channels.fault(row, "clipped", f"{100 * share:.2g} % of its samples at the limit")


def spiking(channels: Channels) -> Iterator[SensorFault]:
    """Find single samples that jump and return while no other channel does."""
    samples = channels.complete
    every_bend, every_size = data_faults.bends(samples)
    for row, (bend, size) in enumerate(zip(every_bend, every_size, strict=True)):
        peers = channels.peers[row]
        # A pothole moves all sensors; without another of its quantity, only a jump that no body performs is a spike.
        places = np.flatnonzero((np.abs(size[1:-1]) > data_faults.SPIKE) & data_faults.returns(size)) + 1
        if not places.size:
            continue
        jump = np.abs(bend[places]) / samples[row].std()
        if peers:
            largest = np.abs(every_size[:, places][peers]).max(axis=0)
            is_alone = (largest < 0.5 * np.abs(size[places])) & (jump > LIMITS.spike)
        else:
            is_alone = jump > data_faults.NO_BODY
        if channels.has_impacts:
            is_alone &= data_faults.are_isolated(bend, places)
        count = data_faults.count_apart(places[is_alone])
        if count >= data_faults.FEWEST_SPIKES:
            yield channels.fault(row, "spiking", f"{count} spikes")


def hum(channels: Channels) -> Iterator[SensorFault]:
    """Find mains lines, and lines that dominate one channel and are not in two or more others."""
    power, frequencies = channels.spectra.densities, channels.spectra.frequencies
    nearest, farthest = LIMITS.neighbourhood
    for mains in (mains for mains in LIMITS.mains[::-1] if mains <= 0.95 * frequencies[-1]):
        distance = np.abs(frequencies - mains)
        around = (distance > nearest) & (distance < farthest)
        ratio = power[:, distance < LIMITS.line].max(axis=1) / np.median(power[:, around], axis=1)
        for row in np.flatnonzero(ratio > LIMITS.hum).tolist():
            yield channels.fault(row, "hum", f"{mains:.0f} Hz stands {10 * np.log10(ratio[row]):.0f} dB out")
    for row, spectrum in enumerate(power):
        place = frequencies[np.argmax(np.where(frequencies > LIMITS.lowest_line, spectrum, 0.0))]
        is_line = np.abs(frequencies - place) < LIMITS.line
        line, peers = spectrum[is_line].sum(), power[np.ix_(channels.peers[row], is_line)].sum(axis=1)
        dominates = line > LIMITS.line_of_channel * spectrum[~is_line].sum()
        if peers.size >= 2 and dominates and line > LIMITS.line_of_peers * peers.max():
            louder = 10 * np.log10(line / peers.max())
            yield channels.fault(row, "hum", f"{place:.3g} Hz is {louder:.0f} dB louder than in the others")


def noisy(channels: Channels) -> Iterator[SensorFault]:
    """Find channels whose top band is far above that of the others of their quantity, at least two."""
    power, frequencies = channels.spectra.densities, channels.spectra.frequencies
    low, high = (edge * frequencies[-1] for edge in LIMITS.top)
    noise = np.median(power[:, (frequencies > low) & (frequencies < high)], axis=1)
    for row, rows in enumerate(channels.peers):
        peers = noise[rows]
        if peers.size >= 2 and noise[row] > LIMITS.noise * peers.max():
            decibels = 10 * np.log10(noise[row] / np.median(peers))
            yield channels.fault(row, "noisy", f"noise {decibels:.0f} dB above the others")


def drifting(channels: Channels) -> Iterator[SensorFault]:
    """Find channels whose mean moves slowly by what two or more others of their quantity lack, or moves alone.

    Gravity and bends move the means of all tilted accelerometers in two common directions: along and across the body.
    """
    samples = channels.complete
    n_blocks = min(LIMITS.max_blocks, int(samples.shape[1] / (LIMITS.block * channels.recording.sampling_rate)))
    if n_blocks < LIMITS.min_blocks:
        return
    means = samples[:, : samples.shape[1] // n_blocks * n_blocks].reshape(len(samples), n_blocks, -1).mean(axis=2)
    means -= means.mean(axis=1, keepdims=True)
    peers = [rows if len(rows) >= 2 else [] for rows in channels.peers]
    away = means.copy()
    for row, rows in enumerate(peers):
        if rows:
            common = np.linalg.svd(means[rows], full_matrices=False)[2][: LIMITS.common_directions]
            away[row] -= means[row] @ common.T @ common
    power = dct(away, norm="ortho")[:, 1:] ** 2 / n_blocks
    wander, slow = np.sqrt(power.sum(axis=1)), np.sqrt(power[:, : LIMITS.slow_terms].sum(axis=1))
    for row, rows in enumerate(peers):
        least = (LIMITS.drift if rows else LIMITS.drift_alone) * samples[row].std()
        is_far = wander[row] > least and (not rows or wander[row] > LIMITS.drift_of_peers * np.median(wander[rows]))
        if is_far and slow[row] ** 2 > LIMITS.slow_share * wander[row] ** 2:
            yield channels.fault(row, "drifting", f"its mean wanders by {wander[row]:.2g} (std) in the window")


#: Checks in the order in which their faults count; spectra are computed for the channels without a fault of the first
#: group. Checks against the rigid body follow (`rigid_body_faults`).
CHECKS_OF_SAMPLES = (dead, stuck, clipped)
CHECKS_OF_SPECTRA = (spiking, hum, noisy, drifting)
#: Kinds of faults that all checks find, each a word of `SensorFault.kind`.
KINDS = (
    *("dead", "stuck", "clipped", "spiking", "hum", "noisy", "drifting"),
    *("inverted", "swapped", "wrong_gain", "time_shifted"),
)


def faults_by(
    checks: Iterable[Callable[[Channels], Iterator[SensorFault]]], channels: Channels
) -> dict[str, SensorFault]:
    """Return the first fault that checks find in each channel, by its name."""
    faults: dict[str, SensorFault] = {}
    for fault in (fault for check in checks for fault in check(channels)):
        faults.setdefault(fault.channel, fault)
    return faults
