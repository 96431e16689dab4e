"""Numbers of a vehicle file: where they are, how wide they are, how they move."""

import numpy as np
import pytest

from sprung.calibration.draft import channel_responses, component_numbers, explicit, file_numbers, moved, with_widths
from sprung.vehicles.sections import LearntNumber

CHANNELS = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")


def every(draft):
    return (*component_numbers(draft, std=0.7), *file_numbers(draft, CHANNELS))


def test_parameters_of_zero_are_the_file(hatchback) -> None:
    draft = explicit(hatchback)
    numbers = every(draft)
    assert moved(draft, numbers, np.zeros(len(numbers))).vehicle == draft.vehicle


def test_every_number_moves_itself_alone(hatchback) -> None:
    draft = explicit(hatchback)
    numbers = [number for number in every(draft) if number.name != "body.centre_x"]
    before = np.array([draft.value_at(number.place) for number in numbers])
    for row, number in enumerate(numbers):
        parameters = 0.1 * number.std * np.eye(len(numbers))[row]
        after = np.array([moved(draft, numbers, parameters).value_at(other.place) for other in numbers])
        assert np.flatnonzero(np.abs(after - before) > 1e-12).tolist() == [row]
        assert after[row] == pytest.approx(number.value(before[row], parameters[row]))


def test_the_centre_of_gravity_moves_against_all_else(hatchback) -> None:
    draft = explicit(hatchback)
    ahead = draft.ahead(0.05).vehicle
    assert [axle.x for axle in ahead.axle] == pytest.approx([axle.x - 0.05 for axle in hatchback.axle])
    places = [(car.sensor[0].position or (np.nan,))[0] for car in (ahead, hatchback)]
    assert places[0] == pytest.approx(places[1] - 0.05)


def test_a_late_channel_lags_and_a_larger_scale_reads_less(hatchback) -> None:
    draft = explicit(hatchback)
    late = draft.with_sensor("acc_fr", delay=5e-3, scale=2.0)
    response = channel_responses(late, draft, CHANNELS, np.array([10.0]))[0]
    assert response[0] == 1
    assert response[1] == pytest.approx(0.5 * np.exp(-2j * np.pi * 10 * 5e-3))


def test_the_width_of_a_guess_is_the_prior(hatchback) -> None:
    guess = LearntNumber(name="front.tyre_stiffness", value=185e3, std=37e3)
    sure = LearntNumber(name="acc_fl.x", value=1.02, std=1e-6)
    draft = explicit(hatchback.model_copy(update={"learnt": (guess, sure)}))
    std = {number.name: number.std for number in with_widths(every(draft), draft)}
    assert std["front.tyre_stiffness"] == pytest.approx(0.2)
    assert std["acc_fl.x"] == pytest.approx(0.01)  # a tenth of the usual: a sensor may be moved
    assert std["rear.tyre_stiffness"] == 0.7
