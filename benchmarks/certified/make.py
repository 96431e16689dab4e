"""Compute the certified answers and write the records: `python -m benchmarks.certified.make`.

Natural frequencies, damping ratios and shapes are eigenvalues and eigenvectors of the state matrix at 40 digits
(mpmath); bounds are quadratures of the exact spectral matrices (`bounds.py`, `car.py`). Options write the records only,
also further realisations of them, which need numpy and scipy alone.
"""

import argparse
import gzip
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.certified import bounds, car
from benchmarks.certified.records import COUNTS, RECORDS, Decay, Friction, Record
from benchmarks.certified.systems import Array

HERE = Path(__file__).parent
DATA, ANSWERS = HERE / "data", HERE / "answers"
_DIGITS = 40
#: Records so short that their bound needs the covariance of all samples.
_SHORT = 1000


def exact_modes(mass: Array, damping: Array, stiffness: Array, sensors: Array) -> list[dict[str, Any]]:
    """Return modes by rising natural frequency, shapes 1 at the largest channel; 15 digits."""
    import mpmath as mp

    mp.mp.dps = _DIGITS
    n = len(mass)
    M, C, K = (mp.matrix(matrix.tolist()) for matrix in (mass, damping, stiffness))
    inverse, A = M**-1, mp.zeros(2 * n)
    for k in range(n):
        A[k, n + k] = 1
    A[n:, :n], A[n:, n:] = -inverse * K, -inverse * C
    values, vectors = mp.eig(A)
    chosen = sorted((k for k in range(2 * n) if values[k].imag > 0), key=lambda k: abs(values[k]))
    modes = []
    for k in chosen:
        residual = mp.norm(A * vectors[:, k] - values[k] * vectors[:, k]) / mp.norm(vectors[:, k])
        if residual > abs(values[k]) * mp.mpf(10) ** -(_DIGITS - 10):
            raise ArithmeticError(f"mode {k} has a residual of {mp.nstr(residual)}: raise the number of digits")
        shape = mp.matrix(sensors.tolist()) * vectors[:n, k]
        largest = max(shape, key=abs)
        shape = [entry / largest for entry in shape]
        modes.append(
            {
                "natural_frequency": float(mp.nstr(abs(values[k]) / (2 * mp.pi), 15)),
                "damping_ratio": float(mp.nstr(-values[k].real / abs(values[k]), 15)),
                "mode_shape": {
                    part: [float(mp.nstr(mp.chop(getattr(entry, part), mp.mpf(10) ** -20), 15)) for entry in shape]
                    for part in ("real", "imag")
                },
            }
        )
    return modes


def answer(name: str) -> dict[str, Any]:
    """Return the certified answer of a record."""
    return _drive_answer() if name == "car-drive" else _modal_answer(name, RECORDS[name])


def _modal_answer(name: str, record: Record | Decay | Friction) -> dict[str, Any]:
    system, friction = record.system, {}
    if isinstance(record, Friction):
        bound, of_sticking = bounds.friction_bound(record)
        friction = {"sticking": {"value": record.sticking, "bound": float(f"{of_sticking:.4g}")}}
    elif isinstance(record, Decay):
        bound = bounds.decay_bound(record)
    else:
        bound = (bounds.exact_bound if record.n_samples < _SHORT else bounds.modal_bound)(record)
    quantity, unit = record.quantity
    return {
        "record": name,
        "title": record.title,
        "files": [f"{name}.csv.gz"],
        "sampling_rate": record.rate,
        "quantity": quantity,
        "unit": unit,
        "unit_per_count": unit_per_count(record.samples()),
        "mass": system.mass.tolist(),
        "damping": system.damping.tolist(),
        "stiffness": system.stiffness.tolist(),
        "sensors": system.sensors.tolist(),
        "modes": _with_bounds(
            exact_modes(system.mass, system.damping, system.stiffness, system.sensors),
            bound.natural_frequency,
            bound.damping_ratio,
        ),
        "tones": [tone.frequency for tone in record.tones],
        **friction,
    }


