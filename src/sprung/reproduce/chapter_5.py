"""Chapter 5: harmonics, pulses and cepstrum editing on a quarter vehicle."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.excitation import QUARTER_CASES
from sprung.identification import Identification, IdentificationSettings, as_in_thesis, coss_ssi
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce import thesis
from sprung.reproduce.chapter import Chapter, set_up
from sprung.results import figures
from sprung.results.page.page import Block, Section, picture, pictures
from sprung.results.tables import Table
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import ShortPass, edit
from sprung.vehicles import frequency_response, read_description, structure

SETUP = set_up("chapter_5")
#: Frequencies of the pulses and of the second sine [Hz].
PULSES = 3.65
TONE = 17.0
PRINTED = thesis.published("5")
#: Case, whether it is edited, figures of the signals and of the diagram.
VARIANTS = (
    (1, False, "5-5", "5-6"),
    (2, False, "5-7", "5-8"),
    (3, False, "5-9", "5-10"),
    (4, False, "5-11", "5-12"),
    (3, True, "5-14", "5-15"),
    (4, True, "", "5-16"),
)
EXCITATIONS = {1: "random", 2: "random and pulses", 3: "random, pulses and a sine", 4: "random, pulses and two sines"}


def example() -> list[Identification]:
    """Return what is identified in each variant of the set of records that the figures show."""
    return [identified(records(case, seed=0), is_edited) for case, is_edited, _, _ in VARIANTS]


def contents(example: list[Identification], results: list[Real]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict, and the sections."""
    truth, runs = _truth(), np.array(results)
    return _verdict(runs), (
        Section("The model", (_response(truth), _theory(truth))),
        Section("Raw signals", tuple(block for k in range(4) for block in _case(k, example[k]))),
        Section("Cepstrum editing", (_cepstrum(), *(block for k in (4, 5) for block in _case(k, example[k])))),
        Section("Modal parameters", (_table(example, runs, truth), *_spreads(runs, truth))),
    )


def records(case: int, *, seed: int) -> list[Recording]:
    """Return the body's acceleration in the records of a case, 1 to 4."""
    quarter = structure(read_description("quarter"))
    runs = thesis.simulated(quarter, QUARTER_CASES[case - 1], SETUP, (seed, case))
    return [run.select(["acc_body"]) for run in runs]


def identified(
    runs: list[Recording], is_edited: bool, *, harmonics: tuple[Harmonic, ...] | None = None
) -> Identification:
    """Return what CoSS-SSI with one subset identifies."""
    lifter = ShortPass(SETUP.quefrency) if is_edited else None
    settings = IdentificationSettings(
        decimate_to=SETUP.rate, segment=SETUP.duration, n_subsets=1, lifter=lifter, harmonics=harmonics
    )
    return coss_ssi(runs, settings=as_in_thesis(settings, rows=SETUP.rows, stable_rate=0.5))


def line_rate(identification: Identification, frequency: float) -> float:
    """Return the share of rungs with a pole within 3 % of a line of the excitation [Hz] and less than 20 % damped."""
    poles = identification.subsets[0].diagrams[0].poles
    near = (np.abs(poles.natural_frequency / frequency - 1) < 0.03) & (np.abs(poles.damping_ratio) < 0.2)
    return np.unique(poles.rungs[near]).size / len(poles.ladder)


def experiment(seed: int) -> Real:
    """Return frequency and damping of both modes, number of others and rates of poles on lines, (variants, 4, 2)."""
    truth = _truth()
    results = np.empty((len(VARIANTS), 4, 2))
    sets = {case: records(case, seed=seed) for case in (1, 2, 3, 4)}
    harmonics: dict[int, tuple[Harmonic, ...]] = {}
    for row, (case, is_edited, _, _) in enumerate(VARIANTS):
        identification = identified(sets[case], is_edited, harmonics=harmonics.get(case))
        harmonics[case] = identification.harmonics
        results[row, :3] = thesis.matched(identification.modes, truth).rows[[0, 1, 3]]
        results[row, 3] = line_rate(identification, PULSES), line_rate(identification, TONE)
    return results


def _truth() -> Modes:
    """Return the true modes in the acceleration of the body."""
    modes = thesis.theoretical(structure(read_description("quarter")))
    return replace(thesis.at_channels(modes, ["acc_body"]), mode_shapes=np.ones((len(modes), 1), dtype=complex))


def _response(truth: Modes) -> Block:
    """Figure 5-4."""
    f = np.linspace(0.5, 100, 800)
    vehicle = structure(read_description("quarter"))
    response = frequency_response(vehicle, f)[:, vehicle.outputs.names.index("acc_body"), 0]
    marked = [(label or "", value) for label, value in zip(("body", "wheel"), truth.natural_frequency, strict=True)]
    figure = figures.response_figure(
        f,
        [("body", response)],
        title="Acceleration of the body over displacement of the base",
        unit="m/s² / m",
        marked=marked,
        has_phase=True,
    )
    return picture(figure, "Figure 5-4: frequency response of the quarter vehicle.")


