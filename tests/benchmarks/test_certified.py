"""The certified answers against a second computation, and the records against the equations that they state."""

import gzip
import io
import json
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov

import sprung
from sprung.likelihood.modal import ModalModel, ModalParameters
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.recording import Channel
from sprung.vehicles import (
    MechanicalSystem,
    Outputs,
    exact_correlations,
    frequency_response,
    modes,
    structure,
)

ROOT = Path(__file__).parents[2]
ANSWERS = sorted((ROOT / "benchmarks" / "certified" / "answers").glob("*.json"))


@pytest.fixture(scope="module")
def certified() -> Any:
    """Modules of `benchmarks/certified`, which no package holds."""
    sys.path.insert(0, str(ROOT))
    try:
        names = ("systems", "records", "bounds", "car", "make", "score")
        found = {name: import_module(f"benchmarks.certified.{name}") for name in names}
        found["chain_bound"] = import_module("benchmarks.chain_bound")
    finally:
        sys.path.remove(str(ROOT))
    return SimpleNamespace(**found)


def answer(name: str) -> dict[str, Any]:
    return json.loads((ROOT / "benchmarks" / "certified" / "answers" / f"{name}.json").read_text())


def samples(file: str) -> np.ndarray:
    text = gzip.decompress((ROOT / "benchmarks" / "certified" / "data" / file).read_bytes()).decode()
    return np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1).T


def test_there_are_fourteen_records_and_they_are_small() -> None:
    assert len(ANSWERS) == 14
    assert sum(path.stat().st_size for path in (ANSWERS[0].parents[1] / "data").iterdir()) < 2e6


@pytest.mark.parametrize("path", ANSWERS, ids=lambda path: path.stem)
def test_modes_are_those_of_the_stated_matrices(path: Path, conforms: Any) -> None:
    """40 digits of mpmath against numpy's eigenvalues."""
    stated = answer(path.stem)
    sensors, mass = np.array(stated["sensors"]), np.array(stated["mass"])
    n = len(mass)
    coordinates = tuple(f"mass_{k}" for k in range(n))
    system = MechanicalSystem(
        mass, np.array(stated["damping"]), np.array(stated["stiffness"]), np.eye(n), coordinates, coordinates
    )
    channels = tuple(Channel(f"ch_{k}", "acceleration") for k in range(len(sensors)))
    exact = modes(system, Outputs(channels, sensors, np.zeros_like(sensors), np.zeros_like(sensors)))
    certified_modes = stated["modes"] + stated.get("optional_modes", [])
    for name, rtol in (("natural_frequency", 1e-10), ("damping_ratio", 1e-9)):
        what = f"{name} by eigenvalues in double precision"
        expected = [mode[name] for mode in certified_modes]
        conforms("Certified records", "answers of 40 digits", what, getattr(exact, name), expected, rel=rtol)
    shapes = np.array(
        [np.array(m["mode_shape"]["real"]) + 1j * np.array(m["mode_shape"]["imag"]) for m in certified_modes]
    )
    for shape, other in zip(exact.mode_shapes, shapes, strict=True):
        largest = np.argmax(np.abs(other))
        np.testing.assert_allclose(shape / shape[largest], other / other[largest], atol=1e-9)


def test_bounds_of_the_chain_are_those_of_sums_over_lines(certified: Any, conforms: Any) -> None:
    """Written apart: derivatives of second order, lines of the record, scales of shapes and forces left free."""
    for snr, name in ((10.0, "chain-snr10"), (0.5, "chain-snr05")):
        bound = certified.chain_bound.chain_bound(snr=snr, duration=60.0, sampling_rate=100.0)
        for key in ("natural_frequency", "damping_ratio"):
            stated = [mode[f"{key}_bound"] for mode in answer(name)["modes"]]
            what = f"bound of {key}, chain at SNR {snr:g}, against a second computation by sums over lines"
            conforms("Cramér-Rao bound", "certified records", what, getattr(bound, key), stated, rel=2e-3)


