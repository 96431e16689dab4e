"""A real car with one six-axis sensor: do its drives agree, are its values a car's, does leaving one drive out alarm.

Needs decoded drives of the CANedge logs (`*_decoded.parquet`), in the folder `canedge_car_body_imu` of `SPRUNG_DATA`.
Make, masses and the place of the sensor are unknown. Three vehicle files are tried: an ordinary car per kilogram, a
car of a data sheet (`sprung describe`), and the latter calibrated on the other drives, which takes minutes.

    python -m benchmarks.real_cars                         guess and data sheet
    python -m benchmarks.real_cars --calibrate             and calibrated, leaving each drive out in turn
    python -m benchmarks.real_cars --folder DRIVES --out real_cars.md
"""

import argparse
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from sprung.calibration import CalibrationSettings, DataSheet, calibrate, described
from sprung.diagnosis import Baseline, Observation, diagnose, learn, observe
from sprung.errors import DataError
from sprung.formats import read
from sprung.likelihood import CornerFit, CornerSettings, fit_corners
from sprung.recording import Recording
from sprung.vehicles import Axle, Sensor, Vehicle
from sprung.vehicles.sections import LearntNumber

#: Axes of the sensor: X up, Y rearward, Z to the right. Its place is a guess.
SENSORS = (
    Sensor(
        channel="AccelerationX",
        quantity="acceleration",
        unit="m/s^2",
        position=(-1.5, 0.0, 0.0),
        direction=(0.0, 0.0, 1.0),
    ),
    Sensor(channel="AngularRateZ", quantity="angular_velocity", unit="deg/s", direction=(0.0, -1.0, 0.0)),
    Sensor(channel="AngularRateY", quantity="angular_velocity", unit="deg/s", direction=(-1.0, 0.0, 0.0)),
)
#: A compact car whose tyres turn once in 1.94 m.
SHEET = DataSheet(mass=1450.0, wheelbase=2.65, track=1.52, tyre="205/55R16", sensors="imu", name="canedge")
#: Deviation of the sensor's guessed place along and across [m].
PLACE = {"x": 0.5, "y": 0.3}
#: Prior deviations of the components, length of a window [s], fewest windows of a baseline, and what is lost.
PRIORS, WINDOW, FEWEST, LOSS = (0.7, 0.2), 150.0, 4, 0.3

Drives = Mapping[str, Recording]


def guessed() -> Vehicle:
    """Return an ordinary car per kilogram of its body."""
    axles = tuple(
        Axle(x=x, half_track=0.75, spring_stiffness=21.0, damping=1.35, tyre_stiffness=140.0) for x in (1.2, -1.5)
    )
    return Vehicle(name="canedge", kind="road", speed_channel="Speed", axle=axles, sensor=SENSORS)


def from_sheet() -> Vehicle:
    """Return the car of the data sheet, with the sensor where it may be."""
    car = described(SHEET)
    places = tuple(
        LearntNumber(name=f"AccelerationX.{axis}", value=value, std=std, source="guess: place not stated")
        for (axis, std), value in zip(PLACE.items(), (-1.5, 0.0), strict=True)
    )
    return car.model_copy(update={"speed_channel": "Speed", "sensor": SENSORS, "learnt": (*car.learnt, *places)})


def calibrated(drives: Drives) -> Vehicle:
    """Return the car of the data sheet, completed by drives."""
    settings = CalibrationSettings(most_mounts=0, has_modes=False)
    return calibrate(tuple(drives.values()), from_sheet(), settings=settings).vehicle


def chi_squared(one: CornerFit, other: CornerFit) -> float:
    """Return the squared distance of the components of two fits by their covariances, per component."""
    rows = one.model.rows("components")
    away = one.log_ratios - other.log_ratios
    covariance = one.covariance[np.ix_(rows, rows)] + other.covariance[np.ix_(rows, rows)]
    return float(away @ np.linalg.solve(covariance, away)) / away.size


def agreement(drives: Drives, car: Vehicle, label: str) -> Iterator[str]:
    """Yield a row for each prior: model errors, distances between the drives, implausible axles."""
    for prior in PRIORS:
        fits = [fit_corners(drive, car, settings=CornerSettings(prior_std=prior)) for drive in drives.values()]
        distances = [f"{chi_squared(*pair):.1f}" for pair in itertools.combinations(fits, 2)]
        errors = ", ".join(f"{100 * fit.model_error:.0f}" for fit in fits)
        odd = "; ".join(
            ", ".join(f"{axle} x {ratio:.2g}" for axle, ratio in {**fit.implausible_axles, **fit.uneven_axles}.items())
            or "none"
            for fit in fits
        )
        yield f"| {label} | {prior:g} | {errors} | {', '.join(distances)} | {odd} |"


