"""Roughness index of simulated roads from the motion of cars, beside that of the true profile.

    python -m benchmarks.road [--minutes M] [--drawn N] [--multibody | --smoother]

First a row for each class and vehicle file: the true one, or one from a data sheet alone (`described`). Then cars that
are drawn from what the data sheet leaves open, each on one of these roads. Then one road under three cars at five
speeds. Values are the index of 100 m of a track over that of the profile that was driven: bias
and RMS of the error, and share of 95 % intervals that hold; for the one road also the RMS over the mean of all drives.
With `--multibody` (needs mujoco) the car of `benchmarks.multibody` drives, which no file describes exactly, with the
file from its data sheet and with that file calibrated on five drives. With `--smoother` a row for each class and way
from the motion to the road: the product's spectral inverse, and a Rauch-Tung-Striebel smoother of the same fitted car.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.measuring import print_table
from benchmarks.smoother import smoothed

from sprung.calibration import DataSheet, described
from sprung.excitation import road_class, surface
from sprung.likelihood import CornerFit
from sprung.recording import Recording
from sprung.road import RoadProfile, RoadSurvey, road_profile, survey, survey_road, suspension_slope
from sprung.road.tracks import Track
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Vehicle, read_vehicle
from sprung.vehicles.window import Window

CASES = (
    ("A", (20.0, 30.0)),
    ("B", (10.0, 14.0)),
    ("C", (8.0, 9.5)),
    ("C", (15.0, 20.0)),
    ("D", (12.0, 16.0)),
    ("E", (10.0, 14.0)),
)
SPACING = 0.05
#: Speeds on the one road [km/h], each within 10 %, its class, and its length [m].
SPEEDS, CLASS, LENGTH = (30, 50, 70, 90, 110), "C", 4000.0
VEHICLES = Path(__file__).parent / "vehicles"
#: What the data sheet of the car states.
SHEET = DataSheet(mass=1642.0, wheelbase=2.8, track=1.404, tyre="195/65R15", name="zafira")

Height = Callable[[bool, np.ndarray], np.ndarray]


@contextmanager
def one_profile(profile: surface.Profile | None = None) -> Iterator[list[surface.Profile]]:
    """Keep the profiles on which drives are simulated, or let all be on one."""
    kept: list[surface.Profile] = []
    make = surface.random_profile

    def random_profile(*arguments, **options) -> surface.Profile:
        kept.append(make(*arguments, **options) if profile is None else profile)
        return kept[-1]

    surface.random_profile = random_profile
    try:
        yield kept
    finally:
        surface.random_profile = make


def judged(survey: RoadSurvey, height: Height, distance: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the index over the true one, and whether the interval holds, shape (stretches, 2); `distance` over time.

    The first stretch, on which the golden car of the survey begins, is left out.
    """
    begin = distance[0]
    x = np.arange(begin, distance[-1], SPACING)
    times = np.arange(distance.size) / rate
    ratios, holds = [], []
    for row, side in enumerate(("left", "right")):
        slopes = 1000 * np.abs(suspension_slope(height(row == 0, x), spacing=SPACING))
        tracks, true = [], []
        for stretch in survey.stretches[1:]:
            ends = np.interp([stretch.begin_time, stretch.end_time], times, distance)
            true.append(slopes[slice(*np.round((ends - begin) / SPACING).astype(int))].mean())
            tracks.append(getattr(stretch, side))
        index, std = (np.array([getattr(track, name) for track in tracks]) for name in ("iri", "iri_std"))
        ratios.append(index / true)
        holds.append(np.abs(index - true) < 1.96 * std)
    return np.array(ratios).T, np.array(holds).T


def travelled(recording: Recording) -> np.ndarray:
    """Return the distance at each sample by the speed [m]."""
    speed = recording.samples[recording.index("speed")]
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / recording.sampling_rate


def figures(ratios: np.ndarray, holds: np.ndarray) -> list[str]:
    """Return number, bias, RMS and share of intervals that hold."""
    error = ratios - 1
    rms = np.sqrt(np.mean(error**2))
    return [str(error.size), f"{100 * error.mean():+.1f}", f"{100 * rms:.1f}", f"{100 * np.mean(holds):.0f}"]


