"""The model of a vehicle: which blocks its settings make free."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
from sprung.likelihood.search import minimised
from sprung.vehicles import read_vehicle, structure

ON_WHEELS = ["components", "payload", "inputs", "class_roughness", "noise"]


def groups(name, kind, classes, **settings) -> list[str]:
    """The groups of the parameters of a model, in its order."""
    vehicle = read_vehicle(name)
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    model = vehicle_model(
        classes(len(layout.rows)), layout, vehicle, nominal, settings=CornerSettings(**settings), kind=kind
    )
    return list(dict.fromkeys(block.group for block in model.blocks))


def test_a_payload_is_fitted_on_roads_and_rails_but_not_on_a_rig(classes) -> None:
    on_road = ["components", "payload", "unsprung", "inputs", "class_roughness", "tracks", "driving", "noise"]
    assert groups("zafira", "road", classes) == on_road
    assert not {"payload", "unsprung"} & set(groups("zafira", "road", classes, has_payload=False))
    assert groups("y25", "rail", classes) == ON_WHEELS
    assert groups("scale-bogie", "rig", classes) == ["components", "inputs", "noise"]
    assert groups("scale-bogie", "rig", classes, has_payload=True) == ["components", "payload", "inputs", "noise"]
    assert "payload" not in groups("zafira", "road", classes, has_payload=False)


@pytest.fixture
def with_bars(car):
    """A car with anti-roll bars on both axles."""
    axles = tuple(axle.model_copy(update={"anti_roll_stiffness": 12e3}) for axle in car.axle)
    return car.model_copy(update={"axle": axles})


def test_an_anti_roll_bar_off_the_file_does_not_scale_the_whole_vehicle(with_bars, classes, with_data) -> None:
    """Accelerations show stiffness over mass: bars known exactly would lend their error to every other number."""
    nominal = structure(with_bars)
    layout = rigid_layout(nominal)
    empty = classes(len(layout.rows), counts=1e5)
    model = vehicle_model(empty, layout, with_bars, nominal, settings=CornerSettings(), kind="road")
    bars = model.rows("elements")
    assert [model.names[row] for row in bars] == ["front_axle_stiffness", "rear_axle_stiffness"]
    truth = model.start.copy()
    truth[bars] = -0.25
    drawn = with_data(model, truth)
    known = replace(drawn, blocks=tuple(block for block in drawn.blocks if block.group != "elements"))
    free, held = (np.abs(minimised(one, one.scaled_start())[one.rows("components")]) for one in (drawn, known))
    assert free.max() < 0.1
    assert held.mean() > 0.15
    assert free.mean() < held.mean() / 2


def test_sensors_are_free_where_the_settings_say_so(classes) -> None:
    assert "sensors" in groups("zafira", "road", classes, has_free_sensors=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"band": (5.0, 2.0)}, "must rise"), ({"prior_std": 0.0}, "above 0"), ({"segment": -1.0}, "above 0")],
)
def test_impossible_settings_are_refused(settings, message) -> None:
    with pytest.raises(ParameterError, match=message):
        CornerSettings(**settings)
