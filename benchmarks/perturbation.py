"""Change one number of a method at a time, by 0.7 and by 1.4, and list what the benchmarks notice.

    python -m benchmarks.perturbation identification signals
    python -m benchmarks.perturbation likelihood diagnosis calibration --jobs 2 --out perturbation.json

A number is a constant of a module or a field of a frozen settings value with a default. Its rows are those of the
rooms that it can change: certified records by five methods; corners of drives with and without speed, with potholes and
loads, and on a rig; faults of sensors; a baseline, healthy windows, faults of the suspension and a type; a calibration.
A row notices a change if one of its figures moves in the third digit, or a word does. A number that no row notices at
0.7 or at 1.4 is a candidate to go: first look for the case that it was made for. Drives are kept in a folder.
"""

import argparse
import ast
import importlib.abc
import importlib.util
import json
import multiprocessing
import os
import pickle
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "sprung"
FACTORS = (0.7, 1.4)
RECORDS = (
    "bogie",
    "chain-snr05",
    "chain-snr10",
    "close-modes",
    "correlated-noise",
    "heavy-damping",
    "light-damping",
    "many-channels",
    "short",
    "tone",
)
#: Imported before the trials fork.
HEAVY = ("scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.stats")
#: Digits of figures that are compared, and the smallest figure that counts, of the largest in its row.
DIGITS, SMALLEST = 3, 1e-6


@dataclass(frozen=True)
class Number:
    """A number of the source: the `place`-th one in the value that is assigned to `name`, inside `owner` if a class."""

    path: str
    owner: str
    name: str
    place: int
    value: float


def numbers(path: Path) -> Iterator[Number]:
    """Yield the numbers of a module that are constants or defaults of fields."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    owners = [("", tree.body), *((node.name, node.body) for node in tree.body if isinstance(node, ast.ClassDef))]
    for owner, body in owners:
        for target, value in _assigned(body):
            for place, node in enumerate(_constants(value)):
                yield Number(str(path.relative_to(SOURCE)), owner, target, place, node.value)


def _assigned(body: Sequence[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    for node in body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        if targets and node.value is not None:
            yield ast.unparse(targets[0]), node.value


def _constants(value: ast.expr) -> list[Any]:
    found = [node for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return [node for node in found if type(node.value) in {int, float} and node.value != 0]


def changed(number: Number, factor: float) -> ast.Module:
    """Return the module of a number with the number changed; whole numbers by one at least."""
    tree = ast.parse((SOURCE / number.path).read_text(encoding="utf-8"))
    bodies = {"": tree.body} | {node.name: node.body for node in tree.body if isinstance(node, ast.ClassDef)}
    value = dict(_assigned(bodies[number.owner]))[number.name]
    node = _constants(value)[number.place]
    if type(node.value) is int:
        step = max(1, round(abs(node.value * (factor - 1))))
        node.value += step if factor > 1 else -step
    else:
        node.value *= factor
    return tree


class Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finder of the one module that is changed."""

    def __init__(self, path: str, tree: ast.Module) -> None:
        parts = ("sprung", *Path(path).with_suffix("").parts)
        self._name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        self._path, self._tree = SOURCE / path, tree

    def find_spec(self, name: str, path: object = None, target: object = None) -> Any:
        """Return the specification of the changed module."""
        if name != self._name:
            return None
        folder = [str(self._path.parent)] if self._path.name == "__init__.py" else None
        return importlib.util.spec_from_file_location(name, self._path, loader=self, submodule_search_locations=folder)

    def exec_module(self, module: Any) -> None:
        """Run the changed module."""
        exec(compile(ast.fix_missing_locations(self._tree), str(self._path), "exec"), module.__dict__)


# --- Rows: names and what is compared -----------------------------------------------------------------------------


