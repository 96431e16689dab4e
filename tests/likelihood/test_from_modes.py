"""Corners from modes: exact modes give exact components."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import corners_from_modes, rigid_layout
from sprung.modal import Modes
from sprung.vehicles import parse_fault, read_description, structure, with_faults


def exact_modes(vehicle, *, labels=("bounce", "pitch", "roll")):
    modes = vehicle.modes()
    rows = [k for k, label in enumerate(modes.labels) if label in labels]
    unknown = np.full(len(rows), np.nan)
    return Modes(
        modes.poles[rows],
        modes.mode_shapes[rows],
        modes.channels,
        unknown,
        unknown,
        np.ones(len(rows)),
        tuple(modes.labels[k] for k in rows),
    )


def components(vehicle, *names):
    corners = ("front_left", "front_right", "rear_left", "rear_right")
    return tuple(c for c in vehicle.components() if c.corner in corners and c.kind in names)


@pytest.mark.parametrize("name", ["zafira", "scale-bogie", "y25"])
def test_exact_modes_give_exact_springs_and_dampers(name) -> None:
    nominal = structure(read_description(name))
    true = with_faults(nominal, [parse_fault("front_left.spring=-0.3"), parse_fault("rear_right.damper=0.2")])
    free = components(nominal, "spring", "damper")
    found = corners_from_modes(exact_modes(true), nominal, rigid_layout(nominal), free, prior_std=1e5)
    expected = [np.log(true.components()[c] / nominal.components()[c]) for c in free]
    assert found == pytest.approx(expected, abs=1e-7)


def test_what_the_modes_do_not_determine_stays_near_nominal(car) -> None:
    nominal = structure(car)
    soft = with_faults(nominal, [parse_fault("front_left.spring=-0.3")])
    free = components(nominal, "spring", "damper", "tyre")
    found = corners_from_modes(exact_modes(soft, labels=("bounce",)), nominal, rigid_layout(nominal), free)
    assert np.abs(found).max() < 0.4
    assert found[0] == min(found)
    everything = corners_from_modes(exact_modes(soft), nominal, rigid_layout(nominal), free)
    assert everything[0] == pytest.approx(np.log(0.7), abs=0.03)
    assert np.abs(everything[1:]).max() < 0.06


def test_modes_without_a_channel_are_refused(car) -> None:
    nominal = structure(car)
    modes = exact_modes(nominal)
    few = Modes(
        modes.poles,
        modes.mode_shapes[:, :3],
        modes.channels[:3],
        modes.natural_frequency_std,
        modes.damping_ratio_std,
        modes.stable_rate,
        modes.labels,
    )
    with pytest.raises(ParameterError, match="modes lack one of the channels acc_fl"):
        corners_from_modes(few, nominal, rigid_layout(nominal), components(nominal, "spring"))
