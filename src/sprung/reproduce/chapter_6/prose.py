"""Tables of the plate and the car, and the text of the page."""

import numpy as np

from sprung._arrays import Real
from sprung.identification import Identification
from sprung.modal import Modes
from sprung.reproduce.chapter_6.numbers import (
    CAR_DURATION,
    CAR_IDENTIFIED,
    CAR_RATE,
    CAR_RUNS,
    CAR_SEGMENT,
    CAR_THEORY,
    CONDITIONS,
    METHODS,
    PLATE_DURATION,
    PLATE_IDENTIFIED,
    PLATE_MAC,
    PLATE_RATE,
    PLATE_TESTS,
    PLATE_THEORY,
    car_truth,
    is_tried,
    plate_truth,
    wheelbase,
)
from sprung.reproduce.thesis import (
    BODY_MODES,
    THRESHOLDS,
    column_table,
    deviations,
    matched,
    number,
    numbers,
    numbers_table,
    of_runs,
    share,
    theoretical,
    theory_table,
    worst_error,
)
from sprung.results.page.page import Paragraph
from sprung.results.tables import Table
from sprung.vehicles import read_vehicle, structure

SETTINGS = (
    f"Plate: {PLATE_TESTS} tests of {PLATE_DURATION:g} s at {PLATE_RATE:g} Hz, hammer blows at random positions and times, sensor noise at SNR 50; 21 segments per test, J = 1, "
    "block rows 12 to 45 at 50 Hz, delta 0.7. Simulated instead of the measured signals.",
    f"Car: {CAR_RUNS} drives of {CAR_DURATION:g} s at 20 to 40 km/h with a stop on a class C road with potholes, nonlinear suspensions (asymmetric dampers, friction, "
    f"progressive springs, bump stops), SNR 50, {CAR_RATE:g} Hz instead of 2000; segments of {CAR_SEGMENT:g} s, J = 3, block rows 12 to 48, delta 0.45 (ACS) and 0.7 (CoSS), modes in 0.5 to 30 Hz. "
    "The fault is a front-right tyre with 30 % less stiffness, for 1.5 instead of 2.2 bar.",
    THRESHOLDS,
    "Command: sprung reproduce 6 --out DIR",
)


def plate_table(truth: Modes, identification: Identification, plates: Real) -> Table:
    """Return table 6-2."""
    match = matched(identification.modes, truth)
    errors = [
        f"{100 * (found / theory - 1):+.2f} %" for found, theory in zip(PLATE_IDENTIFIED, PLATE_THEORY, strict=True)
    ]
    columns = (
        ("", [label.capitalize() for label in BODY_MODES]),
        ("f theory published [Hz]", numbers(PLATE_THEORY)),
        ("f theory ours [Hz]", numbers(truth.natural_frequency, digits=3)),
        ("f found published", numbers(PLATE_IDENTIFIED)),
        ("f found ours", numbers(match.natural_frequency, digits=3)),
        ("error published", errors),
        ("error ours", deviations(match.natural_frequency, truth.natural_frequency)),
        ("f found in, median (5 to 95 %)", [of_runs(values, digits=3) for values in plates[:, 0].T]),
        ("MAC published", numbers(PLATE_MAC, digits=3)),
        ("MAC ours", numbers(match.mac, digits=3)),
    )
    remark = (
        "With the printed 157.5 N/m bounce would be at 3.05 Hz; the published frequencies require 126 N/m, used here."
    )
    return column_table("Table 6-2: errors of the identified modes of the plate", columns, remark=remark)


def car_theory_table() -> Table:
    """Return the numbers of figure 6-19."""
    models = {
        name: theoretical(structure(read_vehicle(name)), labels=BODY_MODES) for name in ("zafira", "zafira-printed")
    }
    return theory_table(
        "Figure 6-19: theoretical modes",
        [f"{name}, {label}" for name in models for label in BODY_MODES],
        (len(models) * CAR_THEORY[0], np.concatenate([modes.natural_frequency for modes in models.values()])),
        (len(models) * CAR_THEORY[1], np.concatenate([100 * modes.damping_ratio for modes in models.values()])),
        digits=(2, 3, 1, 2),
        remark="zafira-printed has the printed springs and dampers, which contradict the printed modes; zafira has springs and dampers that match them.",
    )