def drawn(sheet: Vehicle, generator: np.random.Generator) -> Vehicle:
    """Return a car whose guessed numbers are off those of its data sheet's file by their standard deviations."""
    body, axles = sheet.body.model_dump(), {"front": sheet.axle[0].model_dump(), "rear": sheet.axle[1].model_dump()}
    for guess in sheet.learnt:
        where, field = guess.name.split(".")
        if field != "centre_x":
            numbers = body if where == "body" else axles[where]
            numbers[field] *= np.exp(guess.std / guess.value * generator.standard_normal())
    axle = tuple(type(sheet.axle[0])(**numbers) for numbers in axles.values())
    return sheet.model_copy(update={"body": type(sheet.body)(**body), "axle": axle, "learnt": ()})


def surveyed(car: Vehicle, drive: RoadDrive, seed: int, files: Sequence[Vehicle]) -> list[tuple[np.ndarray, ...]]:
    """Return what `judged` does, of the survey of one drive of a car with each vehicle file."""
    with one_profile() as profiles:
        recording = simulate_drive(car, drive, seed=seed).recording
    return [
        judged(survey_road(recording, file), profiles[-1].height, travelled(recording), recording.sampling_rate)
        for file in files
    ]


def print_classes(minutes: float, car: Vehicle, n_drawn: int) -> None:
    """Print a row for each class and file, and one for each file of all drawn cars."""
    names, sheet, rows, generator = ("true", "data sheet"), described(SHEET), [], np.random.default_rng(3)
    drives = [
        RoadDrive(duration=60 * minutes, sampling_rate=100.0, speed=speed, road=RoadConditions(name), snr=50.0)
        for name, speed in CASES
    ]
    for drive, (name, speed) in zip(drives, CASES, strict=True):
        for file, found in zip(names, surveyed(car, drive, 7, (car, sheet)), strict=True):
            rows.append([name, f"{3.6 * speed[0]:.0f} to {3.6 * speed[1]:.0f}", file, *figures(*found)])
            print(*rows[-1], flush=True)
    pairs = []
    for number in range(n_drawn):
        other = drawn(sheet, generator)
        pairs.append(surveyed(other, drives[number % len(drives)], 100 + number, (other, sheet)))
    for file, founds in zip(names, zip(*pairs, strict=True), strict=bool(pairs)):
        together = [np.concatenate(values) for values in zip(*founds, strict=True)]
        rows.append([f"{n_drawn} drawn cars", "all", file, *figures(*together)])
    print_table(f"`python -m benchmarks.road --minutes {minutes:.3g}`", ["class", "speed [km/h]", "file", *HEADS], rows)


HEADS = ["values", "bias [%]", "RMS error [%]", "intervals that hold [%]"]


def print_one_road(cars: dict[str, Vehicle]) -> None:
    """Print a row for each car and speed on one road."""
    generator = np.random.default_rng(11)
    profile = surface.random_profile(road_class(CLASS), first=-800.0, last=1.2 * LENGTH, generator=generator)
    found = {}
    for name, car in cars.items():
        for kmh in SPEEDS:
            speed = (0.9 * kmh / 3.6, 1.1 * kmh / 3.6)
            drive = RoadDrive(duration=3.6 * LENGTH / kmh, sampling_rate=100.0, speed=speed, snr=50.0)
            with one_profile(profile):
                recording = simulate_drive(car, drive, seed=kmh).recording
            survey = survey_road(recording, car)
            ratios, holds = judged(survey, profile.height, travelled(recording), recording.sampling_rate)
            where = [round(stretch.begin / 100) for stretch in survey.stretches[1:]]
            found[name, kmh] = (dict(zip(where, ratios, strict=True)), figures(ratios, holds))
    everywhere = set.intersection(*(set(ratios) for ratios, _ in found.values()))
    table = {key: np.array([ratios[k] for k in sorted(everywhere)]) for key, (ratios, _) in found.items()}
    mean = np.mean(list(table.values()), axis=0)
    rows = [
        [*map(str, key), *found[key][1], f"{100 * np.sqrt(np.mean((ratios / mean - 1) ** 2)):.1f}"]
        for key, ratios in table.items()
    ]
    print_table(
        f"One road of class {CLASS}, {LENGTH / 1000:g} km",
        ["car", "speed [km/h]", *HEADS, "RMS over the mean [%]"],
        rows,
    )


