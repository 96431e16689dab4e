"""The model of a vehicle: which blocks its settings make free."""

import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
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
    assert groups("zafira", "road", classes) == [*ON_WHEELS[:-1], "tracks", "noise"]
    assert groups("y25", "rail", classes) == ON_WHEELS
    assert groups("scale-bogie", "rig", classes) == ["components", "inputs", "noise"]
    assert groups("scale-bogie", "rig", classes, has_payload=True) == ["components", "payload", "inputs", "noise"]
    assert "payload" not in groups("zafira", "road", classes, has_payload=False)


def test_sensors_are_free_where_the_settings_say_so(classes) -> None:
    assert "sensors" in groups("zafira", "road", classes, has_free_sensors=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"band": (5.0, 2.0)}, "must rise"), ({"prior_std": 0.0}, "above 0"), ({"segment": -1.0}, "above 0")],
)
def test_impossible_settings_are_refused(settings, message) -> None:
    with pytest.raises(ParameterError, match=message):
        CornerSettings(**settings)
