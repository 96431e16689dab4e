import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from sprung.cli import main


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str
    check_document: Callable[[Any], Any]

    def document(self) -> Any:
        """The JSON document on standard output, without NaN and Infinity, checked against its JSON Schema."""

        def refuse(constant: str) -> None:
            raise AssertionError(f"{constant} is not valid JSON")

        assert self.code in {0, 3}, self.err
        return self.check_document(json.loads(self.out, parse_constant=refuse))


@pytest.fixture
def sprung(capfd: pytest.CaptureFixture[str], check_document: Callable[[Any], Any]) -> Callable[..., Outcome]:
    """Run the command line in this process."""

    def run(*words: object) -> Outcome:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return Outcome(code, *capfd.readouterr(), check_document)

    return run


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two minutes of the three-mass chain, with its truth beside it."""
    path = tmp_path_factory.mktemp("chain") / "run.csv"
    words = ["simulate", "chain", "--minutes", "2", "--sampling-rate", "200", "--snr", "10", "--seed", "1"]
    assert main([*words, "--out", str(path), "--json", f"{path}.json"]) == 0
    return path


@pytest.fixture(scope="session")
def bogie(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three minutes of the scale bogie on a random base."""
    from sprung.excitation import RandomInputs
    from sprung.formats import write
    from sprung.simulation import simulate
    from sprung.vehicles import read_vehicle, structure

    path = tmp_path_factory.mktemp("bogie") / "bogie.parquet"
    vehicle = structure(read_vehicle("scale-bogie"))
    excitation = RandomInputs(len(vehicle.inputs), 1e-4)
    write(simulate(vehicle, excitation, duration=180.0, sampling_rate=500.0, snr=20.0, seed=1), path)
    return path
