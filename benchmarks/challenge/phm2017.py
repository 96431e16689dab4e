"""Band powers of a rail vehicle, as in the data challenge of the PHM Society in 2017: layout, files, fit, scores.

The challenge gives, of each experiment, five spectral features of 18 vertical accelerometers of a car on two bogies
(f101 to f190, in the order of `SENSORS`), its speed, mass and track, and asks which of 22 parts are faulty. Neither its
file nor its bands nor the formula of its score (best: 0.762) is in the public texts that could be read, so that nothing
here compares with that number. `make` writes files of this layout from simulated drives of the metro car, `fit` finds
the changed part from features and speed alone, and `score` prints proper scores. A file of the challenge is fitted
alike with its bands (`--bands`) and a vehicle file of its car (`--vehicle`).

    python -m benchmarks.challenge.phm2017 make --out phm.csv --truth phm-truth.csv
    python -m benchmarks.challenge.phm2017 fit phm.csv --learn 20 --out phm-entry.json
    python -m benchmarks.challenge.phm2017 score phm-entry.json --truth phm-truth.csv

Of an experiment, y = ln(power in a band of a sensor) + e. The powers are those of the model that `sprung corners` fits,
at the experiment's speed; their parameters (parts, load, track, noise) have its priors, but parts only the scatter of
healthy vehicles. Powers scatter by chance, sensors on one body together: the covariance of two of them in a band is the
integral of |cross spectrum|^2 over the duration [1, section 8.3]. The first experiments are healthy: from them come the
mean deviation of each feature from the model, and its scatter beyond chance. A faulty part is one whose prior is wide;
with the model linear about the most likely parameters, its evidence is that of a normal distribution [2, section 3.4].

[1] J. S. Bendat, A. G. Piersol, Random Data, 4th edition, Wiley, 2010.
[2] C. M. Bishop, Pattern Recognition and Machine Learning, Springer, 2006.
"""

import argparse
import csv
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.challenge.make import HEALTHY
from benchmarks.challenge.score import HEALTHY_LIFE, base_rates, brier, interval_score, log_score
from scipy.signal import welch

from sprung._threads import one_thread
from sprung.likelihood import CornerSettings, rigid_layout
from sprung.likelihood.fitting import FitSetup
from sprung.likelihood.spectra import ClassSpectra
from sprung.likelihood.whittle import Model
from sprung.simulation import Deviations, PartScatter, Payload, RailDrive, simulate_drive
from sprung.vehicles import Sensor, Vehicle, parse_fault, read_vehicle, structure

#: Sensors in the order of their features: body above a bogie, frame above an axle box, axle box; right before left.
SENSORS = (
    *("azs_1", "azp_1r", "azp_1l", "azp_2r", "azp_2l", "az_1r", "az_1l", "az_2r", "az_2l"),
    *("azs_2", "azp_3r", "azp_3l", "azp_4r", "azp_4l", "az_3r", "az_3l", "az_4r", "az_4l"),
)
FEATURES = tuple(f"f{number}" for number in range(101, 191))
CONDITIONS = ("speed", "mass", "track")
#: Ends of the five bands of the simulated files [Hz].
BANDS = (0.5, 2.0, 5.0, 10.0, 20.0, 50.0)
RATE, SECONDS, STEP = 200.0, 180.0, 0.25
TRACKS = ("good", "bad")
#: Deviations of ln(part) of healthy vehicles, and of a part that may be faulty.
SCATTER, FAULTY = 0.05, 0.5
#: Deviation of ln(power) from the model beyond chance.
MISFIT = 0.01
#: Steps of each search.
STEPS = 8
LOSSES = (0.1, 0.6)


@dataclass(frozen=True)
class Learnt:
    """Features of healthy experiments: their mean deviation from the model, and their variance beyond chance."""

    offset: np.ndarray
    variance: np.ndarray


