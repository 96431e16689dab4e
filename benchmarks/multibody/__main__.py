"""Diagnose vehicles of a general multibody engine, as an engineer would: data sheet, calibration, baseline, windows.

    python -m benchmarks.multibody car                       all rows, a few windows of each
    python -m benchmarks.multibody car van --healthy 40 --ordinary 40 --faulty 8 --jobs 2 --out results.md

A vehicle file is written from the data sheet (`described`) and completed on five drives; the baseline is learnt from
twelve. Then it drives healthy, under conditions it never met and under those that it met, and with faults, under those
that it met or (`--unmet`) never met. Shares have exact 95 % intervals (Clopper and Pearson). Drives and observations
are kept in a folder, each by the code that made it.
"""

import argparse
import gzip
import hashlib
import os
import pickle
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.conditions import CALIBRATIONS, OBSERVATIONS, code_version
from benchmarks.detection import binomial_interval
from benchmarks.multibody.design import DESIGNS, Design, Effects, Faults, Rider, sensor_places
from benchmarks.multibody.drive import RATE, Drive, driven, wheel_loads
from benchmarks.multibody.larger_car import LARGER_CAR
from benchmarks.multibody.truth import modes

from sprung.calibration import DataSheet, calibrate, described
from sprung.diagnosis import Diagnosis, Observation, diagnose, learn, observe_window
from sprung.recording import Channel, Recording
from sprung.vehicles import Sensor, Vehicle
from sprung.vehicles.models import vehicle_from_text, vehicle_text

HERE = Path(__file__).resolve().parent
#: Tyres of each axle, their pressure [Pa], the height of the vehicle [m] and its seats in its data sheet.
SHEETS = {
    "car": (("205/55R16",), 230e3, None, 5),
    "van": (("225/65R16",), 350e3, 2.5, 5),
    "bus": (("275/70R22.5", "2x275/70R22.5", "275/70R22.5"), 800e3, 3.1, 40),
    "suv": (("235/60R18",), 240e3, None, 5),
}
VEHICLES = {**DESIGNS, "suv": LARGER_CAR}
#: Effects that are not the usual ones: in curves of a car a bus often tips over, and larger struts rub more.
OWN_EFFECTS = {"bus": {"cornering": 1.0}, "suv": {"friction": 55.0}}
#: Windows that are diagnosed together: half an hour.
TOGETHER = 3
#: Kinds of conditions that a baseline has not met.
KINDS = 5
#: Acceleration that no vehicle on its wheels reaches here [m/s^2].
TIPPED = 80.0
#: Frequency below which no seat has its own mode [Hz].
LOWEST_OF_SEATS = 3.0
Result = TypeVar("Result")


@dataclass(frozen=True)
class Fault:
    """A fault that a workshop knows, the parts that may be named for it, and the true change where a size is asked."""

    label: str
    factors: dict[str, float]
    names: frozenset[str]
    size: float | None = None


@dataclass(frozen=True)
class Study:
    """A vehicle whose windows are diagnosed, and where drives are kept."""

    design: Design
    folder: Path
    effects: Effects = field(default_factory=Effects)


def seat(mass: float, x: float, y: float) -> Rider:
    """Return a person on a seat."""
    return Rider(mass, x, y, 0.15, frequency=4.5, damping_ratio=0.3)


def seats(design: Design) -> list[tuple[float, float]]:
    """Return the places of seats, the driver's first."""
    if design.name == "bus":
        return [(5.6, 0.6)] + [(x, y) for x in np.arange(3.5, -4.5, -0.8) for y in (-0.75, 0.75)]
    middle = 0.5 * (design.axles[0].x + design.axles[-1].x) + 0.32
    return [(middle, 0.37), (middle, -0.37), (middle - 0.95, 0.38), (middle - 0.95, -0.38)]


def people(design: Design, number: int, generator: np.random.Generator) -> tuple[Rider, ...]:
    """Return the driver and others on the first free seats."""
    return tuple(seat(float(generator.uniform(55, 95)), x, y) for x, y in seats(design)[: number + 1])


def ordinary(design: Design, number: int) -> Drive:
    """Return a drive as any: usual roads and speeds, the driver, sometimes others, luggage."""
    generator = np.random.default_rng([number, 1])
    most = 12 if design.name == "bus" else 2
    luggage = Rider(float(generator.uniform(0, 50)), design.axles[-1].x + 0.2, 0.0)
    return Drive(
        road=str(generator.choice(["B", "C"])),
        speed=(8.0, float(generator.uniform(18, 25))),
        riders=(*people(design, int(generator.integers(0, most)), generator), luggage),
    )