def car_table(cars: Real) -> Table:
    """Return how often which mode of the car is found, from (runs, conditions, methods, 3, modes)."""
    rows = [
        _car_row(cars, row, column, k)
        for row, condition in enumerate(CONDITIONS)
        for column, (method, is_default) in enumerate(METHODS.values())
        if is_tried(condition, method, is_default=is_default)
        for k in range(len(BODY_MODES))
    ]
    columns = (
        "",
        "f found published [Hz]",
        "f true [Hz]",
        "f found in, median (5 to 95 %)",
        "ξ true [%]",
        "ξ found [%]",
        "MAC",
    )
    remark = "Published: found in the field by CoSS-SSI, second subset."
    return numbers_table(f"Body modes in {len(cars)} sets of drives", columns, tuple(rows), remark)


def _car_row(cars: Real, row: int, column: int, k: int) -> tuple[str, ...]:
    """Return the cells of one mode with one method in one condition."""
    condition, method = list(CONDITIONS)[row], list(METHODS)[column]
    truth = car_truth(condition)
    frequency, damping, mac = cars[:, row, column, :, k].T
    return (
        f"{condition}, {method}, {BODY_MODES[k]}",
        number(CAR_IDENTIFIED[k] if (row, column) == (0, 1) else np.nan),
        number(truth.natural_frequency[k]),
        of_runs(frequency),
        number(100 * truth.damping_ratio[k], digits=1),
        of_runs(100 * damping, digits=1),
        of_runs(mac),
    )


def null_table(speeds: tuple[int, ...] = (20, 25, 30, 35, 40)) -> Table:
    """Return the frequencies at which the road excites neither bounce nor pitch, by speed in km/h."""
    in_metres = np.array(speeds) / 3.6
    columns = (
        ("speed", [f"{speed} km/h" for speed in speeds]),
        ("bounce [Hz]", numbers(in_metres / (2 * wheelbase()))),
        ("pitch [Hz]", numbers(in_metres / wheelbase())),
    )
    return column_table("Nulls of the input", columns)


def null_paragraph() -> Paragraph:
    """Return why the road excites neither bounce nor pitch at some frequencies."""
    return Paragraph(
        f"The rear wheels follow the road of the front wheels after {wheelbase():.2f} m: both axles together lift the body by |cos(pi f wheelbase / v)| times the height of the road, which is zero at f = v / (2 wheelbase), "
        "and pitch it in proportion to |sin| of the same argument, which is zero at v / wheelbase. At 20 to 40 km/h the null of bounce lies at 1 to 2 Hz, on the mode itself, so that output-only methods find pitch and roll there. "
        "A method that knows wheelbase and speed has no such blind spot."
    )


def verdict(plates: Real, cars: Real) -> str:
    """Return what reproduces and what does not."""

    def shares(row: int, column: int) -> str:
        return ", ".join(
            f"{label} {100 * share(cars[:, row, column, 0, k]):.0f} %" for k, label in enumerate(BODY_MODES)
        )

    of_plate = 100 * np.mean([share(plates[:, 0, k]) for k in range(3)])
    error = 100 * worst_error(plates[:, 0], plate_truth().natural_frequency)
    return (
        f"The plate's modes are found in {of_plate:.0f} % of the sets, with medians within {error:.1f} % of the truth "
        "(published: within 7.3 %, on a real plate); the printed spring of 157.5 N/m contradicts the published frequencies. The car's theoretical modes reproduce within 1.5 % with springs and dampers that match them, "
        "not with the printed ones. On simulated country roads instead of the field test, the thesis' settings find, of bounce, pitch and roll: "
        f"ACS-Cov-SSI {shares(0, 0)} of the sets (published: pitch only), CoSS-SSI {shares(0, 1)} (published: bounce and pitch), sprung's default CoSS-SSI {shares(0, 2)}; with the soft tyre CoSS-SSI {shares(1, 1)}. "
        "As in the field test, all three are hardly ever found together: the input is not white, since the rear wheels follow the road of the front wheels and left and right are partly coherent. "
        "A soft tyre changes the body's modes by less than their spread, so that these modes do not reveal this fault; the published change of shapes rests on one run per condition."
    )
