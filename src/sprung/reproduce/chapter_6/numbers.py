"""Records of the plate and the car, and what the methods identify in them."""

from typing import NamedTuple

import numpy as np

from sprung._arrays import Real
from sprung.excitation import HammerBlows
from sprung.identification import Identification, acs_ssi, coss_ssi
from sprung.modal import Modes
from sprung.recording import Recording
from sprung.reproduce.thesis import BODY_MODES, matched, theoretical, thesis_settings
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_SUSPENSION,
    RoadConditions,
    RoadDrive,
    simulate,
    simulate_drive,
)
from sprung.vehicles import Vehicle, parse_fault, read_vehicle, structure, with_faults

PLATE_RATE, PLATE_DURATION, PLATE_TESTS, PLATE_SEGMENT = 1000.0, 180.0, 4, 180.0 / 21
#: Published frequencies of the plate [Hz] in theory and as identified, and the MAC between both.
PLATE_THEORY, PLATE_IDENTIFIED, PLATE_MAC = (2.73, 3.81, 4.53), (2.67, 3.73, 4.20), (0.999, 0.998, 0.976)
#: Published theoretical frequencies [Hz] and damping [%] of the car.
CAR_THEORY = ((1.53, 1.77, 2.17), (16.3, 20.5, 23.8))
#: Rate of the recordings: a tenth of the thesis' 2000 Hz.
CAR_RATE, CAR_DURATION, CAR_RUNS, CAR_SEGMENT, CAR_SPEEDS = 200.0, 200.0, 3, 40.0, (20 / 3.6, 40 / 3.6)
CONDITIONS = {"normal": "", "front-right tyre -30 %": "front_right.tyre=-0.3"}
#: Frequencies [Hz] that the thesis identified in the field; roll was not found.
CAR_IDENTIFIED = (1.62, 2.18, np.nan)
#: Methods and whether their settings are the default ones, in the order of the results of `experiment`.
METHODS = {"ACS, thesis": ("acs", False), "CoSS, thesis": ("coss", False), "CoSS, default": ("coss", True)}


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


def plate_records(*, seed: int) -> list[Recording]:
    """Return the tests of the plate."""
    plate = structure(read_vehicle("plate"))
    generators = [np.random.default_rng([seed, 0, k]) for k in range(PLATE_TESTS)]
    return [
        simulate(plate, HammerBlows(), duration=PLATE_DURATION, sampling_rate=PLATE_RATE, snr=50.0, seed=generator)
        for generator in generators
    ]


def identified_plate(runs: list[Recording]) -> Identification:
    """Return what CoSS-SSI with one subset identifies."""
    settings = thesis_settings(
        rows=(12, 45), stable_rate=0.7, segment=PLATE_SEGMENT, n_subsets=1, sampling_rate=50.0, band=(1.0, 20.0)
    )
    return coss_ssi(runs, settings=settings, vehicle=read_vehicle("plate"))


def car_records(condition: str, *, seed: int) -> list[Recording]:
    """Return the drives of the car."""
    text = CONDITIONS[condition]
    settings = RoadDrive(
        duration=CAR_DURATION,
        sampling_rate=CAR_RATE,
        speed=CAR_SPEEDS,
        n_stops=1,
        faults=(parse_fault(text),) if text else (),
        road=RoadConditions(potholes=FEW_POTHOLES),
        suspension=REALISTIC_SUSPENSION,
        snr=50.0,
    )
    row = list(CONDITIONS).index(condition)
    return [simulate_drive(car(), settings, seed=[seed, row, k]).recording for k in range(CAR_RUNS)]


def identified_car(runs: list[Recording], method: str, *, is_default: bool = False) -> Identification:
    """Return what a method identifies in the drives."""
    settings = thesis_settings(
        rows=(12, 48),
        stable_rate=0.45 if method == "acs" else 0.7,
        segment=CAR_SEGMENT,
        sampling_rate=CAR_RATE / 2,
        band=(0.5, 30.0),
    )
    function = acs_ssi if method == "acs" else coss_ssi
    return function(runs, settings=None if is_default else settings, vehicle=car())


def experiment(seed: int) -> tuple[Real, Real]:
    """Return frequency, damping and MAC of the plate, (3, modes), and the car, (conditions, methods, 3, modes)."""
    match = matched(identified_plate(plate_records(seed=seed)).modes, plate_truth())
    plate = np.array([match.natural_frequency, match.damping_ratio, match.mac])
    cars = np.full((len(CONDITIONS), len(METHODS), 3, len(BODY_MODES)), np.nan)
    for row, condition in enumerate(CONDITIONS):
        runs, truth = car_records(condition, seed=seed), car_truth(condition)
        for column, (method, is_default) in enumerate(METHODS.values()):
            if is_tried(condition, method, is_default=is_default):
                modes = identified_car(runs, method, is_default=is_default).modes
                match = matched(modes, truth, reach=0.2)
                cars[row, column] = match.natural_frequency, match.damping_ratio, match.mac
    return plate, cars


def is_tried(condition: str, method: str, *, is_default: bool) -> bool:
    """Return whether a method is run in a condition: with the soft tyre only CoSS with the settings of the thesis."""
    return condition == "normal" or (method == "coss" and not is_default)


def car() -> Vehicle:
    """Return the car whose parameters fit the published modes."""
    vehicle = read_vehicle("zafira")
    assert isinstance(vehicle, Vehicle)
    return vehicle


def plate_truth() -> Modes:
    """Return the modes of the plate."""
    return theoretical(structure(read_vehicle("plate")), labels=BODY_MODES)


def car_truth(condition: str) -> Modes:
    """Return the body modes of the car in a condition."""
    text = CONDITIONS[condition]
    return theoretical(with_faults(structure(car()), [parse_fault(text)] if text else []), labels=BODY_MODES)


def wheelbase() -> float:
    """Return the distance between the first and the last axle of the car [m]."""
    axles = car().axle
    return axles[0].x - axles[-1].x