def unmet(design: Design, number: int) -> Drive:
    """Return a drive under conditions that the baseline has not met: load on one side, full seats, other roads."""
    drive, generator = ordinary(design, 10_000 + number), np.random.default_rng([number, 2])
    heavy = 10.0 if design.name == "bus" else 1.0
    kind = number % KINDS
    if kind == 0:
        return replace(drive, riders=(*people(design, 1, generator), Rider(120.0 * heavy, -0.3, 0.45)))
    if kind == 1:
        return replace(drive, riders=people(design, len(seats(design)) - 1, generator))
    if kind == 2:
        return replace(drive, riders=(*drive.riders, Rider(180.0 * heavy, design.axles[-1].x, -0.2)))
    if kind == 3:
        return replace(drive, road="D", speed=(6.0, 14.0))
    return replace(drive, road="A", speed=(15.0, 30.0))


def faults(design: Design) -> list[Fault]:
    """Return the faults of the table."""
    first, last = design.axles[0].name, design.axles[-1].name
    left, right = f"{first}_left", f"{last}_right"
    rows = [
        Fault(f"{left} spring -20 %, sunk", {f"{left}.spring": 0.8}, frozenset({f"{left}.spring"}), -0.2),
        Fault(f"{right} damper -31 %", {f"{right}.damper": 0.69}, frozenset({f"{right}.damper"}), -0.31),
        Fault(f"{first}_right tyre -25 %", {f"{first}_right.tyre": 0.75}, frozenset({f"{first}_right.tyre"}), -0.25),
        Fault(f"{left} friction x 6", {f"{left}.friction": 6.0}, frozenset({f"{left}.damper", f"{left}.friction"})),
        Fault(
            f"{right} spare wheel",
            {f"{right}.tyre": 1.3, f"{right}.wheel": 0.82},
            frozenset({f"{right}.tyre", f"{right}.wheel"}),
            0.3,
        ),
        Fault(f"{first} bar link broken", {f"{first}.bar": 0.0}, frozenset({f"{first}_axle.anti_roll"})),
    ]
    if design.axles[0].linkage == "macpherson":
        rows.append(
            Fault(f"{left} top mount 12 %", {f"{left}.mount": 0.12}, frozenset({f"{left}.damper", f"{left}.mount"}))
        )
    weak = {f"{left}.rate": 0.8}
    rows.append(Fault(f"{left} spring -20 %, as high as before", weak, frozenset({f"{left}.spring"}), -0.2))
    return rows


def kept(folder: Path, asked: object, make: Callable[[], Result]) -> Result:
    """Return what a function makes of something; kept on disk."""
    path = folder / f"{hashlib.sha256(repr(asked).encode()).hexdigest()[:24]}.pickle.gz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        path.with_suffix(f".{os.getpid()}").write_bytes(gzip.compress(pickle.dumps(make()), compresslevel=1))
        path.with_suffix(f".{os.getpid()}").rename(path)
    return pickle.loads(gzip.decompress(path.read_bytes()))


def recording(study: Study, drive: Drive, seed: int) -> Recording:
    """Return a drive as a recording."""
    code = hashlib.sha256(b"".join((HERE / name).read_bytes() for name in ("design.py", "drive.py"))).hexdigest()[:16]
    samples, speed = kept(
        study.folder / code,
        [study.design, study.effects, drive, seed],
        partial(driven, study.design, study.effects, drive, individual=0, seed=seed),
    )
    channels = [
        *(Channel(name, "acceleration", place, (0.0, 0.0, 1.0)) for name, place in sensor_places(study.design).items()),
        Channel("speed", "speed"),
    ]
    return Recording(np.vstack([samples.T, speed]), RATE, tuple(channels))


def has_tipped(run: Recording) -> bool:
    """Return whether the vehicle of a drive lay on its side at its end."""
    return bool(np.abs(run.samples[:-1]).max() > TIPPED)


