"""Motion of a vehicle file that is possible, but unusual."""

import numpy as np
import pytest

from sprung.recording import Channel, Recording
from sprung.vehicles import VEHICLES, parse_vehicle, read_description, read_vehicle
from sprung.vehicles.labels import plausibility_notes
from sprung.vehicles.window import window_of

USUAL_DAMPING = "2 to 100 % is usual: check damping, and its unit (N s/m)"


def car(**axle):
    """The file of a car with other values for both axles."""
    fields = read_vehicle("zafira").model_dump(exclude_defaults=True)
    return parse_vehicle({**fields, "kind": "road", "axle": [{**one, **axle} for one in fields["axle"]]})


@pytest.mark.parametrize("name", VEHICLES)
def test_shipped_vehicles_are_usual(name) -> None:
    assert plausibility_notes(read_description(name)) == ()


def test_an_undamped_body_is_unusual() -> None:
    (note,) = plausibility_notes(car(damping=0.0))
    assert note == f"unusual damping of the vehicle file's body: bounce 0 %, pitch 0 %, roll 0 %; {USUAL_DAMPING}"


def test_strong_dampers_are_unusual_although_they_leave_no_mode() -> None:
    """4 c / (2 sqrt(4 k m)) of a body above its suspension: 2 sqrt(k m) = c at 100 %."""
    stiffness, mass = 40e3, 1480.0
    damping = 1.5 * np.sqrt(stiffness * mass)
    (note,) = plausibility_notes(car(spring_stiffness=stiffness, damping=damping))
    assert note == f"unusual damping of the vehicle file's body: bounce 150 %; {USUAL_DAMPING}"


def test_a_body_that_vibrates_like_a_bogie_is_unusual_in_full_size_alone() -> None:
    """Springs 900 times as stiff move the modes up by a factor of about 30; at a scale of 1 to 25, by 5 at most."""
    fast = car(spring_stiffness=900 * 40e3, damping=30 * 1781.0, tyre_stiffness=900 * 190900.0)
    note, *_ = plausibility_notes(fast)
    assert note.startswith("unusual frequencies of the vehicle file's body: bounce 4")
    assert note.endswith("0.5 to 20 Hz is usual: check masses, inertias and spring stiffness, and their units")


def test_results_carry_the_note() -> None:
    strange = car(damping=0.0)
    names = [sensor.channel for sensor in strange.sensor]
    run = Recording(np.random.default_rng(1).normal(size=(4, 100)), 100.0, tuple(map(Channel, names)))
    assert window_of(run, strange).notes == plausibility_notes(strange)
