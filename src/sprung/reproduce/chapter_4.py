"""Chapter 4: a chain of three masses, noise of two sizes, three methods."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.identification import METHOD_NAMES, SUBSPACE_METHODS, Identification, IdentificationSettings
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce.chapter import Chapter
from sprung.reproduce.thesis import (
    THRESHOLDS,
    matched,
    number,
    numbers_table,
    of_runs,
    share,
    theoretical,
    theory_table,
    thesis_settings,
    worst_error,
)
from sprung.results.figures import (
    Spread,
    densities_figure,
    histories_figure,
    levels_figure,
    reference_mac_figure,
    runs_figure,
    stabilisation_figure,
    stable_rates_figure,
)
from sprung.results.page.page import Block, Section, picture
from sprung.results.tables import Table
from sprung.signals.harmonics import Harmonic
from sprung.simulation import simulate, usual_excitation, with_noise
from sprung.vehicles import Structure, read_description, structure

RATE, DURATION, N_RECORDS = 500.0, 60.0, 20
RATIOS = (10.0, 0.5)
#: Bands of the noise [Hz]; the thesis states only "band-pass white noise".
BANDS: dict[str, tuple[float, float] | None] = {"white": None, "0.5 to 50 Hz": (0.5, 50.0)}
#: Frequencies [Hz] and damping [%] of tables 4-2 and 4-3 by method and SNR, NaN where the thesis found none.
NONE = (np.nan, np.nan, np.nan)
PUBLISHED = {
    ("cov", 10.0): ((7.03, 19.67, 28.44), (1.25, 3.11, 4.30)),
    ("cov", 0.5): (NONE, NONE),
    ("acs", 10.0): ((7.01, 19.69, 28.32), (1.08, 3.29, 4.81)),
    ("acs", 0.5): ((7.01, 19.68, np.nan), (1.19, 3.41, np.nan)),
}
#: Table 4-4: the three subsets of CoSS-SSI.
SUBSETS = {
    10.0: (
        ((7.03, 19.33, 28.52), (2.17, 4.45, 6.53)),
        ((7.01, 19.34, 28.58), (1.97, 5.91, 6.71)),
        ((7.04, 19.33, 28.51), (5.17, 3.92, 5.83)),
    ),
    0.5: (
        ((7.02, 19.59, 28.43), (3.47, 5.14, 6.53)),
        ((7.02, 19.59, 28.51), (2.58, 3.74, 3.50)),
        ((7.02, 19.59, 28.47), (4.45, 3.51, 5.53)),
    ),
}
PUBLISHED_THEORY = ((7.01, 19.65, 28.39), (1.12, 3.15, 4.55))


class Example(NamedTuple):
    """Records by SNR, with noise in 0.5 to 50 Hz, and what each method identifies in them."""

    records: dict[float, list[Recording]]
    identified: dict[tuple[str, float], Identification]


def example() -> Example:
    """Return the set of records that the figures show."""
    clean = records(structure(read_description("chain3")), seed=0)
    shown = {snr: noisy(clean, snr, BANDS["0.5 to 50 Hz"], seed=0) for snr in RATIOS}
    return Example(shown, {(name, snr): identified(name, shown[snr]) for name in SUBSPACE_METHODS for snr in RATIOS})


def contents(example: Example, results: list[Real]) -> tuple[str, tuple[Section, ...]]:
    """Return the verdict and the sections."""
    truth, runs = theoretical(structure(read_description("chain3"))), np.array(results)
    return _verdict(runs), (
        Section("The model", (_theory(truth),)),
        Section("Sensor signals", _signals(example.records)),
        Section("Stabilisation diagrams", _diagrams(example.identified)),
        Section("Modal parameters", _tables(example.identified, runs, truth)),
        Section("Mode shapes", _shapes(example.identified, truth)),
        Section(f"Spread over {len(runs)} sets of records", _spreads(runs, truth)),
    )


def records(vehicle: Structure, *, seed: int) -> list[Recording]:
    """Return one set of records without noise."""
    excitation = usual_excitation(vehicle)
    generators = [np.random.default_rng([seed, k]) for k in range(N_RECORDS)]
    return [
        simulate(vehicle, excitation, duration=DURATION, sampling_rate=RATE, seed=generator) for generator in generators
    ]


def noisy(clean: list[Recording], snr: float, band: tuple[float, float] | None, *, seed: int) -> list[Recording]:
    """Return the records with sensor noise in a band [Hz]; None: white."""
    generators = [np.random.default_rng([seed, k, 1]) for k in range(len(clean))]
    return [with_noise(record, snr=snr, band=band, generator=g) for record, g in zip(clean, generators, strict=True)]


def settings(method: str) -> IdentificationSettings:
    """Return the settings of the thesis for a method."""
    segment = None if method == "cov" else DURATION
    return thesis_settings(
        rows=(12, 45), stable_rate=0.7 if method == "coss" else 0.5, segment=segment, sampling_rate=RATE
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
    truth, clean = theoretical(vehicle), records(vehicle, seed=seed)
    results = np.full((len(RATIOS), len(BANDS), 2, len(SUBSPACE_METHODS), 4, len(truth)), np.nan)
    for i, snr in enumerate(RATIOS):
        for j, band in enumerate(BANDS.values()):
            runs = noisy(clean, snr, band, seed=seed)
            for k, is_default in enumerate((False, True) if snr < 1 else (False,)):
                harmonics: tuple[Harmonic, ...] | None = None
                for m, method in enumerate(SUBSPACE_METHODS):
                    identification = identified(method, runs, is_default=is_default, harmonics=harmonics)
                    harmonics = identification.harmonics if method == "acs" else None
                    match = matched(identification.modes, truth)
                    results[i, j, k, m, :3] = match.natural_frequency, match.damping_ratio, match.mac
                    results[i, j, k, m, 3] = match.n_others
    return results


def _theory(truth: Modes) -> Table:
    """Table 4-1."""
    return theory_table(
        "Table 4-1: theoretical modal parameters",
        [f"Mode {k + 1}" for k in range(len(truth))],
        (PUBLISHED_THEORY[0], truth.natural_frequency),
        (PUBLISHED_THEORY[1], 100 * truth.damping_ratio),
        remark="m = 1 kg, k = 9800 N/m, c = 5 N s/m, recovered from the modes: figure 4-3 with the parameters is lost.",
    )


def _signals(shown: dict[float, list[Recording]]) -> tuple[Block, ...]:
    """Figures 4-4 to 4-6."""
    curves = [(f"SNR {snr:g}", shown[snr][0]) for snr in sorted(RATIOS)]
    marked = [(f"{f:.2f} Hz", f) for f in PUBLISHED_THEORY[0]]
    return (
        picture(histories_figure(curves, title="Accelerations of the masses"), "Figure 4-4: accelerations over time."),
        picture(levels_figure(curves, title="RMS in intervals of two seconds"), "Figure 4-5: level every two seconds."),
        picture(
            densities_figure(curves, title="Power spectral densities", highest=50.0, marked=marked),
            "Figure 4-6: power spectral densities. Dotted: theoretical natural frequencies.",
        ),
    )


def _diagrams(identifications: dict[tuple[str, float], Identification]) -> tuple[Block, ...]:
    """Figures 4-7 to 4-11."""
    blocks: list[Block] = []
    for figure, method in (("4-7", "cov"), ("4-8", "acs"), ("4-9", "coss")):
        for letter, snr in zip("ab", RATIOS, strict=True):
            source = f"SNR {snr:g}"
            caption = f"Figure {figure}({letter}): stabilisation diagram of {METHOD_NAMES[method]} at SNR {snr:g}."
            blocks.append(picture(stabilisation_figure(identifications[method, snr], source=source), caption))
    for figure, method, snr in (("4-10(a)", "cov", 10.0), ("4-10(b)", "acs", 10.0), ("4-11", "coss", 0.5)):
        caption = f"Figure {figure}: rate of stable points of {METHOD_NAMES[method]} at SNR {snr:g}; dashed: threshold."
        blocks.append(picture(stable_rates_figure(identifications[method, snr], source=f"SNR {snr:g}"), caption))
    return tuple(blocks)


def _tables(identifications: dict[tuple[str, float], Identification], runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Tables 4-2 to 4-4."""
    blocks: list[Block] = []
    columns = ("", "f published [Hz]", "f ours [Hz]", "ξ published [%]", "ξ ours [%]")
    spreads = ("f, white noise: found in, median (5 to 95 %)", "f, noise in 0.5 to 50 Hz")
    for table, method in (("4-2", "cov"), ("4-3", "acs")):
        rows = []
        for i, snr in enumerate(RATIOS):
            match = matched(identifications[method, snr].modes, truth)
            for k in range(len(truth)):
                frequency, damping = PUBLISHED[method, snr]
                values = runs[:, i, :, 0, list(SUBSPACE_METHODS).index(method), 0, k]
                rows.append(
                    (
                        f"SNR {snr:g}, mode {k + 1}",
                        number(frequency[k]),
                        number(match.natural_frequency[k]),
                        number(damping[k]),
                        number(100 * match.damping_ratio[k]),
                        of_runs(values[:, 0]),
                        of_runs(values[:, 1]),
                    )
                )
        title = f"Table {table}: modes found by {METHOD_NAMES[method]}"
        blocks.append(numbers_table(title, (*columns, *spreads), tuple(rows), "–: not found."))
    lines = []
    for snr in RATIOS:
        subsets = identifications["coss", snr].subsets
        for s, published in enumerate(SUBSETS[snr]):
            subset = matched(subsets[s].modes, truth) if s < len(subsets) else None
            for k in range(len(truth)):
                ours = (np.nan, np.nan) if subset is None else (subset.natural_frequency[k], subset.damping_ratio[k])
                lines.append(
                    (
                        f"SNR {snr:g}, S{s + 1}, mode {k + 1}",
                        number(published[0][k]),
                        number(ours[0]),
                        number(published[1][k]),
                        number(100 * ours[1]),
                    )
                )
    remark = (
        "Subsets with fewer than two segments are merged with a neighbour, so that there can be fewer than three. Segments "
        "are sorted by the level of the correlations that are averaged, as published: this biases damping, high at low level "
        "and low at high level, in a linear chain, too."
    )
    blocks.append(numbers_table("Table 4-4: modes found by CoSS-SSI in each subset", columns, tuple(lines), remark))
    return tuple(blocks)


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
        blocks.append(picture(reference_mac_figure(parts, truth, title=title), caption))
    return tuple(blocks)