def sheet_file(design: Design) -> Vehicle:
    """Return the vehicle file from the data sheet, with the sensors where they are."""
    first = design.axles[0]
    tyres, pressure, height, seats = SHEETS[design.name]
    total = design.mass + 2 * sum(axle.wheel_mass for axle in design.axles)
    loads = wheel_loads(design).reshape(len(design.axles), 2).sum(axis=1)
    sheet = DataSheet(
        mass=total + 75.0,
        wheelbase=tuple(first.x - axle.x for axle in design.axles[1:]),
        track=2 * first.half_track,
        tyre=tyres,
        axle_loads=tuple(float(load) for load in loads / loads.sum() * (total + 75.0)) if len(loads) > 2 else None,
        front_share=round(float(loads[0] / loads.sum()), 3),
        height=height,
        seats=seats,
        pressure=pressure,
        name=design.name,
    )
    vehicle = described(sheet)
    upright = (0.0, 0.0, 1.0)
    sensors = tuple(
        Sensor(channel=name, quantity="acceleration", unit="m/s^2", position=place, direction=upright)
        for name, place in sensor_places(design).items()
    )
    return (
        vehicle.model_copy(update={"sensor": sensors})
        if hasattr(vehicle, "model_copy")
        else replace(vehicle, sensor=sensors)
    )


def calibrated_file(study: Study) -> Vehicle:
    """Return the vehicle file completed on five ordinary drives."""

    def make() -> str:
        drives = [recording(study, ordinary(study.design, 100 + number), 100 + number) for number in range(5)]
        return vehicle_text(calibrate(drives, sheet_file(study.design)).vehicle)

    asked = ["calibrated", study.design, study.effects]
    return vehicle_from_text(kept(study.folder / code_version(CALIBRATIONS), asked, make), source="the calibration")


def observed(study: Study, vehicle: Vehicle, drive: Drive, seed: int, time: float) -> Observation:
    """Return what a drive says, as of a time [s]."""
    found = kept(
        study.folder / code_version(OBSERVATIONS),
        [vehicle_text(vehicle), study.design, study.effects, drive, seed],
        lambda: observe_window(recording(study, drive, seed), vehicle),
    )
    return replace(found, time=time)


def judged(
    study: Study, vehicle: Vehicle, learning: list[Observation], drives: list[Drive], seeds: Sequence[int]
) -> Diagnosis:
    """Return the diagnosis of drives together, without those in which the vehicle tipped over."""
    seen = [
        observed(study, vehicle, drive, seed, 600.0 * (1000 + number))
        for number, (drive, seed) in enumerate(zip(drives, seeds, strict=True))
        if not has_tipped(recording(study, drive, seed))
    ]
    return diagnose(seen, learn(learning))


def share(count: int, of: int) -> str:
    """Return a count with its exact interval."""
    low, high = binomial_interval(count, of)
    return f"{count} of {of} ({100 * low:.0f}..{100 * high:.0f} %)"


def named(diagnosis: Diagnosis) -> list[str]:
    """Return the names of what has changed."""
    return [f"{finding.corner}.{finding.component}" for finding in diagnosis.findings]


def rolls(study: Study, learning: list[Observation], drives: list[Drive]) -> str:
    """Return range of the fitted roll mode, and its error against the engine's with the same people and speed."""
    found, errors = [], []
    for each, drive in zip(learning, drives, strict=True):
        if "roll" not in each.modes:
            continue
        speed = each.conditions["speed"]
        of_body = modes(study.design, study.effects, speed=speed, riders=drive.riders, highest=LOWEST_OF_SEATS)
        true = max(of_body, key=lambda mode: mode.shares["roll"] / mode.damping_ratio)  # others sway on the tyres
        found.append(each.modes["roll"])
        errors.append(np.array(each.modes["roll"]) / [true.frequency, true.damping_ratio] - 1)
    (low, low_ratio), (high, high_ratio) = np.min(found, axis=0), np.max(found, axis=0)
    (bias, ratio_bias), (most, ratio_most) = 100 * np.mean(errors, axis=0), 100 * np.abs(errors).max(axis=0)
    ours = f"{low:.2f} to {high:.2f} Hz, {100 * low_ratio:.0f} to {100 * high_ratio:.0f} %"
    off = f"{bias:+.0f} % (at most {most:.0f}) in frequency, {ratio_bias:+.0f} % (at most {ratio_most:.0f}) in damping"
    return f"{ours}; {off}"