def _theory(truth: Modes) -> Table:
    """Theoretical modes."""
    return thesis.theory_table(
        "Theoretical modes (section 5.3)",
        ("Body", "Wheel"),
        (PRINTED["theory"]["frequency"], truth.natural_frequency),
        (PRINTED["theory"]["damping"], 100 * truth.damping_ratio),
        remark="Parameters per kilogram of body, recovered from the modes.",
    )


def _case(index: int, identification: Identification) -> tuple[Block, ...]:
    """Signals and stabilisation diagram of one variant."""
    case, is_edited, signals, diagram = VARIANTS[index]
    runs = records(case, seed=0)
    curves = [("raw", runs[0])]
    if is_edited:
        curves.append(("edited", edit(runs[0], ShortPass(SETUP.quefrency))))
    what = f"Case {case}: {EXCITATIONS[case]}" + (", edited" if is_edited else "")
    blocks: tuple[Block, ...] = ()
    if signals:
        caption = f"Figure {signals}: acceleration of the body, {what.lower()}"
        blocks = pictures(
            {
                f"{caption}, first five seconds.": figures.histories_figure(curves, title=what, window=5.0),
                f"{caption}, power spectral density.": figures.densities_figure(curves, title=what, highest=100.0),
            }
        )
    caption = f"Figure {diagram}: stabilisation diagram, {what.lower()}."
    return (*blocks, *thesis.mode_pictures(identification, {"diagram": caption}, source=what))


def _cepstrum() -> Block:
    """Figure 5-13."""
    return thesis.cepstrum_picture(
        records(3, seed=0)[0],
        SETUP.quefrency,
        "Figure 5-13: cepstrum, short-pass lifter and edited cepstrum.",
        title="Case 3: real cepstrum of the body's acceleration",
        pulse_period=1 / PULSES,
    )


def _table(identifications: list[Identification], runs: Real, truth: Modes) -> Table:
    """Published and identified modes of all variants; below each the false ones."""
    ours = np.array([thesis.matched(identification.modes, truth).rows for identification in identifications])
    with_false = [(case, is_edited, figure, k) for case, is_edited, _, figure in VARIANTS for k in range(3)]
    lines = np.median(runs[:, :, 3], axis=0)

    def column(cells: list[str], below: Sequence[str]) -> list[str]:
        return [cell for v, text in enumerate(below) for cell in (*cells[2 * v : 2 * v + 2], text)]

    columns = (
        (
            "",
            [
                f"Case {case}{', edited' if is_edited else ''} (fig. {figure}), mode {k + 1}"
                if k < 2
                else "– false modes"
                for case, is_edited, figure, k in with_false
            ],
        ),
        ("f published [Hz]", column(thesis.numbers(PRINTED["found"]["frequency"]), list(PRINTED["found"]["others"]))),
        ("f ours [Hz]", column(thesis.numbers(ours[:, 0]), [f"{n:.0f}" for n in ours[:, 3, 0]])),
        (
            "f in all sets: found in, median (5 to 95 %)",
            column(thesis.in_runs(runs[:, :, 0]), [f"{n:.2f} per set" for n in runs[:, :, 2, 0].mean(axis=0)]),
        ),
        (
            "ξ published [%]",
            column(thesis.numbers(PRINTED["found"]["damping"]), ["rungs with poles at 3.65, 17 Hz:"] * len(VARIANTS)),
        ),
        (
            "ξ ours [%]",
            column(thesis.numbers(100 * ours[:, 1]), [" and ".join(f"{100 * x:.0f} %" for x in two) for two in lines]),
        ),
        ("ξ in all sets", column(thesis.in_runs(100 * runs[:, :, 1]), [""] * len(VARIANTS))),
    )
    return thesis.column_table("Modes in the four cases, raw and edited", columns, remark="–: not found.")


def _spreads(runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Spread over the sets."""
    rows = tuple(f"case {case}{', edited' if is_edited else ''}" for case, is_edited, _, _ in VARIANTS)
    spreads = []
    for q, name, factor, true in thesis.QUANTITIES:
        printed, values = PRINTED["found"][name.split()[0]], factor * runs[:, :, q]
        spreads += thesis.spreads(("Mode 1", "Mode 2"), rows, values, true(truth), printed, quantity=name)
    figure = figures.runs_figure(spreads, title="Both modes in all sets")
    return (picture(figure, f"Spread over {len(runs)} sets of records."),)


def _verdict(runs: Real) -> dict[str, object]:
    """What reproduces and what does not, in numbers."""
    truth = _truth().natural_frequency
    pulses, edited = (100 * thesis.worst_error(runs[:, rows, 0], truth) for rows in (slice(1, 2), slice(4, 6)))
    rungs = 100 * np.median(runs[:, :, 3], axis=0)
    raw, edited_3, edited_4 = (100 * thesis.share(runs[:, case, 0, 0]) for case in (3, 4, 5))
    return {
        "pulses": pulses,
        "at_pulses": rungs[2, 0],
        "at_tone": rungs[3, 1],
        "raw": raw,
        "edited": edited,
        "edited_3": edited_3,
        "edited_4": edited_4,
    }


CHAPTER = Chapter("chapter_5", example, experiment, contents)
