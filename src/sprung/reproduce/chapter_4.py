"""Chapter 4: a chain of three masses, noise of two sizes, three methods."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.identification import METHOD_NAMES, SUBSPACE_METHODS, Identification, IdentificationSettings, as_in_thesis
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce import thesis
from sprung.reproduce.chapter import Chapter, set_up
from sprung.results import figures
from sprung.results.page.page import Block, Section, picture, pictures
from sprung.results.tables import Table
from sprung.signals.harmonics import Harmonic
from sprung.simulation import usual_excitation, with_noise
from sprung.vehicles import Structure, read_description, structure

SETUP = set_up("chapter_4")
RATIOS = (10.0, 0.5)
#: Bands of the noise [Hz]; the thesis states only "band-pass white noise".
BANDS: dict[str, tuple[float, float] | None] = {"white": None, "0.5 to 50 Hz": (0.5, 50.0)}
PRINTED = thesis.published("4")


class Example(NamedTuple):
    """Records by SNR, with noise in 0.5 to 50 Hz, and what each method identifies in them."""

    records: dict[float, list[Recording]]
    identified: dict[tuple[str, float], Identification]


def example() -> Example:
    """Return the set of records that the figures show."""
    clean = records(structure(read_description("chain3")), seed=0)
    shown = {snr: noisy(clean, snr, BANDS["0.5 to 50 Hz"], seed=0) for snr in RATIOS}
    return Example(shown, {(name, snr): identified(name, shown[snr]) for name in SUBSPACE_METHODS for snr in RATIOS})


def contents(example: Example, results: list[Real]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict and the sections."""
    truth, runs = thesis.theoretical(structure(read_description("chain3"))), np.array(results)
    return _verdict(runs), (
        Section("The model", (_theory(truth),)),
        Section("Sensor signals", _signals(example.records)),
        Section("Stabilisation diagrams", _diagrams(example.identified)),
        Section("Modal parameters", _tables(example.identified, runs, truth)),
        Section("Mode shapes", _shapes(example.identified, truth)),
        Section(f"Spread over {len(runs)} sets of records", _spreads(runs, truth)),
    )


def records(vehicle: Structure, *, seed: int) -> list[Recording]:
    """Return the records of a set, without noise."""
    return thesis.simulated(vehicle, usual_excitation(vehicle), SETUP, (seed,))


def noisy(clean: list[Recording], snr: float, band: tuple[float, float] | None, *, seed: int) -> list[Recording]:
    """Return the records with sensor noise in a band [Hz]; None: white."""
    generators = [np.random.default_rng([seed, k, 1]) for k in range(len(clean))]
    return [with_noise(record, snr=snr, band=band, generator=g) for record, g in zip(clean, generators, strict=True)]


def settings(method: str) -> IdentificationSettings:
    """Return the settings of the thesis."""
    segment = None if method == "cov" else SETUP.duration
    rate = 0.7 if method == "coss" else 0.5
    return as_in_thesis(
        IdentificationSettings(decimate_to=SETUP.rate, segment=segment), rows=SETUP.rows, stable_rate=rate
    )


def identified(
    method: str, runs: list[Recording], *, is_default: bool = False, harmonics: tuple[Harmonic, ...] | None = None
) -> Identification:
    """Return what a method identifies: Cov-SSI in the first record, the other methods in all."""
    chosen = runs[:1] if method == "cov" else runs
    options = IdentificationSettings() if is_default else settings(method)
    return SUBSPACE_METHODS[method](chosen, settings=replace(options, harmonics=harmonics))


def experiment(seed: int) -> Real:
    """Return frequency, damping, MAC and number of other modes, (SNR, band, thesis or default, method, 4, modes)."""
    vehicle = structure(read_description("chain3"))
    truth, clean = thesis.theoretical(vehicle), records(vehicle, seed=seed)
    results = np.full((len(RATIOS), len(BANDS), 2, len(SUBSPACE_METHODS), 4, len(truth)), np.nan)
    for i, snr in enumerate(RATIOS):
        for j, band in enumerate(BANDS.values()):
            runs = noisy(clean, snr, band, seed=seed)
            for k, is_default in enumerate((False, True) if snr < 1 else (False,)):
                harmonics: tuple[Harmonic, ...] | None = None
                for m, method in enumerate(SUBSPACE_METHODS):
                    identification = identified(method, runs, is_default=is_default, harmonics=harmonics)
                    harmonics = identification.harmonics if method == "acs" else None
                    results[i, j, k, m] = thesis.matched(identification.modes, truth).rows
    return results


