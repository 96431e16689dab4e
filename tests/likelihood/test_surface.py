"""Roads and tracks under the wheels: density, delay between the axles, coherence of left and right."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from sprung.likelihood import ClassRoughness, RailInputs, RoadInputs, rigid_layout
from sprung.likelihood.surface import road_deviations
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import structure

AHEAD = np.array([1.2, 1.2, -1.6, -1.6])
SIDES = np.array([1.0, -1.0, 1.0, -1.0])
WHEELBASE = 2.8


def road_parameters(*, waviness=2.0, delay=0.0, deviations=(0, 0, 0, 0, 0, 0)) -> list[float]:
    """A road of class B whose coherence falls off over 1.5 m."""
    return [np.log(64e-6), waviness, *deviations, np.log(1.5), 0.0, delay]


@pytest.fixture
def spectra(classes):
    """Speed classes without a spread."""
    blurred = classes(3, n_classes=3)
    return replace(blurred, spreads=np.zeros(3))


@pytest.fixture
def inputs(car, spectra):
    """Return a function from a surface and its parameters to the spectral matrix of the wheels' inputs."""
    nominal = structure(car)
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    return lambda surface, parameters: surface.contribute(np.asarray(parameters), terms).inputs


def test_density_of_a_road_is_that_of_iso_8608(spectra, inputs) -> None:
    """G(n) = G0 (n / 0.1)^-w over n, and G(n) / v over the frequency f = n v."""
    road = RoadInputs(spectra, AHEAD, SIDES, contact_length=1e-6)
    matrix = inputs(road, road_parameters(waviness=2.1, delay=0.0))
    speed = spectra.speeds[1]
    expected = 64e-6 * (spectra.grid / speed / 0.1) ** -2.1 / speed
    for wheel in range(4):
        assert matrix[1, :, wheel, wheel] == pytest.approx(expected, rel=1e-9)


def test_the_rear_wheel_follows_the_front_one(spectra, inputs) -> None:
    """x_rear(t) = x_front(t - L / v): S_rear,front = S e^(-i w L / v), and L / v e^delay where the speed is wrong."""
    road = RoadInputs(spectra, AHEAD, SIDES)
    for delay in (0.0, 0.03):
        matrix = inputs(road, road_parameters(waviness=2.0, delay=delay))
        lag = WHEELBASE / spectra.speeds[:, None] * np.exp(delay)
        expected = np.exp(-2j * np.pi * spectra.grid * lag)
        assert matrix[:, :, 2, 0] / matrix[:, :, 0, 0] == pytest.approx(expected, abs=1e-9)


def test_a_spread_of_the_speed_blurs_the_delay(spectra, inputs) -> None:
    """Mean of e^(-i w L / v) over normal delays of 2 %: smaller by exp(-(0.02 w L / v)^2 / 2), the phase stays."""
    sharp, blurred = (RoadInputs(replace(spectra, spreads=np.full(3, s)), AHEAD, SIDES) for s in (0.0, 0.02))
    parameters = road_parameters(waviness=2.0, delay=0.0)
    ratio = inputs(blurred, parameters)[:, :, 2, 0] / inputs(sharp, parameters)[:, :, 2, 0]
    draws = 1 + 0.02 * np.random.default_rng(1).standard_normal(200_000)
    phase = 2 * np.pi * spectra.grid[40] * WHEELBASE / spectra.speeds[0]
    assert ratio[0, 40] == pytest.approx(abs(np.mean(np.exp(-1j * phase * draws))), abs=0.005)
    assert np.abs(ratio.imag).max() < 1e-12


def test_left_and_right_are_coherent_over_long_waves_only(spectra, inputs) -> None:
    """exp(-n l) of one axle: 1 / e at a wavelength of the coherence length."""
    road = RoadInputs(spectra, AHEAD, SIDES)
    matrix = inputs(road, road_parameters(waviness=2.0, delay=0.0))
    coherence = (matrix[2, :, 0, 1] / matrix[2, :, 0, 0]).real
    n = spectra.grid / spectra.speeds[2]
    assert np.interp(1 / 1.5, n, coherence) == pytest.approx(np.exp(-1), rel=1e-3)
    assert np.interp(0.1, n, coherence) == pytest.approx(np.exp(-0.15), rel=1e-3)