def test_bounds_of_light_modes_are_those_of_the_likelihood_of_modes(certified: Any, conforms: Any) -> None:
    """It has complex shapes and forces and free exponents besides, which cost light modes little."""
    record = certified.records.RECORDS["light-damping"]
    frequency, damping, shapes, forces = record.system.modal()
    duration = record.n_samples / record.rate
    lines = np.arange(int(0.3 * duration), int(10 * duration)) / duration
    counts, size = np.ones(lines.size), len(shapes)
    spectra = LineSpectra(lines, np.zeros(lines.size), counts, np.broadcast_to(np.eye(size), (lines.size, size, size)))
    largest = np.array([row[np.argmax(np.abs(row))] for row in shapes.T])
    scale = largest / (2 * np.pi * frequency)  # velocity of a mode of unit mass at x = f / f_k is x / (w_k (..))
    noise = (record.sampled(record.system, record.rate).rms() * 0.1) ** 2 * 2 / record.rate
    begin = ModalParameters(
        frequency, damping, np.zeros(1), np.zeros(3), (shapes / largest).T.astype(complex),
        2 * forces * np.outer(scale, scale) + 0j, noise, np.zeros(size),
    )  # fmt: skip
    model = ModalModel(spectra, begin, 1.0)
    information = model.information(model.start)
    information += np.diag(np.where(np.isfinite(model.prior_std), model.prior_std, np.inf) ** -2.0)
    deviations = np.sqrt(np.diag(np.linalg.inv(information)))
    stated = answer("light-damping")["modes"]
    of_frequency = deviations[model.rows["natural_frequency"]] * frequency
    of_damping = deviations[model.rows["damping_ratio"]] * damping
    for key, found in (("natural_frequency", of_frequency), ("damping_ratio", of_damping)):
        what = f"standard deviation of {key} by the likelihood of modes, light damping, against the bound"
        conforms(
            "Cramér-Rao bound", "certified records", what, found, [mode[f"{key}_bound"] for mode in stated], rel=0.01
        )


def test_bounds_of_the_building_are_those_of_the_uncertainty_law(conforms: Any) -> None:
    """Of single modes in long records without noise; noise, sampling and neighbours move them by a few per cent.

    S.-K. Au, Uncertainty law in ambient modal identification, Mechanical Systems and Signal Processing 48 (2014) 15-33:
    the variances of ln frequency and of the damping ratio both are the damping ratio over 2 pi times the periods.
    """
    stated = answer("iasc-asce")["modes"]
    frequency, damping = (np.array([mode[key] for mode in stated]) for key in ("natural_frequency", "damping_ratio"))
    deviation = np.sqrt(damping / (2 * np.pi * frequency * 40.0))
    for key, expected in (("natural_frequency", frequency * deviation), ("damping_ratio", deviation)):
        found = [mode[f"{key}_bound"] for mode in stated]
        what = f"bound of {key}, building of IASC-ASCE, against the law for long records of single modes without noise"
        conforms("Cramér-Rao bound", "certified records", what, found, expected, rel=0.05)


def test_sampling_is_exact(certified: Any) -> None:
    """Against Van Loan's block exponential, the continuous Lyapunov equation and the package's exact correlations."""
    systems, records = certified.systems, certified.records
    system, rate = records.FRAME, 50.0
    A, G = systems._first_order(system)
    n = len(A)
    blocks = expm(np.block([[-A, G @ G.T], [np.zeros((n, n)), A.T]]) / rate)
    covariance = blocks[n:, n:].T @ blocks[:n, n:]
    factor = systems.noise_factor(A, G, 1 / rate)
    np.testing.assert_allclose(factor @ factor.T, covariance, atol=1e-12 * np.abs(covariance).max())
    stationary = systems.velocities(system, rate).covariance()
    continuous = solve_continuous_lyapunov(A, -G @ G.T)
    np.testing.assert_allclose(stationary, continuous, atol=1e-11 * np.abs(continuous).max())

    held = systems.accelerations(records.CHAIN, 100.0)
    exact = exact_correlations(structure(sprung.read_description("chain3")).discretised(100.0), n_lags=1)[:, :, 0]
    ratio = held.rms() ** 2 / np.diag(exact)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-10)


