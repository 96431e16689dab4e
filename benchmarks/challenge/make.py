"""Make a set of the challenge: recordings for those who enter, and the truth apart from them.

Every random number comes from SHA-256 of the salt, the seed and the name of what it decides. Without the salt nobody
can repeat a set; with it anyone can, and knows the truth.
"""

import hashlib
import json
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.certified.make import ANSWERS, record_files
from benchmarks.certified.score import certified_vehicle

from sprung.recording import Recording
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_FORCE_LAWS,
    Deviations,
    PartScatter,
    Payload,
    RailDrive,
    RoadConditions,
    RoadDrive,
    SuspensionConditions,
    simulate_drive,
)
from sprung.vehicles import Component, Fault, MountedMass, Vehicle, read_vehicle, structure, vehicle_text

CARS = ("zafira", *(str(path) for path in sorted((Path(__file__).parents[1] / "vehicles").glob("*.toml"))))
CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
PARTS = {
    "road": tuple(f"{corner}.{kind}" for corner in CORNERS for kind in ("spring", "damper", "tyre")),
    "rail": tuple(f"{corner}.{kind}" for corner in CORNERS for kind in ("spring", "damper")),
}
PARTS["multibody"] = PARTS["road"]
#: What is known of every life before its recordings: probability that it is healthy, smallest and largest loss.
HEALTHY, LOSSES = 1 / 3, (0.05, 0.5)
#: Standard deviation of ln(value / value in the file) of every part in the task of corner values.
SCATTER = 0.15
#: Shares of lives in which the loss grows, the vehicle has an engine that its file lacks, and the watched recordings
#: have a load on the left or a rougher right track, which the learning ones have not.
GROWING, ENGINE, UNMET = 0.25, 0.25, 0.4
CLICKS = ("00083", "00084", "00085", "00086", "00087")
#: Time stamp of everything in an archive, so that equal contents have equal hashes.
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Sizes:
    """How many cases a set has, and how long their recordings are [s]."""

    road: int = 25
    multibody: int = 5
    rail: int = 10
    corners: int = 8
    learning: int = 8
    watched: int = 8
    life_duration: float = 150.0
    corner_duration: float = 600.0

    @property
    def onsets(self) -> tuple[int, int]:
        """First and last number of a recording that may be the first changed one."""
        return self.learning + 2, self.learning + self.watched - 2


@dataclass(frozen=True)
class Source:
    """Where random numbers come from."""

    salt: str
    seed: int

    def __call__(self, *what: object) -> np.random.Generator:
        text = json.dumps([self.salt, self.seed, *map(str, what)])
        return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest(), "big"))


@dataclass(frozen=True)
class Life:
    """Truth of a life: the part that changed, its first changed recording, and its relative change after the last."""

    name: str
    kind: str
    part: str | None = None
    since: int | None = None
    change: float = 0.0
    is_growing: bool = False

    def change_at(self, number: int, last: int) -> float:
        """Return the relative change of the part in a recording; they are numbered from 1."""
        if self.since is None or number < self.since:
            return 0.0
        share = (number - self.since + 1) / (last - self.since + 1) if self.is_growing else 1.0
        return self.change * share


def lives(source: Source, sizes: Sizes) -> Iterator[Life]:
    """Yield the lives of a set."""
    counts = {"road": sizes.road, "multibody": sizes.multibody, "rail": sizes.rail}
    for kind, count in counts.items():
        for number in range(1, count + 1):
            name = f"{kind}-{number:02d}"
            generator = source(name, "truth")
            if generator.uniform() < HEALTHY:
                yield Life(name, kind)
                continue
            part, (first, last) = str(generator.choice(PARTS[kind])), sizes.onsets
            loss = float(np.exp(generator.uniform(*np.log(LOSSES))))
            since = int(generator.integers(first, last + 1))
            yield Life(name, kind, part, since, -round(loss, 4), bool(generator.uniform() < GROWING))


def corner_case(source: Source, name: str) -> tuple[Vehicle, dict[str, float], dict[str, float]]:
    """Return the vehicle file of a corner case, what of its masses is otherwise, and the factors on its parts."""
    generator = source(name, "truth")
    number = int(name.rpartition("-")[2])
    file = vehicle_like(CARS[number % len(CARS)], generator)
    wrong = {
        key: float(generator.uniform(-0.05, 0.05)) * (number % 2) for key in ("mass", "pitch_inertia", "roll_inertia")
    }
    return file, wrong, {part: float(np.exp(SCATTER * generator.standard_normal())) for part in PARTS["road"]}


