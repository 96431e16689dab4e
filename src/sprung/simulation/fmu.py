"""Vehicles as Functional Mock-up Units (FMUs): written for other programs, and driven as the truth of a simulation."""

import json
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from sprung._checks import check_number, required
from sprung.errors import ParameterError
from sprung.excitation import Excitation
from sprung.recording import Recording
from sprung.simulation import fmu_model
from sprung.simulation.linear import SMOOTH_RATE, sampled_inputs, with_polynomial_inputs
from sprung.vehicles import Structure

_EXTRA = "fmu"
#: Unit of each quantity in FMUs, and its exponents of the base units.
_UNITS: dict[str, tuple[str, dict[str, int]]] = {
    "acceleration": ("m/s2", {"m": 1, "s": -2}),
    "velocity": ("m/s", {"m": 1, "s": -1}),
    "displacement": ("m", {"m": 1}),
    "angular_velocity": ("rad/s", {"rad": 1, "s": -1}),
    "angle": ("rad", {"rad": 1}),
    "force": ("N", {"kg": 1, "m": 1, "s": -2}),
    "force_rate": ("N/s", {"kg": 1, "m": 1, "s": -3}),
    "jerk": ("m/s3", {"m": 1, "s": -3}),
}
#: Quantity of the rate of each quantity that is an input.
_RATES = {"displacement": "velocity", "force": "force_rate", "acceleration": "jerk"}
#: Relative tolerance of the solver of FMUs for model exchange.
_TOLERANCE = 1e-8
#: Ending of the name of the input that is the rate of another input.
RATE = "_rate"

# The class that pythonfmu3 looks for; the arithmetic is in the copy of fmu_model.py beside it.
_SCRIPT = '''"""A vehicle of Sprung as a co-simulation FMU."""
from pathlib import Path

from pythonfmu3 import DefaultExperiment, Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult, Unit

from fmu_model import SteppedModel


class Model(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.model = SteppedModel(Path(self.resources) / "model.json")
        self.modelName = "{identifier}"
        self.description = {description!r}
        self.default_experiment = DefaultExperiment(start_time=0.0, step_size=self.model.step)
        self.register_units([Unit(name, **exponents) for name, exponents in {units!r}])
        self.time = 0.0
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, unit="s"))
        for number, entry in enumerate(self.model.inputs):
            self._register(entry["name"], entry["unit"], entry["description"], Fmi3Causality.input,
                           lambda n=number: self.model.values[n], lambda v, n=number: self.model.set_value(n, v))
            self._register(entry["name"] + "{rate}", entry["rate_unit"], "rate", Fmi3Causality.input,
                           lambda n=number: self.model.rates[n], lambda v, n=number: self.model.set_rate(n, v))
        for number, entry in enumerate(self.model.outputs):
            self._register(entry["name"], entry["unit"], entry["description"], Fmi3Causality.output,
                           lambda n=number: self.model.reading(n), None)

    def _register(self, name, unit, description, causality, getter, setter):
        variable = Float64(name, causality=causality, unit=unit, description=description, getter=getter, setter=setter)
        self.register_variable(variable, nested=False)

    def do_step(self, current_time, step_size):
        self.model.advance(step_size)
        self.time = current_time + step_size
        return Fmi3StepResult()
'''


@dataclass(frozen=True, slots=True)
class Fmu:
    """A Functional Mock-up Unit that takes the place of a vehicle.

    Parameters
    ----------
    path
        File of the FMU: FMI 1, 2 or 3, co-simulation or model exchange.
    inputs
        Names of its inputs that the vehicle's inputs drive, in their order (the height of the ground under each wheel
        [m]); None: named as the vehicle's, `road_front_left` and so on. An input of the same name with `_rate` behind
        it, where there is one, is given the rate of rise within the step.
    """

    path: Path
    inputs: tuple[str, ...] | None = None


