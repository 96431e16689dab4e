"""Chapter 6: a plate on four springs, and a car on a country road."""

from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.excitation import HammerBlows
from sprung.identification import Identification, IdentificationSettings, acs_ssi, as_in_thesis, coss_ssi
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce import thesis
from sprung.reproduce.chapter import Chapter, data, set_up
from sprung.results import figures
from sprung.results.page.page import Block, Paragraph, Picture, Section, picture, pictures
from sprung.results.tables import Table
from sprung.simulation import FEW_POTHOLES, REALISTIC_SUSPENSION, RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import Vehicle, frequency_response, parse_fault, read_vehicle, structure, with_faults

PLATE = set_up("chapter_6", "plate")
CAR = set_up("chapter_6", "car")
CAR_SPEEDS = (20 / 3.6, 40 / 3.6)
CONDITIONS = {"normal": "", "front-right tyre -30 %": "front_right.tyre=-0.3"}
#: Methods and whether their settings are the default ones, in the order of the results of `experiment`.
METHODS = {"ACS, thesis": ("acs", False), "CoSS, thesis": ("coss", False), "CoSS, default": ("coss", True)}
#: What is run: with the soft tyre only CoSS with the settings of the thesis.
TRIED = ((0, 0), (0, 1), (0, 2), (1, 1))
PRINTED = thesis.published("6")


class Example(NamedTuple):
    """One set of records of plate and car by condition, and what is identified in them."""

    plate_records: list[Recording]
    plate: Identification
    drives: dict[str, list[Recording]]
    acs: Identification
    coss: dict[str, Identification]


def example() -> Example:
    """Return the set of records that the figures show."""
    plate = plate_records(seed=0)
    drives = {condition: car_records(condition, seed=0) for condition in CONDITIONS}
    coss = {condition: identified_car(runs, "coss") for condition, runs in drives.items()}
    return Example(plate, identified_plate(plate), drives, identified_car(drives["normal"], "acs"), coss)


def contents(example: Example, results: list[tuple[Real, Real]]) -> tuple[dict[str, object], tuple[Section, ...]]:
    """Return the values of the verdict, and the sections."""
    plates, cars = (np.array(part) for part in zip(*results, strict=True))
    plate, healthy = plate_truth(), car_truth("normal")
    plate_blocks: tuple[Block, ...] = (
        *plate_pictures(plate, example.plate_records, example.plate),
        plate_table(plate, example.plate, plates),
        plate_spread(plate, plates),
    )
    theory: tuple[Block, ...] = (car_responses(), car_theory_table(), *car_theory_shapes())
    nulls: tuple[Block, ...] = (null_paragraph(), null_table(), bounce_input())
    return verdict(plates, cars), (
        Section("Plate on four springs", plate_blocks),
        Section("The car in theory", theory),
        Section("The drive", drive_pictures(example.drives["normal"])),
        Section("ACS-Cov-SSI, normal", acs_pictures(example.acs, healthy)),
        Section("CoSS-SSI, normal and with a soft tyre", coss_pictures(example.coss, healthy)),
        Section("What is found how often", (car_table(cars),)),
        Section("Why bounce is hard to find on a road", nulls),
    )


def plate_records(*, seed: int) -> list[Recording]:
    """Return the tests of the plate under hammer blows."""
    return thesis.simulated(structure(read_vehicle("plate")), HammerBlows(), PLATE, (seed, 0), snr=50.0)


def identified_plate(runs: list[Recording]) -> Identification:
    """Return the modes of the plate by CoSS-SSI with J = 1."""
    settings = IdentificationSettings(decimate_to=50.0, segment=PLATE.segment, n_subsets=1, band=(1.0, 20.0))
    settings = as_in_thesis(settings, rows=PLATE.rows, stable_rate=0.7)
    return coss_ssi(runs, settings=settings, vehicle=read_vehicle("plate"))


def car_records(condition: str, *, seed: int) -> list[Recording]:
    """Return the drives of the car."""
    text = CONDITIONS[condition]
    settings = RoadDrive(
        duration=CAR.duration,
        sampling_rate=CAR.rate,
        speed=CAR_SPEEDS,
        n_stops=1,
        faults=(parse_fault(text),) if text else (),
        road=RoadConditions(potholes=FEW_POTHOLES),
        suspension=REALISTIC_SUSPENSION,
        snr=50.0,
    )
    row = list(CONDITIONS).index(condition)
    return [simulate_drive(car(), settings, seed=[seed, row, k]).recording for k in range(CAR.n_records)]


