"""Faults that show in a channel alone, or in comparison with others of its quantity.

A check takes channels and returns the size of the fault in words, by row of the channels that have it.
"""

import numpy as np
from scipy.fft import dct

from sprung._arrays import Real
from sprung.diagnosis.sensors.channels import Channels
from sprung.signals.data_faults import (
    CLIPPED_SHARE,
    DEAD_SHARE,
    FEWEST_SPIKES,
    NO_BODY,
    SPIKE,
    Rest,
    bends,
    clipped_share,
    count_apart,
    missing_share,
    rest_of,
    returns,
)


def dead(channels: Channels) -> dict[int, str]:
    """Find channels of which nearly all values are missing, or that rest at 0."""
    details = {}
    for row, values in enumerate(channels.samples):
        missing = missing_share(values)
        rest = _rest(channels, row)
        if missing > DEAD_SHARE:
            details[row] = f"{100 * missing:.0f} % of its values are missing"
        elif rest is not None and _is_zero(rest, values):
            details[row] = _rest_in_words(rest)
    return details


def stuck(channels: Channels) -> dict[int, str]:
    """Find channels that rest at a value other than 0."""
    rests = {row: _rest(channels, row) for row in range(len(channels.samples))}
    return {
        row: _rest_in_words(rest)
        for row, rest in rests.items()
        if rest is not None and not _is_zero(rest, channels.samples[row])
    }


def _rest(channels: Channels, row: int) -> Rest | None:
    """Return the runs of one value of a second or more on the move; None if they are no fault."""
    recording = channels.recording
    if not channels.have_runs[row]:
        return None
    breaks = [gap.index for gap in recording.gaps]
    rest = rest_of(recording.samples[row], channels.sampling_rate, breaks=breaks, is_moving=channels.is_moving)
    return rest if rest.is_fault(channels.sampling_rate) else None


def _is_zero(rest: Rest, values: Real) -> bool:
    """Return whether a channel rests at 0 to rounding."""
    return rest.is_at_zero(float(np.std(values[np.isfinite(values)])))


def _rest_in_words(rest: Rest) -> str:
    share = 100 * rest.share
    return f"stays at {rest.value:.4g} {'throughout' if share >= 99.5 else f'for {share:.0f} % of the time'}"


def clipped(channels: Channels) -> dict[int, str]:
    """Find channels that are cut off at their limits, also while the vehicle stands."""
    breaks = [gap.index for gap in channels.recording.gaps]
    shares = [
        clipped_share(values, breaks=breaks) if has_runs else 0.0
        for values, has_runs in zip(channels.recording.samples, channels.have_runs, strict=True)
    ]
    return {
        row: f"{100 * share:.2g} % of its samples at the limit"
        for row, share in enumerate(shares)
        if share > CLIPPED_SHARE
    }


#: Jump and return within a sample that matters where other channels do not jump, in standard deviations of the samples.
_MATTERS = 2.0


def spiking(channels: Channels) -> dict[int, str]:
    """Find single samples that jump and return while no other channel does."""
    samples = channels.complete
    every_bend, every_size = bends(samples)
    details = {}
    for row, (bend, size) in enumerate(zip(every_bend, every_size, strict=True)):
        peers = channels.peers(row)
        # A pothole moves all sensors; without another of its quantity, only a jump that no body performs is a spike.
        places = np.flatnonzero((np.abs(size[1:-1]) > SPIKE) & returns(size)) + 1
        if not places.size:
            continue
        jump = np.abs(bend[places]) / samples[row].std()
        if peers:
            largest = np.abs(every_size[:, places][peers]).max(axis=0)
            is_alone = (largest < 0.5 * np.abs(size[places])) & (jump > _MATTERS)
        else:
            is_alone = jump > NO_BODY
        count = count_apart(places[is_alone])
        if count >= FEWEST_SPIKES:
            details[row] = f"{count} spikes"
    return details


