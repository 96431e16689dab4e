"""Score packages on the certified records: `python -m benchmarks.certified.score [--json FILE]`.

Every package gets the samples and the sampling rate, Sprung nothing else; the peers also the block rows that reach over
two periods of the lowest certified mode (30 to 60) and a largest order of 60. For the drive Sprung gets the vehicle
file, which states the nominal components. A certified mode is found if the package reports one within 5 % of it that is
not nearer to another; a mode that is left over is spurious. The error is that of natural frequency and damping ratio
over their Cramer-Rao bounds, root mean square over the modes found.
"""

import argparse
import json
import logging
import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from benchmarks.measuring import ONE_THREAD, print_circumstances, print_table

os.environ.update(ONE_THREAD, TQDM_DISABLE="1")

import numpy as np
from benchmarks.certified.make import ANSWERS, record_files
from benchmarks.certified.systems import Array

PRESET, PEER_ORDER, N_PERIODS, BLOCK_ROWS, NEAR, CLOSE = "Neu", 60, 2.0, (30, 60), 0.05, 3.0
#: Errors of a peer that finds no modes.
_FAILURES = (TypeError, ValueError, IndexError, AttributeError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Score:
    """What a package found in one record; errors over the bounds, two for each mode found."""

    record: str
    package: str
    n_certified: int
    n_found: int
    n_within: int
    n_spurious: int
    errors: tuple[float, ...] = field(default=())
    corner_errors: tuple[float, ...] = field(default=())
    failure: str = ""


def load(name: str) -> dict[str, Any]:
    """Return a certified answer."""
    answer: dict[str, Any] = json.loads((ANSWERS / f"{name}.json").read_text())
    return answer


def score(answer: dict[str, Any], package: str, frequency: Array, damping: Array) -> Score:
    """Compare modes with a certified answer; each certified mode is matched with one that is nearest to it."""
    certified, found, left = answer["modes"], [], set(range(len(frequency)))
    pairs = sorted(
        (abs(frequency[k] / mode["natural_frequency"] - 1), j, k) for j, mode in enumerate(certified) for k in left
    )
    taken: set[int] = set()
    for distance, j, k in pairs:
        if distance <= NEAR and j not in taken and k in left:
            taken.add(j)
            left.remove(k)
            found.append((certified[j], k))
    optional = [mode["natural_frequency"] for mode in answer.get("optional_modes", [])]
    spurious = [k for k in left if not any(abs(frequency[k] / f - 1) <= NEAR for f in optional)]
    errors = [
        (
            (frequency[k] - mode["natural_frequency"]) / mode["natural_frequency_bound"],
            (damping[k] - mode["damping_ratio"]) / mode["damping_ratio_bound"],
        )
        for mode, k in found
    ]
    n_within = sum(bool(max(abs(f), abs(xi)) <= CLOSE) for f, xi in errors)
    flat = tuple(float(e) for pair in errors for e in pair)
    return Score(answer["record"], package, len(certified), len(found), n_within, len(spurious), flat)


def counted(name: str, realisation: int) -> list[tuple[Array, list[str]]]:
    """Return the samples of a record as its files state them, in units, and the channels."""
    scale = load(name)["unit_per_count"]
    runs = []
    for _, samples, heads in record_files(name, realisation):
        rounded = [
            row if head == "speed" else np.rint(row / scale) * scale for row, head in zip(samples, heads, strict=True)
        ]
        runs.append((np.array(rounded), heads))
    return runs


def sprung_score(name: str, realisation: int) -> Score:
    import sprung

    answer = load(name)
    recordings = []
    for samples, heads in counted(name, realisation):
        channels = tuple(sprung.Channel(head, "speed" if head == "speed" else answer["quantity"]) for head in heads)
        recordings.append(sprung.Recording(samples, answer["sampling_rate"], channels))
    if "sticking" in answer:
        return _friction_score(answer, recordings)
    vehicle = certified_vehicle(answer) if "corners" in answer else None
    modes = sprung.cov_ssi(recordings, vehicle=vehicle).modes
    scored = score(answer, "sprung", modes.natural_frequency, modes.damping_ratio)
    if vehicle is None:
        return scored
    fit = sprung.fit_corners(recordings, vehicle)
    errors = []
    for component, value in zip(fit.components, fit.values, strict=True):
        certified = answer["corners"][str(component.corner)][str(component.kind)]
        errors.append(float(np.log(value / certified["value"]) / certified["relative_bound"]))
    return replace(scored, corner_errors=tuple(errors))


def _friction_score(answer: dict[str, Any], recordings: Sequence[Any]) -> Score:
    """Return the score of the swing between two turns; the error of the friction is another one."""
    import sprung

    fit = sprung.bounce(recordings).tests[0].frictions[0]
    if fit is None:
        return score(answer, "sprung", np.zeros(0), np.zeros(0))
    scored = score(answer, "sprung", np.array([fit.natural_frequency]), np.array([fit.damping_ratio]))
    error = (fit.sticking[0] - answer["sticking"]["value"]) / answer["sticking"]["bound"]
    within = scored.n_within if abs(error) <= CLOSE else 0
    return replace(scored, n_within=within, errors=(*scored.errors, float(error)))


def certified_vehicle(answer: dict[str, Any]) -> Any:
    """Return the vehicle file of the drive, with nominal components."""
    from sprung.vehicles import parse_vehicle

    body, axles, sensors = answer["body"], [], []
    places = zip(body["axles_ahead_of_centre"], ("front", "rear"), answer["unsprung_mass"], strict=True)
    for x, end, unsprung in places:
        parts = {part: number["nominal"] for part, number in answer["corners"][f"{end}_left"].items()}
        axles.append(
            {
                "x": x,
                "half_track": body["half_track"],
                "unsprung_mass": unsprung,
                "spring_stiffness": parts["spring"],
                "damping": parts["damper"],
                "tyre_stiffness": parts["tyre"],
            }
        )
        for side, y in (("l", body["half_track"]), ("r", -body["half_track"])):
            sensors.append(
                {
                    "channel": f"acc_{end[0]}{side}",
                    "quantity": "acceleration",
                    "unit": "m/s^2",
                    "position": [x, y, 0.0],
                    "direction": [0.0, 0.0, 1.0],
                }
            )
    masses = {key: body[key] for key in ("mass", "pitch_inertia", "roll_inertia")}
    return parse_vehicle({"name": "certified", "kind": "road", "body": masses, "axle": axles, "sensor": sensors})


def pyoma_score(name: str, realisation: int) -> Score:
    from benchmarks.peers import pyoma_modes, pyoma_ssi

    def identify(samples: Array, rate: float, block_rows: int) -> tuple[Array, Array]:
        algorithm, _ = pyoma_ssi(samples, rate, block_rows=block_rows, max_order=PEER_ORDER)
        return pyoma_modes(algorithm, PRESET)

    return _peer_score("pyOMA2", identify, name, realisation)


def koma_score(name: str, realisation: int) -> Score:
    from benchmarks.peers import koma_modes, koma_ssi, koma_stable

    def identify(samples: Array, rate: float, block_rows: int) -> tuple[Array, Array]:
        poles = koma_ssi(samples, rate, block_rows=block_rows, orders=np.arange(2, PEER_ORDER + 1, 2))
        return koma_modes(*koma_stable(*poles, n_levels=2))

    return _peer_score("koma", identify, name, realisation)


def _peer_score(
    package: str, identify: Callable[[Array, float, int], tuple[Array, Array]], name: str, realisation: int
) -> Score:
    """Score a peer on the motion channels; files of a drive one after another, as it takes one record."""
    logging.disable(logging.CRITICAL)
    answer = load(name)
    runs = counted(name, realisation)
    samples = np.concatenate(
        [run[[k for k, head in enumerate(heads) if head != "speed"]] for run, heads in runs], axis=1
    )
    rate = answer["sampling_rate"]
    block_rows = int(np.clip(round(N_PERIODS * rate / answer["modes"][0]["natural_frequency"]), *BLOCK_ROWS))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            frequency, damping = (np.atleast_1d(values) for values in identify(samples, rate, block_rows))
        except _FAILURES as error:
            nothing = score(answer, package, np.zeros(0), np.zeros(0))
            return replace(nothing, failure=f"{type(error).__name__}: {error}")
    return score(answer, package, frequency, damping)


PACKAGES: dict[str, Callable[[str, int], Score]] = {
    "sprung": sprung_score,
    "pyOMA2": pyoma_score,
    "koma": koma_score,
}


def _one(job: tuple[str, str, int]) -> Score:
    package, name, realisation = job
    return PACKAGES[package](name, realisation)


def rms(values: Sequence[float]) -> str:
    return f"{np.sqrt(np.mean(np.square(values))):.2f}" if values else "-"


def table(scores: Sequence[Score]) -> list[list[str]]:
    """Return a row of each record: the same figures for each package."""
    rows = []
    for name in dict.fromkeys(each.record for each in scores):
        row = [name]
        for package in dict.fromkeys(each.package for each in scores):
            those = [each for each in scores if (each.record, each.package) == (name, package)]
            of = sum(each.n_certified for each in those)
            row += [
                f"{sum(each.n_found for each in those)} of {of}",
                f"{sum(each.n_within for each in those)} of {of}",
                str(sum(each.n_spurious for each in those)),
                rms([e for each in those for e in each.errors]),
            ]
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="records; default: all")
    parser.add_argument("--realisations", type=int, default=1, help="draws of every record; the first is certified")
    parser.add_argument("--packages", default=",".join(PACKAGES), help="separated by commas")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--json", type=Path, help="file for the scores")
    arguments = parser.parse_args()
    packages = arguments.packages.split(",")
    names = arguments.names or sorted(path.stem for path in ANSWERS.glob("*.json"))
    peers = {"pyOMA2": "pyoma-2", "koma": "koma-python"}
    print_circumstances(peers=[peers[each] for each in packages if each in peers])
    jobs = [(package, name, k) for name in names for package in packages for k in range(arguments.realisations)]
    with ProcessPoolExecutor(arguments.processes) as pool:
        scores = list(pool.map(_one, jobs))
    heads = ["found", f"within {CLOSE:g} bounds", "spurious", "error over bound"]
    header = ["record", *(f"{package}: {head}" for package in packages for head in heads)]
    print_table("Certified records: modes", header, table(scores))
    corners = [each for each in scores if each.corner_errors]
    if corners:
        errors = [error for each in corners for error in each.corner_errors]
        within = sum(abs(error) <= CLOSE for error in errors)
        print(f"\nComponents of the drive within {CLOSE:g} bounds: {within} of {len(errors)}, error {rms(errors)}.")
    for failed in (each for each in scores if each.failure):
        print(f"\n{failed.package} ended with an error on {failed.record}: {failed.failure}")
    if arguments.json:
        document = {
            "command": " ".join(["python -m benchmarks.certified.score", *_stated(arguments)]),
            "versions": _versions(packages),
            "realisations": arguments.realisations,
            "scores": [asdict(each) for each in scores],
        }
        arguments.json.write_text(json.dumps(document, indent=1) + "\n")


def _stated(arguments: argparse.Namespace) -> list[str]:
    """Return the options that change the result."""
    return [*arguments.names, f"--realisations {arguments.realisations}", f"--packages {arguments.packages}"]


def _versions(packages: Sequence[str]) -> dict[str, str]:
    from importlib.metadata import version

    names = {"sprung": "sprung", "pyOMA2": "pyoma-2", "koma": "koma-python"}
    return {package: version(names[package]) for package in packages}


if __name__ == "__main__":
    main()
