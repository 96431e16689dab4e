"""Sensor checks: what is wrong with a channel, before anything is said of a suspension."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sprung._arrays import Booleans, Complex, Real
from sprung.errors import DataError
from sprung.recording import Recording
from sprung.signals.inspection import inspect
from sprung.signals.spectrum import spectral_matrix
from sprung.vehicles import Vehicle, structure
from sprung.vehicles.sensor_layout import with_layout
from sprung.vehicles.usable import speed_channel

#: Kinds of faults, each a word of `SensorFault.kind`.
KINDS = (
    "dead",
    "stuck",
    "clipped",
    "spiking",
    "noisy",
    "drifting",
    "inverted",
    "swapped",
    "wrong_gain",
    "time_shifted",
    "hum",
)
#: Vehicles slower than this [m/s] stand: sensors may well be constant.
_MOVING = 2.0
#: Share of a window that a channel is stuck, and of its samples that are clipped.
_STUCK, _CLIPPED = 0.02, 3e-4
#: Spikes stand out by so many robust standard deviations, and are at least so many.
_SPIKE, _FEWEST_SPIKES = 12.0, 3
#: Samples within which a spike rings where time stamps were made regular.
_ONE_SPIKE = 5
#: Standard deviations of the samples that no body jumps to and back from within a sample.
_NO_BODY = 6.0
#: Power of a mains line over that beside it, and of a channel's top band over that of its like.
_HUM, _NOISE = 12.0, 12.0
#: Standard deviation of a channel's mean over blocks of seconds, over its RMS: away from the others of its quantity,
#: where there are so many, and alone (slopes of the road move it too); and over that of the others.
_DRIFT, _PEERS, _DRIFT_ALONE, _FAR_WANDERED = 0.08, 2, 0.5, 2.5
#: Power of what the rigid body cannot explain over the mean power of the channels, and share of it that one faulty
#: channel must explain.
_RESIDUAL, _EXPLAINED = 1e-3, 0.7
#: Share of the residual that other signs, gains, places and delays of several channels must explain.
_EXPLAINED_TOGETHER = 0.7
#: A channel moves by itself that explains this share of the residual, and so many times more than any other.
_ALONE, _FAR_MORE = 0.03, 5.0
#: Gains within this of 1 and delays [s] below this are right.
_GAIN, _DELAY = 0.03, 1.5e-3
#: Length of segments of spectra [s].
_SEGMENT = 2.048


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault of a channel.

    Parameters
    ----------
    channel
        Its name.
    kind
        One of `KINDS`.
    detail
        How large, in words.
    """

    channel: str
    kind: str
    detail: str


@dataclass(frozen=True, slots=True)
class SensorCheck:
    """What the sensors of a window are worth.

    Parameters
    ----------
    faults
        Of single channels.
    disagreement
        RMS of the residual channel over that of the channels, where no single channel explains it but other signs,
        gains, places or delays of several do; 0 otherwise.
    """

    faults: tuple[SensorFault, ...]
    disagreement: float = 0.0


def sensor_faults(recording: Recording, vehicle: Vehicle) -> tuple[SensorFault, ...]:
    """Return what is wrong with single sensors of a window, see `check_sensors`."""
    return check_sensors(recording, vehicle).faults


