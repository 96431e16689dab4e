from pathlib import Path

import pytest

from sprung.cli import main


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