def with_loss(observation: Observation, row: int, factor: float) -> Observation:
    """Return a window with one component multiplied by a factor."""
    shift = np.log(factor) * np.eye(len(observation.components))[row]
    return replace(observation, log_ratios=observation.log_ratios + shift)


def losses_found(windows: Sequence[Observation], baseline: Baseline) -> tuple[int, int]:
    """Return how many of the components are found to have changed when each loses its share, and how many are named."""
    n_found = n_named = 0
    for row, component in enumerate(baseline.components):
        findings = diagnose([with_loss(window, row, 1 - LOSS) for window in windows], baseline).findings
        n_found += bool(findings)
        n_named += bool(findings) and findings[0].hypothesis == str(component)
    return n_found, n_named


def left_out(drives: Drives, name: str, car: Vehicle, label: str) -> Iterator[str]:
    """Yield a row for each prior: the drive that is left out against the baseline of the others."""
    for prior in PRIORS:
        settings = CornerSettings(prior_std=prior)
        windows = {
            key: [window for window in observe(drive, car, length=WINDOW, settings=settings) if window.is_conclusive]
            for key, drive in drives.items()
        }
        alone = diagnose(windows[name]).verdict
        others = [
            replace(window, time=1e5 * number + window.time)
            for number, key in enumerate(windows)
            if key != name
            for window in windows[key]
        ]
        try:
            baseline = learn(others, min_windows=FEWEST)
        except DataError as error:
            yield f"| {label} | {prior:g} | {name} | {error} | | | | {alone} |"
            continue
        diagnosis = diagnose(windows[name], baseline)
        detectable = sorted(diagnosis.detectable.values())
        span = f"{100 * detectable[0]:.0f} to {100 * detectable[-1]:.0f}" if detectable else ""
        n_found, n_named = losses_found(windows[name], baseline)
        total = len(baseline.components)
        yield (
            f"| {label} | {prior:g} | {name} | {baseline.n_windows} | {diagnosis.verdict} | {span} "
            f"| {n_found} and {n_named} of {total} | {alone} |"
        )


def report(drives: Drives, *, has_calibration: bool) -> Iterator[str]:
    """Yield the lines of both tables."""
    files = {"guess": guessed(), "data sheet": from_sheet()}
    by_drive = {
        name: calibrated({key: drive for key, drive in drives.items() if key != name}) if has_calibration else None
        for name in drives
    }
    yield "| vehicle file | prior | model error, % | chi2 per component between drives | implausible |"
    yield "|---|---|---|---|---|"
    for label, car in files.items():
        yield from agreement(drives, car, label)
    for name, complete in by_drive.items():
        if complete is not None:
            yield from agreement(drives, complete, f"calibrated without {name}")
    yield ""
    yield (
        f"| vehicle file | prior | drive left out | windows learnt | verdict | detectable, % | losses of "
        f"{100 * LOSS:.0f} % found, named | without a baseline |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for name, complete in by_drive.items():
        for label, car in files.items():
            yield from left_out(drives, name, car, label)
        if complete is not None:
            yield from left_out(drives, name, complete, "calibrated on the others")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    usual = Path(os.environ.get("SPRUNG_DATA", ".")) / "canedge_car_body_imu"
    parser.add_argument("--folder", type=Path, default=usual, help="folder with the decoded drives")
    parser.add_argument("--calibrate", action="store_true", help="calibrate on all drives but one, in turn")
    parser.add_argument("--out", type=Path, help="file to write the tables to")
    options = parser.parse_args()
    paths = sorted(options.folder.glob("*_decoded.parquet"))
    if not paths:
        parser.error(f"no *_decoded.parquet in {options.folder}: give the folder of the drives with --folder")
    drives = {path.name.removesuffix("_decoded.parquet"): read(path) for path in paths}
    lines = []
    for line in report(drives, has_calibration=options.calibrate):
        print(line, flush=True)
        lines.append(line)
    if options.out:
        options.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