def check_sensors(recording: Recording, vehicle: Vehicle) -> SensorCheck:
    """Return what is wrong with the sensors of a window.

    Parameters
    ----------
    recording
        A window of a minute or more, as read.
    vehicle
        Says where the sensors are.

    Notes
    -----
    Dead, stuck, clipped, spiking, noisy and drifting channels and mains hum are seen in a channel beside others of its
    quantity. Inverted, swapped, wrongly scaled and late ones are seen in the residual channel n^T y, where n^T T = 0
    for the rigid body's motions T: it is noise while all are right; a faulty channel y = G x adds n (1 - 1/G) y, which
    is coherent with that channel over all frequencies and gives G.

    The residual needs accelerations of more places than the rigid body has motions there: four on a car. With fewer,
    with angular velocities or displacements beside them, and where those of one axle or side are wrong alike and the
    body hardly moves that way, inverted, swapped, wrongly scaled and late sensors are not seen here. Exchanged sensors
    of opposite corners leave it as it is. A gain that is off by less than about 6 % in one of four corners is below
    its limit.

    Several wrong channels: where (a + b d/dt)^T y with constant a and b, a of length 1, nearly vanishes, but n^T y does
    not, signs, gains, places or delays are not those of the vehicle file. Noise, lines of wheels and a body that bends
    follow no such rule. With four channels, two wrong ones may be taken for one.

    Raises
    ------
    DataError
        Where no channel of motion is in the recording.
    """
    ready = with_layout(recording, vehicle.sensor)
    names = [
        s.channel for s in vehicle.sensor if s.quantity not in {"speed", "temperature"} and s.channel in ready.names
    ]
    moving = _moving(ready, speed_channel(ready, vehicle))
    if not names:
        raise DataError("the recording has no channel of motion of the vehicle file's sensors: give accelerations")
    facts = inspect(ready.select(names))
    samples = np.array([ready.samples[ready.index(name)] for name in names])[:, moving]
    rate = ready.sampling_rate
    found: dict[str, SensorFault] = {}
    for name, fact, values in zip(names, facts.channels, samples, strict=True):
        fault = _still(name, values, rate) or _limited(name, fact.clipped)
        if fault is not None:
            found[name] = fault
    kept = [row for row, name in enumerate(names) if name not in found and np.isfinite(samples[row]).mean() > 0.5]
    if not kept or samples.shape[1] < 4 * _SEGMENT * rate:
        return SensorCheck(tuple(found.values()))
    clean = np.nan_to_num(samples[kept])
    channels = tuple(ready.channels[ready.index(names[row])] for row in kept)
    spectra = spectral_matrix(Recording(clean, rate, channels), segment_length=_SEGMENT)
    power = np.einsum("iif->if", spectra.matrix).real
    quantities = [channel.quantity for channel in channels]
    for check in (
        _spiking(clean, quantities),
        _humming(power, spectra.frequencies),
        _noisy(power, spectra.frequencies, quantities),
        _drifting(clean, rate, quantities),
    ):
        for row, (kind, detail) in check.items():
            found.setdefault(channels[row].name, SensorFault(channels[row].name, kind, detail))
    alone, disagreement = _unlike_the_rigid_body(
        spectra.matrix, spectra.frequencies, [channel.name for channel in channels], vehicle
    )
    for fault in alone:
        found.setdefault(fault.channel, fault)
    return SensorCheck(tuple(found.values()), 0.0 if found else disagreement)


def _moving(recording: Recording, speed: str | None) -> Booleans:
    """Tell which samples were taken on the move."""
    if speed is None:
        return np.ones(recording.n_samples, dtype=np.bool_)
    is_moving = recording.samples[recording.index(speed)] > _MOVING
    return is_moving if is_moving.any() else np.ones_like(is_moving)


def _still(name: str, values: Real, rate: float) -> SensorFault | None:
    """Return dead or stuck: a value that stays for a second or more on the move."""
    finite = values[np.isfinite(values)]
    if finite.size < 0.5 * values.size:
        return SensorFault(
            name, "dead", f"{100 * (1 - finite.size / max(values.size, 1)):.0f} % of its values are missing"
        )
    starts = np.flatnonzero(np.concatenate([[True], np.diff(finite) != 0]))
    lengths = np.diff(starts, append=finite.size)
    is_long = lengths >= max(10, rate)
    share = lengths[is_long].sum() / finite.size
    if share < _STUCK:
        return None
    value = float(finite[starts[is_long][np.argmax(lengths[is_long])]])
    spread = float(np.std(finite))
    kind = "dead" if abs(value) <= 1e-6 * max(spread, 1e-12) or value == 0 else "stuck"
    return SensorFault(name, kind, f"stays at {value:.4g} for {100 * share:.0f} % of the time")


def _limited(name: str, share: float) -> SensorFault | None:
    """Return clipped."""
    return (
        SensorFault(name, "clipped", f"{100 * share:.2g} % of its samples at the limit") if share > _CLIPPED else None
    )


