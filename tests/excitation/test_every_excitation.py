"""What all excitations have in common, and what each refuses."""

from typing import Any, cast

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import (
    QUARTER_CASES,
    BaseMotion,
    BodyAccelerations,
    Corrugation,
    Crossings,
    CrossSlope,
    Excitation,
    HammerBlows,
    Joints,
    Lines,
    Potholes,
    RandomInputs,
    RollerRig,
    Route,
    SmoothSteps,
    SpeedChanges,
    SpeedProfile,
    Stack,
    Sum,
    SurfaceMotion,
    constant_speed,
    noise,
    rail_quality,
    random_cross_slope,
    random_speed,
    road_class,
)


def profile(times, speeds):
    return SpeedProfile(np.array(times), np.array(speeds))


SPEED = profile([0.0, 5.0, 10.0], [4.0, 12.0, 6.0])
CURVE, SLOPE = (SmoothSteps(np.array([30.0]), np.array([jump]), np.array([9.0])) for jump in (0.01, 0.02))
ROUTE = Route(SPEED, CURVE, SLOPE, has_longitudinal=True)
AXLES = (1.0, -1.0)
#: Excitations that draw nothing: functions of time.
FIXED: dict[str, Excitation] = {
    "lines": Lines(SPEED, (0.5, 1.0), (2.0, 1.0), (1.0, -1.0), speed_exponent=2.0, phases=(0.3, -0.7)),
    "body": BodyAccelerations(ROUTE),
    "slope": CrossSlope(ROUTE, AXLES, (0.7, 0.6)),
    "base": BaseMotion(0.0, 1e-4, (3.65, 17.0), (0.3, -1.0), 5e-3),
    "rig": RollerRig((True, False), SPEED, random=0.0, joints=4, joint=1e-4),
}
EXCITATIONS: dict[str, Excitation] = FIXED | {
    "noise": RandomInputs(3, 2.0, (1.0, 20.0)),
    "hammer": HammerBlows(rate=20.0),
    "quarter": QUARTER_CASES[3],
    "random lines": Lines(SPEED, (0.5,), (2.0,), (1.0,)),
    "random rig": RollerRig((True, False), SPEED, harmonics=(1e-5,)),
    "road": SurfaceMotion(road_class("D"), AXLES, SPEED, obstacles=(Potholes(),)),
    "rail": SurfaceMotion(rail_quality("good"), AXLES, SPEED, obstacles=(Joints(), Crossings(), Corrugation())),
}
EXCITATIONS["sum"] = Sum((EXCITATIONS["road"], FIXED["slope"]))
EXCITATIONS["stack"] = Stack((FIXED["slope"], FIXED["body"], EXCITATIONS["noise"]))
#: Those that are held from sample to sample, or have a part that is.
HELD = {"noise", "base", "quarter", "rig", "random rig", "stack"}


@pytest.mark.parametrize("name", EXCITATIONS)
def test_samples_have_a_row_for_each_input_and_repeat_by_seed(name, drawn) -> None:
    excitation = EXCITATIONS[name]
    samples = drawn(excitation, 1000, start=-0.3)
    assert samples.shape == (excitation.n_inputs, 1000)
    assert np.all(np.isfinite(samples))
    assert np.array_equal(samples, drawn(excitation, 1000, start=-0.3))
    assert np.array_equal(samples, drawn(excitation, 1000, start=-0.3, seed=2)) == (name in FIXED)
    assert excitation.is_smooth == (name not in HELD)


@pytest.mark.parametrize("name", FIXED)
def test_functions_of_time_continue_from_any_start(name, drawn) -> None:
    whole = drawn(FIXED[name], 1000, start=0.5)
    later = drawn(FIXED[name], 400, start=1.1)
    inner = slice(1 if name == "rig" else 0, None)  # a joint between two calls is seen by neither
    assert later[:, inner] == pytest.approx(whole[:, 600:][:, inner], abs=1e-12)


def steps(knots, jumps, widths):
    return SmoothSteps(np.array(knots), np.array(jumps), np.array(widths))


def banded(low, high):
    return noise((5,), band=(low, high), sampling_rate=100.0, generator=np.random.default_rng(0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: BaseMotion(frequencies=(1.0, 2.0), phases=(0.0,)), "2 frequencies have 1 phases: give one phase for"),
        (lambda: BaseMotion(pulse_frequency=0.0), "pulse_frequency=0 must be above 0"),
        (lambda: BaseMotion(random=-1.0), "random=-1 must be at least 0"),
        (lambda: banded(60.0, 70.0), "band 60 to 70 Hz lies above half the sampling rate 100 Hz: lower it"),
        (lambda: banded(20.0, 10.0), "upper edge of the band=10 must be above 20"),
        (lambda: banded(-1.0, 10.0), "lower edge of the band=-1 must be at least 0"),
        (lambda: banded(1e-9, 10.0), "lower edge of the band=1e-09 must be at least 0.0001: use 0"),
        (lambda: banded(0.0, np.nan), "upper edge of the band=nan must be finite and above"),
        (lambda: RandomInputs(0), "n_inputs=0 must be at least 1"),
        (lambda: RandomInputs(1, standard_deviation=0.0), "standard_deviation=0 must be above 0"),
        (lambda: Lines(SPEED, (1.0, 2.0), (1.0,), (1.0,)), "2 orders have 1 amplitudes"),
        (lambda: Lines(SPEED, (1.0, 2.0), (1.0, 1.0), (1.0,), phases=(0.0,)), "2 orders have 1 phases"),
        (lambda: Sum((RandomInputs(1), RandomInputs(2))), "parts have 1, 2 inputs"),
        (lambda: Stack(()), "no parts"),
        (lambda: RollerRig((False,), SPEED), "at least one driven wheelset"),
        (lambda: steps([0.0], [1.0, 2.0], [1.0]), "1 knots need as many jumps and widths above 0, not 2 and 1"),
        (lambda: steps([0.0], [1.0], [0.0]), "widths above 0"),
        (lambda: random_cross_slope(1.0, largest=0.0, generator=np.random.default_rng(0)), "largest cross slope=0"),
        (lambda: profile([0, 0], [1, 1]), "times of a speed profile must rise"),
        (lambda: profile([], []), "times of a speed profile must rise"),
        (lambda: profile([0, 1], [1, -1]), "must be finite and at least 0"),
        (lambda: profile([0], [np.nan]), "must be finite and at least 0"),
        (lambda: SpeedChanges(braking=(2.0, 1.0)), "largest braking=1 must be at least 2"),
        (lambda: constant_speed(-1.0), "speed=-1 must be at least 0"),
        (lambda: random_speed(0.0, low=1.0, high=2.0, generator=np.random.default_rng(0)), "duration=0 must be above"),
        (lambda: road_class("k"), "road class 'K' is not one of"),
        (lambda: SurfaceMotion(road_class("A"), AXLES[::-1], SPEED), "must fall from front to rear"),
        (lambda: Potholes(side=cast("Any", "up")), "side of the potholes 'up' is not one of left, right"),
    ],
)
def test_what_makes_no_sense_is_refused(call, message) -> None:
    with pytest.raises(ParameterError, match=message):
        call()
