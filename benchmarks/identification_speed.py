"""Time and memory of identification beside the thesis, pyOMA2 and koma: `python benchmarks/identification_speed.py`."""

import argparse
import importlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from measuring import Measured, Stopwatch, measure, print_circumstances, print_table, run_case

SAMPLING_RATE = 1500.0
DURATION = 40.0
N_RECORDS = 10
#: 1500 / 16: decimation passes 0.8 of the new Nyquist frequency, 37 Hz, and the modes lie at 19 to 25 Hz.
LOW_RATE = 93.75
#: The 140 segments of chapter 7: 14 of 4286 samples in each record, which is the least multiple of N = 4096 that fits.
SEGMENT = 4096 / SAMPLING_RATE
N_SUBSETS = 3
BLOCK_ROWS, MAX_ORDER = 82, 80
THESIS_ROWS = (12, 82)
THESIS_SECONDS = 29.56
LENGTHS = (60_000, 600_000)
CHANNELS = ("front_left", "front_right", "rear_left", "rear_right")


def main() -> None:
    arguments = _arguments()
    if arguments.case:
        run_case(partial(_case(arguments.case), np.load(arguments.data)))
        return
    print_circumstances()
    with tempfile.TemporaryDirectory() as folder:
        run = partial(_measured, Path(folder), _make_data(Path(folder)))
        _print_coss(run, arguments.repeats)
        for n_samples in LENGTHS:
            _print_cov(run, n_samples, arguments.repeats)
        _print_uncertainty(run, arguments.repeats)
        _print_start_up(Path(folder), arguments.repeats)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5, help="processes for each case, whose median is printed")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    parser.add_argument("--data", help=argparse.SUPPRESS)
    return parser.parse_args()


def _measured(folder: Path, files: dict[str, Path], case: str, data: str, n_repeats: int) -> Measured:
    return measure(__file__, ["--case", case, "--data", str(files[data])], n_repeats=n_repeats)


def _make_data(folder: Path) -> dict[str, Path]:
    """Simulate the bogie on its rig: independent white inputs at the four contacts, SNR 10."""
    from sprung.simulation import simulate, usual_excitation
    from sprung.vehicles import read_vehicle, structure

    bogie = structure(read_vehicle("scale-bogie"))

    def samples(duration: float, seed: int) -> Any:
        excitation = usual_excitation(bogie)
        return simulate(bogie, excitation, duration=duration, sampling_rate=SAMPLING_RATE, snr=10.0, seed=seed).samples

    data = {str(n): samples(n / SAMPLING_RATE, seed=n) for n in LENGTHS}
    data["records"] = np.array([samples(DURATION, seed) for seed in range(N_RECORDS)])
    files = {name: folder / f"{name}.npy" for name in data}
    for name, path in files.items():
        np.save(path, data[name])
    return files


def _case(name: str) -> Callable[[Any, Stopwatch], None]:
    """Import what a case needs, so that imports are not measured, and return it."""
    kind, *options = name.split(":")
    case, packages = CASES[kind]
    for package in packages:
        importlib.import_module(package)
    return partial(case, options)


def _recording(samples: Any) -> Any:
    from sprung.recording import Channel, Recording

    return Recording(samples, SAMPLING_RATE, tuple(Channel(name, "acceleration") for name in CHANNELS))


def _sprung_coss_parts(options: Sequence[str], records: Any, watch: Stopwatch) -> None:
    """The eight steps of CoSS-SSI alone."""
    from sprung.identification.correlation import average, correlate_segments, join_segments
    from sprung.identification.levels import subsets_of_equal_width
    from sprung.identification.stabilisation import (
        THESIS_CRITERIA,
        StabilityCriteria,
        merge_modes,
        select_modes,
        stabilise,
    )
    from sprung.identification.subspace import block_row_ladder, poles_of_orders, realise
    from sprung.signals.conditioning import decimate

    is_decimated, has_row_ladder = "decimated" in options, "rows" in options
    rows, order = (20, 40) if is_decimated else (BLOCK_ROWS, MAX_ORDER)
    n_lags = 2 * (THESIS_ROWS[1] if has_row_ladder else rows)
    recordings = [_recording(samples) for samples in records]
    if is_decimated:
        with watch("decimation"):
            recordings = [decimate(recording, LOW_RATE) for recording in recordings]
    with watch("correlations"):
        segments = join_segments([correlate_segments(r, n_lags=n_lags, segment=SEGMENT) for r in recordings])
    assert segments.n_segments == 140
    with watch("subsets"):
        subsets = subsets_of_equal_width(segments, N_SUBSETS).subsets
        averages = [average(segments.take(subset.segments)) for subset in subsets]
    parts = []
    for correlations in averages:
        if has_row_ladder:
            with watch("realisations and poles"):
                poles = block_row_ladder(correlations, range(THESIS_ROWS[0], THESIS_ROWS[1] + 1))
        else:
            with watch("realisations and poles"):
                realisation = realise(correlations, block_rows=rows, max_order=order)
                poles = poles_of_orders(realisation, range(2, order + 1, 2))
        with watch("labels and modes"):
            criteria = THESIS_CRITERIA if has_row_ladder else StabilityCriteria()
            parts.append(select_modes(stabilise(poles, criteria=criteria)).modes)
    with watch("labels and modes"):
        merge_modes(parts, weights=[correlations.n_segments for correlations in averages])


