"""Chapter 7: a bogie at a scale of 1 to 5 on a roller rig, healthy and with two faults."""

from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.excitation import RollerRig, random_speed
from sprung.identification import METHOD_NAMES, SUBSPACE_METHODS, Identification, IdentificationSettings, as_in_thesis
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce import thesis
from sprung.reproduce.chapter import Chapter, set_up
from sprung.results import figures
from sprung.results.page.page import Block, Paragraph, Section, picture, pictures
from sprung.results.tables import Table
from sprung.signals.harmonics import Harmonic
from sprung.simulation import simulate
from sprung.vehicles import Structure, parse_fault, read_vehicle, structure, with_faults

SETUP = set_up("chapter_7")
#: Of the runs of the spread.
FAST = set_up("chapter_7", "fast")
CONDITIONS = {
    "normal": (),
    "front left +50 %": ("front_left.spring=0.5",),
    "rear left -75 %": ("rear_left.spring=-0.75",),
}
FIGURES = {"normal": "7-15", "front left +50 %": "7-16", "rear left -75 %": "7-17"}
PRINTED = thesis.published("7")


class Example(NamedTuple):
    """Records and CoSS-SSI by condition, the other methods in the normal condition, and the time of a CoSS-SSI [s]."""

    records: dict[str, list[Recording]]
    single: dict[str, Identification]
    coss: dict[str, Identification]
    seconds: float


def example() -> Example:
    """Return the set of records that the figures show, identified and timed."""
    shown = {name: records(name, seed=0) for name in CONDITIONS}
    single = {method: identified(method, shown["normal"]) for method in ("cov", "acs")}
    begin = perf_counter()
    coss = {name: identified("coss", runs) for name, runs in shown.items()}
    return Example(shown, single, coss, (perf_counter() - begin) / len(shown))