def instrumented(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle on two bogies with the 18 sensors."""
    sensors = []
    for name in SENSORS:
        kind, _, place = name.partition("_")
        number, side = int(place[0]), {"l": 1.0, "r": -1.0}.get(place[1:], 0.0)
        bogie = vehicle.bogie[(number - 1) // (1 if kind == "azs" else 2)]
        ahead = bogie.half_wheelbase * (1 if number % 2 else -1)
        on, x = {
            "azs": ("body", bogie.x),
            "azp": (f"bogie{1 if number < 3 else 2}", ahead),
            "az": (f"wheelset{number}", 0.0),
        }[kind]
        at = (x, side * bogie.half_spacing[0], 0.0)
        up = (0.0, 0.0, 1.0)
        sensors.append(Sensor(channel=name, quantity="acceleration", unit="m/s^2", position=at, direction=up, on=on))
    return vehicle.model_copy(update={"sensor": tuple(sensors)})


def simulated(vehicle: Vehicle, bands: Sequence[float], number: int, part: str | None) -> tuple[list[object], float]:
    """Return a row of the file, and the change of the part: an experiment of a vehicle, load and track of its own."""
    generator = np.random.default_rng([number, 2017])
    speed, track = float(generator.uniform(12.0, 30.0)), int(generator.integers(len(TRACKS)))
    load = float(generator.uniform(0.0, 6000.0))
    change = -float(np.exp(generator.uniform(*np.log(LOSSES))))
    drive = RailDrive(
        duration=SECONDS,
        sampling_rate=RATE,
        speed=(speed - 0.25, speed + 0.25),
        quality=TRACKS[track],
        welded=True,
        payload=Payload(load, float(generator.uniform(-2, 2)), float(generator.uniform(-0.2, 0.2))),
        snr=30.0,
        faults=() if part is None else (parse_fault(f"{part}={change}"),),
        deviations=Deviations({}, scatter=PartScatter(), individual=number),
    )
    run = simulate_drive(vehicle, drive, seed=[number, 17]).recording
    frequencies, spectra = welch(run.select(list(SENSORS)).samples, RATE, nperseg=round(RATE / STEP), axis=1)
    row = [power for spectrum in spectra for power in in_bands(frequencies, spectrum, bands)]
    return [f"{speed:.3f}", f"{vehicle.body.mass + load:.0f}", track + 1, *(f"{each:.6g}" for each in row)], change


def in_bands(frequencies: np.ndarray, spectrum: np.ndarray, bands: Sequence[float]) -> list[float]:
    """Return the power in each band."""
    ends = pairwise(bands)
    return [STEP * float(spectrum[(low <= frequencies) & (frequencies < high)].sum()) for low, high in ends]


class Powers:
    """Powers of the model in the bands of every sensor, at a speed."""

    def __init__(self, vehicle: Vehicle, bands: Sequence[float], seconds: float) -> None:
        nominal = structure(vehicle)
        self.layout = rigid_layout(nominal)
        self.setup = FitSetup(vehicle, nominal, self.layout, CornerSettings(), "rail")
        self.bands, self.seconds = bands, seconds
        self.frequencies = np.arange(bands[0], bands[-1], STEP)
        self.readings = np.linalg.pinv(self.layout.reduction)

    def model(self, speed: float) -> Model:
        """Return the model at a speed; its data do not count."""
        shape = (1, self.frequencies.size)
        size = len(self.layout.coordinates)
        empty = ClassSpectra(
            frequencies=self.frequencies,
            counts=np.ones(1),
            speeds=np.array([speed]),
            spreads=np.array([0.01]),
            matrices=np.broadcast_to(np.eye(size, dtype=np.complex128), (*shape, size, size)),
            segment_length=1 / STEP,
            weights=np.ones(shape),
        )
        return self.setup.model(empty)

    def spectra(self, model: Model, parameters: np.ndarray) -> np.ndarray:
        """Return the spectral matrix of the sensors, shape (frequencies, sensors, sensors)."""
        return np.einsum("ci,fij,dj->fcd", self.readings, model.matrix(parameters)[0], self.readings, optimize=True)

    def logarithms(self, model: Model, parameters: np.ndarray) -> np.ndarray:
        """Return ln of the powers, in the order of the features."""
        spectra = np.einsum("ci,fij,cj->cf", self.readings, model.matrix(parameters)[0], self.readings).real
        return np.log([power for spectrum in spectra for power in in_bands(self.frequencies, spectrum, self.bands)])

    def chance(self, model: Model, parameters: np.ndarray) -> np.ndarray:
        """Return the covariance of ln of the powers by chance, shape (features, features)."""
        squared = abs(self.spectra(model, parameters)) ** 2
        powers = np.exp(self.logarithms(model, parameters))
        covariance = np.zeros((powers.size, powers.size))
        for number, ends in enumerate(pairwise(self.bands)):
            rows = slice(number, None, len(self.bands) - 1)
            inside = (ends[0] <= self.frequencies) & (self.frequencies < ends[1])
            covariance[rows, rows] = STEP * squared[inside].sum(axis=0) / self.seconds
        return covariance / np.outer(powers, powers)

    def slopes(self, model: Model, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ln of the powers and their derivatives, shape (features, parameters)."""
        centre, step = self.logarithms(model, parameters), 1e-3
        ahead = [self.logarithms(model, parameters + step * row) for row in np.eye(parameters.size)]
        return centre, (np.array(ahead).T - centre[:, None]) / step


@dataclass(frozen=True)
class Linear:
    """The model of an experiment, linear about some parameters: what the data leave of it, and its derivatives."""

    model: Model
    misfit: np.ndarray
    slopes: np.ndarray
    chance: np.ndarray

    @classmethod
    def about(cls, powers: Powers, model: Model, parameters: np.ndarray, seen: np.ndarray) -> "Linear":
        """Return it about parameters; the misfit is that at the centre of the prior."""
        centre, slopes = powers.slopes(model, parameters)
        misfit = seen - centre + slopes @ (parameters - model.start)
        return cls(model, misfit, slopes, powers.chance(model, parameters))

    @classmethod
    def converged(cls, powers: Powers, model: Model, seen: np.ndarray, learnt: "Learnt") -> "Linear":
        """Return it about the most likely parameters of a healthy vehicle; a step moves none by more than 1."""
        parameters = model.start
        for _ in range(STEPS):
            linear = cls.about(powers, model, parameters, seen)
            parameters = parameters + np.clip(linear.solved(learnt, None)[0] - parameters, -1.0, 1.0)
        return cls.about(powers, model, parameters, seen)

    def solved(self, learnt: Learnt, wide: int | None) -> tuple[np.ndarray, float, float]:
        """Return the most likely parameters, ln evidence, and the deviation of the part whose prior is wide."""
        deviation, misfit = prior_of(self.model, wide), self.misfit - learnt.offset
        covariance = (self.slopes * deviation**2) @ self.slopes.T + self.chance + np.diag(learnt.variance)
        solved = np.linalg.solve(covariance, misfit)
        parameters = self.model.start + deviation**2 * (self.slopes.T @ solved)
        evidence = -float(misfit @ solved + np.linalg.slogdet(covariance)[1]) / 2
        if wide is None:
            return parameters, evidence, 0.0
        row = deviation[wide] ** 2 * self.slopes[:, wide]
        left = deviation[wide] ** 2 - float(row @ np.linalg.solve(covariance, row))
        return parameters, evidence, float(np.sqrt(max(left, 0.0)))


def prior_of(model: Model, wide: int | None) -> np.ndarray:
    """Return the prior's deviations: parts scatter as those of healthy vehicles, but for one that may be faulty."""
    deviation = model.prior_std.copy()
    deviation[model.rows("components")] = SCATTER
    if wide is not None:
        deviation[wide] = FAULTY
    return deviation


@one_thread
def learn(powers: Powers, rows: Sequence[tuple[float, np.ndarray]]) -> Learnt:
    """Return what healthy experiments show."""
    learnt, left, chance = Learnt(np.zeros(len(FEATURES)), np.full(len(FEATURES), MISFIT**2)), [], []
    for speed, seen in rows:
        linear = Linear.converged(powers, powers.model(speed), seen, learnt)
        parameters = linear.solved(learnt, None)[0]
        left.append(linear.misfit - linear.slopes @ (parameters - linear.model.start))
        chance.append(np.diag(linear.chance))
    spread = np.var(left, axis=0, ddof=1)
    beyond = np.maximum(spread - np.mean(chance, axis=0), 0.0) + MISFIT**2
    return Learnt(np.mean(left, axis=0), beyond + spread / len(rows))


@one_thread
def judged(powers: Powers, speed: float, seen: np.ndarray, learnt: Learnt) -> dict[str, object]:
    """Return the probabilities of an experiment, and the likeliest part's change with its 95 % interval."""
    model = powers.model(speed)
    linear = Linear.converged(powers, model, seen, learnt)
    healthy = linear.solved(learnt, None)[1]
    parts = [str(part) for part in model.components]
    found = [linear.solved(learnt, row) for row in range(len(parts))]
    for row in sorted(range(len(parts)), key=lambda row: -found[row][1])[:3]:
        found[row] = Linear.about(powers, model, found[row][0], seen).solved(learnt, row)
    rates = base_rates(parts)
    logs = np.array([np.log(HEALTHY) + healthy, *(np.log(rates[p]) + f[1] for p, f in zip(parts, found, strict=True))])
    weights = np.exp(logs - logs.max())
    stated = 0.999 * weights / weights.sum() + 0.001 / weights.size
    likeliest = int(np.argmax(stated[1:]))
    size, std = found[likeliest][0][likeliest], found[likeliest][2]
    return {
        "probabilities": dict(zip((HEALTHY_LIFE, *parts), stated.tolist(), strict=True)),
        "change": [float(np.expm1(size + sign * 1.96 * std)) for sign in (-1, 1)],
    }


def read_rows(path: Path) -> list[tuple[float, np.ndarray]]:
    """Return speed and logarithms of the features of each row."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise SystemExit(f"{path} cannot be read: {error.strerror}") from error
    lacking = sorted({"speed", *FEATURES} - set(rows[0] if rows else ()))
    if lacking:
        raise SystemExit(
            f"{path} lacks the columns {', '.join(lacking[:5])}: give speed [m/s] and {FEATURES[0]} to f190"
        )
    return [(float(row["speed"]), np.log([float(row[name]) for name in FEATURES])) for row in rows]


def make(given: argparse.Namespace) -> None:
    """Write experiments: the first ones healthy, then a third."""
    vehicle = instrumented(read_vehicle(given.vehicle))
    powers = Powers(vehicle, given.bands, SECONDS)
    parts = [str(part) for part in powers.model(20.0).components]
    with given.out.open("w", newline="") as out, given.truth.open("w", newline="") as truth:
        rows, truths = csv.writer(out), csv.writer(truth)
        rows.writerow((*CONDITIONS, *FEATURES))
        truths.writerow(("part", "change"))
        for number in range(given.learn + given.experiments):
            generator = np.random.default_rng([number, 71])
            is_faulty = number >= given.learn and generator.random() > HEALTHY
            part = str(generator.choice(parts)) if is_faulty else None
            row, change = simulated(vehicle, given.bands, number, part)
            rows.writerow(row)
            truths.writerow((part or "", f"{change:.4f}" if part else ""))


def fit(given: argparse.Namespace) -> None:
    """Write what each experiment after the learning ones shows."""
    rows = read_rows(given.file)
    if not 2 <= given.learn < len(rows):
        raise SystemExit(f"--learn {given.learn} must be 2 or more, and less than the {len(rows)} rows of {given.file}")
    powers = Powers(instrumented(read_vehicle(given.vehicle)), given.bands, given.seconds)
    learnt = learn(powers, rows[: given.learn])
    entry = [judged(powers, speed, seen, learnt) for speed, seen in rows[given.learn :]]
    given.out.write_text(json.dumps({"learn": given.learn, "experiments": entry}, indent=1), encoding="utf-8")


def score(given: argparse.Namespace) -> None:
    """Print the scores of an entry beside those of silence."""
    entry = json.loads(given.file.read_text(encoding="utf-8"))
    with given.truth.open(newline="", encoding="utf-8") as file:
        truths = list(csv.DictReader(file))[entry["learn"] :]
    losses: dict[str, list[float]] = {
        name: [] for name in ("brier", "log", "silence", "named", "alarm", "size", "held")
    }
    for said, known in zip(entry["experiments"], truths, strict=True):
        outcome, stated = known["part"] or HEALTHY_LIFE, said["probabilities"]
        losses["brier"].append(brier(stated, outcome))
        losses["log"].append(log_score(stated, outcome))
        losses["silence"].append(brier(base_rates([name for name in stated if name != HEALTHY_LIFE]), outcome))
        first = max(stated, key=stated.__getitem__)
        losses["named" if known["part"] else "alarm"].append(first == outcome if known["part"] else first != outcome)
        if known["part"] and first == outcome:
            losses["size"].append(100 * interval_score(said["change"], float(known["change"])))
            losses["held"].append(said["change"][0] <= float(known["change"]) <= said["change"][1])
    print(f"Brier score {np.mean(losses['brier']):.2f} (silence {np.mean(losses['silence']):.2f})")
    print(f"log score {np.mean(losses['log']):.2f} nats")
    print(f"faulty experiments with the right part {sum(losses['named'])} of {len(losses['named'])}")
    print(f"healthy experiments with a part {sum(losses['alarm'])} of {len(losses['alarm'])}")
    print(
        f"size within its interval {sum(losses['held'])} of {len(losses['held'])}, loss {np.mean(losses['size']):.1f}"
    )


def main() -> None:
    """Run one of the three steps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    steps = parser.add_subparsers(required=True)
    for function in (make, fit, score):
        step = steps.add_parser(function.__name__, help=function.__doc__)
        step.set_defaults(function=function)
        if function is not make:
            step.add_argument("file", type=Path)
        if function is not score:
            step.add_argument("--out", type=Path, required=True)
            step.add_argument("--vehicle", default="metro")
            step.add_argument("--bands", type=float, nargs=6, default=BANDS, metavar="HZ")
            step.add_argument("--learn", type=int, default=20, help="healthy experiments at the begin of the file")
        if function is fit:
            step.add_argument("--seconds", type=float, default=SECONDS, help="duration of an experiment")
        if function is not fit:
            step.add_argument("--truth", type=Path, required=True)
        if function is make:
            step.add_argument("--experiments", type=int, default=60)
    given = parser.parse_args()
    given.function(given)


if __name__ == "__main__":
    main()
