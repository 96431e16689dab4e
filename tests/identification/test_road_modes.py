"""Modes of a car on a road: those of the vehicle fitted to its spectra, next to what SSI adds."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.identification import METHODS, SUBSPACE_METHODS, IdentificationSettings, as_in_thesis, cov_ssi
from sprung.identification.road_modes import (
    doubts,
    fit_of_road,
    has_road,
    kept_records,
    modes_of_fit,
    unexplained,
    with_road_modes,
)
from sprung.modal import Modes, mac
from sprung.recording import Channel, Recording
from sprung.signals.spectrum import SpectralMatrix
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle, structure

CAR = read_vehicle("zafira")
BODY = ("bounce", "pitch", "roll")


@pytest.fixture(scope="module")
def drive():
    """Two minutes at changing speed."""
    return simulate_drive(CAR, RoadDrive(duration=120.0, speed=(6.0, 25.0), snr=50.0), seed=3)


@pytest.fixture(scope="module")
def fit(drive):
    return fit_of_road([drive.recording], CAR)


def outputs(fit):
    return tuple(channel for channel in fit.model.structure.outputs.channels)


def some_modes(frequencies, shapes, fit, *, damping=0.05):
    f, unknown = np.array(frequencies), np.full(len(frequencies), np.nan)
    names = tuple(channel.name for channel in outputs(fit))
    poles = 2 * np.pi * f * (1j * np.sqrt(1 - damping**2) - damping)
    shapes = np.array(shapes, dtype=complex)
    return Modes(poles, shapes, names, unknown, unknown, np.ones(len(f)), (None,) * len(f))


def white(fit, *, peak=None):
    """Spectra of independent white noise in all channels, with a resonance of bounce if a frequency is given."""
    f = np.arange(512) / 5.12
    matrix = np.repeat(np.eye(4, dtype=complex)[..., None], f.size, axis=2)
    if peak is not None:
        matrix = matrix + np.ones((4, 4, 1)) / np.abs(1 - (f / peak) ** 2 + 0.1j * f / peak) ** 2
    return SpectralMatrix(f, matrix, tuple(channel.name for channel in outputs(fit)), 5.12, 40)


@pytest.mark.slow
@pytest.mark.parametrize("method", [*SUBSPACE_METHODS, "plscf"])
def test_every_method_gives_the_three_modes_of_the_body_and_none_false(drive, method) -> None:
    found = METHODS[method](drive.recording, vehicle=CAR)
    truth = structure(CAR).modes()
    assert found.modes.labels[:3] == BODY
    assert found.sources[:3] == ("road_likelihood",) * 3
    z = np.array(
        [
            (found.modes.natural_frequency[:3] - truth.natural_frequency[:3]) / found.modes.natural_frequency_std[:3],
            (found.modes.damping_ratio[:3] - truth.damping_ratio[:3]) / found.modes.damping_ratio_std[:3],
        ]
    )
    assert np.abs(z).max() < 2.5
    assert np.all(found.modes.natural_frequency_std[:3] < 0.05 * found.modes.natural_frequency[:3])
    assert np.diag(mac(found.modes.mode_shapes[:3], truth.mode_shapes[:3])).min() > 0.98
    assert set(found.modes.labels[3:]) <= {"wheel_hop"}
    near = np.abs(found.modes.natural_frequency[:, None] / truth.natural_frequency - 1).min(axis=1)
    assert near.max() < 0.1
    assert np.all(np.diff(found.modes.natural_frequency) > 0)
    (note,) = [note for note in found.notes if "fitted to the spectra on the road" in note]
    assert note.startswith("bounce, pitch, roll")
    assert found.members.shape == (len(found.modes), len(found.subsets))


def test_modes_by_ssi_stay_in_the_subsets_and_lead_to_the_modes_that_replace_them(drive) -> None:
    ours = cov_ssi(drive.recording, vehicle=CAR)
    ssi = cov_ssi(drive.recording, vehicle=CAR, settings=IdentificationSettings(has_road_modes=False))
    assert set(ssi.sources) == {"ssi"}
    assert not any("road" in note for note in ssi.notes)
    np.testing.assert_array_equal(ours.subsets[0].modes.poles, ssi.subsets[0].modes.poles)
    for mode, (member,) in enumerate(ours.members):
        if member >= 0:
            own = ssi.subsets[0].modes.natural_frequency[member]
            assert own == pytest.approx(ours.modes.natural_frequency[mode], rel=0.25)
            assert ours.modes.stable_rate[mode] > 0
        else:
            assert ours.modes.stable_rate[mode] == 0


def test_without_the_speed_modes_are_by_ssi_with_a_note(drive) -> None:
    recording = drive.recording.select([name for name in drive.recording.names if name != "speed"])
    found = cov_ssi(recording, vehicle=CAR)
    assert set(found.sources) <= {"ssi"}
    (note,) = [note for note in found.notes if "all modes are by SSI" in note]
    assert note.endswith("no recording has the speed of the vehicle: record it")


def test_only_a_car_with_tyres_and_sensors_has_a_road() -> None:
    settings = IdentificationSettings()
    assert has_road(CAR, settings)
    assert not has_road(CAR, IdentificationSettings(has_road_modes=False))
    assert not has_road(CAR, as_in_thesis())
    axles = tuple(axle.model_copy(update={"tyre_stiffness": None}) for axle in CAR.axle)
    for other in ({"axle": axles}, {"sensor": ()}, {"kind": "rail"}):
        assert not has_road(CAR.model_copy(update=other), settings)


@pytest.mark.parametrize(
    ("component", "factor", "model_error", "doubt"),
    [
        ("spring", 1.2, 0.6, "the spectra deviate 60 %"),
        ("spring", 3.0, 0.2, "front springs 3 times the file's"),
        ("spring", 0.2, 0.0, "the bounce of the fitted vehicle is implausible"),
        ("damper", 4.5, 0.0, "% damped"),
    ],
)
def test_a_fit_of_another_vehicle_is_refused(fit, component, factor, model_error, doubt) -> None:
    nominal = replace(fit, parameters=fit.model.start, model_error=0.0)
    assert doubts(nominal) == ""
    parameters = fit.model.start.copy()
    rows = [row for row, name in enumerate(fit.model.names) if name.endswith(f".{component}")]
    parameters[rows] = np.log(factor)
    unlike = replace(fit, parameters=parameters, covariance=1e-6 * fit.covariance, model_error=model_error)
    assert doubt in doubts(unlike)


def test_without_a_vehicle_file_or_with_one_of_a_rig_nothing_is_fitted(drive) -> None:
    rig = CAR.model_copy(update={"kind": "rig"})
    for vehicle in (None, rig):
        found = cov_ssi(drive.recording.part(0, 12_000), vehicle=vehicle)
        assert set(found.sources) <= {"ssi"}
        assert not any("by SSI" in note for note in found.notes)


def test_modes_of_a_fit_that_found_the_nominal_car_are_its_exact_modes(fit) -> None:
    nominal = replace(fit, parameters=fit.model.start, model_error=0.0)
    names = tuple(reversed([channel.name for channel in outputs(fit)]))
    modes, exact = modes_of_fit(nominal, names), structure(CAR).modes()
    assert modes.labels[:3] == BODY
    np.testing.assert_allclose(modes.poles[:3], exact.poles[:3], rtol=1e-9)
    np.testing.assert_allclose(modes.mode_shapes[:3], exact.mode_shapes[:3, ::-1], atol=1e-9)


@pytest.mark.parametrize("error", [0.0, 0.2])
def test_deviations_hold_chance_the_misfit_and_what_is_not_linear(fit, error) -> None:
    certain = replace(fit, covariance=np.zeros_like(fit.covariance), model_error=error)
    modes = modes_of_fit(certain, [channel.name for channel in outputs(fit)]).take(np.arange(3))
    share = modes.natural_frequency_std / modes.natural_frequency
    np.testing.assert_allclose(share, np.hypot(0.015, error * modes.damping_ratio / 4), rtol=1e-9)
    relative = modes.damping_ratio_std / modes.damping_ratio
    np.testing.assert_allclose(relative, np.hypot(0.06, error), rtol=1e-9)
    by_chance = modes_of_fit(replace(fit, model_error=error), modes.channels)
    assert np.all(by_chance.natural_frequency_std[:3] > modes.natural_frequency_std)


def test_a_drive_that_says_nothing_gives_no_modes(fit) -> None:
    """The covariance is that of the prior."""
    unsure = replace(fit, covariance=np.diag(fit.model.prior_std**2))
    assert len(modes_of_fit(unsure, [channel.name for channel in outputs(fit)])) == 0


def test_wheel_hops_next_to_what_the_file_lacks_are_left_out(fit) -> None:
    names = [channel.name for channel in outputs(fit)]
    assert "wheel_hop" in modes_of_fit(replace(fit, model_error=0.05), names).labels
    assert modes_of_fit(replace(fit, model_error=0.2), names).labels == BODY


def test_modes_by_ssi_that_the_fitted_vehicle_explains_are_left_out(fit) -> None:
    """One of the body, one between body and wheels, a twist, one with more power than the fit has, and two beyond."""
    bounce, twist = [1, 1, 1, 1], [1, -1, -1, 1]
    explained = replace(fit, misfit=np.zeros_like(fit.misfit), model_error=0.0)
    modes = some_modes([1.6, 8.0, 8.0, 22.5], [bounce, bounce, twist, bounce], fit)
    assert unexplained(modes, explained, outputs(fit), white(fit)).tolist() == [False, False, True, False]
    assert unexplained(modes, explained, outputs(fit), white(fit, peak=22.5)).tolist() == [False, False, True, True]
    frequencies = fit.model.spectra.frequencies
    more = np.where(np.abs(frequencies - 8) < 1, 1.0, 0.0) * np.array([[1.0], [0.0], [0.0]])
    noisy = replace(explained, misfit=more)
    assert unexplained(modes, noisy, outputs(fit), white(fit)).tolist() == [False, True, True, False]


def test_each_mode_names_its_source_and_the_mode_that_it_replaces(fit) -> None:
    truth = structure(CAR).modes()
    shapes = [truth.mode_shapes[0], [1, -1, -1, 1]]
    modes = replace(some_modes([1.05 * truth.natural_frequency[0], 26.0], shapes, fit), labels=("bounce", "roll"))
    combined = with_road_modes(modes, fit, outputs(fit), white(fit))
    assert combined.modes.labels[:3] == BODY
    assert combined.modes.labels[-1] is None
    assert combined.sources[-1] == "ssi"
    assert combined.replaced.tolist()[:3] == [0, -1, -1]
    assert combined.replaced.tolist()[-1] == 1
    within = with_road_modes(modes, fit, outputs(fit), white(fit), band=(1.0, 5.0))
    assert within.sources == ("road_likelihood",) * 3 + ("ssi",)


def test_recordings_that_can_be_read_once_are_kept_within_bounds() -> None:
    def record(n_samples):
        return Recording(np.zeros((1, n_samples)), 100.0, (Channel("a"),))

    small, large = record(10), Recording(np.broadcast_to(np.zeros(1), (1, 2**25)), 100.0, (Channel("a"),))
    given, kept = kept_records(iter([small, large, small]), is_keeping=True)
    assert not isinstance(given, Recording)
    assert [recording.n_samples for recording in given] == [10, 2**25, 10]
    assert kept == [small]
    assert kept_records([small, small], is_keeping=False) == ([small, small], [small, small])
