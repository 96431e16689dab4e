"""Cov-SSI, ACS-Cov-SSI and CoSS-SSI on the same data with the same settings: where sorting the segments helps."""

from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.excitation import RandomInputs
from sprung.identification import METHOD_NAMES, SUBSPACE_METHODS, IdentificationSettings, as_in_thesis
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce import thesis
from sprung.reproduce.chapter import Chapter, data, set_up
from sprung.results import figures
from sprung.results.page.page import Block, Paragraph, Section, picture
from sprung.results.tables import Table
from sprung.signals.harmonics import Harmonic
from sprung.simulation import ForceLaw, simulate, simulate_nonlinear, with_noise
from sprung.vehicles import Structure, read_description, structure

SETUP = set_up("comparison")
#: RMS of the signals over that of the noise.
RATIO = 1.0
#: Force of the records that differ in level: from 1 to 10 over the set.
LEVELS = np.geomspace(1.0, 10.0, SETUP.n_records)
#: Rubber in parallel with each spring: 15 % stiffer at small amplitudes than at large ones.
RUBBER = {"suspension": ForceLaw(rubber_stiffness=0.15 * 9800.0, rubber_force=2.0)}
CASES = data("chapters")["comparison"]["cases"]
#: Cases with one truth at all levels.
LINEAR = ("white", "in-band", "level")
HOW = ("thesis", "default")


def example() -> Modes:
    """Return the true modes; the thesis shows no such comparison."""
    return thesis.theoretical(structure(read_description("chain3")))