def _spreads(runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Spread over the sets, the thesis' settings and sprung's own."""
    blocks: list[Block] = []
    for i, snr in enumerate(RATIOS):
        settings_shown = ("thesis", "default") if snr < 1 else ("thesis",)
        rows = tuple(f"{METHOD_NAMES[m]}, {how}" for how in settings_shown for m in SUBSPACE_METHODS)
        n_shown = len(settings_shown)
        for j, band in enumerate(BANDS):
            spreads = []
            for quantity, name, factor in ((0, "frequency [Hz]", 1.0), (1, "damping [%]", 100.0)):
                for k in range(len(truth)):
                    values = factor * runs[:, i, j, :n_shown, :, quantity, k].reshape(len(runs), -1).T
                    true = (truth.natural_frequency, 100 * truth.damping_ratio)[quantity][k]
                    published = tuple(
                        PUBLISHED[m, snr][quantity][k] if m != "coss" else SUBSETS[snr][0][quantity][k]
                        for m in SUBSPACE_METHODS
                    )
                    spreads.append(Spread(f"Mode {k + 1}: {name}", rows, values, true, published))
            others = runs[:, i, j, :n_shown, :, 3, 0].mean(axis=0).ravel()
            caption = (
                f"SNR {snr:g}, noise {band}. Other modes per set: "
                + ", ".join(f"{name} {value:.2f}" for name, value in zip(rows, others, strict=True))
                + ". Published for CoSS: its first subset."
            )
            blocks.append(picture(runs_figure(spreads, title=f"SNR {snr:g}, noise {band}"), caption))
    return tuple(blocks)


def _verdict(runs: Real) -> str:
    """Return what reproduces and what does not."""
    white = [[share(runs[:, i, 0, 0, m, 0, k]) for k in range(3)] for i in range(2) for m in range(3)]
    low = {m: [share(runs[:, 1, 1, 0, n, 0, k]) for k in range(3)] for n, m in enumerate(SUBSPACE_METHODS)}
    default = [share(runs[:, 1, 1, 1, 2, 0, k]) for k in range(3)]
    truth = theoretical(structure(read_description("chain3")))
    error = worst_error(runs[:, 1, 1, 1, 2, 0], truth.natural_frequency)
    damping = worst_error(runs[:, :, :, 0, 2, 1], truth.damping_ratio)

    def shares(values: list[float]) -> str:
        return ", ".join(f"{100 * value:.0f} %" for value in values)

    return (
        "The theoretical modes reproduce to every printed digit. Tables 4-2 and 4-3 depend on the band of the noise, which the "
        f"thesis does not state: with white noise up to half the sampling rate the thesis' settings find each mode in at least "
        f"{100 * np.min(white):.0f} % of the sets with all three methods, at both noise levels. With noise in the "
        f"modes' own band at SNR 0.5 modes are lost, as published, but not always the published ones: Cov-SSI finds modes 1, 2, 3 in "
        f"{shares(low['cov'])} of the sets (published: none), ACS-Cov-SSI in {shares(low['acs'])} (published: the first two). What does not reproduce "
        f"is CoSS-SSI's advantage there: with its published threshold of 0.7 it finds the modes in {shares(low['coss'])} of "
        "the sets, since splitting the segments leaves fewer of them in each average. Its published damping errors "
        f"of up to 360 % do not reproduce either: where modes are found, the median damping of CoSS-SSI is within {100 * damping:.0f} %. Sprung's own defaults, "
        f"which test whether a mode contributes significantly to the correlations between channels, find the modes in {shares(default)} of the sets "
        f"in this hardest case, the median frequency within {100 * error:.2f} %."
    )


CHAPTER = Chapter(
    title="Chapter 4: CoSS-SSI on a chain of three masses",
    example=example,
    experiment=experiment,
    contents=contents,
    settings=(
        f"{N_RECORDS} records of {DURATION:g} s at {RATE:g} Hz in a set; Cov-SSI uses the first record, the other methods use all.",
        THRESHOLDS + " Block rows 12 to 45; delta 0.5 for Cov and ACS, 0.7 for CoSS with J = 3.",
        f"Noise of RMS(signal) / RMS(noise) = 10 and 0.5 in each channel, white up to {RATE / 2:g} Hz or in 0.5 to 50 Hz.",
        "Figures are of set 0 with noise in 0.5 to 50 Hz; the sets of the spread have the seeds 1 and up.",
        "Command: sprung reproduce 4 --out DIR",
    ),
)