def _sprung_coss(options: Sequence[str], records: Any, watch: Stopwatch) -> None:
    """`coss_ssi` with everything it adds: choice of band, search for harmonics, spectra, significance."""
    from sprung.identification import IdentificationSettings, as_in_thesis, coss_ssi

    recordings = [_recording(samples) for samples in records]
    rate = LOW_RATE if "decimated" in options else SAMPLING_RATE
    rows, order = (20, 40) if "decimated" in options else (BLOCK_ROWS, MAX_ORDER)
    settings = IdentificationSettings(
        decimate_to=rate, segment=SEGMENT, n_subsets=N_SUBSETS, block_rows=rows, max_order=order
    )
    if "rows" in options:
        wishes = IdentificationSettings(decimate_to=rate, segment=SEGMENT, n_subsets=N_SUBSETS)
        settings = as_in_thesis(wishes, rows=THESIS_ROWS)
    with watch("coss_ssi"):
        coss_ssi(recordings, settings=settings)


def _sprung_parts(options: Sequence[str], samples: Any, watch: Stopwatch) -> None:
    """Cov-SSI from its parts: correlations, realisation, poles, labels."""
    from sprung.identification.correlation import average, correlate_segments
    from sprung.identification.stabilisation import stabilise
    from sprung.identification.subspace import poles_of_orders, realise

    recording = _recording(samples)
    segment = recording.duration / 48 if "uncertainty" in options else None
    with watch("correlations"):
        segments = correlate_segments(recording, n_lags=2 * BLOCK_ROWS, segment=segment, is_continued=True)
        correlations = average(segments)
    with watch("realisation"):
        is_weighted = "weighted" in options
        realisation = realise(correlations, block_rows=BLOCK_ROWS, max_order=MAX_ORDER, is_weighted=is_weighted)
    with watch("poles"):
        poles = poles_of_orders(realisation, range(2, MAX_ORDER + 1, 2))
    with watch("labels"):
        stabilise(poles)


def _sprung(options: Sequence[str], samples: Any, watch: Stopwatch) -> None:
    """`cov_ssi` with everything it adds."""
    from sprung.identification import IdentificationSettings, cov_ssi

    settings = IdentificationSettings(decimate_to=SAMPLING_RATE, block_rows=BLOCK_ROWS, max_order=MAX_ORDER)
    with watch("cov_ssi"):
        cov_ssi(_recording(samples), settings=settings)


def _pyoma(options: Sequence[str], samples: Any, watch: Stopwatch) -> None:
    """pyOMA2's SSI: poles, hard criteria and labels."""
    import logging

    from peers import pyoma_ssi

    logging.disable(logging.CRITICAL)
    method, step = options[0], int(options[1])
    with watch("SSI"):
        pyoma_ssi(
            samples,
            SAMPLING_RATE,
            block_rows=BLOCK_ROWS,
            max_order=MAX_ORDER,
            method=method,
            step=step,
            calc_unc="uncertainty" in options,
        )


def _koma(options: Sequence[str], samples: Any, watch: Stopwatch) -> None:
    """koma's covssi and find_stable_poles."""
    from peers import koma_ssi, koma_stable

    with watch("covssi"):
        found = koma_ssi(samples, SAMPLING_RATE, block_rows=BLOCK_ROWS, orders=np.arange(2, MAX_ORDER + 1, 2))
    with watch("find_stable_poles"):
        koma_stable(*found)


_SPRUNG = ("sprung.identification.methods", "sprung.identification.stabilisation")
CASES = {
    "sprung-coss-parts": (_sprung_coss_parts, _SPRUNG),
    "sprung-coss": (_sprung_coss, _SPRUNG),
    "sprung-parts": (_sprung_parts, _SPRUNG),
    "sprung": (_sprung, _SPRUNG),
    "pyoma": (_pyoma, ("pyoma2.algorithms", "pyoma2.setup")),
    "koma": (_koma, ("koma.oma",)),
}