def truth(source: Source, sizes: Sizes) -> dict[str, Any]:
    """Return the truth of a set, without simulating anything; modes are those of the certified records."""
    corners = {}
    for name in (f"corners-{number:02d}" for number in range(1, sizes.corners + 1)):
        file, _, factors = corner_case(source, name)
        nominal = structure(file).components()
        values = {part: nominal[Component.parse(part)] for part in factors}
        corners[name] = {
            "parts": {
                part: {"value": float(f"{values[part] * factor:.6g}"), "file": float(f"{values[part]:.6g}")}
                for part, factor in factors.items()
            }
        }
    return {
        "schema": "sprung.challenge-truth/1",
        "salt": source.salt,
        "seed": source.seed,
        "corners": corners,
        "lives": {
            life.name: {
                "kind": life.kind,
                "parts": list(PARTS[life.kind]),
                "onsets": sizes.onsets,
                "part": life.part,
                "since": life.since,
                "change": life.change,
            }
            for life in lives(source, sizes)
        },
        "order": {"rebound-clicks": {"parts": CLICKS}},
    }


def answers() -> list[Path]:
    """Return the answers of the certified records of every set; later records would change the sets that are sealed."""
    return sorted(path for path in ANSWERS.glob("*.json") if path.stem != "iasc-asce")


def _certified_modes(path: Path) -> dict[str, Any]:
    """Return the certified numbers of the modes of a record, and those of modes that may be reported or not."""
    answer, shapes = json.loads(path.read_text(encoding="utf-8")), "mode_shape"
    return {
        key: [{name: value for name, value in mode.items() if name != shapes} for mode in answer.get(key, [])]
        for key in ("modes", "optional_modes")
    }


def vehicle_like(name: str, generator: np.random.Generator) -> Vehicle:
    """Return a vehicle file whose numbers differ by some per cent from those of a type."""
    file = read_vehicle(name)
    body, *springs = generator.normal(1.0, 0.05, 1 + 2 * len(file.axle))
    axles = (
        axle.model_copy(update={"spring_stiffness": axle.spring_stiffness * spring, "damping": axle.damping * damper})
        for axle, spring, damper in zip(file.axle, springs[::2], springs[1::2], strict=True)
    )
    masses = {key: getattr(file.body, key) * body for key in ("mass", "pitch_inertia", "roll_inertia")}
    return file.model_copy(update={"body": file.body.model_copy(update=masses), "axle": tuple(axles)})


def corner_drive(source: Source, name: str, sizes: Sizes) -> tuple[Vehicle, list[Recording]]:
    """Return the vehicle file and the drive of a corner case: a linear vehicle, and white noise of the sensors."""
    file, wrong, factors = corner_case(source, name)
    generator = source(name, "drive")
    settings = RoadDrive(
        sampling_rate=100.0,
        duration=sizes.corner_duration,
        road=RoadConditions(str(generator.choice(["B", "C"]))),
        snr=float(generator.uniform(30, 80)),
        deviations=Deviations(values=wrong),
        faults=tuple(Fault(Component.parse(part), factor - 1) for part, factor in factors.items()),
    )
    return file, [simulate_drive(file, settings, seed=int(generator.integers(2**31))).recording]