def print_multibody() -> None:
    """Print a row for the file from a data sheet and the calibrated one, on two roads."""
    from benchmarks.multibody import __main__ as study
    from benchmarks.multibody import drive as engine
    from benchmarks.multibody.design import DESIGNS

    ways: list[tuple[np.ndarray, engine.Prepared]] = []
    make_tracks, make_way = engine.tracks, engine.prepared
    heights: list[np.ndarray] = []

    def tracks(*arguments) -> np.ndarray:
        heights.append(make_tracks(*arguments))
        return heights[-1]

    def prepared(*arguments) -> engine.Prepared:
        way = make_way(*arguments)
        ways.append((heights[-1], way))
        return way

    engine.tracks, engine.prepared = tracks, prepared
    of = study.Study(DESIGNS["car"], Path("build/road"))
    files = {"data sheet": study.sheet_file(of.design), "calibrated": study.calibrated_file(of)}
    rows = []
    for road, speed in (("B", (12.0, 20.0)), ("C", (10.0, 16.0))):
        riders = study.people(of.design, 0, np.random.default_rng(1))
        asked = engine.Drive(duration=300.0, road=road, speed=speed, riders=riders)
        samples, measured = engine.driven(of.design, of.effects, asked, individual=0, seed=3)
        profile, way = ways[-1]
        channels = study.recording(of, study.ordinary(of.design, 100), 100).channels
        recording = Recording(np.vstack([samples.T, measured]), engine.RATE, channels)
        steps = round(1 / engine.STEP / engine.RATE)
        distance = (np.cumsum(way.speed) * engine.STEP + 20.0)[round(engine.SETTLE / engine.STEP) :: steps]
        along = np.arange(profile.shape[1]) * engine.SPACING
        of_front = distance + of.design.axles[0].x

        def height(is_left: bool, x: np.ndarray, along=along, profile=profile) -> np.ndarray:
            return np.interp(x, along, profile[0 if is_left else 1])

        for file, vehicle in files.items():
            survey = survey_road(recording, vehicle)
            found = judged(survey, height, of_front, engine.RATE)
            rows.append([road, f"{3.6 * speed[0]:.0f} to {3.6 * speed[1]:.0f}", file, *figures(*found)])
    print_table("A car of a multibody engine", ["class", "speed [km/h]", "file", *HEADS], rows)


def print_smoother(minutes: float, car: Vehicle) -> None:
    """Print a row for each class and way, and the processor time of the way."""

    def by_smoother(windows: Sequence[Window], fit: CornerFit, track: Track) -> RoadProfile:
        profile, heights = road_profile(windows, fit, track), smoothed(windows[0], fit)
        times = np.arange(heights.shape[1]) / windows[0].motion.sampling_rate
        return replace(profile, heights=np.array([np.interp(profile.times, times, row) for row in heights]))

    rows = []
    for seed, (name, speed) in enumerate(CASES, start=7):
        drive = RoadDrive(duration=60 * minutes, sampling_rate=100.0, speed=speed, road=RoadConditions(name), snr=50.0)
        for way, profile in (("inverse", road_profile), ("smoother", by_smoother)):
            survey.road_profile = profile
            (found,) = surveyed(car, drive, seed, (car,))
            rows.append([name, f"{3.6 * speed[0]:.0f} to {3.6 * speed[1]:.0f}", way, *figures(*found)])
            rows[-1].append(f"{100 * found[0].std():.1f}")
        survey.road_profile = road_profile
    heads = ["class", "speed [km/h]", "way", *HEADS, "scatter [%]"]
    print_table(f"`python -m benchmarks.road --smoother --minutes {minutes:.3g}`", heads, rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=400 / 60)
    parser.add_argument("--drawn", type=int, default=18)
    parser.add_argument("--multibody", action="store_true")
    parser.add_argument("--smoother", action="store_true", help="takes 0.5 GB of memory a minute and a half")
    given = parser.parse_args()
    if given.multibody:
        print_multibody()
        return
    car = read_vehicle("zafira")
    if given.smoother:
        print_smoother(given.minutes, car)
        return
    print_classes(given.minutes, car, given.drawn)
    print_one_road({"zafira": car} | {name: read_vehicle(VEHICLES / f"{name}.toml") for name in ("hatchback", "van")})


if __name__ == "__main__":
    main()