#: Power of a mains line over the median of its neighbourhood.
_HUM = 12.0
#: Mains frequencies, half width of a line, and inner and outer half width of its neighbourhood [Hz].
_MAINS, _LINE, _NEIGHBOURHOOD = (50.0, 60.0), 0.8, (1.5, 8.0)


def hum(channels: Channels) -> dict[int, str]:
    """Find mains lines."""
    power, frequencies = channels.spectra.densities, channels.spectra.frequencies
    details = {}
    for mains in _MAINS:
        if mains > 0.95 * frequencies[-1]:
            continue
        distance = np.abs(frequencies - mains)
        around = (distance > _NEIGHBOURHOOD[0]) & (distance < _NEIGHBOURHOOD[1])
        ratio = power[:, distance < _LINE].max(axis=1) / np.median(power[:, around], axis=1)
        for row in np.flatnonzero(ratio > _HUM):
            details[int(row)] = f"{mains:.0f} Hz stands {10 * np.log10(ratio[row]):.0f} dB out"
    return details


#: Power of a channel's top band over that of its loudest peer, and edges of that band over half the sampling rate.
_NOISE, _TOP = 12.0, (0.6, 0.9)


def noisy(channels: Channels) -> dict[int, str]:
    """Find channels whose top band is far above that of the others of their quantity, at least two."""
    power, frequencies = channels.spectra.densities, channels.spectra.frequencies
    top = (frequencies > _TOP[0] * frequencies[-1]) & (frequencies < _TOP[1] * frequencies[-1])
    noise = np.median(power[:, top], axis=1)
    details = {}
    for row in range(len(noise)):
        peers = noise[channels.peers(row)]
        if peers.size >= 2 and noise[row] > _NOISE * peers.max():
            details[row] = f"noise {10 * np.log10(noise[row] / np.median(peers)):.0f} dB above the others"
    return details


#: Standard deviation of the slow part of a channel's mean over blocks, relative to its peers and over its own standard
#: deviation, and fewest peers for that; the same without peers (slopes of the road move it too); ratio to that of the
#: peers.
_DRIFT, _PEERS, _DRIFT_ALONE, _FAR_WANDERED = 0.08, 2, 0.5, 2.5
#: Least length of a block [s], most and fewest blocks.
_BLOCK, _MOST_BLOCKS, _FEWEST_BLOCKS = 5.0, 60, 6
#: Half periods of a window that count as slow, and least share of them in the variance of a drift: a random walk has
#: 87 %
#: there, what a tilted accelerometer reads in bends 5 to 30 %.
_SLOW, _SLOW_SHARE = 4, 0.5


def drifting(channels: Channels) -> dict[int, str]:
    """Find channels whose mean moves slowly away from that of the others of their quantity."""
    samples = channels.complete
    n_blocks = min(_MOST_BLOCKS, int(samples.shape[1] / (_BLOCK * channels.sampling_rate)))
    if n_blocks < _FEWEST_BLOCKS:
        return {}
    means = samples[:, : samples.shape[1] // n_blocks * n_blocks].reshape(len(samples), n_blocks, -1).mean(axis=2)
    peers = [channels.peers(row) for row in range(len(samples))]
    has_peers = [len(rows) >= _PEERS for rows in peers]
    deviations = [
        means[row] - (np.median(means[rows], axis=0) if has_peers[row] else 0.0) for row, rows in enumerate(peers)
    ]
    power = dct(np.array(deviations), norm="ortho")[:, 1:] ** 2 / n_blocks
    wander, slow = np.sqrt(power.sum(axis=1)), np.sqrt(power[:, :_SLOW].sum(axis=1))
    details = {}
    for row, rows in enumerate(peers):
        least = (_DRIFT if has_peers[row] else _DRIFT_ALONE) * samples[row].std()
        is_far = wander[row] > least and (not has_peers[row] or wander[row] > _FAR_WANDERED * np.median(wander[rows]))
        if is_far and slow[row] ** 2 > _SLOW_SHARE * wander[row] ** 2:
            details[row] = f"its mean wanders by {wander[row]:.2g} (std) in the window"
    return details