def _theory(truth: Modes) -> Table:
    """Table 4-1."""
    return thesis.theory_table(
        "Table 4-1: theoretical modal parameters",
        [f"Mode {k + 1}" for k in range(len(truth))],
        (PRINTED["theory"]["frequency"], truth.natural_frequency),
        (PRINTED["theory"]["damping"], 100 * truth.damping_ratio),
        remark="m = 1 kg, k = 9800 N/m, c = 5 N s/m, recovered from the modes: figure 4-3 with the parameters is lost.",
    )


def _signals(shown: dict[float, list[Recording]]) -> tuple[Block, ...]:
    """Figures 4-4 to 4-6."""
    curves = [(f"SNR {snr:g}", shown[snr][0]) for snr in sorted(RATIOS)]
    marked = [(f"{f:.2f} Hz", f) for f in PRINTED["theory"]["frequency"]]
    density = figures.densities_figure(curves, title="Power spectral densities", highest=50.0, marked=marked)
    return pictures(
        {
            "Figure 4-4: accelerations over time.": figures.histories_figure(
                curves, title="Accelerations of the masses"
            ),
            "Figure 4-5: level every two seconds.": figures.levels_figure(
                curves, title="RMS in intervals of two seconds"
            ),
            "Figure 4-6: power spectral densities. Dotted: theoretical natural frequencies.": density,
        }
    )


def _diagrams(identifications: dict[tuple[str, float], Identification]) -> tuple[Block, ...]:
    """Figures 4-7 to 4-11."""
    blocks: list[Block] = []
    diagrams = [
        (f"{n}({x})", m, snr)
        for n, m in zip(("4-7", "4-8", "4-9"), SUBSPACE_METHODS, strict=True)
        for x, snr in zip("ab", RATIOS, strict=True)
    ]
    for figure, method, snr in diagrams:
        caption = f"Figure {figure}: stabilisation diagram of {METHOD_NAMES[method]} at SNR {snr:g}."
        blocks += thesis.mode_pictures(identifications[method, snr], {"diagram": caption}, source=f"SNR {snr:g}")
    for figure, method, snr in (("4-10(a)", "cov", 10.0), ("4-10(b)", "acs", 10.0), ("4-11", "coss", 0.5)):
        caption = f"Figure {figure}: rate of stable points of {METHOD_NAMES[method]} at SNR {snr:g}; dashed: threshold."
        blocks += thesis.mode_pictures(identifications[method, snr], {"rates": caption}, source=f"SNR {snr:g}")
    return tuple(blocks)


