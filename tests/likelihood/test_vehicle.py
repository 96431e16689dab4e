"""The model of a vehicle: which blocks its settings make free."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
from sprung.likelihood.masses import payload
from sprung.likelihood.search import minimised
from sprung.likelihood.vehicle import default_choices
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


def test_a_broken_link_comes_out_of_exact_spectra(with_bars, classes, recovered) -> None:
    """All of the front bar is lost, and nothing of the rear one: a logarithm would reach neither."""
    nominal = structure(with_bars)
    layout = rigid_layout(nominal)
    model = vehicle_model(classes(len(layout.rows)), layout, with_bars, nominal, settings=CornerSettings(), kind="road")
    model = replace(model, blocks=tuple(block for block in model.blocks if block.group != "unsprung"))  # the scale
    truth = model.start.copy()
    truth[model.names.index("front_axle_stiffness")] = -1.0
    assert recovered(model, truth)[model.rows("elements")] == pytest.approx([-1.0, 0.0], abs=1e-6)


def _load_behind_on_the_right(model):
    """100 kg off both axes, and a track 2.5 dB rougher on that side."""
    x, y = -1.3, -0.4
    point = 100.0 * np.array([1.0, -x, y, x**2, y**2, -x * y])
    loads = point / [part.unit for part in payload(model.structure).parts]
    return {"right_over_left": np.log(10) * 2.5 / 20, **dict(zip(LOADS, loads, strict=True))}


def _lively_driver(_):
    exponents = {"braking_exponent": 3.5, "cornering_exponent": 2.5}
    return {"braking": np.log(0.3), "cornering": np.log(0.5), "rear_left.spring": -0.2, **exponents}


LOADS = [f"payload_{name}" for name in ("mass", "x_moment", "y_moment", "pitch_inertia", "roll_inertia", "product")]


def test_cornering_stiffness_and_the_height_of_a_load_come_out_of_exact_spectra(car, classes, recovered) -> None:
    """Side forces move the roll mode; corners and loads are not to take their error up."""
    tyres = tuple(axle.model_copy(update={"cornering_stiffness": 60e3}) for axle in car.axle)
    body = car.body.model_copy(update={"height": 0.55})
    on_tyres = car.model_copy(update={"axle": tyres, "body": body})
    nominal = structure(on_tyres, speed=12.0)
    layout = rigid_layout(nominal)
    model = vehicle_model(classes(len(layout.rows)), layout, on_tyres, nominal, settings=CornerSettings(), kind="road")
    model = replace(model, blocks=tuple(block for block in model.blocks if block.group != "unsprung"))  # the scale
    truth = model.start.copy()
    changes = {"front_tyres.cornering_stiffness": 0.3, "rear_tyres.cornering_stiffness": -0.2, "payload_z_moment": 0.1}
    for name, value in changes.items():
        truth[model.names.index(name)] = value
    rows = model.rows("components", "payload", "elements")
    assert recovered(model, truth)[rows] == pytest.approx(truth[rows], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [_load_behind_on_the_right, _lively_driver])
def test_corners_come_out_of_exact_spectra_with_loads_tracks_and_driving(car, classes, recovered, changes) -> None:
    nominal = structure(car)
    layout = rigid_layout(nominal)
    model = vehicle_model(classes(len(layout.rows)), layout, car, nominal, settings=CornerSettings(), kind="road")
    model = replace(model, blocks=tuple(block for block in model.blocks if block.group != "unsprung"))  # the scale
    truth = model.start.copy()
    for name, value in changes(model).items():
        truth[model.names.index(name)] = value
    rows = model.rows("components", "payload", "tracks", "driving")
    assert recovered(model, truth)[rows] == pytest.approx(truth[rows], abs=1e-6)


def test_sensors_are_free_where_the_settings_say_so(classes) -> None:
    assert "sensors" in groups("zafira", "road", classes, has_free_sensors=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"band": (5.0, 2.0)}, "must rise"), ({"prior_std": 0.0}, "above 0"), ({"segment": -1.0}, "above 0")],
)
def test_impossible_settings_are_refused(settings, message) -> None:
    with pytest.raises(ParameterError, match=message):
        CornerSettings(**settings)


@pytest.mark.parametrize("kind", ["road", "rig"])
def test_a_vehicle_without_tyres_is_refused(car, kind) -> None:
    """Before: an IndexError of an empty band."""
    axles = tuple(axle.model_copy(update={"tyre_stiffness": None, "unsprung_mass": 0.0}) for axle in car.axle)
    bare = car.model_copy(update={"axle": axles})
    with pytest.raises(ParameterError, match="no axle of the vehicle file 'zafira' has a tyre_stiffness"):
        default_choices(bare, structure(bare), CornerSettings(kind=kind), 200.0)
