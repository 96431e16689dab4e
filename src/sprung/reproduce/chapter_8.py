"""Chapter 8: a Y25 bogie on a full-size roller rig, its harmonics removed by cepstrum editing."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.excitation import RollerRig, constant_speed
from sprung.identification import Identification, coss_ssi
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce.chapter import Chapter
from sprung.reproduce.thesis import (
    BODY_MODES,
    THRESHOLDS,
    at_channels,
    cepstrum_picture,
    column_table,
    deviations,
    frequency_spreads,
    in_runs,
    matched,
    mode_pictures,
    numbers,
    published,
    shares,
    simulated,
    theoretical,
    thesis_settings,
)
from sprung.results import figures
from sprung.results.page.page import Block, Section, picture
from sprung.results.tables import Table
from sprung.signals.cepstrum import ShortPass, edit
from sprung.signals.harmonics import Harmonic
from sprung.vehicles import read_vehicle, structure

RATE = 1000.0
DURATION = 60.0
N_RECORDS = 6
SEGMENT = 7.168
#: Length of the lifter [s].
QUEFRENCY = 0.25
#: Rotation of the drum [Hz].
ROTATION = 0.9125
ROWS = (12, 45)
BAND = (5.0, 21.0)
FRAME = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
PRINTED = published("8")


class Example(NamedTuple):
    """One set of records, and what CoSS-SSI identifies in the raw and the edited signals."""

    records: list[Recording]
    raw: Identification
    edited: Identification


def example() -> Example:
    """Return the set of records that the figures show."""
    shown = records(seed=0)
    return Example(shown, identified(shown, is_edited=False), identified(shown, is_edited=True))


def contents(example: Example, results: list[Real]) -> tuple[str, tuple[Section, ...]]:
    """Return the verdict and the sections."""
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
    seeds = [(seed, k) for k in range(N_RECORDS)]
    return simulated(vehicle, rig, seeds, duration=DURATION, sampling_rate=RATE, snr=50.0)


def identified(
    runs: list[Recording], *, is_edited: bool, harmonics: tuple[Harmonic, ...] | None = None
) -> Identification:
    """Return what CoSS-SSI identifies in the frame's accelerations."""
    settings = thesis_settings(
        rows=ROWS,
        stable_rate=0.5,
        segment=SEGMENT,
        n_subsets=2,
        sampling_rate=RATE / 4,
        lifter=ShortPass(QUEFRENCY) if is_edited else None,
        band=BAND,
    )
    return coss_ssi([run.select(FRAME) for run in runs], settings=replace(settings, harmonics=harmonics))


def experiment(seed: int) -> Real:
    """Return frequency, damping, MAC and number of others, raw and edited, (2, 4, modes)."""
    truth, runs = _truth(), records(seed=seed)
    results = np.empty((2, 4, len(truth)))
    harmonics: tuple[Harmonic, ...] | None = None
    for row, is_edited in enumerate((False, True)):
        identification = identified(runs, is_edited=is_edited, harmonics=harmonics)
        harmonics = identification.harmonics
        results[row] = matched(identification.modes, truth).rows
    return results


def _truth() -> Modes:
    """Return the rigid-body modes of the frame at its four sensors."""
    return at_channels(theoretical(structure(read_vehicle("y25")), labels=BODY_MODES), FRAME)


def _theory(truth: Modes) -> Table:
    """Theoretical modes."""
    printed = [PRINTED["theory"][label] for label in truth.labels]
    columns = (
        ("", [str(label).capitalize() for label in truth.labels]),
        ("f published [Hz]", numbers(printed)),
        ("f ours [Hz]", numbers(truth.natural_frequency)),
        ("deviation", deviations(truth.natural_frequency, printed)),
        ("ξ ours [%]", numbers(100 * truth.damping_ratio, digits=1)),
    )
    remark = (
        "Geometry, vertical damping and the number of springs at an axle box are not printed: with a wheelbase of 1.8 m, springs 2.0 m apart and "
        "two nests at each box the order is bounce, roll, pitch, with bounce and pitch near the published values and roll below."
    )
    return column_table("Figure 8-3: rigid modes of the frame", columns, remark=remark)


def _model_shapes(recording: Recording, truth: Modes) -> Block:
    """Figure 8-3."""
    figure = figures.shapes_figure(truth, recording.select(FRAME).channels, source="theory")
    return picture(figure, "Figure 8-3: rigid modes of the bogie frame.")


