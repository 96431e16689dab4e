"""Identification with default settings on records of many kinds: `python benchmarks/identification_records.py`.

Modes of known structures beside tones, harmonics, drift and strong channels, in short records and in many channels,
simulated by a modal superposition that is written here and shares no code with `sprung.simulation`. A record counts as
complete if every mode that it must show is found within 1.5 % (short records: 3 %) of its natural frequency and no mode
is reported that the structure does not have. Shares have exact 95 % intervals (Clopper and Pearson). The peers are
given the number of block rows and the largest order that the record length and the modes suggest, and the preset of
pyOMA2 that selects best on the chain. Short records are also fitted by the exact likelihood of their samples, begun at
the true modes: what no method can be expected to surpass.
"""

import argparse
import logging
import os
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path

from measuring import ONE_THREAD, print_circumstances, print_table

os.environ.update(ONE_THREAD, TQDM_DISABLE="1")

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, signal, special

from sprung.identification import coss_ssi, cov_ssi
from sprung.recording import Channel, Recording

Array = NDArray[np.float64]
#: Largest order for the peers.
PEER_ORDER = 60
#: The preset of pyOMA2 that selects best on the chain.
PRESET = "Neu"


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes of a structure: natural frequencies [Hz], damping ratios, real shapes (channels, modes)."""

    natural_frequency: Array
    damping_ratio: Array
    shapes: Array

    def response(self, n: int, rate: float, rng: np.random.Generator, *, scale: Array | None = None) -> Array:
        """Return accelerations under white modal forces, each mode of unit RMS times `scale`."""
        n_start = int(rate * 5 / np.min(self.natural_frequency * self.damping_ratio) / (2 * np.pi)) + 1
        rows = []
        for f, xi in zip(self.natural_frequency, self.damping_ratio, strict=True):
            omega = 2 * np.pi * f
            system = signal.cont2discrete(([1.0, 0.0, 0.0], [1.0, 2 * xi * omega, omega**2]), 1 / rate, method="zoh")
            row = signal.lfilter(system[0][0], system[1], rng.standard_normal(n + n_start))[n_start:]
            rows.append(row)
        modal = np.array(rows)
        modal /= np.sqrt(rate * np.pi * self.natural_frequency / self.damping_ratio / 4 / rate**2)[:, None]
        if scale is not None:
            modal *= scale[:, None]
        return self.shapes @ modal


def shear_frame(n: int, first: float, damping: float) -> Structure:
    """Return a frame of equal storeys with its first natural frequency [Hz] and one damping ratio."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    stiffness[-1, -1] = 1.0
    squares, shapes = np.linalg.eigh(stiffness)
    return Structure(first * np.sqrt(squares / squares[0]), np.full(n, damping), shapes)


CHAIN = shear_frame(3, 5.2, 0.02)
LIGHT = Structure(np.array([1.9, 2.4, 2.7]), np.full(3, 0.015), np.linalg.qr(np.vander([1.0, 2.0, 3.5], 3))[0])
PLATE = Structure(
    np.array([1.31, 2.07, 2.9, 3.7, 4.4]),
    np.full(5, 0.012),
    np.array([np.sin((k + 1) * np.pi * np.arange(1, 18) / 18) for k in range(5)]).T,
)


@dataclass(frozen=True, eq=False)
class Case:
    """Samples (channels, samples), their rate, modes that must and that may be found, and frequencies that are none."""

    samples: Array
    rate: float
    modes: Array
    tones: Array = field(default_factory=lambda: np.zeros(0))
    tolerance: float = 0.015
    block_rows: int = 45
    optional: Array = field(default_factory=lambda: np.zeros(0))


def with_noise(samples: Array, snr: float, rng: np.random.Generator) -> Array:
    return samples + rng.standard_normal(samples.shape) * samples.std(axis=1, keepdims=True) / snr


