"""Numbers of a vehicle file in a wrong unit: what is refused, and in which words."""

import copy

import pytest

from sprung.errors import ParameterError
from sprung.vehicles import VEHICLES, parse_vehicle, read_description, read_vehicle

CAR = read_vehicle("zafira").model_dump(exclude_defaults=True) | {"kind": "road"}


def changed(changes, kind="road"):
    """The fields of a car of 1480 kg with other values, by place: those of axles are of both, "front" is the first."""
    fields = copy.deepcopy(CAR) | {"kind": kind}
    tables = {"body": [fields["body"]], "axle": fields["axle"], "front": fields["axle"][:1], "": [fields]}
    for place, value in changes.items():
        table, _, name = place.rpartition(".")
        for one in tables[table]:
            one[name] = value
    return fields


MOUNTED = {"mass": 180.0, "x": 1.1, "frequency": 11.0, "damping_ratio": 0.1}
SENSOR = {"channel": "a", "quantity": "acceleration", "unit": "g", "position": [1220.0, 0, 0], "direction": [0, 0, 1]}
TONNES = {"body.mass": 1.48, "body.pitch_inertia": 2.2, "body.roll_inertia": 0.36}
GRAMS = {name: value * 1e6 for name, value in TONNES.items()}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"axle.spring_stiffness": 44.0}, "N/m under 370 kg of body: sinking by 82.5 m, more than 2.8 m: is that N/mm"),
        ({"axle.spring_stiffness": 4e9}, "[[axle]] 1, spring_stiffness=4e+09 N/m under 370 kg of body: a bounce at 52"),
        ({"axle.half_track": 720.0}, "[[axle]] 1, half_track=720 m of a vehicle with a wheelbase of 2.8 m: is that mm"),
        ({"axle.half_track": 1e-3}, "[[axle]], x: a wheelbase of 2.8 m with a half track of 0.001 m: is that mm? Give"),
        ({"axle.damping": 1.78}, "that damps it by 0.022 %: is that N s/mm? Give N s/m, kg and N/m"),
        ({"axle.damping": 1.78e6}, "that damps it by 2.2e+04 %: is the stiffness in another unit? Give N s/m, kg and"),
        ({"axle.tyre_stiffness": 190.9}, "tyre_stiffness=190.9 N/m below springs of 44179 N/m: is that N/mm? Give N/m"),
        ({"axle.unsprung_mass": 0.0405}, "unsprung_mass=0.0405 kg under 370 kg of body: is that t? Give kilograms"),
        ({"axle.unsprung_mass": 40500.0}, "kg under 370 kg of body: is that g, or is the mass of the body missing? Gi"),
        (TONNES, "body, mass=1.48 kg of a vehicle with 3.93 m2 between its wheels: is that t? Give kilograms, or leav"),
        (GRAMS, "body, mass=1.48e+06 kg of a vehicle with 3.93 m2 between its wheels: is that g? Give kilograms"),
        ({"body.pitch_inertia": 2.2e9}, "body, pitch_inertia=2.2e+09 kg m2 must be 9.24 to 5.91e+04 for a mass of 148"),
        ({"body.roll_inertia": 0.36}, "kg with axles and wheels within 0.702 m: correct the unit"),
        ({"axle.rolling_radius": 310.0}, "[[axle]] 1, rolling_radius=310 m of a vehicle with a wheelbase of 2.8 m: is"),
        ({"body.height": 550.0}, "body, height=550 m of a vehicle with a wheelbase of 2.8 m: is that mm? Give metres"),
        ({"mounted_mass": [MOUNTED | {"x": 1100.0}]}, "[[mounted_mass]] 1, x=1100, y=0 is more than 14 m, five wheelb"),
        ({"mounted_mass": [MOUNTED | {"mass": 180e3}]}, "[[mounted_mass]] 1, mass=180000 kg on a body of 1480 kg: is"),
        ({"sensor": [SENSOR]}, "[[sensor]] 1, position=[1220.0, 0.0, 0.0] is more than 14 m, five wheelbases, from th"),
        ({"front.wheelset_mass": 1300.0}, "wheelset_mass needs wheelset_roll_inertia"),
        ({"front.contact_half_track": 0.75}, "contact_half_track needs wheelset_mass"),
        ({"front.lateral_damping": 10.0}, "lateral_damping needs lateral_stiffness"),
        ({"front.lateral_stiffness": 10.0}, "lateral_stiffness is given for some axles only"),
        ({"front.damper_bushing_stiffness": 0.0}, "[[axle]] 1, damper_bushing_stiffness=0.0 must be above 0"),
    ],
)
def test_what_no_vehicle_can_be_is_refused(changes, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        parse_vehicle(changed(changes))
    assert sentence in str(refusal.value)


def test_lengths_in_millimetres_are_asked_for() -> None:
    """All lengths of the axles alike: they agree among themselves, but not with any vehicle."""
    fields = changed({"axle.half_track": 702.0})
    for axle in fields["axle"]:
        axle["x"] *= 1000
    with pytest.raises(ParameterError, match=r"\[\[axle\]\], x: a wheelbase of 2800 m: is that mm\? Give metres"):
        parse_vehicle(fields)


def test_a_quarter_vehicle_is_checked_by_its_mass() -> None:
    corner = {"unsprung_mass": 40.0, "spring_stiffness": 20.0, "damping": 1500.0, "tyre_stiffness": 200e3}
    with pytest.raises(
        ParameterError, match=r"\[corner\], spring_stiffness=20 N/m under 400 kg of body: sinking by 196"
    ):
        parse_vehicle({"name": "q", "kind": "quarter", "body": {"mass": 400.0}, "corner": corner})


@pytest.mark.parametrize(("kind", "damping"), [("road", 0.0), ("rail", 0.0), ("rig", 0.0), ("rig", 1.78)])
def test_dampers_may_be_left_out_and_rigs_have_hardly_any(kind, damping) -> None:
    assert parse_vehicle(changed({"axle.damping": damping}, kind)).kind == kind


@pytest.mark.parametrize("scale", [0.1, 0.2, 1.0, 3.0])
@pytest.mark.parametrize("name", [name for name in VEHICLES if name not in {"chain3", "quarter"}])
def test_models_of_any_scale_are_vehicles(name, scale) -> None:
    """Of the same material: lengths s, masses s^3, stiffnesses s, damping s^2, inertias s^5; frequencies 1/s."""
    fields = read_description(name).model_dump(exclude_defaults=True)
    powers = {"mass": 3, "unsprung_mass": 3, "wheelset_mass": 3, "damping": 2, "x": 1, "half_track": 1, "height": 1}
    powers |= {"pitch_inertia": 5, "roll_inertia": 5, "yaw_inertia": 5, "wheelset_roll_inertia": 5}
    powers |= dict.fromkeys(("spring_stiffness", "tyre_stiffness", "longitudinal_stiffness"), 1)
    stages = dict.fromkeys(("primary_stiffness", "secondary_stiffness"), 1)
    powers |= {"contact_half_track": 1, "half_wheelbase": 1, "primary_damping": 2, "secondary_damping": 2, **stages}
    tables = [fields["body"], *fields.get("axle", ()), *fields.get("bogie", ()), *fields.get("mounted_mass", ())]
    for table in tables:
        table |= {key: value * scale ** powers[key] for key, value in table.items() if key in powers}
        if "half_spacing" in table:
            table["half_spacing"] = [scale * place for place in table["half_spacing"]]
    for sensor in fields["sensor"]:
        sensor["position"] = [scale * place for place in sensor["position"]]
    parse_vehicle({**fields, "kind": read_description(name).kind})
