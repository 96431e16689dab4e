"""Chapter 8: a Y25 bogie on a full-size roller rig, its harmonics removed by cepstrum editing."""

from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.excitation import RollerRig, constant_speed
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
from sprung.vehicles import read_vehicle, structure

SETUP = set_up("chapter_8")
#: Rotation of the drum [Hz].
ROTATION = 0.9125
FRAME = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
PRINTED = thesis.published("8")


class Example(NamedTuple):
    """One set of records, and what CoSS-SSI identifies in the raw and the edited signals."""

    records: list[Recording]
    raw: Identification
    edited: Identification


def example() -> Example:
    """Return the set of records that the figures show."""
    shown = records(seed=0)
    return Example(shown, identified(shown, is_edited=False), identified(shown, is_edited=True))


def contents(example: Example, results: list[Real]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict, and the sections."""
    truth, runs = _truth(), np.array(results)
    return _verdict(runs, truth), (
        Section("The model", (_theory(truth), _model_shapes(example.records[0], truth))),
        Section("Sensor signals", _signals(example.records[0])),
        Section("Raw and edited", _diagrams(example.raw, example.edited)),
        Section("Modal parameters", _tables(example.edited, runs, truth)),
    )


def records(*, seed: int) -> list[Recording]:
    """Return one set of records of the whole rig."""
    vehicle = structure(read_vehicle("y25"))
    rig = RollerRig(
        (True, False),
        constant_speed(ROTATION),
        random=5e-6,
        joints=4,
        joint=5e-4,
        harmonics=(2e-5, 1e-5, 1e-5, 5e-6, 5e-6, 3e-6, 3e-6, 3e-6),
    )
    return thesis.simulated(vehicle, rig, SETUP, (seed,), snr=50.0)


def identified(
    runs: list[Recording], *, is_edited: bool, harmonics: tuple[Harmonic, ...] | None = None
) -> Identification:
    """Return what CoSS-SSI identifies in the frame's accelerations."""
    settings = IdentificationSettings(
        decimate_to=SETUP.rate / 4,
        segment=SETUP.segment,
        n_subsets=2,
        lifter=ShortPass(SETUP.quefrency) if is_edited else None,
        band=(5.0, 21.0),
        harmonics=harmonics,
    )
    settings = as_in_thesis(settings, rows=SETUP.rows, stable_rate=0.5)
    return coss_ssi([run.select(FRAME) for run in runs], settings=settings)


def experiment(seed: int) -> Real:
    """Return frequency, damping, MAC and number of others, raw and edited, (2, 4, modes)."""
    truth, runs = _truth(), records(seed=seed)
    results = np.empty((2, 4, len(truth)))
    harmonics: tuple[Harmonic, ...] | None = None
    for row, is_edited in enumerate((False, True)):
        identification = identified(runs, is_edited=is_edited, harmonics=harmonics)
        harmonics = identification.harmonics
        results[row] = thesis.matched(identification.modes, truth).rows
    return results


def _truth() -> Modes:
    """Return the rigid-body modes of the frame at its four sensors."""
    return thesis.at_channels(thesis.theoretical(structure(read_vehicle("y25")), labels=thesis.BODY_MODES), FRAME)


def _theory(truth: Modes) -> Table:
    """Theoretical modes."""
    printed = [PRINTED["theory"][label] for label in truth.labels]
    columns = (
        ("", [str(label).capitalize() for label in truth.labels]),
        ("f published [Hz]", thesis.numbers(printed)),
        ("f ours [Hz]", thesis.numbers(truth.natural_frequency)),
        ("deviation", thesis.deviations(truth.natural_frequency, printed)),
        ("ξ ours [%]", thesis.numbers(100 * truth.damping_ratio, digits=1)),
    )
    remark = (
        "Geometry, vertical damping and the number of springs at an axle box are not printed: with a wheelbase of 1.8 m, springs 2.0 m apart and "
        "two nests at each box the order is bounce, roll, pitch, with bounce and pitch near the published values and roll below."
    )
    return thesis.column_table("Figure 8-3: rigid modes of the frame", columns, remark=remark)


def _model_shapes(recording: Recording, truth: Modes) -> Block:
    """Figure 8-3."""
    figure = figures.shapes_figure(truth, recording.select(FRAME).channels, source="theory")
    return picture(figure, "Figure 8-3: rigid modes of the bogie frame.")


def _signals(run: Recording) -> tuple[Block, ...]:
    """Figures 8-8 to 8-11."""
    front = run.select(("acc_fl", "acc_rl", "acc_al"))
    edited = edit(front, ShortPass(SETUP.quefrency))
    curves = [("raw", front), ("edited", edited)]
    caption = "Figure 8-10(a): cepstrum, lifter and edited cepstrum."
    title = "Real cepstrum, frame front left"
    cepstra = thesis.cepstrum_picture(front, SETUP.quefrency, caption, title=title, pulse_period=1 / (4 * ROTATION))
    title, raw = "Raw and edited", curves[:1]
    densities = (
        figures.densities_figure(own, title=what, highest=21.0, segment=20.0)
        for own, what in ((raw, "Raw"), (curves, title))
    )
    before, after = densities
    joints = "multiples of 3.65 Hz from the joints, of 0.91 Hz from the drum"
    first = {
        "Figure 8-8: signals over time (simulated).": figures.histories_figure(
            raw, title="Frame front and rear, axle box", window=5.0
        ),
        f"Figure 8-9: spectra (simulated): {joints}.": before,
    }
    last = {
        "Figure 8-10(b): raw and edited signals.": figures.histories_figure(curves, title=title, window=5.0),
        "Figure 8-11: spectra of raw and edited signals.": after,
    }
    return (*pictures(first), cepstra, *pictures(last))


def _diagrams(raw: Identification, edited: Identification) -> tuple[Block, ...]:
    """Figures 8-12 to 8-15."""
    captions = {
        "diagram": "Figure 8-13: stabilisation diagrams of the edited signals.",
        "rates": "Figure 8-14: rates of stable points, edited.",
        "shapes": "Figure 8-15: modes identified by CoSS-SSI, edited.",
    }
    first = {"diagram": "Figure 8-12: stabilisation diagrams of the raw signals."}
    return (*thesis.mode_pictures(raw, first, source="raw"), *thesis.mode_pictures(edited, captions, source="edited"))


def _tables(edited: Identification, runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Published and identified modes."""
    names = [str(label) for label in truth.labels]
    columns = (
        ("", [name.capitalize() for name in names]),
        ("f published [Hz]", thesis.numbers([PRINTED["found"][name] for name in names])),
        ("f true here [Hz]", thesis.numbers(truth.natural_frequency)),
        ("f ours [Hz]", thesis.numbers(thesis.matched(edited.modes, truth).natural_frequency)),
        ("f raw: found in, median (5 to 95 %)", thesis.in_runs(runs[:, 0, 0])),
        ("f edited", thesis.in_runs(runs[:, 1, 0])),
        ("ξ edited [%]", thesis.in_runs(100 * runs[:, 1, 1], digits=1)),
    )
    spreads = thesis.spreads(names, ("raw", "edited"), runs[:, :, 0], truth.natural_frequency)
    others = runs[:, :, 3, 0].mean(axis=0)
    remark = f"Other modes per set: {others[0]:.2f} raw, {others[1]:.2f} edited. Published values are of the real bogie, true ones of the model."
    return (
        thesis.column_table("Modes of the frame", columns, remark=remark),
        picture(
            figures.runs_figure(spreads, title="Frequencies in all sets"), f"Spread over {len(runs)} sets of records."
        ),
    )


def _verdict(runs: Real, truth: Modes) -> dict[str, object]:
    """What reproduces and what does not, in numbers."""
    raw, edited = (thesis.shares(runs[:, row, 0], truth.labels) for row in range(2))
    modes = zip(truth.labels, truth.natural_frequency, strict=True)
    multiples = 4 * ROTATION * np.array([3, 4, 5])
    return {
        "raw": raw,
        "edited": edited,
        "model": ", ".join(f"{label} {frequency:.2f} Hz" for label, frequency in modes),
        "damping": 100 * truth.damping_ratio[0],
        "apart": truth.natural_frequency[1] - truth.natural_frequency[0],
        "near": 100 * np.abs(np.array([11.06, 15.0, 18.3]) / multiples - 1).max(),
    }


CHAPTER = Chapter("chapter_8", example, experiment, contents)