def tones(t: Array, frequencies: Sequence[float], shape: Array, rng: np.random.Generator) -> Array:
    """Return sines of unit RMS, with one phase for all channels."""
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    waves = [np.sqrt(2) * np.sin(2 * np.pi * f * t + p) for f, p in zip(frequencies, phases, strict=True)]
    return np.outer(shape, np.sum(waves, axis=0))


def ordinary(rng: np.random.Generator, *, snr: float = 10.0) -> Case:
    rate, n = 200.0, 12_000
    return Case(with_noise(CHAIN.response(n, rate, rng), snr, rng), rate, CHAIN.natural_frequency)


def tone_beside(rng: np.random.Generator, *, on: bool = False) -> Case:
    rate, n = 200.0, 12_000
    motion = CHAIN.response(n, rate, rng)
    mode = rng.integers(3)
    offset = 0.0 if on else rng.choice([-1, 1]) * rng.uniform(0.2, 0.8)
    frequency = CHAIN.natural_frequency[mode] + offset
    shape = motion.std() * rng.uniform(0.5, 1.5, 3)
    motion = motion + tones(np.arange(n) / rate, [frequency], shape, rng)
    return Case(with_noise(motion, 10.0, rng), rate, CHAIN.natural_frequency, np.array([frequency]))


def three_tones(rng: np.random.Generator, *, level: float = 1.0) -> Case:
    rate, n = 200.0, 12_000
    motion = CHAIN.response(n, rate, rng)
    half = CHAIN.natural_frequency * CHAIN.damping_ratio
    frequencies = CHAIN.natural_frequency + rng.choice([-1, 1], 3) * rng.uniform(0.3, 1.0, 3) * half
    added = tones(np.arange(n) / rate, list(frequencies), motion.std() * rng.uniform(0.5, 1.5, 3), rng)
    motion = motion + level * added / np.sqrt(3)
    return Case(with_noise(motion, 10.0, rng), rate, CHAIN.natural_frequency, frequencies)


def sine_family(rng: np.random.Generator) -> Case:
    rate, n = 200.0, 20_000
    fundamental = rng.uniform(1.2, 2.8)
    orders = np.arange(1, 15)
    t = np.arange(n) / rate
    added = np.zeros((3, n))
    for order in orders:
        height = 10 ** (-rng.uniform(10, 35) / 20) if order > 1 else 1.0
        added += 2 * height * tones(t, [order * fundamental], rng.uniform(0.5, 1.5, 3), rng)
    motion = CHAIN.response(n, rate, rng)
    return Case(
        with_noise(motion + motion.std() * added, 10.0, rng), rate, CHAIN.natural_frequency, orders * fundamental
    )


def drifting_engine(rng: np.random.Generator) -> Case:
    rate, n = 200.0, 24_000
    t = np.arange(n) / rate
    wander = np.cumsum(rng.standard_normal(n)) * 0.002
    speed = 22.4 * (
        1 + 0.006 * np.sin(2 * np.pi * t / rng.uniform(30, 70)) + 0.001 * wander / max(np.std(wander), 1e-9)
    )
    phase = 2 * np.pi * np.cumsum(speed) / rate
    motion = CHAIN.response(n, rate, rng)
    added = sum(
        np.outer(rng.uniform(0.3, 1.0, 3), np.sqrt(2) * np.sin(order * phase + rng.uniform(0, 6))) for order in (1, 2)
    )
    motion = motion + 0.7 * motion.std() * added
    return Case(with_noise(motion, 10.0, rng), rate, CHAIN.natural_frequency, np.array([22.4, 44.8]))


def slow_drift(rng: np.random.Generator) -> Case:
    rate, n = 100.0, 30_000
    t = np.arange(n) / rate
    motion = LIGHT.response(n, rate, rng, scale=np.array([1.0, 0.8, 0.6]))
    b, a = signal.butter(1, 0.04, fs=rate)
    drift = signal.lfilter(b, a, rng.standard_normal((3, n + 6000)), axis=1)[:, 6000:]
    shared = signal.lfilter(b, a, rng.standard_normal(n + 6000))[6000:]
    drift = drift / drift.std() + shared / shared.std() + np.sin(2 * np.pi * 0.04 * t + rng.uniform(0, 6))
    return Case(with_noise(motion + 3 * motion.std() * drift, 5.0, rng), rate, LIGHT.natural_frequency, block_rows=60)


