"""What breaks on real vehicles, condition by condition: false alarms, faults found, errors and their coverage.

Every condition is simulated on drives of ten minutes (nonlinear force laws, potholes, roads A to D, payloads on the
centre line, 0 to 40 degrees). A baseline is learnt from ordinary drives of the same vehicle and sensors, but without
the load, the road or the driving that the condition is about, as `sprung baseline` does: a vehicle file that explains
these drives badly is calibrated on them first. Then windows without and with faults are diagnosed. Shares have exact
95 % intervals (Clopper and Pearson). Drives, calibrations and observations are kept in a folder, each by the code that
made it: a second run with more windows continues, and a run of other code repeats only what that code decides.

    python -m benchmarks.conditions                          all rows, 8 windows of each kind
    python -m benchmarks.conditions load tracks --windows 40
    python -m benchmarks.conditions --vehicle benchmarks/vehicles/hatchback.toml --jobs 2 --out results.md
"""

import argparse
import gzip
import hashlib
import json
import math
import os
import pickle
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TypeVar

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.detection import binomial_interval

import sprung
from sprung.calibration import calibrated_if_imperfect, chosen_windows, usable_spectra
from sprung.diagnosis import Baseline, Observation, diagnose, learn, observe_window
from sprung.errors import DataError
from sprung.excitation import Potholes
from sprung.recording import Recording
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_FORCE_LAWS,
    Deviations,
    Driving,
    PartScatter,
    Payload,
    RoadConditions,
    RoadDrive,
    SensorErrors,
    SuspensionConditions,
    Wear,
    WheelOrders,
    held,
    mems_accelerometers,
    simulate_drive,
)
from sprung.simulation.truth import plain
from sprung.vehicles import Component, Fault, FlexibleMode, MountedMass, Sensor, Vehicle, read_vehicle, structure
from sprung.vehicles.models import vehicle_from_text, vehicle_text

#: Code that decides the samples of a drive, what a window says, and how a vehicle file is completed.
DRIVES = ("excitation", "recording.py", "signals", "simulation", "vehicles")
OBSERVATIONS = (
    *DRIVES,
    "likelihood",
    *(f"diagnosis/{name}.py" for name in ("observation", "residuals", "sensors")),
)
CALIBRATIONS = (*OBSERVATIONS, "calibration")
KINDS = ("spring", "damper", "tyre")
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
#: Healthy or faulty windows of one individual before the next one has its turn.
PER_INDIVIDUAL = 24
#: What is fast and true enough for frequencies up to wheel hop [Hz].
SAMPLING_RATE = 100.0

Change = Callable[[RoadDrive], RoadDrive]
Result = TypeVar("Result")


def same(drive: RoadDrive) -> RoadDrive:
    """Return the drive unchanged."""
    return drive


@dataclass(frozen=True)
class Group:
    """Windows of one kind, diagnosed alike."""

    row: str
    label: str
    goal: str
    state: Change = same  # of the vehicle and its sensors: in the baseline, too
    condition: Change = same  # of the drives that are diagnosed alone
    faults: Callable[[int], tuple[Fault, ...]] = lambda number: ()
    n_windows: int = 1  # diagnosed together
    has_baseline: bool = True
    is_new_car: bool = False  # every diagnosis is of another individual
    is_sequence: bool = False  # windows are drives that wear the vehicle


@dataclass(frozen=True)
class Study:
    """A vehicle, and how much is done with it."""

    vehicle: Vehicle
    n_learning: int
    folder: Path


@lru_cache
def code_version(names: tuple[str, ...]) -> str:
    """Return the digest of files and packages of the source."""
    source = Path(sprung.__file__).parent
    files = sorted(path for name in names for path in [source / name, *(source / name).rglob("*.py")] if path.is_file())
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]


def ordinary(individual: int, part: str, number: int) -> RoadDrive:
    """Return the settings of a drive as any: roads, payload on the centre line, temperature, stops, noise."""
    generator = np.random.default_rng([individual, zlib.crc32(part.encode()), number])
    road = str(generator.choice(["A", "B", "C", "D"], p=[0.1, 0.35, 0.4, 0.15]))
    slow, fast = generator.uniform(5.0, 8.0), generator.uniform(16.0, 24.0)
    return RoadDrive(
        sampling_rate=SAMPLING_RATE,
        speed=(float(slow), float(fast)),
        road=RoadConditions(road, potholes=FEW_POTHOLES),
        n_stops=int(generator.integers(0, 3)),
        payload=Payload(float(generator.uniform(0, 300)), float(generator.uniform(-0.6, 0.3)), 0.0),
        suspension=SuspensionConditions(float(generator.uniform(0, 40)), REALISTIC_FORCE_LAWS),
        snr=float(generator.uniform(30, 80)),
        deviations=Deviations(individual=individual),
    )