def _tables(identifications: dict[tuple[str, float], Identification], runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Tables 4-2 to 4-4."""
    blocks: list[Block] = []
    for table, m, method in (("4-2", 0, "cov"), ("4-3", 1, "acs")):
        ours = [thesis.matched(identifications[method, snr].modes, truth) for snr in RATIOS]
        columns = (
            ("", [f"SNR {snr:g}, mode {k + 1}" for snr in RATIOS for k in range(len(truth))]),
            ("f published [Hz]", thesis.numbers(PRINTED[method]["frequency"])),
            ("f ours [Hz]", thesis.numbers([match.natural_frequency for match in ours])),
            ("ξ published [%]", thesis.numbers(PRINTED[method]["damping"])),
            ("ξ ours [%]", thesis.numbers([100 * match.damping_ratio for match in ours])),
            ("f, white noise: found in, median (5 to 95 %)", thesis.in_runs(runs[:, :, 0, 0, m, 0])),
            ("f, noise in 0.5 to 50 Hz", thesis.in_runs(runs[:, :, 1, 0, m, 0])),
        )
        blocks.append(
            thesis.column_table(
                f"Table {table}: modes found by {METHOD_NAMES[method]}", columns, remark="–: not found."
            )
        )
    found = np.full((2, *PRINTED["coss"]["frequency"].shape), np.nan)
    for i, snr in enumerate(RATIOS):
        for s, subset in enumerate(identifications["coss", snr].subsets[: found.shape[2]]):
            match = thesis.matched(subset.modes, truth)
            found[:, i, s] = match.natural_frequency, 100 * match.damping_ratio
    columns_of_subsets = (
        ("", [f"SNR {snr:g}, S{s + 1}, mode {k + 1}" for snr in RATIOS for s in range(3) for k in range(len(truth))]),
        ("f published [Hz]", thesis.numbers(PRINTED["coss"]["frequency"])),
        ("f ours [Hz]", thesis.numbers(found[0])),
        ("ξ published [%]", thesis.numbers(PRINTED["coss"]["damping"])),
        ("ξ ours [%]", thesis.numbers(found[1])),
    )
    remark = (
        "Subsets with fewer than two segments are merged with a neighbour, so that there can be fewer than three. Segments "
        "are sorted by the level of the correlations that are averaged, as published: this biases damping, high at low level "
        "and low at high level, in a linear chain, too."
    )
    title = "Table 4-4: modes found by CoSS-SSI in each subset"
    return (*blocks, thesis.column_table(title, columns_of_subsets, remark=remark))


def _shapes(identifications: dict[tuple[str, float], Identification], truth: Modes) -> tuple[Block, ...]:
    """Figures 4-12 to 4-14."""
    blocks: list[Block] = []
    for figure, method in (("4-12", "cov"), ("4-13", "acs"), ("4-14", "coss")):
        parts = []
        for snr in RATIOS:
            for s, subset in enumerate(identifications[method, snr].subsets):
                name = f"SNR {snr:g}" + (f", S{s + 1}" if method == "coss" else "")
                parts.append((name, subset.modes))
        title = f"MAC of theory (rows) and {METHOD_NAMES[method]} (columns)"
        caption = f"Figure {figure}: MAC between theoretical and identified mode shapes, {METHOD_NAMES[method]}."
        blocks.append(picture(figures.reference_mac_figure(parts, truth, title=title), caption))
    return tuple(blocks)


def _spreads(runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Spread over the sets, the thesis' settings and sprung's own."""
    blocks: list[Block] = []
    names = [f"Mode {k + 1}" for k in range(len(truth))]
    for i, snr in enumerate(RATIOS):
        settings_shown = ("thesis", "default") if snr < 1 else ("thesis",)
        rows = tuple(f"{METHOD_NAMES[m]}, {how}" for how in settings_shown for m in SUBSPACE_METHODS)
        n_shown = len(settings_shown)
        for j, band in enumerate(BANDS):
            spreads = []
            for q, name, factor, true in thesis.QUANTITIES:
                shown = factor * runs[:, i, j, :n_shown, :, q].reshape(len(runs), len(rows), len(truth))
                printed = [np.atleast_2d(PRINTED[m][name.split()[0]][i])[0] for m in SUBSPACE_METHODS]
                spreads += thesis.spreads(names, rows, shown, true(truth), np.array(printed), quantity=name)
            others = runs[:, i, j, :n_shown, :, 3, 0].mean(axis=0).ravel()
            caption = (
                f"SNR {snr:g}, noise {band}. Other modes per set: "
                + ", ".join(f"{name} {value:.2f}" for name, value in zip(rows, others, strict=True))
                + ". Published for CoSS: its first subset."
            )
            blocks.append(picture(figures.runs_figure(spreads, title=f"SNR {snr:g}, noise {band}"), caption))
    return tuple(blocks)


def _verdict(runs: Real) -> dict[str, object]:
    """What reproduces and what does not, in numbers."""
    truth = thesis.theoretical(structure(read_description("chain3")))
    low = {method: thesis.shares(runs[:, 1, 1, 0, n, 0]) for n, method in enumerate(SUBSPACE_METHODS)}
    return {
        **low,
        "white": 100 * np.min(np.isfinite(runs[:, :, 0, 0, :, 0]).mean(axis=0)),
        "default": thesis.shares(runs[:, 1, 1, 1, 2, 0]),
        "damping": 100 * thesis.worst_error(runs[:, :, :, 0, 2, 1], truth.damping_ratio),
        "error": 100 * thesis.worst_error(runs[:, 1, 1, 1, 2, 0], truth.natural_frequency),
    }


CHAPTER = Chapter("chapter_4", example, experiment, contents)