def drift_and_noise(rng: np.random.Generator) -> Case:
    rate, n = 100.0, 12_000
    ramp = np.outer(rng.standard_normal(3) * 5, np.linspace(-1, 1, n))
    return Case(rng.standard_normal((3, n)) + ramp, rate, np.zeros(0))


def short(rng: np.random.Generator, *, periods: float = 20.0) -> Case:
    rate = 200.0
    n = int(periods * rate / CHAIN.natural_frequency[0])
    motion = with_noise(CHAIN.response(n, rate, rng), 10.0, rng)
    return Case(motion, rate, CHAIN.natural_frequency, tolerance=0.03, block_rows=20)


def short_noise(rng: np.random.Generator) -> Case:
    return Case(rng.standard_normal((3, 800)), 200.0, np.zeros(0), block_rows=20)


def many_channels(rng: np.random.Generator) -> Case:
    rate, n = 50.0, 15_000
    motion = PLATE.response(n, rate, rng, scale=np.array([0.15, 1.0, 0.8, 0.8, 0.6]))
    return Case(with_noise(motion, 5.0, rng), rate, PLATE.natural_frequency, block_rows=30)


def dominating_channel(rng: np.random.Generator) -> Case:
    rate, n = 100.0, 12_000
    motion = with_noise(CHAIN.response(n, rate, rng, scale=np.array([0.1, 1.0, 1.0])), 5.0, rng)
    b, a = signal.butter(2, [18, 30], fs=rate, btype="band")
    motion[2] += 30 * motion.std() * signal.lfilter(b, a, rng.standard_normal(n))
    return Case(motion, rate, CHAIN.natural_frequency[:2], optional=CHAIN.natural_frequency[2:])


CASES: dict[str, Callable[[np.random.Generator], Case]] = {
    "ordinary record, SNR 10": ordinary,
    "ordinary record, SNR 0.5": partial(ordinary, snr=0.5),
    "tone 0.2 to 0.8 Hz beside a mode": tone_beside,
    "tone on a mode": partial(tone_beside, on=True),
    "three tones within the bandwidths": three_tones,
    "three tones within the bandwidths, +10 dB": partial(three_tones, level=10**0.5),
    "sine with 13 multiples": sine_family,
    "engine orders that drift": drifting_engine,
    "slow drift under light modes, 5 min": slow_drift,
    "linear drift and white noise": drift_and_noise,
    "20 periods of the first mode": short,
    "white noise, 4 s": short_noise,
    "17 channels, weak first mode": many_channels,
    "one channel dominates the band": dominating_channel,
}


@dataclass(frozen=True)
class Score:
    """What an estimator found in one record; z: errors of the natural frequencies over their stated deviations."""

    n_found: int
    n_modes: int
    n_tones: int
    n_false: int
    z: tuple[float, ...] = ()

    @property
    def is_complete(self) -> bool:
        return self.n_found == self.n_modes and not self.n_tones and not self.n_false


def score(case: Case, frequencies: Array, deviations: Array | None = None) -> Score:
    """Compare frequencies with a case; each mode is matched with the nearest frequency only."""
    left = list(range(len(frequencies)))
    matches = []
    for mode in case.modes:
        if not left:
            break
        nearest = min(left, key=lambda k: abs(frequencies[k] - mode))
        if abs(frequencies[nearest] / mode - 1) <= case.tolerance:
            left.remove(nearest)
            matches.append((nearest, mode))
    left = [k for k in left if not np.any(np.abs(case.optional / frequencies[k] - 1) < 2 * case.tolerance)]
    near = [k for k in left if len(case.tones) and np.min(np.abs(case.tones / frequencies[k] - 1)) < 0.02]
    z = () if deviations is None else tuple((frequencies[k] - mode) / deviations[k] for k, mode in matches)
    return Score(len(matches), len(case.modes), len(near), len(left) - len(near), z)


