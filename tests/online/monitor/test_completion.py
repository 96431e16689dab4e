"""Learning with a vehicle file whose sensors are out of place: the file is calibrated first."""

import cbor2
import numpy as np
import pytest

from sprung.online.monitor import MonitorSettings, Observed, VehicleMonitor
from sprung.results.documents import baseline_document
from sprung.vehicles import Vehicle, vehicle_from_text

SETTINGS = MonitorSettings(window=300.0, identify_every=0, learning_windows=2)


@pytest.fixture(scope="module")
def misplaced(car) -> Vehicle:
    """The car in a file that places its sensors up to 15 cm away."""
    errors = ((0.1, 0.05), (-0.1, 0.08), (-0.08, -0.1), (0.15, 0.0))
    sensors = tuple(
        sensor.model_copy(update={"position": (sensor.position[0] + dx, sensor.position[1] + dy, sensor.position[2])})
        for sensor, (dx, dy) in zip(car.sensor[:4], errors, strict=True)
    )
    return car.model_copy(update={"sensor": (*sensors, *car.sensor[4:])})


@pytest.mark.slow
def test_the_file_is_calibrated_before_a_baseline_is_learnt_and_a_restart_changes_nothing(
    car, misplaced, drive, alike
) -> None:
    through, stopped = (VehicleMonitor(misplaced, settings=SETTINGS) for _ in range(2))
    learnings = []
    for part in (drive(number).part(k, k + 60_000) for number in (0, 1) for k in (0, 60_000)):
        (expected,), (window,) = through.update(part), stopped.update(part)
        assert isinstance(expected, Observed)
        assert isinstance(window, Observed)
        stopped = VehicleMonitor.from_state(misplaced, cbor2.loads(cbor2.dumps(stopped.state())))
        learnings.append(through.learning)
        assert stopped.learning == through.learning
        assert stopped.vehicle == through.vehicle
        assert alike(window.observation.log_ratios.tolist(), expected.observation.log_ratios.tolist())
    assert learnings == [(1, 2), (0, 2), (1, 2), (2, 2)]
    assert through.baseline is not None
    assert stopped.baseline is not None
    assert alike(baseline_document(stopped.baseline).as_json(), baseline_document(through.baseline).as_json())
    completed = vehicle_from_text(through.baseline.vehicle_file, source="baseline")
    assert completed == through.vehicle
    places, given, learnt = (
        np.array([sensor.position for sensor in file.sensor[:4]]) for file in (car, misplaced, completed)
    )
    apart = np.ptp((learnt - places)[:, 0]), np.ptp((given - places)[:, 0])
    assert apart[0] < 0.4 * apart[1]


def test_a_file_is_left_alone_if_the_settings_say_so(misplaced) -> None:
    monitor = VehicleMonitor(misplaced, settings=MonitorSettings(calibrate=False))
    assert not monitor.state()["completion"]["is_open"]
    assert monitor.state()["completed"] == ""
