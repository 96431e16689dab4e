"""Descriptions of vehicles: what is refused, and in which words."""

import pytest

from sprung.errors import ParameterError
from sprung.vehicles import (
    corner_names,
    parse_vehicle,
    read_vehicle,
)


def test_corner_names() -> None:
    assert corner_names(2) == ("front_left", "front_right", "rear_left", "rear_right")
    assert corner_names(4)[2:6] == ("axle2_left", "axle2_right", "axle3_left", "axle3_right")
    with pytest.raises(ParameterError, match="n_axles=1 must be at least 2"):
        corner_names(1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"body": {"mass": 1480.0, "pitch_inertia": 2.2e9}},
            r"body, pitch_inertia=2.2e\+09 kg m2 must be .* correct the unit",
        ),
        ({"body": {"mass": 1480.0, "roll_inertia": 0.36}}, "body, roll_inertia=0.36 kg m2 must be"),
        (
            {
                "sensor": [
                    {
                        "channel": "a",
                        "quantity": "acceleration",
                        "unit": "g",
                        "position": [1220.0, 0.0, 0.0],
                        "direction": [0.0, 0.0, 1.0],
                    }
                ]
            },
            r"\[\[sensor\]\] 1, position=\[1220.0, 0.0, 0.0\] is more than 14 m, five wheelbases, .*: is that mm\? ",
        ),
    ],
)
def test_what_no_vehicle_can_be_is_refused(change, message) -> None:
    fields = read_vehicle("zafira").model_dump(exclude_defaults=True)
    with pytest.raises(ParameterError, match=message):
        parse_vehicle({**fields, "kind": "road", **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wheelset_mass": 1300.0}, "wheelset_mass needs wheelset_roll_inertia"),
        ({"contact_half_track": 0.75}, "contact_half_track needs wheelset_mass"),
        ({"lateral_damping": 10.0}, "lateral_damping needs lateral_stiffness"),
        ({"lateral_stiffness": 10.0}, "lateral_stiffness is given for some axles only"),
        ({"damper_bushing_stiffness": 0.0}, r"\[\[axle\]\] 1, damper_bushing_stiffness=0.0 must be above 0"),
    ],
)
def test_half_a_description_of_an_axle_is_refused(change, message) -> None:
    fields = read_vehicle("zafira").model_dump(exclude_defaults=True)
    front, rear = fields["axle"]
    with pytest.raises(ParameterError, match=message):
        parse_vehicle({**fields, "kind": "road", "axle": [{**front, **change}, rear]})