def identified_car(runs: list[Recording], method: str, *, is_default: bool = False) -> Identification:
    """Return what a method identifies in the drives."""
    settings = IdentificationSettings(decimate_to=CAR.rate / 2, segment=CAR.segment, band=(0.5, 30.0))
    settings = as_in_thesis(settings, rows=CAR.rows, stable_rate=0.45 if method == "acs" else 0.7)
    function = acs_ssi if method == "acs" else coss_ssi
    return function(runs, settings=None if is_default else settings, vehicle=car())


def experiment(seed: int) -> tuple[Real, Real]:
    """Return frequency, damping and MAC of the plate, (3, modes), and the car, (conditions, methods, 3, modes)."""
    plate = thesis.matched(identified_plate(plate_records(seed=seed)).modes, plate_truth()).rows[:3]
    cars = np.full((len(CONDITIONS), len(METHODS), 3, len(thesis.BODY_MODES)), np.nan)
    for row, condition in enumerate(CONDITIONS):
        runs, truth = car_records(condition, seed=seed), car_truth(condition)
        for column, (method, is_default) in enumerate(METHODS.values()):
            if (row, column) in TRIED:
                modes = identified_car(runs, method, is_default=is_default).modes
                cars[row, column] = thesis.matched(modes, truth, reach=0.2).rows[:3]
    return plate, cars


def car() -> Vehicle:
    """Return the car whose parameters fit the published modes."""
    vehicle = read_vehicle("zafira")
    assert isinstance(vehicle, Vehicle)
    return vehicle


def plate_truth() -> Modes:
    """Return the modes of the plate."""
    return thesis.theoretical(structure(read_vehicle("plate")), labels=thesis.BODY_MODES)


def car_truth(condition: str) -> Modes:
    """Return the body modes of the car in a condition."""
    text = CONDITIONS[condition]
    return thesis.theoretical(
        with_faults(structure(car()), [parse_fault(text)] if text else []), labels=thesis.BODY_MODES
    )


def wheelbase() -> float:
    """Return the distance between the first and the last axle of the car [m]."""
    axles = car().axle
    return axles[0].x - axles[-1].x


def plate_pictures(truth: Modes, runs: list[Recording], identification: Identification) -> tuple[Picture, ...]:
    """Figures 6-7 to 6-15."""
    marked = list(zip(thesis.BODY_MODES, truth.natural_frequency, strict=True))
    captions = {
        "diagram": "Figure 6-13: stabilisation diagram of CoSS-SSI.",
        "rates": "Figure 6-14: modes selected by the rate of stable points.",
    }
    shapes = {"shapes": "Figure 6-15: modes identified by CoSS-SSI."}
    run = [("", runs[0])]
    drawn = {
        "Figure 6-7: theoretical modes of the plate.": figures.shapes_figure(truth, runs[0].channels, source="theory"),
        "Figure 6-11: responses (simulated), first thirty seconds.": figures.histories_figure(
            run, title="Plate under hammer blows", window=30.0
        ),
        "Figure 6-12: power spectral densities (simulated). Dotted: theory.": figures.densities_figure(
            run, title="Plate", highest=10.0, segment=20.0, marked=marked
        ),
    }
    named = thesis.mode_pictures(identification, shapes, name="CoSS-SSI")
    return (*pictures(drawn), *thesis.mode_pictures(identification, captions), *named)


def plate_spread(truth: Modes, plates: Real) -> Picture:
    """Frequencies of the plate in all sets."""
    found = PRINTED["plate"]["frequency"][None]
    spreads = thesis.spreads(thesis.BODY_MODES, ("CoSS-SSI",), plates[:, None, 0], truth.natural_frequency, found)
    figure = figures.runs_figure(spreads, title="Plate: frequencies in all sets")
    return picture(figure, f"Spread over {len(plates)} sets.")


def car_responses() -> Picture:
    """Return figure 6-18."""
    model, f = structure(car()), np.linspace(0.2, 20, 500)
    response = frequency_response(model, f)
    curves = [
        (channel.removeprefix("acc_").upper(), response[:, row, row]) for row, channel in enumerate(model.outputs.names)
    ]
    return picture(
        figures.response_figure(f, curves, title="Acceleration of each corner over the road below it", unit="m/s² / m"),
        "Figure 6-18: frequency responses of the 7-degree-of-freedom model (parameters of zafira).",
    )