def road_life(source: Source, life: Life, sizes: Sizes) -> tuple[Vehicle, list[Recording]]:
    """Return the vehicle file and the recordings of a road vehicle in the nonlinear simulator."""
    own = source(life.name, "vehicle")
    file = vehicle_like(str(own.choice(CARS)), own)
    engine = MountedMass(mass=0.12 * file.body.mass, x=0.9 * file.axle[0].x, frequency=11.0, damping_ratio=0.08)
    real = Deviations(
        values={"mass": float(own.normal(0, 0.04)), "pitch_inertia": float(own.normal(0, 0.06))},
        scatter=PartScatter(),
        mounted_masses=(engine,) if own.uniform() < ENGINE else (),
        individual=int(own.integers(2**31)),
    )
    is_unmet, is_load = own.uniform() < UNMET, own.uniform() < 0.5

    def drive(number: int, generator: np.random.Generator) -> Recording:
        unmet = is_unmet and number > sizes.learning
        load = Payload(0.1 * file.body.mass, -0.3, 0.45)
        settings = RoadDrive(
            sampling_rate=100.0,
            duration=sizes.life_duration,
            speed=(float(generator.uniform(5, 8)), float(generator.uniform(16, 24))),
            road=RoadConditions(
                str(generator.choice(["A", "B", "C", "D"], p=[0.1, 0.35, 0.4, 0.15])),
                FEW_POTHOLES,
                2.5 if unmet and not is_load else 0.0,
            ),
            payload=(
                Payload(float(generator.uniform(0, 0.2)) * file.body.mass, float(generator.uniform(-0.6, 0.3))),
                *((load,) if unmet and is_load else ()),
            ),
            suspension=SuspensionConditions(float(generator.uniform(0, 40)), REALISTIC_FORCE_LAWS),
            snr=float(generator.uniform(30, 80)),
            deviations=real,
            faults=_faults(life, number, sizes),
        )
        return simulate_drive(file, settings, seed=int(generator.integers(2**31))).recording

    return file, _recordings(source, life, sizes, drive)


def rail_life(source: Source, life: Life, sizes: Sizes) -> tuple[Vehicle, list[Recording]]:
    """Return the vehicle file and the recordings of a bogie with one stage of suspension on a track."""
    own = source(life.name, "vehicle")
    file = vehicle_like("y25", own)
    real = Deviations(scatter=PartScatter(), individual=int(own.integers(2**31)))

    def drive(number: int, generator: np.random.Generator) -> Recording:
        settings = RailDrive(
            sampling_rate=200.0,
            duration=sizes.life_duration,
            speed=(float(generator.uniform(12, 18)), float(generator.uniform(24, 32))),
            suspension=SuspensionConditions(float(generator.uniform(0, 40))),
            snr=float(generator.uniform(30, 80)),
            deviations=real,
            faults=_faults(life, number, sizes),
        )
        return simulate_drive(file, settings, seed=int(generator.integers(2**31))).recording

    return file, _recordings(source, life, sizes, drive)


def multibody_life(source: Source, life: Life, sizes: Sizes) -> tuple[Vehicle, list[Recording]]:
    """Return a file from the data sheet and the recordings of a car of the general multibody engine."""
    from benchmarks.multibody.__main__ import ordinary, sheet_file, unmet
    from benchmarks.multibody.design import DESIGNS, Effects, Faults, sensor_places
    from benchmarks.multibody.drive import RATE, driven

    from sprung.recording import Channel

    own, design = source(life.name, "vehicle"), DESIGNS["car"]
    individual, is_unmet = int(own.integers(2**31)), own.uniform() < UNMET
    channels = (*(Channel(name, "acceleration") for name in sensor_places(design)), Channel("speed", "speed"))

    def drive(number: int, generator: np.random.Generator) -> Recording:
        choose = unmet if is_unmet and number > sizes.learning else ordinary
        change = life.change_at(number, sizes.learning + sizes.watched)
        conditions = replace(
            choose(design, int(generator.integers(2**31))),
            duration=sizes.life_duration,
            faults=Faults({life.part: 1 + change} if life.part and change else {}),
        )
        seed = int(generator.integers(2**31))
        samples, speed = driven(design, Effects(), conditions, individual=individual, seed=seed)
        return Recording(np.vstack([samples.T, speed]), RATE, channels)

    return sheet_file(design), _recordings(source, life, sizes, drive)


def _recordings(
    source: Source, life: Life, sizes: Sizes, drive: Callable[[int, np.random.Generator], Recording]
) -> list[Recording]:
    numbers = range(1, sizes.learning + sizes.watched + 1)
    return [drive(number, source(life.name, "recording", number)) for number in numbers]


def _faults(life: Life, number: int, sizes: Sizes) -> tuple[Fault, ...]:
    change = life.change_at(number, sizes.learning + sizes.watched)
    return (Fault(Component.parse(life.part), change),) if life.part and change else ()


LIVES = {"road": road_life, "multibody": multibody_life, "rail": rail_life}