def test_deviations_of_a_road_are_a_smooth_process_without_a_straight_part() -> None:
    """At the knots: e^(-1/2) at a distance of 1.2 in ln n but for the straight part; constant beyond the knots."""
    knots = np.geomspace(0.02, 8.0, 8)
    deviations = road_deviations(knots)
    line = np.stack([np.ones(8), np.log(knots)])
    assert deviations @ line.T == pytest.approx(np.zeros((6, 2)), abs=1e-9)
    distance = np.subtract.outer(np.log(knots), np.log(knots))
    curved = np.eye(8) - np.linalg.pinv(line) @ line
    expected = curved @ (0.49 * np.exp(-(distance**2) / 2 / 1.2**2)) @ curved
    assert deviations.T @ deviations == pytest.approx(expected, abs=1e-9)
    assert road_deviations(np.array([0.001, 100.0])) == pytest.approx(deviations[:, [0, -1]])
    n = np.geomspace(0.02, 8.0, 200)
    between = road_deviations(n)
    spline = CubicSpline(np.log(knots), deviations, axis=1, bc_type="natural")
    assert between == pytest.approx(spline(np.log(n)), abs=1e-12)
    assert np.abs(np.diff(between, axis=1)).max() < 0.05


def test_a_deviation_scales_the_density_of_a_road(spectra, inputs) -> None:
    road = RoadInputs(spectra, AHEAD, SIDES)
    straight, curved = (inputs(road, road_parameters(deviations=(a, 0, 0, 0, 0, 0))) for a in (0.0, 2.0))
    n = spectra.grid / spectra.speeds[1]
    assert (curved / straight)[1, :, 2, 1].real == pytest.approx(np.exp(2 * road_deviations(n)[0]))


def test_a_wheel_averages_waves_as_long_as_its_contact(spectra, inputs) -> None:
    """The mean of a sine over one wavelength is 0, over half a wavelength at its crest 2 / pi."""
    step = spectra.grid[50] / spectra.speeds[0]
    parameters = road_parameters(waviness=2.0, delay=0.0)
    point, half, whole = (
        inputs(RoadInputs(spectra, AHEAD, SIDES, contact_length=length), parameters)[0, 50, 0, 0].real
        for length in (1e-9, 0.5 / step, 1 / step)
    )
    assert half / point == pytest.approx((2 / np.pi) ** 2, rel=1e-6)
    assert whole / point == pytest.approx(0, abs=1e-20)


def test_a_track_falls_off_by_two_more_powers_beyond_its_bend(spectra, inputs) -> None:
    n = spectra.grid / spectra.speeds[0]
    bend, cross = n[15], np.sqrt(2) * n[10]
    track = RailInputs(spectra, AHEAD, SIDES, contact_length=1e-9)
    matrix = inputs(track, [np.log(1e-6), 2.0, np.log(bend), np.log(cross), 0.0])
    common = (matrix[0, :, 0, 0] + matrix[0, :, 0, 1]).real / 2
    relative = common * spectra.speeds[0] / (1e-6 * (n / 0.1) ** -2.0)
    assert relative[15] == pytest.approx(1 / 2)
    assert relative[-1] == pytest.approx(1 / (1 + (n[-1] / bend) ** 2))
    coherence = (matrix[0, :, 0, 1] / matrix[0, :, 0, 0]).real
    assert coherence[10] == pytest.approx(1 / 2)


def test_each_class_may_have_a_rougher_road(car, spectra) -> None:
    nominal = structure(car)
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    terms = replace(terms, inputs=np.ones_like(terms.inputs))
    scaled = ClassRoughness(3).contribute(np.log([1.0, 0.5, 2.0]), terms).inputs
    assert scaled[:, 0, 0, 0].real == pytest.approx([1.0, 0.5, 2.0])
    assert ClassRoughness(3).values(np.log([1.0, 0.5, 2.0])) == pytest.approx(
        {"class_0": 1.0, "class_1": 0.5, "class_2": 2.0}
    )