def _parts(measured: Measured) -> str:
    return ", ".join(f"{part} {1000 * seconds:.0f}" for part, seconds in measured.parts.items())


def _memory(measured: Measured) -> list[str]:
    return [f"{measured.memory_above_imports:.0f}", f"{measured.memory:.0f}"]


def _print_coss(run: Any, n_repeats: int) -> None:
    rows = []
    for scope, case in (("the method alone", "sprung-coss-parts"), ("`coss_ssi`, everything", "sprung-coss")):
        for rate, decimated in (("1500 Hz", "full"), (f"decimated to {LOW_RATE:g} Hz", "decimated")):
            orders = "20 block rows, orders 2..40" if decimated == "decimated" else "82 block rows, orders 2..80"
            for ladder, option in (("block rows 12..82 (thesis)", "rows"), (orders, "orders")):
                took = run(f"{case}:{decimated}:{option}", "records", n_repeats)
                ratio = f"{THESIS_SECONDS / took.seconds:.0f}"
                rows.append([scope, rate, ladder, f"{took.seconds:.3f}", ratio, _parts(took), *_memory(took)])
    header = [
        "what",
        "rate",
        "ladder",
        "s",
        "thesis' 29.56 s over ours",
        "parts, ms",
        "MiB above imports and data",
        "MiB",
    ]
    print_table("CoSS-SSI: 4 channels, 1500 Hz, 10 x 40 s, 140 segments, 3 subsets", header, rows)


def _print_cov(run: Any, n_samples: int, n_repeats: int) -> None:
    cases = [
        ("sprung, weighted, with uncertainty", "sprung-parts:weighted:uncertainty"),
        ("sprung, weighted", "sprung-parts:weighted"),
        ("sprung, unweighted, with uncertainty", "sprung-parts:unweighted:uncertainty"),
        ("sprung, unweighted", "sprung-parts:unweighted"),
        ("sprung, `cov_ssi`, everything", "sprung"),
        ("pyOMA2, defaults (`cov`, every order)", "pyoma:cov:1"),
        ("pyOMA2, `cov`, step 2", "pyoma:cov:2"),
        ("pyOMA2, `cov_R`, step 2", "pyoma:cov_R:2"),
        ("koma", "koma"),
    ]
    took = {name: run(case, str(n_samples), n_repeats) for name, case in cases}
    own = took["sprung, unweighted"].seconds
    rows = [[name, f"{m.seconds:.3f}", f"{m.seconds / own:.1f}", _parts(m), *_memory(m)] for name, m in took.items()]
    header = ["what", "s", "over sprung, unweighted", "parts, ms", "MiB above imports and data", "MiB"]
    print_table(f"Cov-SSI: {n_samples:,} x 4 samples, 82 block rows, orders 2..80, with labels", header, rows)


def _print_uncertainty(run: Any, n_repeats: int) -> None:
    cases = [
        ("sprung, 48 blocks, even orders", "sprung-parts:weighted:uncertainty", n_repeats),
        ("pyOMA2, `calc_unc`, 50 blocks, step 1", "pyoma:cov:1:uncertainty", 1),
        ("pyOMA2, `calc_unc`, 50 blocks, step 2", "pyoma:cov:2:uncertainty", 1),
    ]
    took = {name: run(case, str(LENGTHS[0]), repeats) for name, case, repeats in cases}
    own = next(iter(took.values())).seconds
    rows = [[name, f"{m.seconds:.3f}", f"{m.seconds / own:.0f}", *_memory(m)] for name, m in took.items()]
    title = f"Standard deviations of frequency and damping at all orders to 80, {LENGTHS[0]:,} x 4 samples"
    print_table(title, ["what", "s", "over sprung", "MiB above imports and data", "MiB"], rows)


def _print_start_up(folder: Path, n_repeats: int) -> None:
    """Time the command line, processes and imports included."""
    program = Path(sys.executable).with_name("sprung")
    run = folder / "run.csv"
    commands = {
        "sprung --help": [program, "--help"],
        "sprung identify run.csv (20 s of the chain, 500 Hz)": [program, "identify", run],
    }
    subprocess.run(
        [program, "simulate", "chain", "--minutes", "0.3333", "--sampling-rate", "500", "--out", run],
        check=True,
        capture_output=True,
    )
    rows = []
    for name, command in commands.items():
        seconds = []
        for _ in range(n_repeats):
            start = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            seconds.append(time.perf_counter() - start)
        rows.append([f"`{name}`", f"{median(seconds):.2f}", f"{min(seconds):.2f}"])
    print_table("Start-up", ["command", "s, median", "s, fastest"], rows)


if __name__ == "__main__":
    main()