def _spiking(samples: Real, quantities: list[str]) -> dict[int, tuple[str, str]]:
    """Find single samples that jump and return while no other channel does."""
    bend = samples[:, 1:-1] - (samples[:, 2:] + samples[:, :-2]) / 2
    scale = 1.4826 * np.median(np.abs(bend), axis=1, keepdims=True) + 1e-300
    size = bend / scale
    found = {}
    for row in range(len(samples)):
        here = size[row]
        inner = np.abs(here[1:-1]) > _SPIKE
        returns = (here[:-2] * here[1:-1] < -0.25 * here[1:-1] ** 2) & (here[2:] * here[1:-1] < -0.25 * here[1:-1] ** 2)
        like = [k for k, other in enumerate(quantities) if other == quantities[row] and k != row]
        # A pothole moves all sensors; where there is no other of its quantity, only what no body does is a spike.
        alone = (
            np.abs(size[like, 1:-1]).max(axis=0) < 0.5 * np.abs(here[1:-1])
            if like
            else np.abs(bend[row, 1:-1]) > _NO_BODY * samples[row].std()
        )
        at = np.flatnonzero(inner & returns & alone)
        count = int(at.size and 1 + np.count_nonzero(np.diff(at) > _ONE_SPIKE))
        if count >= _FEWEST_SPIKES:
            found[row] = ("spiking", f"{count} spikes")
    return found


def _humming(power: Real, frequencies: Real) -> dict[int, tuple[str, str]]:
    """Find mains lines."""
    found = {}
    for mains in (50.0, 60.0):
        if mains > 0.95 * frequencies[-1]:
            continue
        line = np.abs(frequencies - mains) < 0.8
        beside = (np.abs(frequencies - mains) > 1.5) & (np.abs(frequencies - mains) < 8.0)
        ratio = power[:, line].max(axis=1) / np.median(power[:, beside], axis=1)
        for row in np.flatnonzero(ratio > _HUM):
            found[int(row)] = ("hum", f"{mains:.0f} Hz stands {10 * np.log10(ratio[row]):.0f} dB out")
    return found


def _noisy(power: Real, frequencies: Real, quantities: list[str]) -> dict[int, tuple[str, str]]:
    """Find channels whose top band is far above that of the others of their quantity."""
    top = (frequencies > 0.6 * frequencies[-1]) & (frequencies < 0.9 * frequencies[-1])
    level = np.median(power[:, top], axis=1)
    found = {}
    for row, quantity in enumerate(quantities):
        others = [level[k] for k, other in enumerate(quantities) if other == quantity and k != row]
        if len(others) >= 2 and level[row] > _NOISE * max(others):
            found[row] = ("noisy", f"noise {10 * np.log10(level[row] / np.median(others)):.0f} dB above the others")
    return found