def car_theory_shapes() -> tuple[Picture, ...]:
    """Return the shapes of figures 6-19 and 6-20."""
    model = structure(car())
    healthy = thesis.theoretical(model, labels=thesis.BODY_MODES)
    faulty = thesis.theoretical(with_faults(model, [parse_fault("front_left.spring=-0.5")]), labels=thesis.BODY_MODES)
    shown = [(healthy, "healthy"), (faulty, "front-left spring -50 %")]
    before, after = (figures.shapes_figure(modes, model.outputs.channels, source=source) for modes, source in shown)
    fall = "front-left spring halved: all frequencies fall and the shapes turn"
    return pictures(
        {
            "Figure 6-19: theoretical modes, healthy suspensions.": before,
            f"Figure 6-20: theoretical modes, {fall}.": after,
        }
    )


def drive_pictures(runs: list[Recording]) -> tuple[Picture, ...]:
    """Figures 6-22 and 6-23."""
    corners = [("", runs[0].select(("acc_fl", "acc_fr", "acc_rl", "acc_rr")))]
    title = "A drive: corners of the body, and the speed"
    density = figures.densities_figure(corners, title="Corners of the body", highest=20.0, segment=10.0)
    return pictures(
        {
            "Figure 6-22: a drive (simulated).": figures.histories_figure([("", runs[0])], title=title),
            "Figure 6-23: power spectral densities (simulated).": density,
        }
    )


def acs_pictures(acs: Identification, truth: Modes) -> tuple[Picture, ...]:
    """Return figures 6-24 and 6-25."""
    captions = {
        "diagram": "Figure 6-24: stabilisation diagram of ACS-Cov-SSI.",
        "rates": "Figure 6-24: rate of stable points of ACS-Cov-SSI.",
        "shapes": "Figure 6-25: modes identified by ACS-Cov-SSI.",
        "mac": "Figure 6-25: MAC.",
    }
    return thesis.mode_pictures(acs, captions, name="ACS-Cov-SSI", truth=truth)


def coss_pictures(coss: dict[str, Identification], truth: Modes) -> tuple[Picture, ...]:
    """Return figures 6-26 to 6-29."""
    pictures: list[Picture] = []
    for (condition, identification), first in zip(coss.items(), (26, 28), strict=True):
        captions = {
            "diagram": f"Figure 6-{first}: stabilisation diagrams of CoSS-SSI, {condition}.",
            "rates": f"Figure 6-{first}: rates of stable points, {condition}.",
            "shapes": f"Figure 6-{first + 1}: modes identified by CoSS-SSI, {condition}.",
            "mac": f"Figure 6-{first + 1}: MAC, {condition}.",
        }
        parts, title = thesis.subset_parts(identification), f"MAC of healthy theory (rows) and subsets, {condition}"
        pictures += thesis.mode_pictures(
            identification, captions, source=condition, parts=parts, truth=truth, title=title
        )
    return tuple(pictures)


def bounce_input(speeds: tuple[int, ...] = (20, 30, 40)) -> Picture:
    """Return the input of bounce by a road under both axles, at speeds in km/h."""
    f = np.linspace(0.2, 5, 600)
    curves = []
    for speed in speeds:
        delay = wheelbase() / (speed / 3.6)
        gain = np.abs(1 + np.exp(-2j * np.pi * f * delay)) / 2
        curves.append((f"bounce input at {speed} km/h", gain + 1e-4 + 0j))
    marked = [("bounce mode", float(car_truth("normal").natural_frequency[0]))]
    title = "Share of the road's height that reaches bounce"
    return picture(
        figures.response_figure(f, curves, title=title, unit="-", marked=marked),
        "Input of bounce by a road under both axles.",
    )