def likelihood_score(name: str, number: int) -> Score:
    """Score the largest likelihood of a short record, searched from the truth: frequencies, damping, shapes, noise."""
    case = draw(name, number)
    n, lead = len(case.modes), np.argmax(np.abs(CHAIN.shapes), axis=0)
    is_free = np.arange(n)[:, None] != lead
    start_noise = case.samples.std(axis=1) / 10

    def modes(unknown: Array) -> Structure:
        shapes = CHAIN.shapes.copy()
        shapes[is_free] += 0.1 * unknown[4 * n :]
        frequency = CHAIN.natural_frequency * np.exp(0.02 * unknown[:n])
        return Structure(frequency, CHAIN.damping_ratio * np.exp(unknown[n : 2 * n]), shapes)

    def objective(unknown: Array) -> float:
        if np.any(np.abs(unknown[: 4 * n]) > 12):
            return 1e9
        power, noise = np.exp(unknown[2 * n : 3 * n]), start_noise**2 * np.exp(unknown[3 * n : 4 * n])
        return minus_log_likelihood(case.samples, case.rate, modes(unknown), power, noise)

    found = optimize.minimize(objective, np.zeros(4 * n + is_free.sum()), method="L-BFGS-B", options={"maxiter": 80})
    return score(case, np.sort(modes(found.x).natural_frequency))


def minus_log_likelihood(samples: Array, rate: float, modes: Structure, power: Array, noise: Array) -> float:
    """Return minus the log likelihood of stationary accelerations under held white modal forces, by Kalman's filter."""
    f, xi = modes.natural_frequency, modes.damping_ratio
    omega, gain = 2 * np.pi * f, np.sqrt(power / (rate * np.pi * f / xi / 4 / rate**2))
    own = [np.array([[0.0, 1.0, 0.0], [-w * w, -2 * x * w, 1.0], [0, 0, 0]]) for w, x in zip(omega, xi, strict=True)]
    steps = [linalg.expm(each / rate) for each in own]
    A, B = linalg.block_diag(*(step[:2, :2] for step in steps)), linalg.block_diag(*(step[:2, 2:] for step in steps))
    C, D, B = modes.shapes @ linalg.block_diag(*(each[1:2, :2] for each in own)), modes.shapes * gain, B * gain
    Q, R, S = B @ B.T, D @ D.T + np.diag(noise), B @ D.T
    return float(_compiled()(samples, (A, np.ascontiguousarray(C), Q, R, S, linalg.solve_discrete_lyapunov(A, Q))))


@cache
def _compiled() -> Callable[..., float]:
    from numba import njit

    compiled: Callable[..., float] = njit(_filtered)
    return compiled


def _filtered(samples: Array, process: tuple[Array, Array, Array, Array, Array, Array]) -> float:
    """Return half of the sum of the squared white innovations and of the logarithms of their variances."""
    A, C, Q, R, S, P = process
    state, total, is_settled = np.zeros(len(A)), 0.0, False
    whitener, gain = R, np.ascontiguousarray(C.T)
    for k in range(samples.shape[1]):
        if not is_settled:
            root = np.linalg.cholesky(C @ P @ C.T + R)
            whitener = np.ascontiguousarray(np.linalg.inv(root))
            gain = np.ascontiguousarray((A @ P @ C.T + S) @ whitener.T @ whitener)
            after = A @ P @ A.T + Q - gain @ root @ root.T @ gain.T
            is_settled = np.abs(after - P).max() < 1e-9 * np.abs(P).max()
            P = after
        innovation = samples[:, k] - C @ state
        white = whitener @ innovation
        total += np.sum(white**2) / 2 - np.sum(np.log(np.diag(whitener)))
        state = A @ state + gain @ innovation
    return total


def draw(name: str, number: int) -> Case:
    return CASES[name](np.random.default_rng((list(CASES).index(name), number)))