def make_set(
    folder: Path, source: Source, *, sizes: Sizes = Sizes(), only: str = "*", report: Callable[[str], None] = print
) -> dict[str, Any]:
    """Write the recordings of a set with their manifest to `folder`, and return the manifest.

    Lives and drives whose files are there already are kept, so that a run that was interrupted goes on.
    """
    path = folder / "manifest.json"
    manifest: dict[str, Any] = {"schema": "sprung.challenge-set/1", "modes": {}, "corners": {}, "lives": {}}
    if path.exists():
        manifest = json.loads(path.read_text(encoding="utf-8"))
    for name in (each.stem for each in answers()):
        if fnmatch(name, only):
            manifest["modes"][name] = _record(folder, source, name)
            report(name)
    for name in (f"corners-{number:02d}" for number in range(1, sizes.corners + 1)):
        if fnmatch(name, only):
            case = _case(folder, f"corners/{name}", partial(corner_drive, source, name, sizes))
            manifest["corners"][name] = case | {"parts": PARTS["road"]}
            report(name)
    for life in lives(source, sizes):
        if fnmatch(life.name, only):
            case = _case(folder, f"lives/{life.name}", partial(LIVES[life.kind], source, life, sizes))
            facts = {"kind": life.kind, "learning": sizes.learning, "parts": PARTS[life.kind]}
            manifest["lives"][life.name] = facts | case
            report(life.name)
    manifest["order"] = {"rebound-clicks": {"parts": CLICKS, "files": [f"{one}.SST" for one in CLICKS]}}
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    return manifest


def _record(folder: Path, source: Source, name: str) -> dict[str, Any]:
    """Write another draw of a certified record, and return its entry of the manifest."""
    answer = json.loads((ANSWERS / f"{name}.json").read_text(encoding="utf-8"))
    runs = record_files(name, int(source(name, "draw").integers(1, 2**31)))
    facts = {key: answer[key] for key in ("sampling_rate", "quantity")}
    facts["lowest"] = float(f"{answer['modes'][0]['natural_frequency']:.1g}")
    facts["files"] = [
        save(folder, f"modes/{name}-{k}.npz", samples, heads, answer["sampling_rate"])
        for k, (_, samples, heads) in enumerate(runs, start=1)
    ]
    if "corners" in answer:
        facts["vehicle"] = f"modes/{name}.toml"
        (folder / facts["vehicle"]).write_text(vehicle_text(certified_vehicle(answer)), encoding="utf-8")
    return facts


def _case(folder: Path, name: str, make: Callable[[], tuple[Vehicle, list[Recording]]]) -> dict[str, Any]:
    """Write the vehicle file and the recordings of a case, and return where they are."""
    vehicle = folder / name / "vehicle.toml"
    if not vehicle.exists():
        file, recordings = make()
        for number, one in enumerate(recordings, start=1):
            save(folder, f"{name}/{number:02d}.npz", one.samples, one.names, one.sampling_rate)
        vehicle.write_text(vehicle_text(file), encoding="utf-8")
    files = sorted(path.relative_to(folder).as_posix() for path in vehicle.parent.glob("*.npz"))
    return {"vehicle": vehicle.relative_to(folder).as_posix(), "files": files}


def save(folder: Path, name: str, samples: Any, channels: Any, sampling_rate: float) -> str:
    """Write samples as single-precision numbers, shape (channels, samples), and return the name of the file."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        path, samples=np.asarray(samples, dtype=np.float32), channels=list(channels), sampling_rate=sampling_rate
    )
    return name


def archive(path: Path, contents: Mapping[str, bytes]) -> str:
    """Write files as an archive that depends on their contents alone, and return its SHA-256."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as packed:
        for name in sorted(contents):
            packed.writestr(zipfile.ZipInfo(name, _EPOCH), contents[name])
    return hashlib.sha256(path.read_bytes()).hexdigest()


def truth_archive(path: Path, source: Source, sizes: Sizes = Sizes()) -> str:
    """Write the archive of the truth of a set, and return its SHA-256."""
    return archive(path, {"truth.json": json.dumps(truth(source, sizes), indent=1).encode()})


def read_truth(path: Path) -> dict[str, Any]:
    """Return the truth in an archive, with the certified answers."""
    with zipfile.ZipFile(path) as packed:
        document: dict[str, Any] = json.loads(packed.read("truth.json"))
    return document | {"modes": {each.stem: _certified_modes(each) for each in answers()}}