def test_spectra_hold_the_power_of_the_samples(certified: Any) -> None:
    bounds, record = certified.bounds, certified.records.RECORDS["close-modes"]
    frequency, damping, shapes, forces = record.system.modal()
    nu, weights = bounds.quadrature(frequency / record.rate, frequency * damping / record.rate, n_nodes=16)
    spectra = bounds.modal_spectra(frequency, damping, forces, np.exp(2j * np.pi * nu), record)
    power = np.einsum("z,zij->ij", 2 * weights, spectra).real
    rms = record.sampled(record.system, record.rate).rms()
    np.testing.assert_allclose(np.diag(shapes @ power @ shapes.T), rms**2, rtol=1e-10)


@pytest.mark.parametrize("name", [path.stem for path in ANSWERS if path.stem != "car-drive"])
def test_files_are_what_the_seeds_give(certified: Any, name: str) -> None:
    """Another library of linear algebra may round a sample the other way."""
    ((file, drawn, _),) = certified.make.record_files(name)
    counts = drawn / answer(name)["unit_per_count"]
    stored = samples(file)
    assert np.abs(stored - counts).max() < 0.51
    assert np.abs(stored).max() < 2**15


def test_the_car_moves_as_the_structure_of_its_description_does(certified: Any) -> None:
    """Spectra of the exactly sampled drive against response x road x response^H, where aliases are small."""
    car, stated = certified.car, answer("car-drive")
    vehicle = structure(certified.score.certified_vehicle(stated))
    factors = {c: car.FACTORS.get(str(c), 1.0) for c in vehicle.components()}
    driven = vehicle.changed(factors)
    frequencies, speed = np.array([1.2, 1.6, 2.4, 5.0, 10.0, 13.0]), 18.0
    response = frequency_response(driven, frequencies)
    n = frequencies / speed
    auto = car.ROUGHNESS * (0.1**2 / (n**2 + car.LOWEST**2)) / speed
    cross = 1 / (1 + (n / car.HALF_COHERENT) ** 2)
    delay = np.exp(-2j * np.pi * frequencies * 2.7 / speed)
    tracks = np.array([[np.ones_like(n), cross], [cross, np.ones_like(n)]])
    ends = np.array([np.ones_like(delay), delay])
    road = np.einsum("f,abf,ef,gf->feagb", auto, tracks, ends, ends.conj()).reshape(-1, 4, 4)
    expected = response @ road @ response.conj().swapaxes(1, 2)
    z = np.exp(2j * np.pi * frequencies / car.RATE)
    sampled = car.stretch(car.DRIVEN, speed).spectra(z) * 2 / car.RATE
    for one, other in zip(sampled, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=0.02 * np.abs(other).max())


def test_scores_match_each_mode_once(certified: Any) -> None:
    bounds = {"damping_ratio": 0.01, "natural_frequency_bound": 0.01, "damping_ratio_bound": 0.001}
    stated = {"record": "two", "modes": [{"natural_frequency": f} | bounds for f in (3.0, 3.06)]}
    scored = certified.score.score(stated, "any", np.array([3.01, 9.0]), np.array([0.011, 0.01]))
    assert (scored.n_found, scored.n_within, scored.n_spurious) == (1, 1, 1)
    assert scored.errors == pytest.approx((1.0, 1.0))
    both = certified.score.score(stated, "any", np.array([3.04, 3.07]), np.array([0.01, 0.014]))
    assert (both.n_found, both.n_within, both.n_spurious) == (2, 0, 0)


@pytest.mark.slow
def test_twenty_periods_of_the_first_mode_show_all_modes(certified: Any) -> None:
    """Six blocks scatter by the modes' own random level: modes were taken for chance (9 of 20 records were right)."""
    scores = [certified.score.sprung_score("short", draw) for draw in range(20)]
    assert sum(each.n_found == 3 and each.n_spurious == 0 for each in scores) >= 16
    assert sum(each.n_spurious for each in scores) <= 2