def _drive_answer() -> dict[str, Any]:
    M, damping, K, _, rows = car.DRIVEN.matrices()
    of_logs = car.covariance()
    n_body = 3
    modes = _with_bounds(exact_modes(M, damping, K, rows), *car.modal_deviations(of_logs))
    deviations = np.sqrt(np.diag(of_logs))
    corners: dict[str, dict[str, Any]] = {corner: {} for corner in car.CORNERS}
    for name, nominal, value, bound in zip(
        car.NAMES, car.NOMINAL.components, car.DRIVEN.components, deviations, strict=True
    ):
        corner, part = name.split(".")
        corners[corner][part] = {"value": value, "nominal": nominal, "relative_bound": float(f"{bound:.4g}")}
    nominal = car.NOMINAL
    return {
        "record": "car-drive",
        "title": "Linear car of 7 degrees of freedom on a class C road, three steady speeds",
        "files": [f"car-drive-{number}.csv.gz" for number in range(1, 1 + len(car.DELAYS))],
        "sampling_rate": car.RATE,
        "quantity": "acceleration",
        "unit": "m/s^2",
        "unit_per_count": unit_per_count(np.concatenate([run[:4] for run in car.samples()])),
        "speeds": list(car.DELAYS),
        "body": {
            "mass": nominal.mass,
            "pitch_inertia": nominal.pitch_inertia,
            "roll_inertia": nominal.roll_inertia,
            "axles_ahead_of_centre": nominal.x,
            "half_track": nominal.half_track,
        },
        "unsprung_mass": nominal.unsprung_mass,
        "corners": corners,
        "mass": M.tolist(),
        "damping": damping.tolist(),
        "stiffness": K.tolist(),
        "sensors": rows.tolist(),
        "modes": modes[:n_body],
        "optional_modes": modes[n_body:],
        "tones": [],
    }


def _with_bounds(modes: Sequence[dict[str, Any]], frequency: Array, damping: Array) -> list[dict[str, Any]]:
    return [
        mode | {"natural_frequency_bound": float(f"{f:.4g}"), "damping_ratio_bound": float(f"{xi:.4g}")}
        for mode, f, xi in zip(modes, frequency, damping, strict=True)
    ]


def unit_per_count(samples: Array) -> float:
    """Return the unit of one count of the file: 1, 2 or 5 times a power of ten, about a thousandth of the RMS."""
    wanted = samples.std(axis=-1).max() / COUNTS
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(f"{max(step for step in (1, 2, 5) if step * power <= wanted) * power:.1g}")


def write_records(folder: Path, names: Sequence[str], realisation: int = 0) -> None:
    """Write records as gzipped CSV of counts, with the names of the channels in the first line."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        scale = json.loads((ANSWERS / f"{name}.json").read_text())["unit_per_count"]
        for file, samples, heads in record_files(name, realisation):
            counts = [
                row if head == "speed" else np.rint(row / scale) + 0.0 for row, head in zip(samples, heads, strict=True)
            ]
            text = io.StringIO()
            text.write(",".join(heads) + "\n")
            np.savetxt(text, np.transpose(counts), fmt=_formats(heads), delimiter=",")
            with (folder / file).open("wb") as raw, gzip.GzipFile("", "wb", 9, raw, mtime=0) as packed:
                packed.write(text.getvalue().encode())


def record_files(name: str, realisation: int = 0) -> list[tuple[str, Array, list[str]]]:
    """Return the name of each file of a record, its samples in units, and its channels."""
    if name == "car-drive":
        heads = ["acc_fl", "acc_fr", "acc_rl", "acc_rr", "speed"]
        runs = enumerate(car.samples(realisation), start=1)
        return [(f"car-drive-{number}.csv.gz", run, heads) for number, run in runs]
    samples = RECORDS[name].samples(realisation)
    return [(f"{name}.csv.gz", samples, [f"ch_{k}" for k in range(1, 1 + len(samples))])]


def _formats(heads: Sequence[str]) -> list[str]:
    return ["%.1f" if head == "speed" else "%.0f" for head in heads]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="records; default: all")
    parser.add_argument("--records-only", action="store_true", help="keep the answers")
    parser.add_argument("--realisation", type=int, default=0, help="another draw of the same records")
    parser.add_argument("--out", type=Path, default=DATA, help="folder of the records")
    arguments = parser.parse_args()
    names = arguments.names or [*RECORDS, "car-drive"]
    for name in names if not arguments.records_only else []:
        ANSWERS.mkdir(exist_ok=True)
        (ANSWERS / f"{name}.json").write_text(json.dumps(answer(name), indent=1) + "\n")
        print(name)
    write_records(arguments.out, names, arguments.realisation)


if __name__ == "__main__":
    main()