def _signals(run: Recording) -> tuple[Block, ...]:
    """Figures 8-8 to 8-11."""
    front = run.select(("acc_fl", "acc_rl", "acc_al"))
    edited = edit(front, ShortPass(QUEFRENCY))
    curves = [("raw", front), ("edited", edited)]
    caption = "Figure 8-10(a): cepstrum, lifter and edited cepstrum."
    title = "Real cepstrum, frame front left"
    cepstra = cepstrum_picture(front, QUEFRENCY, caption, title=title, pulse_period=1 / (4 * ROTATION))
    return (
        picture(
            figures.histories_figure(curves[:1], title="Frame front and rear, axle box", window=5.0),
            "Figure 8-8: signals over time (simulated).",
        ),
        picture(
            figures.densities_figure(curves[:1], title="Raw", highest=21.0, segment=20.0),
            "Figure 8-9: spectra (simulated): multiples of 3.65 Hz from the joints, of 0.91 Hz from the drum.",
        ),
        cepstra,
        picture(
            figures.histories_figure(curves, title="Raw and edited", window=5.0),
            "Figure 8-10(b): raw and edited signals.",
        ),
        picture(
            figures.densities_figure(curves, title="Raw and edited", highest=21.0, segment=20.0),
            "Figure 8-11: spectra of raw and edited signals.",
        ),
    )


def _diagrams(raw: Identification, edited: Identification) -> tuple[Block, ...]:
    """Figures 8-12 to 8-15."""
    captions = {
        "diagram": "Figure 8-13: stabilisation diagrams of the edited signals.",
        "rates": "Figure 8-14: rates of stable points, edited.",
        "shapes": "Figure 8-15: modes identified by CoSS-SSI, edited.",
    }
    first = {"diagram": "Figure 8-12: stabilisation diagrams of the raw signals."}
    return (*mode_pictures(raw, first, source="raw"), *mode_pictures(edited, captions, source="edited"))


def _tables(edited: Identification, runs: Real, truth: Modes) -> tuple[Block, ...]:
    """Published and identified modes."""
    names = [str(label) for label in truth.labels]
    columns = (
        ("", [name.capitalize() for name in names]),
        ("f published [Hz]", numbers([PRINTED["found"][name] for name in names])),
        ("f true here [Hz]", numbers(truth.natural_frequency)),
        ("f ours [Hz]", numbers(matched(edited.modes, truth).natural_frequency)),
        ("f raw: found in, median (5 to 95 %)", in_runs(runs[:, 0, 0])),
        ("f edited", in_runs(runs[:, 1, 0])),
        ("ξ edited [%]", in_runs(100 * runs[:, 1, 1], digits=1)),
    )
    spreads = frequency_spreads(names, ("raw", "edited"), runs[:, :, 0], truth.natural_frequency)
    others = runs[:, :, 3, 0].mean(axis=0)
    remark = f"Other modes per set: {others[0]:.2f} raw, {others[1]:.2f} edited. Published values are of the real bogie, true ones of the model."
    return (
        column_table("Modes of the frame", columns, remark=remark),
        picture(
            figures.runs_figure(spreads, title="Frequencies in all sets"), f"Spread over {len(runs)} sets of records."
        ),
    )


def _verdict(runs: Real, truth: Modes) -> str:
    """Return what reproduces and what does not."""
    found = [shares(runs[:, row, 0], truth.labels) for row in range(2)]
    return (
        f"The printed data of the Y25 do not determine its geometry: the model gives {', '.join(f'{label} {f:.2f} Hz' for label, f in zip(truth.labels, truth.natural_frequency, strict=True))} "
        "where 11.42 (bounce), 13.59 (roll) and 14.77 Hz (pitch) are published. The measured signals are not available. On the simulated rig the harmonics of "
        f"joints and drum dominate as in the thesis. Found in the raw signals: {found[0]} of the sets (published: none); after cepstrum editing: {found[1]} "
        "(published: three modes at 11.06, 15.0 and 18.3 Hz). That editing removes the harmonics and reveals modes holds. Bounce, damped by the load's "
        f"damper ({100 * truth.damping_ratio[0]:.0f} %) and {truth.natural_frequency[1] - truth.natural_frequency[0]:.1f} Hz below roll, is hard to separate from it here. "
        f"The published frequencies lie within {100 * max(abs(f / (n * 4 * ROTATION) - 1) for n, f in zip((3, 4, 5), (11.06, 15.0, 18.3), strict=True)):.0f} % "
        "of three, four and five times the 3.65 Hz of the joints, where a residue of the harmonics would lie too."
    )


CHAPTER = Chapter(
    title="Chapter 8: Y25 bogie on a full-size roller rig",
    example=example,
    experiment=experiment,
    contents=contents,
    settings=(
        f"Simulated instead of the rig: {N_RECORDS} records of {DURATION:g} s at {RATE:g} Hz, the front wheelset on a drum that turns "
        f"{60 * ROTATION:.0f} times a minute with four joints; the rear wheelset stands on fixed ground. Segments of 7168 samples, J = 2.",
        THRESHOLDS
        + f" Block rows {ROWS[0]} to {ROWS[1]} (the thesis does not say), delta 0.5, modes of {BAND[0]:g} to {BAND[1]:g} Hz.",
        f"Short-pass lifter of {QUEFRENCY:g} s. Geometry of the bogie: see the vehicle file y25.",
        "Command: sprung reproduce 8 --out DIR",
    ),
)
