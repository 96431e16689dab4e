"""Windows of a few vehicles, and one session of Spark for all tests."""

import shutil
from dataclasses import replace

import pytest

from sprung.fleet.lake import window_of_recording
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle, vehicle_text

START = 1_767_225_600 * 10**9  # 2026-01-01
BETWEEN = 1800 * 10**9
#: Windows of two minutes: what the fit of one costs, tests need many times.
SETTINGS = RoadDrive(duration=120.0, sampling_rate=100.0, snr=50.0)


@pytest.fixture(scope="session")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="session")
def car_text(car):
    return vehicle_text(car)


@pytest.fixture(scope="session")
def window(car):
    """Return a function from a vehicle, a number and a fault to a window of a lake."""
    kept = {}

    def made(vehicle, number, fault=None):
        if (vehicle, number, fault) not in kept:
            faults = () if fault is None else (parse_fault(fault),)
            seed = [5, int(vehicle[3:]), number]
            recording = simulate_drive(car, replace(SETTINGS, faults=faults), seed=seed).recording
            stamped = replace(recording, start=START + number * BETWEEN, history=())
            kept[vehicle, number, fault] = window_of_recording(vehicle, stamped)
        return kept[vehicle, number, fault]

    return made


@pytest.fixture(scope="session")
def tables():
    """Return a function to all rows of results but those of the table of runs, sorted."""
    from sprung.fleet.jobs.results import SCHEMAS

    def rows(results):
        return {
            name: sorted(repr(sorted(row.items())) for row in results[name].rows().to_pylist())
            for name in SCHEMAS
            if name != "runs"
        }

    return rows


@pytest.fixture(scope="session")
def spark():
    """A session with two processes on this machine."""
    pytest.importorskip("pyspark")
    if shutil.which("java") is None:
        pytest.skip("no Java: install Debian's default-jre-headless (scripts/system-packages)")
    from sprung.fleet.jobs import spark_session

    session = spark_session("local[2]", settings={"spark.sql.shuffle.partitions": "2"})
    yield session
    session.stop()