def sprung_score(name: str, method: str, number: int) -> Score:
    case = draw(name, number)
    channels = tuple(Channel(f"s{k + 1}") for k in range(len(case.samples)))
    identify = {"cov": cov_ssi, "coss": coss_ssi}[method]
    modes = identify(Recording(case.samples, case.rate, channels)).modes
    return score(case, modes.natural_frequency, modes.natural_frequency_std)


def pyoma_score(name: str, number: int) -> Score:
    from peers import pyoma_modes, pyoma_ssi

    logging.disable(logging.CRITICAL)
    case = draw(name, number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            algorithm, _ = pyoma_ssi(case.samples, case.rate, block_rows=case.block_rows, max_order=PEER_ORDER)
            frequencies = np.atleast_1d(pyoma_modes(algorithm, PRESET)[0])
        except (TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError):
            frequencies = np.zeros(0)
    return score(case, frequencies)


def koma_score(name: str, number: int) -> Score:
    from peers import koma_modes, koma_ssi, koma_stable

    case = draw(name, number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            poles = koma_ssi(
                case.samples, case.rate, block_rows=case.block_rows, orders=np.arange(2, PEER_ORDER + 1, 2)
            )
            frequencies = koma_modes(*koma_stable(*poles, n_levels=2))[0]
        except (TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError):
            frequencies = np.zeros(0)
    return score(case, frequencies)


def share(n: int, of: int) -> str:
    low = special.betaincinv(n, of - n + 1, 0.025) if n else 0.0
    high = special.betaincinv(n + 1, of - n, 0.975) if n < of else 1.0
    return f"{n} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", help="parts of names of cases; default: all")
    parser.add_argument("--records", type=int, default=40, help="records of each case")
    parser.add_argument(
        "--methods", default="cov", help="cov, coss or both, separated by a comma; '' for the peers only"
    )
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--without-peers", action="store_true")
    arguments = parser.parse_args()
    print_circumstances(peers=() if arguments.without_peers else ("pyoma-2", "koma-python"))
    estimators: dict[str, Callable[[str, int], Score]] = {
        f"sprung, {method}": partial(_by_method, method) for method in arguments.methods.split(",") if method
    }
    if not arguments.without_peers:
        estimators |= {f"pyOMA2, {PRESET}": pyoma_score, "koma, clusters": koma_score}
    rows = []
    with ProcessPoolExecutor(arguments.processes) as pool:
        for name, kind in CASES.items():
            if arguments.cases and not any(part in name for part in arguments.cases):
                continue
            of_short = {"largest likelihood": likelihood_score} if kind is short else {}
            for estimator, estimate in (estimators | of_short).items():
                scores = list(pool.map(partial(estimate, name), range(arguments.records), chunksize=2))
                rows.append(_row(name, estimator, scores))
                print(Path(__file__).stem, *rows[-1], sep=" | ", flush=True)
    print_table(
        "Records of many kinds",
        ["record", "what", "complete", "modes found", "tones as modes", "other false modes", "z of f, rms"],
        rows,
    )


def _by_method(method: str, name: str, number: int) -> Score:
    return sprung_score(name, method, number)


def _row(name: str, estimator: str, scores: Sequence[Score]) -> list[str]:
    n_modes = sum(one.n_modes for one in scores)
    z = np.array([z for one in scores for z in one.z])
    z = z[np.isfinite(z)]
    spread = f"{np.sqrt(np.mean(z**2)):.2f}" if z.size else "-"
    return [
        name,
        estimator,
        share(sum(one.is_complete for one in scores), len(scores)),
        f"{sum(one.n_found for one in scores)} of {n_modes}" if n_modes else "-",
        str(sum(one.n_tones for one in scores)),
        str(sum(one.n_false for one in scores)),
        spread,
    ]


if __name__ == "__main__":
    start = time.perf_counter()
    main()
    print(f"\nTook {time.perf_counter() - start:.0f} s.")