def sides(learning: list[Observation]) -> str:
    """Return ln of left over right of each axle's springs, dampers and tyres: mean and scatter of the windows [%]."""
    valid = [each for each in learning if each.is_valid]
    values = [dict(zip(map(str, each.components), each.log_ratios, strict=True)) for each in valid]
    lines = []
    for name in (name for name in values[0] if "_left." in name):
        ratios = [100 * (each[name] - each[name.replace("_left.", "_right.")]) for each in values]
        lines.append(f"{name.replace('_left', '')} {np.mean(ratios):+.0f} and {np.std(ratios, ddof=1):.1f}")
    return ", ".join(lines)


def numbers(vehicle: Vehicle) -> str:
    """Return what holds the body in roll, by a calibrated file."""
    axles = [
        f"{axle.cornering_stiffness or 0:.4g} N/rad, bar {axle.anti_roll_stiffness:.4g} N/m, springs at "
        f"{axle.half_track:.2f} m"
        for axle in vehicle.axle
    ]
    return f"height {vehicle.body.height or 0:.2f} m; {'; '.join(axles)}"


def detectable(diagnosis: Diagnosis) -> str:
    """Return the largest of the smallest losses that would be found, by kind, and of each anti-roll bar [%]."""
    largest: dict[str, float] = {}
    for part, loss in diagnosis.detectable.items():
        name = str(part) if part.kind == "anti_roll" else part.kind
        largest[name] = max(loss, largest.get(name, 0.0))
    return " ".join(f"{kind} {100 * loss:.0f}" for kind, loss in largest.items())


def throughout(
    study: Study, vehicle: Vehicle, learning: list[Observation], given: argparse.Namespace, work: ProcessPoolExecutor
) -> Iterable[str]:
    """Yield the rows of windows under conditions never met, those of one condition together: half hours to two hours.

    They are judged by the baseline, and by those of twelve other drives each.
    """
    of_kind = given.healthy // KINDS
    sizes = [size for size in (TOGETHER, 2 * TOGETHER, 4 * TOGETHER) if size <= of_kind]
    firsts = [
        (size, kind + KINDS * begun) for size in sizes for kind in range(KINDS) for begun in _begun(size, of_kind)
    ]
    members = [[first + KINDS * k for k in range(size)] for size, first in firsts]
    groups = [[unmet(study.design, number) for number in group] for group in members]
    seeds = [[20_000 + number for number in group] for group in members]
    for other in range(-1, given.baselines if firsts else -1):
        if other >= 0:
            numbers = [50_000 + other * len(learning) + k for k in range(len(learning))]
            drives = [ordinary(study.design, number) for number in numbers]
            times = [600.0 * k for k in range(len(numbers))]
            learning = list(work.map(partial(observed, study, vehicle), drives, numbers, times))
        found = list(work.map(partial(judged, study, vehicle, learning), groups, seeds))
        named_in = [
            f"{size} {first % KINDS}" for (size, first), each in zip(firsts, found, strict=True) if each.findings
        ]
        words = f"one condition never met throughout, by {'the' if other < 0 else 'another'} baseline"
        yield f"| {words} | findings {share(len(named_in), len(found))} {named_in} |"


def _begun(size: int, count: int) -> range:
    """Return where sets of a size begin among a number of windows."""
    return range(0, count - size + 1, size)


