"""Runs of chains and quarter vehicles, and several records of one simulation."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import QUARTER_CASES
from sprung.simulation import RailDrive, RigRun, RoadConditions, RoadDrive, simulate, usual_excitation
from sprung.simulation.runs import StationaryRun, drive_document, joint_truth, record_seeds, simulate_run
from sprung.vehicles import Chain, Quarter, parse_fault, read_description, structure, with_faults


def test_a_run_is_the_simulation_of_the_faulty_vehicle():
    chain, fault = read_description("chain3"), parse_fault("mass_2.spring=-0.3")
    assert isinstance(chain, Chain)
    settings = StationaryRun(duration=5.0, sampling_rate=200.0, faults=(fault,), snr=10.0, noise_band=(1.0, 50.0))
    run = simulate_run(chain, settings, seed=3)
    healthy = structure(chain)
    expected = simulate(
        with_faults(healthy, [fault]),
        usual_excitation(healthy),
        duration=5.0,
        sampling_rate=200.0,
        snr=10.0,
        noise_band=(1.0, 50.0),
        seed=np.random.default_rng(3),
    )
    np.testing.assert_array_equal(run.recording.samples, expected.samples)
    assert run.truth["components"]["mass_2"]["spring"]["value"] == pytest.approx(0.7 * 9800.0)
    assert run.truth["components"]["mass_1"]["spring"]["value"] == 9800.0
    assert (run.truth["duration"], run.truth["snr"], run.truth["noise_band"]) == (5.0, 10.0, (1.0, 50.0))
    assert run.truth["excitation"] == str(usual_excitation(healthy))


def test_the_excitation_of_a_run_can_be_given():
    settings = StationaryRun(duration=1.0, sampling_rate=200.0, excitation=QUARTER_CASES[3])
    quarter = read_description("quarter")
    assert isinstance(quarter, Quarter)
    assert simulate_run(quarter, settings).truth["excitation"] == str(QUARTER_CASES[3])


def test_a_fault_that_grows_needs_a_drive():
    with pytest.raises(ParameterError, match=r"mass_1\.spring begins later or grows, as only faults of drives can"):
        StationaryRun(sampling_rate=200.0, faults=(parse_fault("mass_1.spring=-0.2@5"),))


def test_settings_of_drives_are_in_their_documents():
    assert drive_document(RoadDrive(road=RoadConditions("B"), duration=60.0, snr=5.0)) == {
        "duration": 60.0,
        "sampling_rate": 200.0,
        "snr": 5.0,
        "noise_band": None,
        "kind": "road",
        "road": "B",
        "nonlinear": False,
        "payload": 0.0,
        "temperature": 20.0,
    }
    for settings, kind in ((RailDrive(), "rail"), (RigRun(), "rig")):
        document = drive_document(settings)
        assert (document["kind"], document["road"]) == (kind, None)


def test_every_record_has_a_seed_of_its_own():
    assert record_seeds(4, 1) == [4]
    assert record_seeds(4, 3) == [[4, 0], [4, 1], [4, 2]]


def test_joint_truth_is_that_of_the_first_record_with_all_speeds():
    truths = [{"seed": k, "modes": [k], "speed": {"mean": float(k)}} for k in (1, 2)]
    assert joint_truth(truths, seed=7) == {
        "seed": 7,
        "modes": [1],
        "speed": {"mean": 1.0},
        "speeds": [{"mean": 1.0}, {"mean": 2.0}],
    }
    assert "speeds" not in joint_truth(truths[:1], seed=7)
    assert "speeds" not in joint_truth([{"seed": 1, "speed": None}] * 2, seed=7)
