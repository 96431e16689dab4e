"""Cars that nothing is tuned to."""

from pathlib import Path

import pytest

from sprung.vehicles import Vehicle, read_vehicle

CARS = Path(__file__).parents[2] / "benchmarks" / "vehicles"


@pytest.fixture(scope="session", params=["hatchback", "van"])
def other_car(request: pytest.FixtureRequest) -> Vehicle:
    """Return an invented car."""
    return read_vehicle(CARS / f"{request.param}.toml")


@pytest.fixture(scope="session")
def hatchback() -> Vehicle:
    """Return an invented small car."""
    return read_vehicle(CARS / "hatchback.toml")