def write_fmu(vehicle: Structure, path: str | Path, *, step: float = 1e-3, name: str = "vehicle") -> None:
    """Write a vehicle as an FMU of FMI 3.0 for co-simulation.

    Parameters
    ----------
    vehicle
        Structure with at least one sensor.
    path
        File to write, with the ending `.fmu`.
    step
        Step of the model [s], above 0; communication steps are multiples of it.
    name
        Name of the vehicle in the description of the FMU.

    Raises
    ------
    ParameterError
        If the vehicle has no sensors, the step is not above 0, or the ending is another.
    MissingPackageError
        If pythonfmu3 is not installed.

    Notes
    -----
    Inputs are those of the vehicle (heights of the ground [m], forces [N], accelerations of the body [m/s^2]) and the
    rate of each, with the ending `_rate`: within a communication step an input rises evenly, and with a rate of 0 it is
    held. Outputs are the sensors in SI units. The sampled state space is exact for such inputs, for every step. The FMU
    runs the model in Python, of which it needs the shared library at run time, and no package.

    References
    ----------
    Modelica Association, Functional Mock-up Interface Specification, version 3.0 (2022).
    """
    check_number("step", step, above=0)
    target = Path(path)
    if target.suffix != ".fmu":
        raise ParameterError(f"{target} must end in .fmu: other programs know FMUs by it")
    if not vehicle.outputs.channels:
        raise ParameterError("the vehicle has no motion sensors: add [[sensor]] tables to its file")
    builder = required("pythonfmu3", purpose="writing FMUs", extra=_EXTRA).FmuBuilder
    identifier = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in target.stem)
    identifier = identifier if identifier[:1].isalpha() else f"fmu_{identifier}"
    script = _SCRIPT
    for field, text in {
        "{identifier}": identifier,
        "{rate}": RATE,
        "{description!r}": repr(f"{name}: body, suspension and tyres, linear, in steps of {step:g} s"),
        "{units!r}": repr([("s", {"s": 1}), *_UNITS.values()]),
    }.items():
        script = script.replace(field, text)
    with TemporaryDirectory() as folder:
        files = {f"{identifier}_script.py": script, "model.json": json.dumps(_document(vehicle, step))}
        files[Path(fmu_model.__file__).name] = Path(fmu_model.__file__).read_text(encoding="utf-8")
        for file, text in files.items():
            Path(folder, file).write_text(text, encoding="utf-8")
        first, *others = (Path(folder, file) for file in files)
        built = builder.build_FMU(first, dest=Path(folder, "out"), project_files=others)
        target.write_bytes(Path(built).read_bytes())


def _document(vehicle: Structure, step: float) -> dict[str, Any]:
    """Return the matrices and variables of a vehicle as `SteppedModel` reads them."""
    sampled, n = with_polynomial_inputs(vehicle.state_space(), sampling_rate=1 / step), len(vehicle.inputs)
    inputs = []
    for name in vehicle.inputs:
        quantity = next((part for part in ("force", "acceleration") if part in name), "displacement")
        units = {"unit": _UNITS[quantity][0], "rate_unit": _UNITS[_RATES[quantity]][0]}
        inputs.append({"name": name, "description": f"{quantity} {name}".replace("_", " "), **units})
    return {
        "step": step,
        "inputs": inputs,
        "outputs": [
            {"name": channel.name, "unit": _UNITS[channel.quantity][0], "description": channel.quantity}
            for channel in vehicle.outputs.channels
        ],
        "state": sampled.state_matrix.tolist(),
        "values": sampled.input_matrix[:, :n].tolist(),
        "rises": sampled.input_matrix[:, n:].tolist(),
        "readings": sampled.output_matrix.tolist(),
        "feedthrough": sampled.feedthrough[:, :n].tolist(),
    }