def with_deviations(drive: RoadDrive, **changes) -> RoadDrive:
    return replace(drive, deviations=replace(drive.deviations, **changes))


def with_load(drive: RoadDrive, *loads: Payload) -> RoadDrive:
    return replace(drive, payload=(*drive.payloads, *loads))


def with_road(drive: RoadDrive, **changes) -> RoadDrive:
    return replace(drive, road=replace(drive.road, **changes))


def smooth(drive: RoadDrive) -> RoadDrive:
    return with_road(drive, road_class="A", potholes=Potholes(per_kilometre=1.5))


def rough_driving(drive: RoadDrive) -> RoadDrive:
    return replace(drive, driving=Driving(braking=3.5, cornering=3.0, cross_slope=0.03))


def with_engine(drive: RoadDrive) -> RoadDrive:
    engine = MountedMass(mass=180.0, x=1.1, y=0.1, frequency=11.0, damping_ratio=0.08)
    return with_deviations(drive, mounted_masses=(engine,))


def with_torsion(drive: RoadDrive, frequency: float) -> RoadDrive:
    return with_deviations(
        drive, flexible_modes=(FlexibleMode(shape="torsion", frequency=frequency, damping_ratio=0.03),)
    )


def with_sensors(drive: RoadDrive, **errors) -> RoadDrive:
    return with_deviations(drive, sensors=replace(drive.deviations.sensors, **errors))


def with_gps(drive: RoadDrive) -> RoadDrive:
    return replace(drive, imperfections=(*drive.imperfections, partial(held, channel="speed", rate=1.0, delay=1.0)))


def with_everything(drive: RoadDrive) -> RoadDrive:
    """Return the drive with engine, wheel orders, braking, cornering, tilt, GPS, MEMS sensors and a wrong file."""
    sign = np.random.default_rng(drive.deviations.individual).choice([-0.1, 0.1], size=2)
    drive = replace(with_engine(rough_driving(drive)), wheel_orders=WheelOrders(2e-3, (3e-4, 1e-4)), snr=None)
    drive = with_deviations(
        drive,
        values={"mass": 0.07, "pitch_inertia": float(sign[0]), "roll_inertia": float(sign[1])},
        sensors=SensorErrors(tilt=math.radians(2)),
    )
    return with_gps(replace(drive, imperfections=mems_accelerometers()))


def used(drive: RoadDrive) -> RoadDrive:
    return with_deviations(drive, scatter=PartScatter())


