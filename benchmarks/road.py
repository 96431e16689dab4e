"""Roughness index of simulated roads from the motion of a car, beside that of the true profile.

    python -m benchmarks.road [--minutes M]

For each class: index of 100 m of both tracks over that of the profile that was driven, bias and RMS of the error, and
share of 95 % intervals that hold.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from benchmarks.measuring import print_table

from sprung.excitation import surface
from sprung.road import RoadSurvey, roughness_index, survey_road
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

CASES = (
    ("A", (20.0, 30.0)),
    ("B", (10.0, 14.0)),
    ("C", (8.0, 9.5)),
    ("C", (15.0, 20.0)),
    ("D", (12.0, 16.0)),
    ("E", (10.0, 14.0)),
)
SPACING = 0.05


def true_index(profile: surface.Profile, recording, survey: RoadSurvey, *, is_left: bool) -> np.ndarray:
    """Return the index of the stretches of a survey from the profile."""
    speed = recording.samples[recording.index("speed")]
    travelled = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / recording.sampling_rate
    first = np.interp(survey.stretches[0].begin_time, np.arange(speed.size) / recording.sampling_rate, travelled)
    return roughness_index(profile.height(is_left, np.arange(first, travelled[-1], SPACING)), spacing=SPACING)


def main() -> None:
    """Print a row for each case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=400 / 60)
    given = parser.parse_args()
    profiles: list[surface.Profile] = []
    make = surface.random_profile

    def kept(*arguments, **options) -> surface.Profile:
        profiles.append(make(*arguments, **options))
        return profiles[-1]

    surface.random_profile = kept
    car, rows = read_vehicle("zafira"), []
    for name, speed in CASES:
        road = RoadConditions(name)
        drive = RoadDrive(duration=60 * given.minutes, sampling_rate=100.0, speed=speed, road=road, snr=50.0)
        recording = simulate_drive(car, drive, seed=7).recording
        survey = survey_road(recording, car)
        errors, holds = [], []
        for side in ("left", "right"):
            true = true_index(profiles[-1], recording, survey, is_left=side == "left")[1:]
            tracks = [getattr(stretch, side) for stretch in survey.stretches[1:]][: true.size]
            index, std = (np.array([getattr(track, field) for track in tracks]) for field in ("iri", "iri_std"))
            errors += list(index / true[: index.size] - 1)
            holds += list(np.abs(index - true[: index.size]) < 1.96 * std)
        error = np.array(errors)
        figures = (
            f"{100 * error.mean():+.1f}",
            f"{100 * np.sqrt(np.mean(error**2)):.1f}",
            f"{100 * np.mean(holds):.0f}",
        )
        rows.append([name, f"{3.6 * speed[0]:.0f} to {3.6 * speed[1]:.0f}", str(error.size), *figures])
    title = f"`python -m benchmarks.road --minutes {given.minutes:.3g}`"
    print_table(
        title, ["class", "speed [km/h]", "values", "bias [%]", "RMS error [%]", "intervals that hold [%]"], rows
    )


if __name__ == "__main__":
    main()