def simulate_fmu(
    fmu: Fmu,
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    lead_in: float | None = None,
    seed: int | np.random.Generator = 0,
) -> Recording:
    """Simulate the signals of the sensors of an FMU that takes the place of a vehicle, from rest before the lead-in.

    Parameters
    ----------
    fmu
        Functional Mock-up Unit, with an output for each motion sensor of `vehicle`, under its name and in its SI unit.
    vehicle
        Structure of the vehicle file: names of inputs and sensors, and the settling time.
    excitation, duration, sampling_rate, lead_in, seed
        As in `simulate`, with a smooth excitation; the FMU communicates in steps of 1 ms or shorter.

    Returns
    -------
    Recording
        Signals in SI units.

    Raises
    ------
    ParameterError
        If the excitation jumps, or the FMU lacks an input or an output, cannot run on this machine, or stops.
    MissingPackageError
        If fmpy is not installed.

    Notes
    -----
    An input without a rate is held over each step, also by FMPy's solver for model exchange, at its mean there: sensors
    on the body follow to second order in the step, and what the ground moves at once (sensors on wheels) is half a step
    off.
    """
    fmpy = required("fmpy", purpose="driving FMUs", extra=_EXTRA)
    if not excitation.is_smooth:
        raise ParameterError(f"{type(excitation).__name__} jumps between samples: drive FMUs on a road or a track")
    try:
        description = fmpy.read_model_description(str(fmu.path))
    except FileNotFoundError:
        raise
    except Exception as error:
        raise ParameterError(f"{fmu.path} is not an FMU that FMPy reads: {str(error).strip()}") from error
    driven = _driven(fmu, description, vehicle.inputs)
    outputs = vehicle.outputs.names
    _check_named("outputs", _names(description, "output", "local"), outputs, "name the sensors of the vehicle file so")
    drive = sampled_inputs(
        vehicle,
        excitation,
        duration=duration,
        sampling_rate=sampling_rate,
        least_rate=SMOOTH_RATE,
        lead_in=lead_in,
        generator=np.random.default_rng(seed),
    )
    inputs, step = drive.inputs, 1 / drive.rate
    rises = np.diff(inputs, axis=1, append=inputs[:, -1:])
    columns = {"time": np.arange(inputs.shape[1]) * step}
    offered = _names(description, "input")
    for name, values, rise in zip(driven, inputs, rises, strict=True):
        has_rate = f"{name}{RATE}" in offered
        columns[name] = values if has_rate else values + rise / 2  # held over the step
        if has_rate:
            columns[f"{name}{RATE}"] = rise * drive.rate
    signals = np.empty(inputs.shape[1], dtype=[(name, np.float64) for name in columns])
    for name, values in columns.items():
        signals[name] = values
    try:
        with redirect_stdout(StringIO()):  # prints the inputs that are not driven
            result = fmpy.simulate_fmu(
                str(fmu.path),
                start_time=0.0,
                stop_time=float(signals["time"][-1]),
                step_size=step,
                output_interval=step,
                relative_tolerance=_TOLERANCE,
                record_events=False,
                input=signals,
                output=list(outputs),
                model_description=description,
            )
    except Exception as error:
        raise ParameterError(f"FMU {fmu.path} stopped: {str(error).strip()}") from error
    readings = np.array([result[name] for name in outputs], dtype=np.float64)
    if readings.shape[1] != inputs.shape[1] or not np.all(np.isfinite(readings)):
        raise ParameterError(
            f"FMU {fmu.path} gave {readings.shape[1]} of {inputs.shape[1]} samples, or values that are not finite:"
            f" check that it runs in steps of {step:g} s"
        )
    return drive.recorded(readings, vehicle, f"simulated with {fmu.path.name}")


def _driven(fmu: Fmu, description: Any, inputs: tuple[str, ...]) -> tuple[str, ...]:
    """Return the input of the FMU for each input of the vehicle."""
    driven = inputs if fmu.inputs is None else (*fmu.inputs, *inputs[len(fmu.inputs) :])
    if len(driven) != len(inputs):
        raise ParameterError(
            f"{len(driven)} inputs of the FMU are named, but the vehicle has {len(inputs)}: {', '.join(inputs)}"
        )
    _check_named("inputs", _names(description, "input"), driven, "name its inputs with --fmu-inputs")
    return driven


def _names(description: Any, *causalities: str) -> set[str]:
    return {each.name for each in description.modelVariables if each.causality in causalities}


def _check_named(kind: str, offered: set[str], needed: tuple[str, ...], advice: str) -> None:
    """Raise if an FMU lacks inputs or outputs."""
    absent = [name for name in needed if name not in offered]
    if absent:
        raise ParameterError(
            f"the FMU has no {kind} {', '.join(absent)}, but {', '.join(sorted(offered)) or 'none'}: {advice}"
        )
