"""Refinement: modes at the bound where the model is true, untouched modes and the reason where it is not."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.runs import modes_of

from sprung.identification import IdentificationSettings, as_in_thesis, cov_ssi
from sprung.identification.band_fits import RecordSpectra
from sprung.identification.refinement import refined_by_spectra
from sprung.likelihood.modal_spectra import LineSums, line_edges
from sprung.modal import unit_shapes
from sprung.recording import Channel
from sprung.signals.spectrum import Exponential, ShortPass
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain

RATE = 1000.0
FREQUENCY, DAMPING = np.array([3.0, 3.06, 7.0]), np.array([0.01, 0.012, 0.02])


def refinement_of(identification):
    """Return what the refinement of an identification changed."""
    assert identification.refinement is not None
    return identification.refinement


def exact_spectra(shapes, quantities, *, duration=1e3, noise=1e-3):
    """Return the sums that records of exactly the expected spectra have, and the channels."""
    edges = line_edges(0.5, 20.0, duration=duration)
    frequencies = (edges[1:] + edges[:-1]) / 2
    x = frequencies[:, None] / FREQUENCY
    responses = 1 / (1 - x**2 + 2j * DAMPING * x)
    moved = responses[:, None, :] * shapes.T
    forces = np.array([[1.0, 0.2, 0.1], [0.2, 1.5, 0.3], [0.1, 0.3, 2.0]])
    powers = np.array([{"displacement": 0, "velocity": 1}.get(quantity, 2) for quantity in quantities])
    tilt = (frequencies[:, None] / 3.0) ** powers
    motion = moved @ forces @ moved.conj().swapaxes(-1, -2)
    matrices = motion * tilt[:, :, None] * tilt[:, None, :] + noise * np.eye(len(quantities))
    n_lines = np.diff(edges) * duration
    moments = np.array([n_lines, n_lines * frequencies, n_lines * frequencies**2])
    channels = tuple(Channel(f"s{k}", quantity) for k, quantity in enumerate(quantities))
    lines = LineSums(edges, moments, matrices * n_lines[:, None, None], duration)
    return RecordSpectra(lines, (), np.zeros(0, dtype=np.intp), RATE), channels


@pytest.mark.parametrize(
    "quantities",
    [("acceleration",) * 3, ("displacement",) * 3, ("acceleration", "velocity", "displacement"), ("unknown",) * 12],
)
def test_exact_spectra_give_exact_modes(quantities) -> None:
    generator = np.random.default_rng(0)
    shapes = generator.normal(size=(3, len(quantities)))
    spectra, channels = exact_spectra(shapes, quantities)
    powers = np.array([{"displacement": 0, "velocity": 1}.get(quantity, 2) for quantity in quantities])
    seen = unit_shapes((shapes * (FREQUENCY[:, None] / 3.0) ** powers).astype(complex))
    factor = np.array([1.0005, 0.9995, 1.001])
    start = modes_of(
        FREQUENCY * factor, DAMPING * np.array([1.05, 0.97, 1.04]), seen + 0.01 * generator.normal(size=seen.shape)
    )
    start = replace(start, natural_frequency_std=np.full(3, 0.05), damping_ratio_std=np.full(3, 0.01))
    modes, refinement = refined_by_spectra(start, spectra, channels)
    assert refinement.reasons == ("", "", "")
    assert modes.natural_frequency == pytest.approx(FREQUENCY, rel=3e-4)  # 0.4 standard deviations
    assert modes.damping_ratio == pytest.approx(DAMPING, rel=0.02)
    assert modes.mode_shapes == pytest.approx(seen, abs=0.02)
    assert np.all(np.isfinite(modes.mode_shape_std))


def test_forces_held_over_samples_hardly_move_refined_frequencies() -> None:
    """Without noise and chance. Delayed by half a sample only: the same; with frequencies from 1 Hz on: 0.26 %."""
    system, rate, duration = chain(), 500.0, 60.0
    held, exact = system.discretised(rate), system.modes()
    edges = line_edges(1.0, 50.0, duration=duration)
    frequencies = (edges[1:] + edges[:-1]) / 2
    turns = np.exp(2j * np.pi * frequencies / rate)[:, None, None] * np.eye(len(held.state_matrix))
    responses = held.output_matrix @ np.linalg.solve(turns - held.state_matrix, held.input_matrix) + held.feedthrough
    matrices = np.asarray(responses @ responses.conj().swapaxes(-1, -2), dtype=np.complex128)
    matrices += 1e-9 * np.abs(matrices).max() * np.eye(3)
    n_lines = np.diff(edges) * duration
    moments = np.array([n_lines, n_lines * frequencies, n_lines * frequencies**2])
    lines = LineSums(edges, moments, matrices * n_lines[:, None, None], duration)
    spectra = RecordSpectra(lines, (), np.zeros(0, dtype=np.intp), rate)
    start = modes_of(exact.natural_frequency, exact.damping_ratio, exact.mode_shapes, std=0.2, damping_std=0.01)
    modes, refinement = refined_by_spectra(start, spectra, system.outputs.channels)
    assert not any(refinement.reasons)
    assert modes.natural_frequency == pytest.approx(exact.natural_frequency, rel=1e-3)


def test_a_mode_far_from_the_largest_likelihood_keeps_its_values() -> None:
    shapes = np.random.default_rng(0).normal(size=(3, 3))
    spectra, channels = exact_spectra(shapes, ("unknown",) * 3)
    start = modes_of(FREQUENCY * np.array([1, 1, 1.01]), DAMPING, unit_shapes(shapes.astype(complex)), std=0.01)
    modes, refinement = refined_by_spectra(start, spectra, channels)
    assert [not reason for reason in refinement.reasons] == [True, True, False]
    assert "refined values too far from" in refinement.reasons[2]
    assert modes.poles[2] == start.poles[2]
    assert np.isnan(modes.natural_frequency_std).sum() == 0
    assert refinement.notes == ("modes not refined: 7.07 Hz (refined values too far from those of the subspace)",)


def test_heavily_damped_and_unresolved_modes_keep_their_values() -> None:
    shapes = np.eye(3)[:, :3].astype(complex)
    spectra, channels = exact_spectra(shapes.real, ("unknown",) * 3, duration=40.0)
    start = modes_of(FREQUENCY, np.array([1e-3, 0.02, 0.3]), unit_shapes(shapes))
    modes, refinement = refined_by_spectra(start, spectra, channels)
    assert "peak too narrow for stretches of 40 s: record longer" in refinement.reasons[0]
    assert "damped by more than 15 %" in refinement.reasons[2]
    assert np.array_equal(modes.poles[[0, 2]], start.poles[[0, 2]])


@pytest.fixture(scope="module")
def runs(vehicle):
    chain = vehicle("chain3")
    excitation = usual_excitation(chain)
    return [simulate(chain, excitation, duration=60.0, sampling_rate=500.0, snr=10.0, seed=seed) for seed in range(8)]


@pytest.mark.slow
def test_refined_modes_scatter_less_and_as_stated(runs, vehicle) -> None:
    exact = vehicle("chain3").modes()
    refined, start, stated, shape_errors = [], [], [], []
    for run in runs:
        identified = cov_ssi(run)
        assert not any(refinement_of(identified).reasons)
        assert refinement_of(identified).bands[0].fits
        modes, before = identified.modes, refinement_of(identified).start
        refined.append([modes.natural_frequency, modes.damping_ratio])
        start.append([before.natural_frequency, before.damping_ratio])
        stated.append([modes.natural_frequency_std, modes.damping_ratio_std])
        error, std = modes.mode_shapes - exact.mode_shapes, modes.mode_shape_std
        shape_errors += [
            (error.real[std.real > 0] / std.real[std.real > 0]),
            error.imag[std.imag > 0] / std.imag[std.imag > 0],
        ]
    truth = np.array([exact.natural_frequency, exact.damping_ratio])
    z = (np.array(refined) - truth) / np.array(stated)
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3
    assert 0.7 < np.sqrt(np.mean(np.concatenate(shape_errors) ** 2)) < 1.3
    ratio = np.mean((np.array(refined) - truth) ** 2, axis=0) / np.mean((np.array(start) - truth) ** 2, axis=0)
    assert np.exp(np.mean(np.log(ratio))) < 0.9


def test_refinement_of_modes_from_elsewhere_says_so(runs) -> None:
    identified = cov_ssi(runs[0])
    refinement = refinement_of(identified)
    turned = refinement.of(identified.modes, np.array([2, -1, 0]), instead="picked")
    assert turned.reasons == ("", "picked", "")
    np.testing.assert_array_equal(turned.distances, refinement.distances[[2, 0, 0]] * [1, np.nan, 1])
    np.testing.assert_array_equal(turned.start.poles[[0, 2]], refinement.start.poles[[2, 0]])
    assert turned.start.poles[1] == identified.modes.poles[1]
    assert [sorted(band.modes) for band in turned.bands] == [
        sorted({0: 2, 2: 0}[k] for k in band.modes if k != 1) for band in refinement.bands if set(band.modes) != {1}
    ]


def test_nothing_is_refined_where_spectra_are_edited_or_it_is_switched_off(runs) -> None:
    for lifter in (ShortPass(3.0), Exponential(2.0)):
        edited = cov_ssi(runs[0], settings=IdentificationSettings(lifter=lifter))
        assert edited.refinement is None
        assert any("modes not refined: cepstrum editing" in note for note in edited.notes)
    for settings in (IdentificationSettings(refine=False), as_in_thesis()):
        plain = cov_ssi(runs[0], settings=settings)
        assert plain.refinement is None
        assert not any("refined" in note for note in plain.notes)
        assert np.isnan(plain.modes.mode_shape_std).all()


def test_a_line_beside_a_mode_is_left_out(runs, vehicle) -> None:
    exact, run = vehicle("chain3").modes(), runs[1]
    times = np.arange(run.samples.shape[1]) / run.sampling_rate
    disturbed = replace(run, samples=run.samples + run.samples.std() * np.sin(2 * np.pi * 12.0 * times))
    identified = cov_ssi(disturbed)
    for mode, reason in zip(identified.modes.natural_frequency, refinement_of(identified).reasons, strict=True):
        assert np.min(np.abs(mode / exact.natural_frequency - 1)) < 0.02
        assert not reason