def rows(study: Study, arguments: argparse.Namespace, work: ProcessPoolExecutor) -> Iterable[str]:
    """Yield the rows of the table of a vehicle."""
    design = study.design
    vehicle = calibrated_file(study)
    times = [600.0 * number for number in range(12)]
    drives = [ordinary(design, number) for number in range(12)]
    learning = list(work.map(partial(observed, study, vehicle), drives, range(12), times))
    errors = [each.conditions["model_error"] for each in learning if each.is_valid]
    spread = f"{np.median(errors):.3f} ({min(errors):.3f} to {max(errors):.3f})" if errors else "none"
    yield f"| {design.name}: model error while learning | {spread}, {len(errors)} of {len(learning)} windows fitted |"
    lying = sum(has_tipped(recording(study, drive, number)) for number, drive in enumerate(drives))
    yield f"| drives in which the vehicle tipped over, while learning | {lying} of {len(drives)} |"
    yield f"| roll while learning, and its error | {rolls(study, learning, drives)} |"
    yield f"| left over right while learning, mean and scatter [%] | {sides(learning)} |"
    yield f"| calibrated file | {numbers(vehicle)} |"
    never_met = ("conditions never met", unmet, arguments.healthy, 0, 20_000)
    as_met = ("conditions as the baseline's", ordinary, arguments.ordinary, 50_000, 50_000)
    for together, size, (words, drive_of, count, offset, start) in (
        ("half hours", TOGETHER, never_met),
        ("two hours", 4 * TOGETHER, never_met),
        ("half hours", TOGETHER, as_met),
        ("two hours", 4 * TOGETHER, as_met),
    ):
        firsts = [size * number for number in range(count // size)]
        if not firsts:
            continue
        groups = [[drive_of(design, offset + first + k) for k in range(size)] for first in firsts]
        seeds = [range(start + first, start + first + size) for first in firsts]
        healthy = list(work.map(partial(judged, study, vehicle, learning), groups, seeds))
        verdicts = Counter(str(diagnosis.verdict) for diagnosis in healthy)
        yield f"| {design.name}: healthy {together}, {words} | {dict(verdicts)} |"
        yield f"| findings | {share(sum(bool(each.findings) for each in healthy), len(healthy))} |"
        yield f"| sensor faults | {share(sum(bool(each.sensor_faults) for each in healthy), len(healthy))} |"
        yield f"| smallest losses that would be found | {', '.join(map(detectable, healthy))} |"
    yield from throughout(study, vehicle, learning, arguments, work)
    for row, fault in enumerate(faults(design) if arguments.faulty else ()):
        first = 30_000 + 1000 * row
        drive_of, where = (unmet, ", conditions never met") if arguments.unmet else (ordinary, "")
        groups = [
            [
                replace(drive_of(design, first + TOGETHER * number + k), faults=Faults(fault.factors))
                for k in range(TOGETHER)
            ]
            for number in range(arguments.faulty)
        ]
        firsts = [first + TOGETHER * number for number in range(arguments.faulty)]
        seeds = [range(begun, begun + TOGETHER) for begun in firsts]
        found = list(work.map(partial(judged, study, vehicle, learning), groups, seeds))
        alone = sum(bool(names := set(named(each))) and names <= fault.names for each in found)
        wrong = sum(bool(set(named(each)) - fault.names) for each in found)
        verdicts = dict(Counter(str(each.verdict) for each in found))
        counts = f"named alone {share(alone, len(found))}, a healthy part named in {wrong}"
        text = f"| {fault.label}{where} | {verdicts}, {counts}"
        has_size = [f for each in found for f in each.findings if f.interval is not None]
        if fault.size is not None and has_size:
            sizes = [f for f in has_size if f"{f.corner}.{f.component}" in fault.names]
            held = sum(f.interval is not None and f.interval[0] <= fault.size <= f.interval[1] for f in sizes)
            read = ", ".join(
                f"{100 * f.change:+.1f} ({100 * f.interval[0]:+.1f}..{100 * f.interval[1]:+.1f})"
                for f in sizes
                if f.change is not None and f.interval is not None
            )
            text += f", size within {held} of {len(sizes)}: {read}"
        yield text + f" | {Counter(name for each in found for name in named(each)).most_common(4)} |"


def main() -> None:
    """Print the table of each vehicle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("vehicles", nargs="+", choices=sorted(SHEETS))
    parser.add_argument("--healthy", type=int, default=12, help="healthy windows under conditions never met")
    parser.add_argument("--ordinary", type=int, default=12, help="healthy windows under those of the baseline")
    parser.add_argument("--baselines", type=int, default=1, help="other baselines that judge one condition throughout")
    parser.add_argument("--faulty", type=int, default=2, help="half hours of each fault")
    parser.add_argument("--unmet", action="store_true", help="faults under conditions that the baseline has not met")
    parser.add_argument(
        "--without", nargs="+", default=[], metavar="EFFECT", choices=sorted(asdict(Effects())), help="effects left out"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "sprung-multibody")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    lines = []
    with ProcessPoolExecutor(arguments.jobs) as work:
        for name in arguments.vehicles:
            usual = replace(Effects(), **OWN_EFFECTS.get(name, {}))
            effects = replace(usual, **{effect: type(getattr(usual, effect))(0) for effect in arguments.without})
            for line in rows(Study(VEHICLES[name], arguments.folder, effects), arguments, work):
                print(line, flush=True)
                lines.append(line)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
