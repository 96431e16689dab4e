from dataclasses import replace

import pytest

from sprung.identification import BlockRowLadder, IdentificationSettings, acs_ssi, coss_ssi, cov_ssi
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import ShortPass
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import read_description, read_vehicle, structure

LINES = (
    Harmonic(12.5, "constant", (12.4, 12.6), 0.2, 20.0, ("acc_1",), fundamental=12.5, order=1),
    Harmonic(25.0, "constant", (24.9, 25.1), 0.2, 15.0, ("acc_1", "acc_2"), fundamental=12.5, order=2),
    Harmonic(0.516, "speed", (31.0, 36.0), 0.01, 12.0, ("acc_3",)),
)


def records(n=1, *, name="chain3", duration=60.0, sampling_rate=500.0, **fields):
    vehicle = structure(read_description(name))
    excitation = usual_excitation(vehicle)
    return [
        simulate(vehicle, excitation, duration=duration, sampling_rate=sampling_rate, seed=seed, **fields)
        for seed in range(n)
    ]


@pytest.fixture(scope="session")
def chain():
    return cov_ssi(records(snr=0.5))


@pytest.fixture(scope="session")
def chain_with_lines(chain):
    return replace(chain, harmonics=LINES)


@pytest.fixture(scope="session")
def edited():
    return cov_ssi(records(), settings=IdentificationSettings(lifter=ShortPass(0.25)))


@pytest.fixture(scope="session")
def row_ladder():
    return acs_ssi(records(), settings=IdentificationSettings(ladder=BlockRowLadder(12, 30)))


@pytest.fixture(scope="session")
def subsets():
    settings = IdentificationSettings(has_disjoint_references=True)
    return coss_ssi(records(6, snr=2.0), settings=settings)


@pytest.fixture(scope="session")
def car():
    settings = IdentificationSettings(n_subsets=3, block_rows=60)
    runs = records(2, name="zafira", duration=900.0, sampling_rate=100.0)
    return coss_ssi(runs, settings=settings, vehicle=read_vehicle("zafira"))


@pytest.fixture(scope="session")
def single():
    run = records()[0]
    return cov_ssi(run.select([run.names[-1]]))