def plate_table(truth: Modes, identification: Identification, plates: Real) -> Table:
    """Return table 6-2."""
    match = thesis.matched(identification.modes, truth)
    printed = PRINTED["plate"]
    columns = (
        ("", [label.capitalize() for label in thesis.BODY_MODES]),
        ("f theory published [Hz]", thesis.numbers(printed["theory"])),
        ("f theory ours [Hz]", thesis.numbers(truth.natural_frequency, digits=3)),
        ("f found published", thesis.numbers(printed["frequency"])),
        ("f found ours", thesis.numbers(match.natural_frequency, digits=3)),
        ("error published", thesis.deviations(printed["frequency"], printed["theory"])),
        ("error ours", thesis.deviations(match.natural_frequency, truth.natural_frequency)),
        ("f found in, median (5 to 95 %)", thesis.in_runs(plates[:, 0], digits=3)),
        ("MAC published", thesis.numbers(printed["mac"], digits=3)),
        ("MAC ours", thesis.numbers(match.mac, digits=3)),
    )
    remark = (
        "With the printed 157.5 N/m bounce would be at 3.05 Hz; the published frequencies require 126 N/m, used here."
    )
    return thesis.column_table("Table 6-2: errors of the identified modes of the plate", columns, remark=remark)


def car_theory_table() -> Table:
    """Return the numbers of figure 6-19."""
    models = {
        name: thesis.theoretical(structure(read_vehicle(name)), labels=thesis.BODY_MODES)
        for name in ("zafira", "zafira-printed")
    }
    return thesis.theory_table(
        "Figure 6-19: theoretical modes",
        [f"{name}, {label}" for name in models for label in thesis.BODY_MODES],
        (
            np.tile(PRINTED["theory"]["frequency"], 2),
            np.concatenate([modes.natural_frequency for modes in models.values()]),
        ),
        (
            np.tile(PRINTED["theory"]["damping"], 2),
            np.concatenate([100 * modes.damping_ratio for modes in models.values()]),
        ),
        digits=(2, 3, 1, 2),
        remark="zafira-printed has the printed springs and dampers, which contradict the printed modes; zafira has springs and dampers that match them.",
    )


def car_table(cars: Real) -> Table:
    """Return how often which mode of the car is found, from (runs, conditions, methods, 3, modes)."""
    truths = [car_truth(condition) for condition in CONDITIONS]
    shown = cars[:, [row for row, _ in TRIED], [column for _, column in TRIED]]
    names = [
        f"{list(CONDITIONS)[row]}, {list(METHODS)[column]}, {label}"
        for row, column in TRIED
        for label in thesis.BODY_MODES
    ]
    printed = [PRINTED["found"]["frequency"] if place == (0, 1) else np.full(3, np.nan) for place in TRIED]
    columns = (
        ("", names),
        ("f found published [Hz]", thesis.numbers(printed)),
        ("f true [Hz]", thesis.numbers([truths[row].natural_frequency for row, _ in TRIED])),
        ("f found in, median (5 to 95 %)", thesis.in_runs(shown[:, :, 0])),
        ("ξ true [%]", thesis.numbers([100 * truths[row].damping_ratio for row, _ in TRIED], digits=1)),
        ("ξ found [%]", thesis.in_runs(100 * shown[:, :, 1], digits=1)),
        ("MAC", thesis.in_runs(shown[:, :, 2])),
    )
    remark = "Published: found in the field by CoSS-SSI, second subset."
    return thesis.column_table(f"Body modes in {len(cars)} sets of drives", columns, remark=remark)


def null_table(speeds: tuple[int, ...] = (20, 25, 30, 35, 40)) -> Table:
    """Return the frequencies at which the road excites neither bounce nor pitch, by speed in km/h."""
    in_metres = np.array(speeds) / 3.6
    columns = (
        ("speed", [f"{speed} km/h" for speed in speeds]),
        ("bounce [Hz]", thesis.numbers(in_metres / (2 * wheelbase()))),
        ("pitch [Hz]", thesis.numbers(in_metres / wheelbase())),
    )
    return thesis.column_table("Nulls of the input", columns)


def null_paragraph() -> Paragraph:
    """Why output-only methods find pitch and roll, but hardly bounce."""
    return Paragraph(data("chapters")["chapter_6"]["nulls"].format(wheelbase=wheelbase()))


def verdict(plates: Real, cars: Real) -> dict[str, object]:
    """What reproduces and what does not, in numbers."""
    found = (thesis.shares(cars[:, row, column, 0], thesis.BODY_MODES) for row, column in TRIED)
    return {
        **dict(zip(("acs", "coss", "default", "tyre"), found, strict=True)),
        "plate": 100 * np.mean([thesis.share(plates[:, 0, k]) for k in range(3)]),
        "error": 100 * thesis.worst_error(plates[:, 0], plate_truth().natural_frequency),
    }


CHAPTER = Chapter("chapter_6", example, experiment, contents)