def contents(example: Example, results: list[Real]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict, and the sections."""
    runs = np.array(results)
    truths = {name: thesis.theoretical(bogie(name), labels=thesis.BODY_MODES) for name in CONDITIONS}
    healthy, normal = truths["normal"], example.records["normal"]
    return _verdict(runs, truths, example.seconds), (
        Section("The model", (_theory(healthy), _model_shapes(normal[0], healthy))),
        Section("Sensor signals", _signals(normal)),
        Section("Cov-SSI and ACS-Cov-SSI", _single(example.single, healthy)),
        Section("CoSS-SSI", _subsets(example.coss, truths)),
        Section("Modal parameters", (*_tables(runs, truths), _time(example.seconds))),
        Section("Faults", _faults(runs, truths)),
    )


def bogie(condition: str) -> Structure:
    """Return the bogie in a condition."""
    return with_faults(structure(read_vehicle("scale-bogie")), [parse_fault(text) for text in CONDITIONS[condition]])


def records(condition: str, *, seed: int) -> list[Recording]:
    """Return one set of records with rollers of varying speed."""
    runs = []
    for row in range(SETUP.n_records):
        generator = np.random.default_rng([seed, list(CONDITIONS).index(condition), row])
        rotation = random_speed(SETUP.duration, low=1.0, high=4.0, generator=generator)
        rig = RollerRig((True, True), rotation, random=2e-6)
        vehicle, rate = bogie(condition), SETUP.rate
        runs.append(simulate(vehicle, rig, duration=SETUP.duration, sampling_rate=rate, snr=10.0, seed=generator))
    return runs


def settings(method: str, *, is_fast: bool = False) -> IdentificationSettings:
    """Return the settings of the thesis for a method."""
    setup = FAST if is_fast else SETUP
    segment = None if method == "cov" else setup.segment
    chosen = IdentificationSettings(decimate_to=setup.rate, segment=segment, band=(10.0, 60.0))
    return as_in_thesis(chosen, rows=setup.rows, stable_rate=0.8 if method == "coss" else 0.6)


def identified(
    method: str, runs: list[Recording], *, is_fast: bool = False, harmonics: tuple[Harmonic, ...] | None = None
) -> Identification:
    """Return what a method identifies: Cov-SSI in the first record, the other methods in all."""
    chosen = runs[:1] if method == "cov" else runs
    options = replace(settings(method, is_fast=is_fast), harmonics=harmonics)
    return SUBSPACE_METHODS[method](chosen, settings=options, vehicle=read_vehicle("scale-bogie"))


def experiment(seed: int) -> Real:
    """Return frequency, damping, MAC of the body's modes and number of others, (conditions, methods, 4, modes)."""
    healthy = thesis.theoretical(bogie("normal"), labels=thesis.BODY_MODES)
    results = np.full((len(CONDITIONS), len(SUBSPACE_METHODS), 4, len(healthy)), np.nan)
    for row, condition in enumerate(CONDITIONS):
        truth = thesis.theoretical(bogie(condition), labels=thesis.BODY_MODES)
        runs = records(condition, seed=seed)
        harmonics: tuple[Harmonic, ...] | None = None
        for column, method in enumerate(SUBSPACE_METHODS):
            if condition != "normal" and method != "coss":
                continue
            identification = identified(method, runs, is_fast=True, harmonics=harmonics)
            harmonics = identification.harmonics if method == "acs" else None
            results[row, column] = thesis.matched(identification.modes, truth).rows
    return results


def _theory(truth: Modes) -> Table:
    """Theoretical modes."""
    return thesis.theory_table(
        "Figure 7-7: theoretical modes, from the geometry and table 7-1",
        [label.capitalize() for label in thesis.BODY_MODES],
        (PRINTED["theory"]["frequency"], truth.natural_frequency),
        (PRINTED["theory"]["damping"], 100 * truth.damping_ratio),
        digits=(2, 3, 2, 3),
        remark="The 24.03 Hz given for pitch in the text contradict the parameters of table 7-1.",
    )


def _model_shapes(recording: Recording, truth: Modes) -> Block:
    """Figure 7-7."""
    figure = figures.shapes_figure(truth, recording.channels, source="theory")
    return picture(figure, "Figure 7-7: theoretical rigid modes of the bogie frame.")


def _signals(runs: list[Recording]) -> tuple[Block, ...]:
    """Figure 7-9."""
    run, marked = [("", runs[0])], list(zip(thesis.BODY_MODES, PRINTED["theory"]["frequency"], strict=True))
    level = "raw signals (simulated); the level follows the speed of the rollers"
    density = figures.densities_figure(
        run, title="Power spectral densities", highest=60.0, lowest=5.0, segment=2.0, marked=marked
    )
    return pictures(
        {
            f"Figure 7-9: {level}.": figures.histories_figure(run, title="Accelerations of the frame"),
            "Figure 7-9: power spectral densities (simulated). Dotted: theory.": density,
        }
    )


def _single(identifications: dict[str, Identification], truth: Modes) -> tuple[Block, ...]:
    """Figures 7-10 to 7-13."""
    blocks: list[Block] = []
    for method, first, second in (("cov", "7-10", "7-11"), ("acs", "7-12", "7-13")):
        name = METHOD_NAMES[method]
        captions = {
            "diagram": f"Figure {first}(a): stabilisation diagram of {name}.",
            "rates": f"Figure {first}(b): rate of stable points of {name}.",
            "shapes": f"Figure {second}(a): modes identified by {name}.",
            "mac": f"Figure {second}(b): MAC of {name}.",
        }
        blocks += thesis.mode_pictures(identifications[method], captions, name=name, truth=truth)
    return tuple(blocks)


def _subsets(coss: dict[str, Identification], truths: dict[str, Modes]) -> tuple[Block, ...]:
    """Figures 7-14 to 7-17."""
    captions = {
        "diagram": "Figure 7-14(a): stabilisation diagrams of CoSS-SSI, normal suspension.",
        "rates": "Figure 7-14(b): rates of stable points.",
    }
    blocks: list[Block] = [*thesis.mode_pictures(coss["normal"], captions)]
    for condition, identification in coss.items():
        captions = {
            "shapes": f"Figure {FIGURES[condition]}: modes identified by CoSS-SSI, {condition}.",
            "mac": f"Figure {FIGURES[condition]}: MAC against the healthy theory, {condition}.",
        }
        blocks += thesis.mode_pictures(
            identification,
            captions,
            source=condition,
            parts=thesis.subset_parts(identification),
            truth=truths["normal"],
            title=f"MAC of theory of the healthy bogie (rows) and subsets, {condition}",
        )
    return tuple(blocks)


def _tables(runs: Real, truths: dict[str, Modes]) -> tuple[Block, ...]:
    """Published and identified frequencies."""
    blocks: list[Block] = []
    for row, (condition, truth) in enumerate(truths.items()):
        methods = list(SUBSPACE_METHODS) if condition == "normal" else ["coss"]
        shown = runs[:, row, [list(SUBSPACE_METHODS).index(method) for method in methods]]
        nothing = np.full(len(thesis.BODY_MODES), np.nan)
        printed = [PRINTED["found"].get(method, nothing) if condition == "normal" else nothing for method in methods]
        columns = (
            ("", [f"{METHOD_NAMES[method]}, {label}" for method in methods for label in thesis.BODY_MODES]),
            ("f published [Hz]", thesis.numbers(printed)),
            ("f true [Hz]", thesis.numbers(np.tile(truth.natural_frequency, len(methods)))),
            ("f found in, median (5 to 95 %)", thesis.in_runs(shown[:, :, 0])),
            ("ξ true [%]", thesis.numbers(np.tile(100 * truth.damping_ratio, len(methods)))),
            ("ξ found [%]", thesis.in_runs(100 * shown[:, :, 1])),
            ("MAC against truth", thesis.in_runs(shown[:, :, 2], digits=3)),
        )
        blocks.append(thesis.column_table(f"Modes in {len(runs)} sets of records, {condition}", columns))
    return tuple(blocks)


def _time(seconds: float) -> Table:
    """Run time next to the published one."""
    columns = (
        ("", ["CoSS-SSI of 400 s in four channels, thesis' ladder"]),
        ("published [s]", thesis.numbers([PRINTED["found"]["seconds"]])),
        ("ours, this run [s]", thesis.numbers([seconds])),
        ("ratio", thesis.numbers([PRINTED["found"]["seconds"] / seconds], digits=0)),
    )
    remark = (
        "Published: MATLAB on a desktop computer of the 2010s; ours: all steps on the machine that wrote this page."
    )
    return thesis.column_table("Run time", columns, remark=remark)


def _faults(runs: Real, truths: dict[str, Modes]) -> tuple[Block, ...]:
    """Changes of frequency with the faults, in theory and as identified."""
    found = runs[:, :, list(SUBSPACE_METHODS).index("coss"), 0]
    theory = np.array([truth.natural_frequency for truth in truths.values()])
    columns = (
        ("", [f"{condition}, {label}" for condition in list(CONDITIONS)[1:] for label in thesis.BODY_MODES]),
        ("theory", [f"{shift:+z.2f}" for shift in (theory[1:] - theory[0]).ravel()]),
        ("CoSS-SSI: both found in, median (5 to 95 %)", thesis.in_runs(found[:, 1:] - found[:, :1])),
    )
    table = thesis.column_table("Change of frequency with the fault [Hz]", columns)
    spreads = thesis.spreads(
        thesis.BODY_MODES, tuple(CONDITIONS), found, np.full(len(thesis.BODY_MODES), np.nan), theory
    )
    figure = figures.runs_figure(spreads, title="Frequencies in the three conditions (diamonds: theory)")
    text = (
        "A change of one corner's spring shifts all three frequencies slightly and turns the shapes towards the softer corner; "
        "the frequencies alone do not show which corner it is."
    )
    return (Paragraph(text), table, picture(figure, "Found by CoSS-SSI in all sets."))


def _verdict(runs: Real, truths: dict[str, Modes], seconds: float) -> dict[str, object]:
    """What reproduces and what does not, in numbers."""
    return {
        **{method: thesis.shares(runs[:, 0, n, 0], thesis.BODY_MODES) for n, method in enumerate(SUBSPACE_METHODS)},
        "error": 100 * thesis.worst_error(runs[:, 0, :, 0], truths["normal"].natural_frequency),
        "ours": seconds,
        "published": PRINTED["found"]["seconds"],
    }


CHAPTER = Chapter("chapter_7", example, experiment, contents)