def contents(truth: Modes, results: list[Real]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict, and the sections."""
    runs = np.array(results)
    cases = tuple(
        Section(f"Case: {case}", (Paragraph(text), *_case(runs[:, row], truth, case == "nonlinear")))
        for row, (case, text) in enumerate(CASES.items())
    )
    paired = Section("CoSS-SSI against ACS-Cov-SSI, set by set", (_paired(runs, truth), _levels(runs)))
    return _verdict(runs, truth), (paired, *cases)


def records(case: str, *, seed: int) -> list[Recording]:
    """Return one set of records of a case."""
    vehicle = structure(read_description("chain3"))
    clean = []
    for k in range(SETUP.n_records):
        generator = np.random.default_rng([seed, list(CASES).index(case), k])
        level = LEVELS[k] if case in {"level", "nonlinear"} else 1.0
        excitation = RandomInputs(3, standard_deviation=level)
        clean.append(_simulated(vehicle, excitation, case, generator))
    if case in {"white", "in-band"}:
        band = (0.5, 50.0) if case == "in-band" else None
        return [
            with_noise(record, snr=RATIO, band=band, generator=np.random.default_rng([seed, 9, k]))
            for k, record in enumerate(clean)
        ]
    size = np.sqrt(np.mean([np.mean(record.samples**2, axis=1) for record in clean], axis=0)) / RATIO
    noise = np.random.default_rng([seed, 9])
    return [
        record.changed("noise", samples=record.samples + size[:, None] * noise.standard_normal(record.samples.shape))
        for record in clean
    ]


def _simulated(vehicle: Structure, excitation: RandomInputs, case: str, generator: np.random.Generator) -> Recording:
    """Return one record without noise."""
    if case == "nonlinear":
        return simulate_nonlinear(
            vehicle,
            excitation,
            duration=SETUP.duration,
            sampling_rate=SETUP.rate,
            force_laws=RUBBER,
            lead_in=20.0,
            seed=generator,
        )
    return simulate(vehicle, excitation, duration=SETUP.duration, sampling_rate=SETUP.rate, seed=generator)


def settings(how: str) -> IdentificationSettings:
    """Return the settings of all methods."""
    if how == "default":
        return IdentificationSettings(segment=SETUP.segment)
    return as_in_thesis(
        IdentificationSettings(decimate_to=SETUP.rate, segment=SETUP.segment), rows=SETUP.rows, stable_rate=0.5
    )


def experiment(seed: int) -> Real:
    """Return results of each case, setting and method, (case, how, method, 6, modes).

    Rows: frequency, damping, MAC, number of other modes, and of CoSS-SSI the frequency in the lowest and the highest subset.
    """
    truth = thesis.theoretical(structure(read_description("chain3")))
    results = np.full((len(CASES), len(HOW), len(SUBSPACE_METHODS), 6, len(truth)), np.nan)
    for i, case in enumerate(CASES):
        runs = records(case, seed=seed)
        for j, how in enumerate(HOW):
            harmonics: tuple[Harmonic, ...] | None = None
            for k, (name, method) in enumerate(SUBSPACE_METHODS.items()):
                chosen = settings(how) if name != "cov" or how == "thesis" else IdentificationSettings()
                identification = method(runs, settings=replace(chosen, harmonics=harmonics))
                harmonics = identification.harmonics
                results[i, j, k, :4] = thesis.matched(identification.modes, truth).rows
                if name == "coss":
                    for end in (0, -1):
                        subset = thesis.matched(identification.subsets[end].modes, truth)
                        results[i, j, k, 4 - end] = subset.natural_frequency
    return results


def _case(runs: Real, truth: Modes, is_nonlinear: bool) -> tuple[Block, ...]:
    """Table and figure of one case."""
    names = tuple(f"{METHOD_NAMES[name]}, {how}" for how in HOW for name in SUBSPACE_METHODS)
    flat = runs.reshape(len(runs), len(names), *runs.shape[3:])
    columns: list[thesis.Column] = [("", names)]
    for m in range(len(truth)):
        frequency = flat[:, :, 0, m] / truth.natural_frequency[m] - 1
        damping = flat[:, :, 1, m] / truth.damping_ratio[m] - 1
        columns += [
            (f"mode {m + 1} found", [f"{100 * thesis.share(own):.0f} %" for own in frequency.T]),
            ("f bias ± std [%]", [_bias_and_spread(own) for own in frequency.T]),
            ("ξ bias ± std [%]", [_bias_and_spread(own, digits=1) for own in damping.T]),
        ]
    columns.append(("other modes per set", thesis.numbers(flat[:, :, 3, 0].mean(axis=0))))
    remark = (
        "Against the linear chain without rubber: the bias includes the effect of the rubber." if is_nonlinear else ""
    )
    modes = [f"Mode {m + 1}" for m in range(len(truth))]
    spreads = thesis.spreads(modes, names, flat[:, :, 0], truth.natural_frequency)
    title = "Natural frequencies in all sets"
    table = thesis.column_table(f"{len(runs)} sets", columns, remark=remark)
    return table, picture(figures.runs_figure(spreads, title=title), f"{title}.")


def _bias_and_spread(relative: Real, *, digits: int = 2) -> str:
    """Return mean and standard deviation in percent."""
    percent = 100 * relative[np.isfinite(relative)]
    return f"{percent.mean():+.{digits}f} ± {percent.std():.{digits}f}" if percent.size else "–"


def gain(runs: Real, truth: Modes, *, quantity: int) -> Real:
    """Return by how much the error of CoSS is smaller than that of ACS in the same set, and its standard error [%].

    Shape (2, linear cases, settings, modes), of frequency (0) or damping (1); NaN where fewer than two sets have both.
    """
    values = (truth.natural_frequency, truth.damping_ratio)[quantity]
    errors = 100 * np.abs(runs[:, : len(LINEAR), :, 1:, quantity] / values - 1)
    difference = errors[:, :, :, 0] - errors[:, :, :, 1]
    gains = np.full((2, *difference.shape[1:]), np.nan)
    for place in np.ndindex(difference.shape[1:]):
        own = difference[(slice(None), *place)]
        own = own[np.isfinite(own)]
        if own.size >= 2:
            gains[(slice(None), *place)] = own.mean(), own.std(ddof=1) / np.sqrt(own.size)
    return gains


def _paired(runs: Real, truth: Modes) -> Table:
    """Error of ACS less that of CoSS in the same sets."""
    columns: list[thesis.Column] = [("", [f"{case}, {how}" for case in LINEAR for how in HOW])]
    for name, quantity in (("f", 0), ("ξ", 1)):
        gains = gain(runs, truth, quantity=quantity)
        for m in range(len(truth)):
            means, errors = (thesis.numbers(part, digits=3 - quantity) for part in gains[..., m])
            cells = [f"{mean} ± {error}" for mean, error in zip(means, errors, strict=True)]
            columns.append((f"{name}, mode {m + 1} [%]", cells))
    remark = (
        "Mean of |error of ACS| - |error of CoSS| with its standard error: positive where CoSS is nearer to the truth."
    )
    return thesis.column_table("Error of ACS-Cov-SSI less that of CoSS-SSI", columns, remark=remark)


def _levels(runs: Real) -> Table:
    """Frequency in the highest over that in the lowest subset of CoSS-SSI."""
    change = 100 * (runs[:, :, :, 2, 5] / runs[:, :, :, 2, 4] - 1)
    columns: list[thesis.Column] = [("", [f"{case}, {how}" for case in CASES for how in HOW])]
    for m in range(change.shape[-1]):
        own = change[:, :, :, m].reshape(len(runs), -1).T
        columns.append((f"mode {m + 1}: mean ± std [%]", [_bias_and_spread(values / 100) for values in own]))
    remark = "Only with the rubber do frequencies truly change with the level: what the subsets of CoSS-SSI show and an average cannot."
    title = "Frequency in the subset of the highest level over that of the lowest, less 1"
    return thesis.column_table(title, columns, remark=remark)


def _verdict(runs: Real, truth: Modes) -> dict[str, object]:
    """Say where CoSS-SSI wins."""
    wins: list[str] = []
    losses: list[str] = []
    neither = 0
    gains = np.stack([gain(runs, truth, quantity=quantity) for quantity in (0, 1)])
    for i, case in enumerate(LINEAR):
        for j, how in enumerate(HOW):
            for quantity, name in enumerate(("frequency", "damping")):
                for m in range(len(truth)):
                    mean, error = gains[quantity, :, i, j, m]
                    if np.isfinite(mean) and abs(mean) > 3 * error:
                        text = f"{name} of mode {m + 1} ({case}, {how}: {abs(mean):.2g} % of the value)"
                        (wins if mean > 0 else losses).append(text)
                    else:
                        neither += 1
    cases = {
        case: ", ".join(
            f"{METHOD_NAMES[name]} {100 * np.mean([thesis.share(runs[:, i, 0, k, 0, m]) for m in range(3)]):.0f} %"
            for k, name in enumerate(SUBSPACE_METHODS)
        )
        for i, case in enumerate(CASES)
    }
    change = 100 * (runs[:, 3, 1, 2, 5, 0] / runs[:, 3, 1, 2, 4, 0] - 1)
    return {
        "cases": "; ".join(f"{case}: {text}" for case, text in cases.items()),
        "default": 100 * np.mean(np.isfinite(runs[:, :, 1, :, 0])),
        "n_wins": len(wins),
        "n_losses": len(losses),
        "n_all": len(wins) + len(losses) + neither,
        "wins": f" ({'; '.join(wins)})" if wins else "",
        "losses": f" ({'; '.join(losses)})" if losses else "",
        "change": np.mean(change[np.isfinite(change)]),
        "error": 100 * thesis.worst_error(runs[:, :3, 1, :, 0], truth.natural_frequency),
    }


CHAPTER = Chapter("comparison", example, experiment, contents)
