"""Vehicles as FMUs: the model against the exact response, the round trip, and an FMU by another route."""

import json
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sprung.cli import main
from sprung.errors import ParameterError
from sprung.excitation import RandomInputs
from sprung.simulation import (
    Driving,
    Fmu,
    Payload,
    RoadDrive,
    driven_structure,
    response,
    simulate,
    simulate_drive,
    with_derivatives,
    with_polynomial_inputs,
)
from sprung.simulation import fmu as fmus
from sprung.simulation.fmu_model import SteppedModel
from sprung.vehicles import Quarter, Sensor, chain, parse_fault, read_description, read_vehicle, structure

#: A quarter of a car as a model-exchange FMU: equations of motion written down by hand, integrated by FMPy's solver.
FOREIGN = textwrap.dedent("""
    from pythonfmu3 import Float64, Fmi3Causality, Fmi3Initial, Fmi3SlaveBase, Fmi3Variability, ModelExchange

    K, C, T, M, U = 20000.0, 1500.0, 200000.0, 400.0, 40.0

    class Foreign(Fmi3SlaveBase, ModelExchange):
        def __init__(self, **kwargs):
            super().__init__(**kwargs)
            self.time = self.ground = self.z = self.w = self.dz = self.dw = 0.0
            self.register_variable(Float64("time", causality=Fmi3Causality.independent,
                                           variability=Fmi3Variability.continuous))
            self.register_variable(Float64("ground", causality=Fmi3Causality.input))
            for name in ("z", "w", "dz", "dw"):
                self.register_variable(Float64(name, causality=Fmi3Causality.local, initial=Fmi3Initial.exact,
                                               variability=Fmi3Variability.continuous))
            rates = {"z": self._dz, "w": self._dw, "dz": self._ddz, "dw": self._ddw}
            for number, (name, rate) in enumerate(rates.items()):
                self.register_variable(Float64("der_" + name, causality=Fmi3Causality.local, derivative=2 + number,
                                               variability=Fmi3Variability.continuous, getter=rate))
            self.register_variable(Float64("acc_body", causality=Fmi3Causality.output, getter=self._ddz))
            self.register_variable(Float64("acc_wheel", causality=Fmi3Causality.output, getter=self._ddw))

        def _dz(self):
            return self.dz

        def _dw(self):
            return self.dw

        def _ddz(self):
            return (K * (self.w - self.z) + C * (self.dw - self.dz)) / M

        def _ddw(self):
            return (T * (self.ground - self.w) - M * self._ddz()) / U

        def get_continuous_state_derivatives(self):
            return [self._dz(), self._dw(), self._ddz(), self._ddw()]
""")


def _turned_car():
    """Return a car with sensors that read gravity, wheels and rotation, too."""
    zafira = read_vehicle("zafira")
    sensors = (
        Sensor(
            channel="lateral", quantity="acceleration", unit="m/s^2", position=(0.5, 0, 0.2), direction=(0, 0.6, 0.8)
        ),
        Sensor(channel="roll_rate", quantity="angular_velocity", unit="rad/s", direction=(1.0, 0.0, 0.0)),
        Sensor(channel="wheel", quantity="acceleration", unit="m/s^2", on="wheel_front_left"),
    )
    return zafira.model_copy(update={"sensor": (*zafira.sensor, *sensors)})


def test_the_stepped_model_is_the_exact_response(tmp_path) -> None:
    car = structure(read_vehicle("zafira"))
    (tmp_path / "model.json").write_text(json.dumps(fmus._document(car, 1e-3)), encoding="utf-8")
    model = SteppedModel(tmp_path / "model.json")
    heights = np.cumsum(np.random.default_rng(1).standard_normal((4, 41)), axis=1)
    fine = np.array([np.interp(np.arange(201) / 5, np.arange(41), row) for row in heights])
    exact = response(with_polynomial_inputs(car.state_space(), sampling_rate=1000.0), with_derivatives(fine))
    for k in range(40):  # communication steps of five steps of the model
        for number in range(4):
            model.set_value(number, heights[number, k])
            model.set_rate(number, (heights[number, k + 1] - heights[number, k]) / 5e-3)
        model.advance(5e-3)
        readings = [model.reading(number) for number in range(4)]
        np.testing.assert_allclose(readings, exact[:, 5 * k + 5], rtol=0, atol=1e-9 * np.abs(exact).max())