def part(number: int) -> Component:
    """Return the springs, dampers and tyres one after the other."""
    return Component(CORNERS[number % 4], KINDS[number // 4 % 3])


def fault(size: float) -> Callable[[int], tuple[Fault, ...]]:
    return lambda number: (Fault(part(number), -size),)


def two_faults(size: float) -> Callable[[int], tuple[Fault, ...]]:
    """Return pairs of parts at different corners."""
    return lambda number: (Fault(part(number), -size), Fault(part(number + 5 + 4 * (number % 2)), -size))


def ageing(kind: str) -> Callable[[int], tuple[Fault, ...]]:
    return lambda number: tuple(Fault(Component(corner, kind), -0.2) for corner in CORNERS)


def groups(vehicle: Vehicle) -> Iterator[Group]:
    """Yield the kinds of windows of every row."""
    rear, side = vehicle.axle[-1].x, vehicle.axle[-1].half_track
    imu = vehicle.sensor[0].channel
    for name, load in (
        ("passenger behind on the right, 80 kg", Payload(80.0, 0.6 * rear, -0.6 * side)),
        ("400 kg behind, a little right", Payload(400.0, rear, -0.3 * side)),
        ("300 kg on the left, behind the middle", Payload(300.0, 0.5 * rear, 0.6 * side)),
    ):
        yield Group("load", name, "0 of 200 alarm", condition=partial(_loaded, load=load))
    for level in (1.0, 2.5):
        yield Group(
            "tracks",
            f"right track {level:g} dB rougher",
            "0 of 200 alarm",
            condition=partial(with_road, right_rougher_db=level),
        )
    one_side = Potholes(per_kilometre=10.0, side="right")
    yield Group("tracks", "potholes on the right", "0 of 200 alarm", condition=partial(with_road, potholes=one_side))
    yield Group("engine", "healthy", "0 alarm", state=with_engine)
    yield Group("engine", "20 %, 10 min", "", state=with_engine, faults=fault(0.2))
    yield Group("engine", "10 %, 60 min", "95 of 100", state=with_engine, faults=fault(0.1), n_windows=6)
    yield Group("engine", "5 %, 120 min", "95 of 100", state=with_engine, faults=fault(0.05), n_windows=12)
    yield Group("everything", "healthy", "0 alarm", state=with_everything)
    yield Group("everything", "20 %, 10 min", "", state=with_everything, faults=fault(0.2))
    yield Group("everything", "20 %, 30 min", "95 of 100", state=with_everything, faults=fault(0.2), n_windows=3)
    for name, errors in (
        ("5 cm", {"places": 0.05}),
        ("10 cm", {"places": 0.1}),
        ("one sensor 39 cm", {"moved": {imu: (0.3, -0.25, 0.0)}}),
    ):
        state = partial(with_sensors, **errors)
        yield Group("places", f"{name}, healthy", "as with right places", state=state)
        yield Group("places", f"{name}, 20 %, 10 min", "as with right places", state=state, faults=fault(0.2))
    for frequency in (18.0, 24.0, 30.0):
        state = partial(with_torsion, frequency=frequency)
        yield Group("torsion", f"{frequency:g} Hz, healthy", "learnt, tyres within 3 %", state=state)
    tilted = partial(with_sensors, tilt=math.radians(2))
    yield Group("driving", "braking, cornering, slope; tilt 2 deg", "model error 0.04", tilted, rough_driving)
    yield Group("driving", "speed 1 s late at 1 Hz", "model error 0.04", with_gps)
    yield Group("smooth", "road A with single potholes", "springs within 6 %", condition=smooth)
    yield Group("absolute", "complete file, healthy", "90..97 % covered")
    yield Group("intervals", "complete file, 20 %, 10 min", "93..97 % of intervals hold", faults=fault(0.2))
    yield Group("pairs", "two parts, 20 % each, 10 min", "95 of 100", faults=two_faults(0.2))
    yield Group("pairs", "two parts, 20 % each, 20 min", "95 of 100", faults=two_faults(0.2), n_windows=2)
    yield Group("wear", "damper -1 % a drive, 30 drives", "size of now within 2", n_windows=30, is_sequence=True)
    for kind in KINDS:
        yield Group("ageing", f"all {kind}s -20 %, 30 min", "all found", faults=ageing(kind), n_windows=3)
    yield Group("used", "healthy, no baseline", "1 in 1,000", used, has_baseline=False, is_new_car=True)
    for minutes in (10, 30):
        yield Group(
            "used",
            f"20 % from the start, {minutes} min, no baseline",
            "90 %",
            used,
            faults=fault(0.2),
            n_windows=minutes // 10,
            has_baseline=False,
            is_new_car=True,
        )


def _loaded(drive: RoadDrive, *, load: Payload) -> RoadDrive:
    return with_load(drive, load)


ROWS = (
    *("load", "tracks", "engine", "everything", "places", "torsion", "driving", "smooth", "absolute", "intervals"),
    *("pairs", "wear", "ageing", "used"),
)


@dataclass(frozen=True)
class Seen:
    """What a window says in terms of a vehicle file, and what is true of it."""

    vehicle: Vehicle
    observation: Observation
    truth: dict


@dataclass(frozen=True)
class Verdict:
    """Diagnosis of windows, next to the truth."""

    named: tuple[str, ...]
    expected: tuple[str, ...]
    sizes: tuple[tuple[float, float, float, float], ...]  # change, its interval, true change
    seen: tuple[Seen, ...]
    alarm_at: int | None = None
    error: str = ""
    verdict: str = ""
    n_different: int = 0  # windows that differ by the residual test
    n_tested: int = 0


def kept(study: Study, names: tuple[str, ...], asked: object, make: Callable[[], Result]) -> Result:
    """Return what a function makes of something; kept on disk by the code that decides it."""
    name = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:24]
    path = study.folder / code_version(names) / f"{name}.pickle.gz"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.with_suffix(f".{os.getpid()}").write_bytes(gzip.compress(pickle.dumps(make()), compresslevel=1))
        path.with_suffix(f".{os.getpid()}").rename(path)
    return pickle.loads(gzip.decompress(path.read_bytes()))


def driven(study: Study, drive: RoadDrive, seed: Sequence[int]) -> tuple[Recording, dict]:
    """Return the recording of a drive and what is true of it."""

    def make() -> tuple[Recording, dict]:
        run = simulate_drive(study.vehicle, drive, seed=list(seed))
        truth = {key: run.truth[key] for key in ("components", "faults")} | {"body": run.truth["conditions"]["body"]}
        return run.recording, truth

    return kept(study, DRIVES, [vehicle_text(study.vehicle), plain(drive), list(seed)], make)


def window(study: Study, vehicle: Vehicle, drive: RoadDrive, seed: Sequence[int], time: float) -> Seen:
    """Return what a drive says in terms of a vehicle file, its own or a completed one."""

    def make() -> tuple[Observation, dict]:
        recording, truth = driven(study, drive, seed)
        return observe_window(recording, vehicle, time=time), truth

    asked = [vehicle_text(study.vehicle), vehicle_text(vehicle), plain(drive), list(seed), time]
    return Seen(vehicle, *kept(study, OBSERVATIONS, asked, make))


def completed(study: Study, drives: Sequence[tuple[RoadDrive, tuple[int, ...]]], seen: Sequence[Seen]) -> Vehicle:
    """Return the vehicle file completed from drives where it explains them badly."""

    def make() -> str:
        errors = [one.observation.conditions.get("model_error", math.inf) for one in seen]
        recordings = [driven(study, *drives[number])[0] for number in sorted(chosen_windows(len(drives)))]
        spectra = usable_spectra(recordings, study.vehicle)
        calibration = calibrated_if_imperfect(spectra, study.vehicle, model_errors=errors)
        return "" if calibration is None else vehicle_text(calibration.vehicle)

    asked = [vehicle_text(study.vehicle), [[plain(drive), list(seed)] for drive, seed in drives]]
    text = kept(study, CALIBRATIONS, asked, make)
    return vehicle_from_text(text, source="the calibration") if text else study.vehicle


@lru_cache(maxsize=4)
def learnt(study: Study, name: tuple[str, str], individual: int) -> tuple[Vehicle, Baseline]:
    """Return the file and the baseline of a vehicle in the state of the group with a row and a label.

    Raises
    ------
    DataError
        If too few windows are usable.
    """
    group = named_group(study, name)
    drives = [
        (group.state(ordinary(individual, "learning", number)), (individual, 1, number))
        for number in range(study.n_learning)
    ]
    seen = [window(study, study.vehicle, *drive, 600.0 * number) for number, drive in enumerate(drives)]
    vehicle = completed(study, drives, seen)
    if vehicle is not study.vehicle:
        seen = [window(study, vehicle, *drive, 600.0 * number) for number, drive in enumerate(drives)]
    return vehicle, learn([one.observation for one in seen])


def judged(study: Study, group: Group, number: int) -> Verdict:
    """Return the diagnosis number `number` of a group."""
    individual = number if group.is_new_car else number // PER_INDIVIDUAL
    faults = group.faults(number)
    expected = tuple(str(fault.component) for fault in faults)
    vehicle, baseline = study.vehicle, None
    if group.has_baseline:
        try:
            vehicle, baseline = learnt(study, (group.row, group.label), individual)
        except DataError as error:
            return Verdict((), expected, (), (), error=str(error))
    seen = []
    wear = (Wear(part(4 + number), -0.01),)
    for k in range(group.n_windows):
        drive = group.condition(group.state(ordinary(individual, group.label, 100 * number + k)))
        drive = replace(drive, faults=faults)
        if group.is_sequence:
            drive = with_deviations(drive, wear=wear, n_drives=k + 1)
        seed = (individual, 2, zlib.crc32(group.label.encode()), number, k)
        seen.append(window(study, vehicle, drive, seed, 600.0 * (1000 + k)))
    diagnosis = diagnose([one.observation for one in seen], baseline)
    named = tuple(f"{finding.corner}.{finding.component}" for finding in diagnosis.findings)
    true = seen[-1].truth["faults"]
    sizes = tuple(
        (finding.change, *finding.interval, true[name])
        for finding, name in zip(diagnosis.findings, named, strict=True)
        if name in true and finding.interval is not None
    )
    alarm = None if diagnosis.detection is None else diagnosis.detection.first_alert
    alarm_at = None if alarm is None else round(alarm / 600.0) - 1000
    return Verdict(
        *(named, expected or (tuple(true) if group.is_sequence else ()), sizes, tuple(seen), alarm_at),
        verdict=diagnosis.verdict,
        n_different=sum(test.is_different for test in diagnosis.residual_tests.values()),
        n_tested=len(diagnosis.residual_tests),
    )


def log_errors(seen: Sequence[Seen]) -> dict[str, list[tuple[float, float]]]:
    """Return errors of ln values, and their stated standard deviations: left over right by kind, and all springs."""
    errors: dict[str, list[tuple[float, float]]] = {kind: [] for kind in (*KINDS, "springs")}
    for one in seen:
        observation = one.observation
        if not observation.is_conclusive:
            continue
        nominal = structure(one.vehicle).components()
        rows = {component: row for row, component in enumerate(observation.components)}
        truth = {
            c: math.log(one.truth["components"][c.corner][c.kind]["value"] / nominal[c]) for c in observation.components
        }
        error = {c: observation.log_ratios[row] - truth[c] for c, row in rows.items()}
        for component, row in rows.items():
            if component.kind == "spring":
                errors["springs"].append((error[component], math.sqrt(observation.covariance[row, row])))
            if component.side == "left" and component.kind in KINDS:
                other = Component(f"{component.axle}_right", component.kind)
                contrast = np.zeros(len(rows))
                contrast[[row, rows[other]]] = 1.0, -1.0
                std = math.sqrt(contrast @ observation.covariance @ contrast)
                errors[component.kind].append((error[component] - error[other], std))
    return errors


def rms(pairs: Sequence[tuple[float, float]]) -> str:
    return f"{100 * np.sqrt(np.mean([error**2 for error, _ in pairs])):.1f}" if pairs else ""


def covered(pairs: Sequence[tuple[float, float]]) -> str:
    return f"{100 * np.mean([abs(error) <= 1.96 * std for error, std in pairs]):.0f}" if pairs else ""


def share(count: int, total: int) -> str:
    if not total:
        return ""
    low, high = binomial_interval(count, total)
    return f"{count} of {total} ({100 * low:.0f}..{100 * high:.0f} %)"


HEADER = (
    *("row", "condition", "goal", "alarms", "right part", "right corner", "inconclusive"),
    *("differ by residuals", "refused"),
    *("left/right: springs, dampers, tyres, %", "covered, %", "springs, %", "covered, %", "payload, kg"),
    *("model error", "remarks"),
)


def line(group: Group, verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """Return the row of a group in the table."""
    learnt = [verdict for verdict in verdicts if not verdict.error]
    seen = [one for verdict in learnt for one in verdict.seen]
    errors = log_errors(seen)
    alarms = sum(bool(verdict.named) for verdict in learnt)
    right = sum(bool(verdict.expected) and is_right(verdict) for verdict in learnt)
    corners = sum(
        {name.split(".")[0] for name in verdict.named} == {name.split(".")[0] for name in verdict.expected}
        for verdict in learnt
    )
    fine = [one for one in seen if one.observation.is_conclusive]
    payload = [
        one.observation.conditions["payload"] - (one.truth["body"]["mass"] - one.vehicle.body.mass)
        for one in fine
        if "payload" in one.observation.conditions
    ]
    has_faults = any(verdict.expected for verdict in verdicts)
    pairs = [pair for kind in KINDS for pair in errors[kind]]
    return (
        group.row,
        group.label,
        group.goal,
        share(alarms, len(learnt)),
        share(right, len(learnt)) if has_faults else "",
        share(corners, len(learnt)) if has_faults else "",
        share(sum(verdict.verdict == "inconclusive" for verdict in learnt), len(learnt)),
        share(sum(verdict.n_different for verdict in learnt), sum(verdict.n_tested for verdict in learnt)),
        share(len(seen) - len(fine), len(seen)),
        ", ".join(rms(errors[kind]) for kind in KINDS),
        covered(pairs),
        rms(errors["springs"]),
        covered(errors["springs"]),
        f"{np.mean(payload):+.0f} +- {np.std(payload):.0f}" if payload else "",
        f"{np.median([one.observation.conditions['model_error'] for one in fine]):.3f}" if fine else "",
        remarks(group, verdicts),
    )


def is_right(verdict: Verdict) -> bool:
    """Return whether the findings name what is faulty: each part, or all parts of a kind."""
    if len(verdict.expected) == len(CORNERS):
        return verdict.named == (f"all.{verdict.expected[0].split('.')[1]}",)
    return set(verdict.named) == set(verdict.expected)


def remarks(group: Group, verdicts: Sequence[Verdict]) -> str:
    """Return errors of learning, coverage of sizes, names of sensor faults, and the sizes of wear."""
    words = []
    failed = [verdict.error for verdict in verdicts if verdict.error]
    if failed:
        words.append(f"{len(failed)} not learnt: {failed[0]}")
    if any(one.vehicle.learnt for verdict in verdicts for one in verdict.seen):
        words.append("file calibrated")
    sizes = [size for verdict in verdicts for size in verdict.sizes]
    if sizes:
        words.append(
            f"sizes' intervals hold {share(sum(low <= true <= high for _, low, high, true in sizes), len(sizes))}"
        )
    reasons = [
        one.observation.reason for verdict in verdicts for one in verdict.seen if not one.observation.is_conclusive
    ]
    if reasons:
        words.append(max(set(reasons), key=reasons.count))
    sensor_faults = {
        f"{fault.channel} {fault.kind}"
        for verdict in verdicts
        for one in verdict.seen
        for fault in one.observation.sensor_faults
    }
    if sensor_faults:
        words.append(f"sensors: {', '.join(sorted(sensor_faults))}")
    wrong = [", ".join(verdict.named) for verdict in verdicts if verdict.named and not is_right(verdict)]
    if wrong:
        words.append(f"named: {max(set(wrong), key=wrong.count)}")
    if group.is_sequence:
        for verdict in verdicts:
            first = None if verdict.alarm_at is None else 0.99 ** (verdict.alarm_at + 1) - 1
            said = ", ".join(f"{100 * size[0]:.1f} %" for size in verdict.sizes)
            at = "no alarm" if first is None else f"first alarm at {100 * first:.1f} %"
            words.append(
                f"{at}, says {said or 'nothing of it'} where {100 * (0.99**group.n_windows - 1):.1f} % is true"
            )
    return "; ".join(words)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    option = arguments.add_argument
    option("rows", nargs="*", metavar="ROW", help=f"of the table, in this order: {', '.join(ROWS)} (default: all)")
    option("--windows", type=int, default=8, metavar="N", help="diagnoses of each kind (default: 8)")
    option("--learning", type=int, default=12, metavar="N", help="windows of a baseline, at least 6 (default: 12)")
    option(
        "--longest",
        type=int,
        default=30,
        metavar="N",
        help="leave out kinds whose diagnosis takes more than N windows (default: 30, none)",
    )
    option("--vehicle", default="zafira", metavar="V.toml|NAME", help="vehicle file, or name of a shipped one")
    option("--jobs", type=int, default=1, metavar="N", help="processes (default: 1)")
    option(
        "--cache",
        type=Path,
        default=Path.home() / ".cache" / "sprung-conditions",
        metavar="DIR",
        help="folder of drives and observations (default: ~/.cache/sprung-conditions)",
    )
    option("--out", type=Path, metavar="FILE", help="write the table to this file, too (Markdown)")
    given = arguments.parse_args()
    unknown = set(given.rows) - set(ROWS)
    if unknown:
        arguments.error(f"no row {', '.join(sorted(unknown))}: choose from {', '.join(ROWS)}")
    vehicle = read_vehicle(given.vehicle)
    thermometer = Sensor(channel="temperature", quantity="temperature", unit="degC")
    vehicle = vehicle.model_copy(update={"sensor": (*vehicle.sensor, thermometer)})
    study = Study(vehicle, given.learning, given.cache)
    lines = [
        f"`python -m benchmarks.conditions`, {vehicle.name}, {given.windows} diagnoses of a kind, "
        f"{given.learning} windows of a baseline, code {code_version(CALIBRATIONS)}",
        "",
        f"| {' | '.join(HEADER)} |",
        "|" + "---|" * len(HEADER),
    ]
    print("\n".join(lines), flush=True)
    with ProcessPoolExecutor(given.jobs) as pool:
        for group in (group for row in given.rows or ROWS for group in groups(vehicle) if group.row == row):
            if group.n_windows > given.longest:
                continue
            verdicts = list(pool.map(partial(judge, study, (group.row, group.label)), range(given.windows)))
            lines.append(f"| {' | '.join(line(group, verdicts))} |")
            print(lines[-1], flush=True)
            if given.out:
                given.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


def judge(study: Study, name: tuple[str, str], number: int) -> Verdict:
    """Return a diagnosis of the group with a row and a label, in a process of its own."""
    return judged(study, named_group(study, name), number)


def named_group(study: Study, name: tuple[str, str]) -> Group:
    """Return the group with a row and a label."""
    return next(group for group in groups(study.vehicle) if (group.row, group.label) == name)


if __name__ == "__main__":
    main()
