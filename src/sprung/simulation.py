"""Simulated recordings: exact response of a linear vehicle to an excitation, with sensor noise and the truth."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, schur
from scipy.signal import lfilter

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation import Excitation, RandomInputs, noise
from sprung.recording import Recording
from sprung.vehicles import StateSpace, Structure


def response(discrete: StateSpace, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the outputs of a sampled state space that starts at rest.

    Parameters
    ----------
    discrete
        A sampled state space; it may be unstable or have repeated eigenvalues.
    inputs
        Shape (inputs, samples).

    Returns
    -------
    ndarray
        Shape (channels, samples).

    Notes
    -----
    In the coordinates of the complex Schur form A = Q T Q^H of the balanced A, the states follow one after the
    other from the last, each by a filter of first order over all samples: exact, without a loop over time, and
    unlike a modal transformation well conditioned for every A.
    """
    if inputs.ndim != 2 or inputs.shape[0] != discrete.input_matrix.shape[1]:
        raise ParameterError(
            f"inputs has shape {inputs.shape}, but must be ({discrete.input_matrix.shape[1]}, samples)"
        )
    balanced, (scale, _) = matrix_balance(discrete.state_matrix, permute=False, separate=True)
    T, Q = schur(balanced, output="complex")
    drive = (Q.conj().T @ (discrete.input_matrix / scale[:, None])) @ inputs
    states = np.zeros_like(drive)
    for row in reversed(range(len(T))):
        drive[row] += T[row, row + 1 :] @ states[row + 1 :]
        states[row, 1:] = lfilter([1.0], [1.0, -T[row, row]], drive[row, :-1])
    return np.asarray(((discrete.output_matrix * scale @ Q) @ states).real + discrete.feedthrough @ inputs)


def settling_time(vehicle: Structure, *, remainder: float = 1e-4) -> float:
    """Return the time after which free motion has decayed to `remainder` of its amplitude [s]."""
    check_number("remainder", remainder, above=0, at_most=1)
    slowest = -float(np.max(np.linalg.eigvals(vehicle.state_space().state_matrix).real))
    if slowest <= 0:
        raise ParameterError("a free motion of the vehicle does not decay: give every coordinate a spring and a damper")
    return -math.log(remainder) / slowest


def simulate(
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    snr: float | None = None,
    noise_band: tuple[float, float] | None = None,
    seed: int | np.random.Generator = 0,
) -> Recording:
    """Simulate what the sensors of a linear vehicle record in the steady state.

    Parameters
    ----------
    vehicle
        Structure with at least one sensor.
    excitation
        What drives its inputs; held from each sample to the next (zero-order hold). A smooth base displacement
        is so half a sample late; accelerometers on its wheels, which read each step at once, need a rate far above
        its frequency.
    duration
        Recorded time [s], after a lead-in of the vehicle's settling time that is cut off.
    sampling_rate
        In Hz.
    snr, noise_band
        Sensor noise, see `with_noise`; none by default.
    seed
        A seed, or a generator to draw from.

    Returns
    -------
    Recording
        In SI units.

    Raises
    ------
    ParameterError
        Where the vehicle has no sensors or other inputs than the excitation.
    """
    check_number("duration", duration, above=0)
    check_number("sampling_rate", sampling_rate, above=0)
    if not vehicle.outputs.channels:
        raise ParameterError("the vehicle has no motion sensors: add [[sensor]] tables to its file")
    if excitation.n_inputs != len(vehicle.inputs):
        raise ParameterError(
            f"the excitation has {excitation.n_inputs} inputs, but the vehicle {len(vehicle.inputs)}: "
            f"drive {', '.join(vehicle.inputs)}"
        )
    generator = np.random.default_rng(seed)
    n_samples = max(1, round(duration * sampling_rate))
    lead_in = math.ceil(settling_time(vehicle) * sampling_rate)
    inputs = excitation.samples(
        lead_in + n_samples, sampling_rate=sampling_rate, generator=generator, start=-lead_in / sampling_rate
    )
    recording = Recording(
        samples=response(vehicle.discretised(sampling_rate), inputs)[:, lead_in:],
        sampling_rate=sampling_rate,
        channels=vehicle.outputs.channels,
        history=(f"simulated {duration:g} s at {sampling_rate:g} Hz, driven by {excitation}",),
    )
    if snr is None:
        return recording
    return with_noise(recording, snr=snr, band=noise_band, generator=generator)


def with_noise(
    recording: Recording,
    *,
    snr: float,
    generator: np.random.Generator,
    band: tuple[float, float] | None = None,
) -> Recording:
    """Return the recording with sensor noise, independent between channels.

    Parameters
    ----------
    recording
        Signals without noise.
    snr
        RMS(signal) / RMS(noise) of every channel, an amplitude ratio, above 0; met exactly.
    generator
        Source of the randomness.
    band
        Lower and upper edge of the noise [Hz]; None for white noise. See `sprung.excitation.noise`.
    """
    check_number("snr", snr, above=0)
    added = noise(recording.samples.shape, band=band, sampling_rate=recording.sampling_rate, generator=generator)
    missing = np.isnan(recording.samples)
    added[missing] = np.nan
    scale = _rms(recording.samples) / (snr * _rms(added))
    where = "white" if band is None else f"in {band[0]:g} to {band[1]:g} Hz"
    return recording.changed(
        f"added sensor noise, {where}, at SNR {snr:g}", samples=recording.samples + scale[:, None] * added
    )


def usual_excitation(vehicle: Structure) -> Excitation:
    """Return white excitation of every input: forces of 1 N, base displacements of 0.1 mm (standard deviation)."""
    moved = any(element.foot is not None for element in vehicle.elements)
    return RandomInputs(len(vehicle.inputs), standard_deviation=1e-4 if moved else 1.0)


def truth(vehicle: Structure, *, seed: int | None = None) -> dict[str, Any]:
    """Return what a simulated recording holds, as the JSON object `sprung.truth/1`.

    Parameters
    ----------
    vehicle
        Structure that was simulated.
    seed
        Of the simulation.

    Returns
    -------
    dict
        Exact modes as the sensors see them, components by corner or mass with their SI values; no speed and no
        faults.
    """
    modes = vehicle.modes()
    columns = zip(modes.natural_frequency, modes.damping_ratio, modes.mode_shapes, modes.labels, strict=True)
    return {
        "schema": "sprung.truth/1",
        "channels": list(modes.channels),
        "modes": [
            {
                "natural_frequency": float(frequency),
                "damping_ratio": float(ratio),
                "mode_shape": {"real": shape.real.tolist(), "imag": shape.imag.tolist()},
                "label": label,
            }
            for frequency, ratio, shape, label in columns
        ],
        "components": {
            owner: {name: {"value": value} for name, value in owned.items()}
            for owner, owned in vehicle.components().items()
        },
        "speed": None,
        "faults": {},
        "seed": seed,
    }


def _rms(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """RMS of each channel over the samples that are there."""
    return np.asarray(np.sqrt(np.nanmean(samples**2, axis=1)))