def identification_rows(data: dict[str, Any]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield the identifications of the certified records."""
    import sprung

    def modes(method: Callable[..., Any], name: str, **options: Any) -> object:
        found = method(data["records"][name], **options)
        return [
            found.modes.natural_frequency,
            found.modes.damping_ratio,
            found.modes.natural_frequency_std,
            len(found.notes),
        ]

    for name in data["records"]:
        yield f"cov {name}", lambda name=name: modes(sprung.cov_ssi, name)
    for name in ("chain-snr05", "bogie"):
        yield f"acs {name}", lambda name=name: modes(sprung.acs_ssi, name)
        yield f"coss {name}", lambda name=name: modes(sprung.coss_ssi, name)
        yield f"fdd {name}", lambda name=name: modes(sprung.enhanced_fdd, name)
        yield f"plscf {name}", lambda name=name: modes(sprung.poly_lscf, name)
    yield "road", lambda: modes(sprung.cov_ssi, "drive", vehicle=data["vehicle"])
    yield "harmonics", lambda: modes(sprung.cov_ssi, "wheel orders")
    yield "tracks", lambda: _plain([(track.modes, track.times) for track in sprung.track_modes(data["windows"]).tracks])


def corner_rows(data: dict[str, Any]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield the fits of corners."""
    import sprung

    def fitted(name: str) -> object:
        fit = sprung.fit_corners(data["drives"][name], data["vehicle"])
        return [fit.values, fit.log_ratios_std, fit.model_error, len(fit.notes)]

    for name in data["drives"]:
        yield f"corners {name}", lambda name=name: fitted(name)


def diagnosis_rows(data: dict[str, Any]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield faults of sensors, and diagnoses of observed windows."""
    import sprung
    from sprung.diagnosis import sensor_faults

    for name, run in data["sensors"].items():
        yield (
            f"sensors {name}",
            lambda run=run: [(f.channel, f.kind, f.detail) for f in sensor_faults(run, data["vehicle"])],
        )
    yield "observe", lambda: _plain(list(sprung.observe([data["drives"]["road"]], data["vehicle"], length=240.0)))
    for name, windows in data["diagnosed"].items():
        yield f"diagnose {name}", lambda windows=windows: _diagnosed(data["learning"], windows)
        yield f"alone {name}", lambda windows=windows: _plain(sprung.diagnose(windows))
    yield "type", lambda: _plain(sprung.learn_type({str(k): data["learning"][k : k + 2] for k in range(6)}))


def calibration_rows(data: dict[str, Any]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield a calibration and a vehicle from a data sheet."""
    import sprung

    yield "calibrate", lambda: _plain(sprung.calibrate(data["calibration"], data["vehicle"]))
    yield (
        "describe",
        lambda: _plain(sprung.described(sprung.DataSheet(mass=1400.0, wheelbase=2.6, track=1.5, tyre="205/55R16"))),
    )


ROWS = (
    (("identification", "signals", "likelihood"), identification_rows),
    (("likelihood", "signals", "vehicles"), corner_rows),
    (("diagnosis", "signals", "vehicles"), diagnosis_rows),
    (("calibration",), calibration_rows),
)


def _diagnosed(learning: Any, windows: Any) -> object:
    import sprung

    answer = sprung.diagnose(windows, sprung.learn(learning))
    return [_plain(answer.findings), str(answer.verdict), sorted(map(str, answer.notes))]


def _plain(value: object) -> object:
    """Return a value as lists of figures and words."""
    if isinstance(value, int | float | str | bytes | np.ndarray | np.number | None):
        return value
    if isinstance(value, dict):
        return [(str(key), _plain(each)) for key, each in value.items()]
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(each) for each in value]
    fields = getattr(value, "__dataclass_fields__", None)
    return [_plain(getattr(value, name)) for name in fields] if fields else str(value)


def digest(value: object, *, scale: float = 0.0) -> object:
    """Return a value whose figures are rounded to the digits that are compared."""
    if isinstance(value, np.ndarray):
        scale = float(np.nanmax(np.abs(value), initial=0.0)) if value.dtype.kind in "fc" else 0.0
        return tuple(digest(each, scale=scale) for each in value.ravel().tolist())
    if isinstance(value, list | tuple):
        return tuple(digest(each) for each in value)
    if isinstance(value, complex):
        return digest(value.real, scale=scale), digest(value.imag, scale=scale)
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if abs(value) > SMALLEST * scale else 0.0
    return value


# --- Trials -------------------------------------------------------------------------------------------------------


def trial(number: Number | None, factor: float, rooms: Sequence[str], folder: Path) -> dict[str, object]:
    """Return the digest of each row in a process of its own, with a number changed; what failed is a row, too."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        answer: dict[str, object] = {}
        try:
            if number is not None:
                sys.meta_path.insert(0, Changed(number.path, changed(number, factor)))
            data = pickle.loads((folder / "data.pickle").read_bytes())
            for names, rows in ROWS:
                for row, compute in rows(data) if set(names) & set(rooms) else ():
                    started = time.process_time()
                    try:
                        answer[row] = repr(digest(compute()))
                    except Exception as error:  # a refusal is an answer
                        answer[row] = f"{type(error).__name__}: {error}"
                    if number is None:
                        print(
                            f"{time.process_time() - started:6.2f} s  {row}: {str(answer[row])[:90]}", file=sys.stderr
                        )
        except Exception as error:  # a module that cannot be imported
            answer["import"] = repr(error)
        with os.fdopen(writer, "wb") as out:
            pickle.dump(answer, out)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as into:
        received = into.read()
    os.waitpid(child, 0)
    return pickle.loads(received) if received else {"process": "ended"}


def make_data(folder: Path) -> None:
    """Simulate drives and observe windows once."""
    from benchmarks.certified.score import counted, load

    import sprung
    from sprung.simulation import FEW_POTHOLES, Payload, RigRun, RoadConditions, RoadDrive, WheelOrders, simulate_drive
    from sprung.simulation.sensors import inverted, with_imperfections
    from sprung.vehicles import parse_fault, read_vehicle

    vehicle = read_vehicle("zafira")
    short = RoadDrive(duration=240.0, sampling_rate=100.0, snr=50.0)

    def driven(seed: int, drive: RoadDrive = short, *faults: str) -> Any:
        return simulate_drive(vehicle, replace(drive, faults=tuple(map(parse_fault, faults))), seed=seed).recording

    potholes = replace(short, road=RoadConditions("C", potholes=FEW_POTHOLES), payload=Payload(200.0))
    road = driven(1)
    records: dict[str, Any] = {}
    for name in RECORDS:
        answer = load(name)
        samples, heads = counted(name, 0)[0]
        channels = tuple(sprung.Channel(head, answer["quantity"]) for head in heads)
        records[name] = sprung.Recording(samples, answer["sampling_rate"], channels)
    records["drive"] = road
    drives = {
        "road": road,
        "potholes": driven(2, potholes),
        "without speed": road.select([name for name in road.names if name != "speed"]),
        "rig": simulate_drive(vehicle, RigRun(duration=240.0, sampling_rate=100.0), seed=3).recording,
        "spring": driven(4, short, "front_left.spring=-0.2"),
        "wheel orders": driven(5, replace(short, wheel_orders=WheelOrders())),
    }
    sensors = {"inverted": with_imperfections(road, [partial(inverted, channel="acc_rr")])}
    samples = road.samples.copy()
    rng = np.random.default_rng(5)
    size, rate = road.n_samples, road.sampling_rate
    k = road.index("acc_fl")
    times = np.arange(size) / rate
    rms = float(np.std(samples[k]))
    made: dict[str, Callable[[Any], Any]] = {
        "dead": lambda y: np.where(times > 100, 0.0, y),
        "stuck": lambda y: np.where(times > 100, y[int(100 * rate)], y),
        "clipped": lambda y: np.clip(y, -1.2 * rms, 1.2 * rms),
        "spiking": lambda y: y + np.where(rng.random(size) < 0.002, 12 * rms, 0.0),
        "noisy": lambda y: y + rms * rng.standard_normal(size),
        "drifting": lambda y: y + 3 * rms * np.cumsum(rng.standard_normal(size)) / np.sqrt(size),
        "hum": lambda y: y + rms * np.sin(2 * np.pi * 17.0 * times),
        "gain": lambda y: 1.15 * y,
        "late": lambda y: np.roll(y, int(0.02 * rate) + 1),
        "small gain": lambda y: 1.05 * y,
        "missing": lambda y: np.where(rng.random(size) < 0.3, np.nan, y),
    }
    for kind, change in made.items():
        wrong = samples.copy()
        wrong[k] = change(wrong[k])
        sensors[kind] = replace(road, samples=wrong)
    swapped = samples.copy()
    swapped[[road.index("acc_fl"), road.index("acc_fr")]] = samples[[road.index("acc_fr"), road.index("acc_fl")]]
    sensors["swapped"] = replace(road, samples=swapped)

    def observed(seeds: range, *faults: str) -> Any:
        return sprung.observe([driven(seed, short, *faults) for seed in seeds], vehicle, length=240.0)

    learning = observed(range(10, 18))
    diagnosed = {"healthy": observed(range(20, 22))}
    for fault in ("front_left.spring=-0.1", "rear_right.damper=-0.3", "front_right.tyre=-0.15"):
        diagnosed[fault] = observed(range(30, 32), fault)
    records["wheel orders"] = drives["wheel orders"]
    calibration = [driven(seed, replace(short, duration=150.0)) for seed in (40, 41)]
    chain = records["chain-snr10"]
    part = chain.n_samples // 6
    windows = [sprung.cov_ssi(chain.part(k * part, (k + 1) * part)).modes for k in range(6)]
    data = {
        "records": records,
        "windows": windows,
        "vehicle": vehicle,
        "drives": drives,
        "sensors": sensors,
        "learning": learning,
        "diagnosed": diagnosed,
        "calibration": calibration,
    }
    (folder / "data.pickle").write_bytes(pickle.dumps(data))


def noticed(before: dict[str, object], after: dict[str, object]) -> list[str]:
    """Return the rows that differ."""
    return sorted(row for row in before.keys() | after.keys() if before.get(row) != after.get(row))


def main() -> int:
    """Try the numbers of some rooms and print what notices them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "perturbation")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    if not (arguments.folder / "data.pickle").exists():
        made = multiprocessing.get_context("fork").Process(target=make_data, args=(arguments.folder,))
        made.start()
        made.join()
        if made.exitcode:
            return 1
    for name in HEAVY:
        importlib.import_module(name)
    found: list[dict[str, Any]] = []
    for room in arguments.rooms:
        before = trial(None, 1.0, [room], arguments.folder)
        tried = [number for path in sorted((SOURCE / room).rglob("*.py")) for number in numbers(path)]
        with ThreadPoolExecutor(arguments.jobs) as pool:
            trials = [
                [pool.submit(trial, number, factor, [room], arguments.folder) for factor in FACTORS] for number in tried
            ]
            for number, both in zip(tried, trials, strict=True):
                rows = [noticed(before, each.result()) for each in both]
                found.append(asdict(number) | {"rows": rows})
                name = ".".join(filter(None, (number.owner, number.name)))
                counts = f"{len(rows[0])} and {len(rows[1])} rows"
                print(f"{number.path}: {name}[{number.place}] = {number.value:g}: {counts}", flush=True)
                if arguments.out:
                    arguments.out.write_text(json.dumps(found, indent=1), encoding="utf-8")
    unnoticed = [each for each in found if not any(each["rows"])]
    print(f"{len(found)} numbers, {len(unnoticed)} that no row notices")
    return 0


if __name__ == "__main__":
    sys.exit(main())
