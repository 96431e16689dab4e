"""Run-out of the wheels from the lines of their turns: exact spectra, and simulated drives on roads and tracks."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import RailInputs, SpectralLine, fit_corners, run_out, wheels
from sprung.likelihood.masked_lines import without_lines
from sprung.likelihood.spectra import through_window
from sprung.likelihood.transfer import transfer
from sprung.simulation import RailDrive, RoadConditions, RoadDrive, WheelOrders, simulate_drive
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")


@pytest.fixture(scope="module")
def round_fit():
    """A fit of the car on round wheels."""
    drive = RoadDrive(duration=90.0, sampling_rate=60.0, speed=(10.0, 20.0), snr=50.0)
    return fit_corners(simulate_drive(CAR, drive, seed=1).recording, CAR)


def test_exact_spectra_give_the_run_out_of_every_wheel(round_fit, monkeypatch) -> None:
    """Wheels of known run-out at a line and at its double, in spectra that are otherwise those of the model: 1e-6."""
    monkeypatch.setattr(wheels, "SETTINGS", replace(wheels.SETTINGS, settled=1e-13, max_steps=100_000))
    model = round_fit.model
    spectra, response = model.spectra, transfer(model.terms(round_fit.parameters))
    matrices, ground = through_window(response.spectral_matrix).copy(), response.matrix[1:-1, :, :4]
    lines = SpectralLine(0.5, follows_speed=True), SpectralLine(1.0, follows_speed=True)
    sizes = 1e-3 * np.array([[0.2, 0.5, 0.3, 0.1], [0.1, 0.2, 0.4, 0.3]])
    for line, size in zip(lines, sizes, strict=True):
        near = ~without_lines(spectra, (line,))
        for row, place in enumerate(line.place * spectra.speeds):
            if place <= spectra.frequencies[-1]:
                h = ground[np.argmin(np.abs(spectra.frequencies - place))]
                matrices[row, near[row]] += (h * size**2) @ h.conj().T * spectra.segment_length / near[row].sum()
    beside = SpectralLine(0.505, follows_speed=True)  # as of a wheel of another radius, in the bins of the first line
    with_data = replace(model, spectra=replace(spectra, matrices=matrices))
    exact = replace(round_fit, model=with_data, lines=(lines[0], beside, lines[1]))
    found = run_out(exact)
    assert found is not None
    assert found.circumference == pytest.approx(2.0)
    assert found.values == pytest.approx(np.hypot(*sizes), rel=1e-6)


def test_round_wheels_have_none(round_fit) -> None:
    assert run_out(round_fit) is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_wheels_of_a_car_are_distinguished_from_its_body(seed) -> None:
    """Four accelerometers on the body, wheels that drift apart: every wheel within three deviations, and 20 %."""
    orders = WheelOrders(run_out=(1e-3, 3e-4))
    settings = RoadDrive(
        duration=400.0,
        sampling_rate=100.0,
        speed=(12.0, 25.0),
        road=RoadConditions("C"),
        snr=50.0,
        wheel_orders=orders,
    )
    drive = simulate_drive(CAR, settings, seed=seed)
    found = run_out(fit_corners(drive.recording, CAR))
    assert found is not None
    facts = drive.truth["conditions"]["wheel_orders"]
    truth = np.array([np.sqrt(sum(line["amplitude"] ** 2 for line in lines) / 2) for lines in facts.values()])
    assert found.wheels == tuple(facts)
    assert found.circumference == pytest.approx(2 * np.pi * 0.31, rel=0.01)
    assert np.all(np.abs(found.values - truth) < 3 * found.stds)
    assert np.all(np.abs(found.values - truth) < 0.2 * truth.max())


@pytest.mark.slow
def test_an_uneven_wheel_of_a_bogie_is_named_and_hides_no_joints() -> None:
    """Its lines were taken for joints every 5.8 m (two turns), and the model error was 91 %."""
    bogie = read_vehicle("y25").model_copy(update={"kind": "rail"})
    orders = WheelOrders(run_out=(1e-3, 5e-4), radius=0.46, wheels=("rear_left",))
    settings = RailDrive(duration=240.0, sampling_rate=200.0, snr=50.0, wheel_orders=orders)
    drive = simulate_drive(bogie, settings, seed=1)
    fit = fit_corners(drive.recording, bogie)
    assert [block.pitch for block in fit.model.blocks if isinstance(block, RailInputs)] == [pytest.approx(18, rel=0.01)]
    assert fit.model_error < 0.15
    found = run_out(fit)
    assert found is not None
    assert found.circumference == pytest.approx(2 * np.pi * 0.46, rel=0.01)
    lines = drive.truth["conditions"]["wheel_orders"]["rear_left"]
    truth = np.sqrt(sum(line["amplitude"] ** 2 for line in lines) / 2)
    assert found.values == pytest.approx([0.0, 0.0, truth, 0.0], abs=0.15 * truth)