def test_a_step_that_is_no_multiple_of_the_models_is_refused(tmp_path) -> None:
    (tmp_path / "model.json").write_text(json.dumps(fmus._document(chain(), 1e-3)))
    with pytest.raises(ValueError, match=r"multiple of the model's step 0.001 s"):
        SteppedModel(tmp_path / "model.json").advance(1.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "driving", [Driving(), Driving(braking=2.0, cornering=2.0)], ids=["straight", "braking_and_curves"]
)
def test_our_vehicle_as_an_fmu_drives_as_itself(driving, tmp_path) -> None:
    pytest.importorskip("fmpy")
    pytest.importorskip("pythonfmu3")
    car, path = _turned_car(), tmp_path / "a car.fmu"
    fmus.write_fmu(driven_structure(car), path, name="a car")
    settings = RoadDrive(duration=5.0, driving=driving)
    own = simulate_drive(car, settings, seed=3).recording
    driven = simulate_drive(car, replace(settings, fmu=Fmu(path)), seed=3)
    assert driven.recording.names == own.names
    largest = np.abs(own.samples).max(axis=1, keepdims=True)
    assert np.all(np.abs(driven.recording.samples - own.samples) <= 1e-6 * largest)
    assert driven.truth["fmu"] == "a car.fmu"
    assert (driven.truth["modes"], driven.truth["components"]) == ([], {})


def test_excitation_that_jumps_is_refused() -> None:
    pytest.importorskip("fmpy")
    with pytest.raises(ParameterError, match="RandomInputs jumps between samples"):
        fmus.simulate_fmu(Fmu(Path("chain.fmu")), chain(), RandomInputs(3), duration=1.0, sampling_rate=500.0)


def test_a_foreign_fmu_by_model_exchange(tmp_path) -> None:
    builder = pytest.importorskip("pythonfmu3").FmuBuilder
    pytest.importorskip("fmpy")
    (tmp_path / "foreign.py").write_text(FOREIGN, encoding="utf-8")
    path = builder.build_FMU(tmp_path / "foreign.py", dest=tmp_path)
    shipped = read_description("quarter")
    assert isinstance(shipped, Quarter)
    numbers = {"unsprung_mass": 40.0, "spring_stiffness": 20000.0, "damping": 1500.0, "tyre_stiffness": 200000.0}
    corner = shipped.corner.model_copy(update={**numbers, "damper_bushing_stiffness": None})
    body = shipped.body.model_copy(update={"mass": 400.0})
    quarter = structure(shipped.model_copy(update={"body": body, "corner": corner}))
    bump = _Bump()
    given: dict[str, Any] = {"duration": 3.0, "sampling_rate": 200.0, "lead_in": 0.5}
    own = simulate(quarter, bump, **given).samples
    driven = fmus.simulate_fmu(Fmu(path, inputs=("ground",)), quarter, bump, **given).samples
    assert np.abs(own).max() > 1.0
    away = np.abs(driven - own).max(axis=1) / np.abs(own).max(axis=1)
    assert np.all(away <= [1e-2, 7e-2])  # the solver holds inputs over 1 ms


class _Bump:
    """One smooth bump of 2 cm at 1 s."""

    n_inputs = 1
    is_smooth = True

    def samples(self, n_samples, *, sampling_rate, generator, start=0.0):
        del generator
        time = start + np.arange(n_samples) / sampling_rate
        return 0.02 * np.exp(-(((time - 1.0) / 0.05) ** 2))[None]


def test_what_changes_the_vehicle_is_refused_beside_an_fmu() -> None:
    fmu = Fmu(Path("car.fmu"))
    with pytest.raises(ParameterError, match="faults, payload: the FMU takes the place of the vehicle"):
        RoadDrive(fmu=fmu, faults=(parse_fault("front_left.spring=-0.2"),), payload=Payload(mass=80.0))


def test_inputs_and_outputs_of_an_fmu_must_be_those_of_the_vehicle(tmp_path) -> None:
    pytest.importorskip("fmpy")
    pytest.importorskip("pythonfmu3")
    zafira = read_vehicle("zafira")
    fmus.write_fmu(structure(zafira), tmp_path / "car.fmu")
    settings = RoadDrive(duration=1.0, fmu=Fmu(tmp_path / "car.fmu", inputs=("left",)))
    with pytest.raises(ParameterError, match=r"no inputs left, but .*: name its inputs with --fmu-inputs"):
        simulate_drive(zafira, settings)
    with pytest.raises(ParameterError, match=r"no outputs lateral, roll_rate, wheel, but .*acc_fl"):
        simulate_drive(_turned_car(), replace(settings, fmu=Fmu(tmp_path / "car.fmu")))
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(ParameterError, match="is not an FMU that FMPy reads"):
        simulate_drive(zafira, replace(settings, fmu=Fmu(tmp_path / "text.fmu")))


def test_the_ending_of_an_fmu(tmp_path, capsys) -> None:
    assert main(["fmu", "zafira", "--out", str(tmp_path / "car.zip")]) == 2
    assert "must end in .fmu" in capsys.readouterr().err
    assert main(["simulate", "road", "--fmu-inputs", "a,b", "--out", str(tmp_path / "a.csv")]) == 2
    assert "--fmu-inputs needs --fmu" in capsys.readouterr().err
