"""Rail joints: their lines, their distance from the data, and what a fit makes of a jointed track."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.excitation import Crossings, Joints, Rail
from sprung.likelihood import ClassSpectra, RailInputs, fit_corners, rigid_layout
from sprung.likelihood.joints import comb
from sprung.likelihood.spectra import through_window
from sprung.likelihood.terms import nominal_terms
from sprung.simulation import RailDrive, simulate_drive
from sprung.vehicles import read_vehicle, structure

SIDES = np.array([1.0, -1.0, 1.0, -1.0])


def class_of(speed, spread, *, length=4.0):
    """One speed class without data."""
    f = np.arange(8, 120) / length
    one = np.ones((1, f.size, 1, 1), dtype=complex)
    return ClassSpectra(f, np.ones(1), np.array([speed]), np.array([spread]), one, length, np.ones((1, f.size)))


def test_lines_are_those_of_windowed_impulses_at_equal_distances() -> None:
    """Mean periodogram of Hann-windowed impulse trains at speeds about 20 m/s, over that of impulses at random."""
    spectra, generator = class_of(20.0, 0.01), np.random.default_rng(1)
    power = np.zeros(spectra.frequencies.size)
    for speed in 20.0 * (1 + 0.01 * generator.standard_normal(4000)):
        times = (np.arange(0, 4.0 * speed + 20, 18.0) - generator.uniform(0, 18.0)) / speed
        times = times[(times > 0) & (times < 4.0)]
        window = np.sin(np.pi * times / 4.0) ** 2
        power += np.abs(np.exp(-2j * np.pi * spectra.frequencies[:, None] * times) @ window) ** 2
    impulses_at_random = 20.0 / 18.0 * (3 / 8 * 4.0)  # rate times the power of the window
    lines = through_window(comb(spectra, 18.0)[..., None, None])[0, :, 0, 0]
    truth = power / 4000 / impulses_at_random
    assert lines[40:] == pytest.approx(truth[40:], abs=0.07)
    assert lines[:40] == pytest.approx(truth[:40], abs=0.4)  # the grid cannot hold lines sharper than its bins
    assert np.mean(lines - truth) == pytest.approx(0, abs=0.05)


def test_lines_of_the_other_rail_have_the_phase_of_its_distance() -> None:
    """Mean cross periodogram of a train of impulses and of one 5.4 m ahead, over that of impulses at random."""
    spectra, generator = class_of(20.0, 0.01), np.random.default_rng(1)
    power = np.zeros(spectra.frequencies.size, dtype=complex)
    for speed in 20.0 * (1 + 0.01 * generator.standard_normal(4000)):
        places = np.arange(0, 4.0 * speed + 60, 18.0) - generator.uniform(18, 36)
        lines = []
        for times in (places / speed, (places + 5.4) / speed):
            inside = times[(times > 0) & (times < 4.0)]
            window = np.sin(np.pi * inside / 4.0) ** 2
            lines.append(np.exp(-2j * np.pi * spectra.frequencies[:, None] * inside) @ window)
        power += lines[0] * lines[1].conj()
    cross = through_window(comb(spectra, 18.0, 5.4 / 18)[..., None, None])[0, :, 0, 0]
    truth = power / 4000 / (20.0 / 18.0 * (3 / 8 * 4.0))
    assert np.abs(cross[40:] - truth[40:]).max() < 0.08
    assert np.abs(cross[:40] - truth[:40]).max() < 0.4


def test_joints_of_one_rail_are_under_its_wheels(classes) -> None:
    """The left rail without any has the density of a smooth track, and both rails have its cross spectrum."""
    nominal = structure(read_vehicle("zafira"))
    spectra = classes(3, n_classes=2)
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    smooth = RailInputs(spectra, np.array([1.0, 1.0, -1.0, -1.0]), SIDES)
    jointed = replace(smooth, pitch=18.0)
    values = dict(zip(jointed.names, jointed.start, strict=True)) | {"joint_left": -60.0}
    right = jointed.contribute(np.array(list(values.values())), terms).inputs
    none = smooth.contribute(smooth.start, terms).inputs
    left_and_cross = np.array([0, 0, 0, 2, 2, 2, 1, 3]), np.array([0, 1, 2, 0, 1, 3, 2, 0])
    assert np.allclose(right[..., *left_and_cross], none[..., *left_and_cross], rtol=1e-9)
    n = spectra.grid / spectra.speeds[:, None]
    dips = 1e-6 * 1e-4 * np.exp(2) / (1 + n**2) ** 2 * np.sinc(0.1 * n) ** 2 / spectra.speeds[:, None]
    lines = np.maximum(comb(spectra, 18.0).real, 1e-3)
    assert (right - none)[..., 3, 3].real == pytest.approx(dips * lines, rel=1e-6)


def test_a_smooth_track_is_that_of_erri_b176() -> None:
    """Auto and cross spectra of the rails, of the common and the differing part that simulations draw."""
    spectra = class_of(20.0, 0.0)
    nominal = structure(read_vehicle("y25"))
    terms = nominal_terms(nominal, rigid_layout(nominal), replace(spectra, matrices=np.ones((1, 112, 5, 5), complex)))
    track = RailInputs(spectra, np.array([1.0, 1.0, -1.0, -1.0]), SIDES, contact_length=1e-9)
    rail, n = Rail(4.032e-7), spectra.grid / 20.0
    bend, cross = 0.8246 / (2 * np.pi), 0.4380 / (2 * np.pi)
    level = 2 * np.pi * 4.032e-7 / (2 * np.pi * 0.1) ** 2
    matrix = track.contribute(np.array([np.log(level), 2.0, np.log(bend), np.log(cross), 0.0]), terms).inputs[0]
    above = 1 / (1 + (0.0206 / (2 * np.pi * n)) ** 2)  # the lowest bend, which the likelihood leaves out
    auto, between = rail.common(n) + rail.differing(n), rail.common(n) - rail.differing(n)
    assert matrix[:, 0, 0].real * 20.0 * above == pytest.approx(auto, rel=1e-9)
    assert matrix[:, 0, 1].real * 20.0 * above == pytest.approx(between, rel=1e-9)


@pytest.fixture(scope="module")
def bogie():
    """The Y25 on a track, with the sensors of its frame."""
    y25 = read_vehicle("y25").model_copy(update={"kind": "rail"})
    return y25.model_copy(update={"sensor": y25.sensor[:4]})


def drive(bogie, seed, minutes=4.0, **track):
    settings = RailDrive(duration=60 * minutes, sampling_rate=200.0, speed=(15.0, 30.0), snr=50.0, **track)
    return simulate_drive(bogie, settings, seed=seed).recording


@pytest.mark.slow
@pytest.mark.parametrize("pitch", [12.5, 18.0, 25.0, None])
def test_the_distance_of_the_joints_is_found_and_the_springs_are_right(bogie, pitch) -> None:
    """Model error 57 % and springs to 11 % without lines of joints in the model."""
    track = {"joints": Joints(rail_length=pitch)} if pitch else {"welded": True}
    fit = fit_corners(drive(bogie, 1, **track), bogie)
    assert fit.model_error < 0.1
    springs = [row for row, component in enumerate(fit.components) if component.kind == "spring"]
    assert np.all(fit.log_ratios_std[springs] < 0.03)
    assert np.all(np.abs(fit.log_ratios[springs]) < 4 * fit.log_ratios_std[springs])
    assert any("rail joints every" in note for note in fit.notes) == bool(pitch)
    assert not any(component.kind == "tyre" for component in fit.components)
    found = [block.pitch for block in fit.model.blocks if isinstance(block, RailInputs)]
    assert found == [np.inf if pitch is None else pytest.approx(pitch, rel=0.01)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "track",
    [
        {"joints": Joints(rail_length=36.0)},  # two are not within one segment of 3 s
        {"welded": True, "crossings": Crossings(per_kilometre=10.0, share_of_both_rails=1.0)},
    ],
)
def test_impacts_without_a_distance_are_explained(bogie, track) -> None:
    """Model error 87 and 56 %, and springs to 8 to 10 %, where a track without a distance of joints has no impacts."""
    fit = fit_corners(drive(bogie, 1, minutes=3.0, **track), bogie)
    springs = [row for row, component in enumerate(fit.components) if component.kind == "spring"]
    assert fit.model_error < 0.1
    assert np.all(fit.log_ratios_std[springs] < 0.01)
    assert np.all(np.abs(fit.log_ratios[springs]) < 4 * fit.log_ratios_std[springs])
    assert not any("joints" in note for note in fit.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joints", "found"),
    [
        (Joints(18.0, side="right"), (18.0, None)),
        (Joints(25.0, stagger=12.5), (25.0, 0.5)),
        (Joints(18.0, stagger=5.4), (18.0, 0.3)),
    ],
)
def test_joints_of_one_rail_or_not_at_once_on_both_are_explained(bogie, joints, found) -> None:
    """Every 18 m of one rail 29 %, alternating 33 %, springs to 3 to 7 %, with joints on both rails at once."""
    fit = fit_corners(drive(bogie, 1, minutes=3.0, joints=joints), bogie)
    (track,) = (block for block in fit.model.blocks if isinstance(block, RailInputs))
    assert track.pitch == pytest.approx(found[0], rel=0.002)
    if found[1]:
        assert track.offset == pytest.approx(found[1], abs=0.005)
    springs = [row for row, component in enumerate(fit.components) if component.kind == "spring"]
    assert fit.model_error < 0.1
    assert np.all(fit.log_ratios_std[springs] < 0.015)
    assert np.all(np.abs(fit.log_ratios[springs]) < 3 * fit.log_ratios_std[springs])


@pytest.mark.slow
def test_two_sensors_name_no_healthy_spring_for_crossings() -> None:
    """Without impacts in the model a spring of this drive is 5.7 standard deviations off."""
    metro = read_vehicle("metro")
    names = ("bogie1_fl", "body_fl")
    metro = metro.model_copy(update={"sensor": tuple(one for one in metro.sensor if one.channel in names)})
    crossings = Crossings(per_kilometre=10.0, share_of_both_rails=1.0)
    settings = RailDrive(duration=180.0, sampling_rate=100.0, snr=50.0, welded=True, crossings=crossings)
    fit = fit_corners(simulate_drive(metro, settings, seed=1).recording, metro)
    assert np.abs(fit.log_ratios / fit.log_ratios_std)[fit.is_identifiable].max() < 3


@pytest.mark.slow
def test_no_multiple_of_the_distance_is_found(coach) -> None:
    """The motion of this drive repeats itself after 36 m even more than after 18 m."""
    settings = RailDrive(duration=300.0, sampling_rate=100.0, speed=(35.0, 37.0), snr=30.0, quality="good")
    fit = fit_corners(simulate_drive(coach, settings, seed=1).recording, coach)
    assert any("rail joints every 18.0 m" in note for note in fit.notes)
    assert fit.model_error < 0.15


@pytest.mark.slow
def test_joints_sharpen_a_speed_that_was_not_recorded() -> None:
    """Refused (the speed of only 8 of 77 segments) where joints are no part of the estimate of the speed."""
    metro = read_vehicle("metro")
    names = ("bogie1_fl", "body_fl")
    metro = metro.model_copy(update={"sensor": tuple(one for one in metro.sensor if one.channel in names)})
    settings = RailDrive(duration=300.0, sampling_rate=100.0, speed=(14.5, 18.5), snr=30.0)
    fit = fit_corners(simulate_drive(metro, settings, seed=4).recording.select(names), metro)
    assert fit.model_error < 0.1
    near = [
        row
        for row, part in enumerate(fit.components)
        if part.corner.startswith("bogie1_f") and part.kind == "primary_spring"
    ]
    assert np.abs(fit.log_ratios[near]).max() < 0.05
    assert np.abs(fit.log_ratios / fit.log_ratios_std)[fit.is_identifiable].max() < 3.5