def _drifting(samples: Real, rate: float, quantities: list[str]) -> dict[int, tuple[str, str]]:
    """Find channels whose mean moves away from that of the others of their quantity."""
    n_blocks = min(60, int(samples.shape[1] / (5 * rate)))
    if n_blocks < 6:
        return {}
    means = samples[:, : samples.shape[1] // n_blocks * n_blocks].reshape(len(samples), n_blocks, -1).mean(axis=2)
    found, wander = {}, np.empty(len(samples))
    peers = [
        [k for k, other in enumerate(quantities) if other == one and k != row] for row, one in enumerate(quantities)
    ]
    for row, like in enumerate(peers):
        away = means[row] - (np.median(means[like], axis=0) if len(like) >= _PEERS else 0.0)
        wander[row] = np.std(away)
    for row, like in enumerate(peers):
        has_peers = len(like) >= _PEERS
        least = (_DRIFT if has_peers else _DRIFT_ALONE) * samples[row].std()
        if wander[row] > least and (not has_peers or wander[row] > _FAR_WANDERED * np.median(wander[like])):
            found[row] = ("drifting", f"its mean wanders by {wander[row]:.2g} (std) in the window")
    return found


def _unlike_the_rigid_body(
    matrix: Complex, frequencies: Real, names: list[str], vehicle: Vehicle
) -> tuple[list[SensorFault], float]:
    """Find inverted, swapped, wrongly scaled, late and noisy channels by what the rigid body cannot explain.

    Beside them the size of that over the channels' (RMS), where several channels explain it and no single one does.
    """
    outputs = structure(vehicle).outputs
    rows = [outputs.names.index(name) for name in names]
    if np.any(outputs.velocity[rows]) or np.any(outputs.displacement[rows]):
        return [], 0.0  # rates beside accelerations: the residual would need differentiation
    T = outputs.acceleration[rows]
    T = T[:, np.abs(T).max(axis=0) > 0]
    left, values, _ = np.linalg.svd(T, full_matrices=True)
    null = left[:, np.count_nonzero(values > 1e-6 * values[0]) :].T
    band = (frequencies > 0.5) & (frequencies < 0.5 * frequencies[-1])
    if not len(null):
        return [], 0.0
    S = matrix.transpose(2, 0, 1)[band]
    mean_power = np.einsum("fii->", S).real / len(names)
    residual = np.einsum("ki,fij,kj->", null, S, null).real / len(null)
    if residual < _RESIDUAL * mean_power:
        return [], 0.0
    alone = _swapped(S, null, residual, names) or _faulty(S, null, names, frequencies[band])
    together = 1 - _least(S, frequencies[band], len(null)) / residual
    return alone, 0.0 if alone or together < _EXPLAINED_TOGETHER else float(np.sqrt(residual / mean_power))


def _least(S: Complex, frequencies: Real, count: int) -> float:
    """Return the least mean power of so many orthogonal combinations (a + b d/dt)^T y with a of length 1."""
    omega = 2 * np.pi * frequencies
    own, slopes = S.sum(axis=0).real, np.einsum("f,fij->ij", omega**2, S).real
    cross = np.einsum("f,fij->ij", -1j * omega, S).real
    powers = np.linalg.eigvalsh(own - cross @ np.linalg.pinv(slopes, hermitian=True) @ cross.T)
    return float(powers[:count].mean())


def _faulty(S: Complex, null: Real, names: list[str], frequencies: Real) -> list[SensorFault]:
    """Return the one channel that explains the residual, and how."""
    shares = [_explained(S, null, row) for row in range(len(names))]
    worst = int(np.argmax(shares))
    if shares[worst] < _EXPLAINED:
        second = np.sort(shares)[-2]
        if shares[worst] > _ALONE and shares[worst] > _FAR_MORE * second:
            return [SensorFault(names[worst], "noisy", "moves by itself")]
        return []
    return [SensorFault(names[worst], *_kind(S, null, worst, frequencies))]


def _swapped(S: Complex, null: Real, residual: float, names: list[str]) -> list[SensorFault]:
    """Return the pairs of channels whose exchange makes the residual vanish."""
    found: list[SensorFault] = []
    pairs = []
    for first, second in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[first, second]] = second, first
        changed = null[:, order]
        if np.einsum("ki,fij,kj->", changed, S, changed).real / len(null) < 0.05 * residual:
            pairs.append((names[first], names[second]))
    words = " or ".join(f"{first} with {second}" for first, second in pairs)
    for pair in pairs:
        found += [SensorFault(name, "swapped", words) for name in pair]
    return found


def _transfer(S: Complex, null: Real, row: int) -> tuple[Complex, Real, Real]:
    """Return the residual over a channel, the power of that channel and what it explains, all over frequency."""
    direction = null[:, row] / max(np.sum(null[:, row] ** 2), 1e-300)
    cross = np.einsum("k,ki,fi->f", direction, null, S[:, :, row])
    own = S[:, row, row].real
    return cross / own, own, np.abs(cross) ** 2 / own


def _explained(S: Complex, null: Real, row: int) -> float:
    """Return the share of the residual's power that a fault of one channel explains."""
    size = np.sum(null[:, row] ** 2)
    total = np.einsum("ki,fij,kj->", null, S, null).real
    return float(np.sum(_transfer(S, null, row)[2]) * size / total)


def _kind(S: Complex, null: Real, row: int, frequencies: Real) -> tuple[str, str]:
    """Return what is wrong with a channel y = G x, 1/G = 1 - residual over channel = e^(i w delay) / gain."""
    ratio, own, _ = _transfer(S, null, row)
    inverse = 1 - ratio
    omega = 2 * np.pi * frequencies
    delays = np.linspace(-0.1, 0.1, 801)
    sums = np.exp(-1j * delays[:, None] * omega) @ (own * inverse) / own.sum()
    best = int(np.argmax(np.abs(sums.real)))
    delay, amplitude = float(delays[best]), float(sums[best].real)
    error = inverse - amplitude * np.exp(1j * omega * delay)
    if np.sum(own * np.abs(error) ** 2) > 0.3 * np.sum(own * np.abs(inverse) ** 2):
        return "noisy", "moves by itself"
    if amplitude < 0:
        return "inverted", f"{-1 / amplitude:.2f} times the opposite of what the others say"
    if abs(delay) > _DELAY:
        return "time_shifted", f"{1e3 * abs(delay):.1f} ms {'late' if delay > 0 else 'early'}"
    if abs(1 / amplitude - 1) > _GAIN:
        return "wrong_gain", f"{1 / amplitude:.2f} times what the others say"
    return "noisy", "moves by itself"
