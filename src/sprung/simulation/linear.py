"""Exact response of a linear vehicle to an excitation."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, matrix_balance, schur

from sprung._arrays import Real
from sprung._checks import check_number, check_type
from sprung.errors import ParameterError
from sprung.excitation import Excitation, RandomInputs
from sprung.recording import Recording
from sprung.signals.conditioning import decimate
from sprung.simulation.sensors import with_noise
from sprung.vehicles import StateSpace, Structure

#: Lowest rate at which smooth excitations are simulated [Hz].
SMOOTH_RATE = 1000.0
#: Samples per period of the fastest natural mode from which a smooth excitation may be linear between them.
LINEAR_PER_PERIOD = 30.0


def response(discrete: StateSpace, inputs: Real) -> Real:
    """Return the outputs of a sampled state space that starts at rest.

    Parameters
    ----------
    discrete
        Sampled state space; it may be unstable or have repeated eigenvalues.
    inputs
        Inputs at the samples, shape (inputs, samples).

    Returns
    -------
    ndarray
        Outputs, shape (channels, samples).

    Raises
    ------
    ParameterError
        If the inputs have the wrong shape.

    Notes
    -----
    In the coordinates of the complex Schur form A = Q T Q^H of the balanced A, the states are computed one after the
    other from the last to the first, each by a first-order filter over all samples: exact, without a loop over time,
    and unlike a modal transformation well conditioned for every A.

    References
    ----------
    B. N. Parlett and C. Reinsch (1969), Balancing a matrix for calculation of eigenvalues and eigenvectors, Numerische
    Mathematik 13, 293-304.

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> first_order = StateSpace(0.5 * one, one, one, 0 * one, sampling_rate=1.0)
    >>> response(first_order, np.array([[1.0, 0.0, 0.0, 0.0]])).round(6).tolist()
    [[0.0, 1.0, 0.5, 0.25]]
    """
    if inputs.ndim != 2 or inputs.shape[0] != discrete.input_matrix.shape[1]:
        raise ParameterError(
            f"inputs has shape {inputs.shape}, but must be ({discrete.input_matrix.shape[1]}, samples)"
        )
    from scipy.signal import lfilter

    balanced, (scale, _) = matrix_balance(discrete.state_matrix, permute=False, separate=True)
    T, Q = schur(balanced, output="complex")
    drive, read = Q.conj().T @ (discrete.input_matrix / scale[:, None]), discrete.output_matrix * scale @ Q
    outputs, last = discrete.feedthrough @ inputs, np.zeros((len(T), 1), dtype=np.complex128)
    size = 2**11  # samples whose states a processor's cache holds
    for first in range(0, inputs.shape[1], size):
        block = slice(first, first + size)
        states = drive @ inputs[:, block]
        for row in reversed(range(len(T))):
            states[row] += T[row, row + 1 :] @ states[row + 1 :]
            states[row], last[row] = lfilter([0.0, 1.0], [1.0, -T[row, row]], states[row], zi=last[row])
        outputs[:, block] += (read @ states).real
    return np.asarray(outputs, dtype=np.float64)


def with_polynomial_inputs(continuous: StateSpace, *, sampling_rate: float, degree: int = 1) -> StateSpace:
    """Return the state space sampled at `sampling_rate` [Hz] for inputs that are polynomials between samples.

    Parameters
    ----------
    continuous
        State space over time.
    sampling_rate
        Sampling rate of the result [Hz].
    degree
        Degree of the polynomials: 1 for inputs that are linear between samples.

    Returns
    -------
    StateSpace
        Sampled state space with `degree` + 1 times the inputs: their values and their derivatives per sample at the
        start of each sample, in this order (see `with_derivatives`).

    Notes
    -----
    Hold of order d: x[k+1] = A x[k] + B0 u[k] + B1 u'[k] + ... + Bd u^(d)[k], all from one matrix exponential of
    [[A, B, 0], [0, 0, I], [0, 0, 0]] over a sample, with one more row of I for each further degree.

    References
    ----------
    C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978).

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> integrator = StateSpace(0 * one, one, one, 0 * one)
    >>> ramp = np.arange(4.0)[None]
    >>> sampled = with_polynomial_inputs(integrator, sampling_rate=1.0)
    >>> response(sampled, with_derivatives(ramp)).round(6).tolist()  # t^2 / 2
    [[0.0, 0.5, 2.0, 4.5]]
    """
    states, inputs = continuous.input_matrix.shape
    augmented = np.zeros(2 * (states + (degree + 1) * inputs,))
    augmented[:states, : states + inputs] = (
        np.hstack([continuous.state_matrix, continuous.input_matrix]) / sampling_rate
    )
    augmented[states:-inputs, states + inputs :] = np.eye(degree * inputs)
    exponential = expm(augmented)
    return StateSpace(
        state_matrix=exponential[:states, :states],
        input_matrix=exponential[:states, states:],
        output_matrix=continuous.output_matrix,
        feedthrough=np.pad(continuous.feedthrough, ((0, 0), (0, degree * inputs))),
        sampling_rate=sampling_rate,
    )


def with_derivatives(inputs: Real, *, degree: int = 1) -> Real:
    """Return inputs, shape (inputs, samples), stacked on their derivatives per sample up to `degree`, 1 or 3.

    Notes
    -----
    Degree 1: rises to the next sample, the last of which is 0. Degree 3: derivatives of the cubic spline through the
    samples.

    Examples
    --------
    >>> with_derivatives(np.array([[0.0, 1.0, 3.0]])).tolist()
    [[0.0, 1.0, 3.0], [1.0, 2.0, 0.0]]
    """
    if degree == 1:
        return np.vstack([inputs, np.diff(inputs, axis=1, append=inputs[:, -1:])])
    from scipy.interpolate import CubicSpline

    places = np.arange(inputs.shape[1])
    spline = CubicSpline(places, inputs, axis=1)
    return np.vstack([inputs, *(spline(places, order) for order in range(1, degree + 1))])


def linear_rate(vehicle: Structure) -> float:
    """Return the rate [Hz] from which inputs that are linear between samples move a vehicle as smooth ones do.

    Notes
    -----
    Corners of linear pieces at the rate r have images at k r +- f, in which accelerations have the size of that at f:
    a mass on a stiff foot (a wheelset on its rail) with the natural frequency f_n then has an acceleration that is too
    small by 2 (1 + 1/4 + 1/9 + ...) (f_n / r)^2 = pi^2 / 3 (f_n / r)^2, 0.4 % at thirty samples per period.
    """
    return LINEAR_PER_PERIOD * float(np.max(np.abs(np.linalg.eigvals(vehicle.system.state_matrix())))) / (2 * np.pi)


def settling_time(vehicle: Structure, *, remainder: float = 1e-4) -> float:
    """Return the time after which free motion has decayed to `remainder` of its amplitude [s].

    Raises
    ------
    ParameterError
        If a free motion does not decay, or the remainder is not between 0 and 1.

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> one = chain(1, mass=1.0, stiffness=100.0, damping=2.0)  # decays as exp(-t)
    >>> round(settling_time(one, remainder=math.exp(-5)), 6)
    5.0
    """
    check_number("remainder", remainder, above=0, at_most=1)
    slowest = -float(np.max(np.linalg.eigvals(vehicle.state_space().state_matrix).real))
    if slowest <= 0:
        raise ParameterError("a free motion of the vehicle does not decay: give every coordinate a spring and a damper")
    return -math.log(remainder) / slowest


def check_fits(vehicle: Structure, excitation: Excitation) -> None:
    """Reject a vehicle without sensors, and an excitation with a different number of inputs.

    Raises
    ------
    ParameterError
        If the vehicle has no sensors, or a different number of inputs.
    """
    if not vehicle.outputs.channels:
        raise ParameterError("the vehicle has no motion sensors: add [[sensor]] tables to its file")
    if excitation.n_inputs != len(vehicle.inputs):
        raise ParameterError(
            f"the excitation has {excitation.n_inputs} inputs, but the vehicle {len(vehicle.inputs)}: "
            f"excite {', '.join(vehicle.inputs)}"
        )


def simulate(
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    snr: float | None = None,
    noise_band: tuple[float, float] | None = None,
    lead_in: float | None = None,
    seed: int | np.random.Generator = 0,
) -> Recording:
    """Simulate the signals of the sensors of a linear vehicle in the steady state.

    Parameters
    ----------
    vehicle
        Structure with at least one sensor.
    excitation
        Excitation of its inputs. Noise and pulses are held from each sample to the next (zero-order hold); a smooth
        excitation is simulated at 1000 Hz or more, then decimated: linear between samples (first-order hold), or a
        cubic spline where the vehicle is too fast for that (`linear_rate`).
    duration
        Recorded time [s], after a lead-in that is discarded.
    sampling_rate
        Sampling rate of the recording [Hz].
    snr, noise_band
        Signal-to-noise ratio and band [Hz] of sensor noise, see `with_noise`; None: no noise, white noise.
    lead_in
        Time before the recording [s]; None: the vehicle's settling time. With the same lead-in, vehicles that differ
        slightly drive on the same road.
    seed
        Seed of the random numbers, or their generator.

    Returns
    -------
    Recording
        Signals in SI units.

    Raises
    ------
    ParameterError
        If the vehicle has no sensors, or its number of inputs differs from that of the excitation.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> zafira = structure(read_vehicle("zafira"))
    >>> run = simulate(zafira, usual_excitation(zafira), duration=10.0, sampling_rate=200.0, seed=1)
    >>> run.names, run.samples.shape
    (('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr'), (4, 2000))
    >>> again = simulate(zafira, usual_excitation(zafira), duration=10.0, sampling_rate=200.0, seed=1)
    >>> np.array_equal(run.samples, again.samples)
    True
    """
    check_type("vehicle", vehicle, Structure)
    check_number("duration", duration, above=0)
    check_number("sampling_rate", sampling_rate, above=0)
    check_fits(vehicle, excitation)
    generator = np.random.default_rng(seed)
    drive = sampled_inputs(
        vehicle,
        excitation,
        duration=duration,
        sampling_rate=sampling_rate,
        least_rate=SMOOTH_RATE if excitation.is_smooth else 0.0,
        lead_in=lead_in,
        generator=generator,
    )
    if excitation.is_smooth:
        degree = 1 if drive.rate >= linear_rate(vehicle) else 3
        discrete = with_polynomial_inputs(vehicle.state_space(), sampling_rate=drive.rate, degree=degree)
        inputs = with_derivatives(drive.inputs, degree=degree)
    else:
        discrete, inputs = vehicle.discretised(drive.rate), drive.inputs
    recording = drive.recorded(response(discrete, inputs), vehicle, "simulated")
    if snr is None:
        return recording
    return with_noise(recording, snr=snr, band=noise_band, generator=generator)


@dataclass(frozen=True, eq=False, slots=True)
class SampledInputs:
    """Inputs of a vehicle over lead-in and recording, as they are simulated.

    Parameters
    ----------
    inputs
        Inputs at the samples, shape (inputs, samples).
    rate
        Rate of the samples [Hz]: that of the recording, or a multiple of it.
    n_lead
        Number of samples of the lead-in.
    sampling_rate
        Sampling rate of the recording [Hz].
    source
        Kind of the excitation.
    """

    inputs: Real
    rate: float
    n_lead: int
    sampling_rate: float
    source: str

    def recorded(self, readings: Real, vehicle: Structure, verb: str) -> Recording:
        """Return the recording of readings at all samples, shape (channels, samples); `verb` says how they came."""
        duration = (readings.shape[1] - self.n_lead) / self.rate
        recording = Recording(
            samples=readings[:, self.n_lead :],
            sampling_rate=self.rate,
            channels=vehicle.outputs.channels,
            history=(f"{verb} {duration:g} s at {self.rate:g} Hz, driven by {self.source}",),
        )
        return recording if self.rate == self.sampling_rate else decimate(recording, self.sampling_rate)


def sampled_inputs(
    vehicle: Structure,
    excitation: Excitation,
    *,
    duration: float,
    sampling_rate: float,
    least_rate: float,
    lead_in: float | None,
    generator: np.random.Generator,
) -> SampledInputs:
    """Return the inputs of a vehicle from an excitation, over lead-in and recording.

    Parameters
    ----------
    vehicle, excitation, duration, sampling_rate, lead_in
        As in `simulate`.
    least_rate
        Lowest rate of the samples [Hz]; they have a multiple of the sampling rate.
    generator
        Generator of the random numbers of the excitation.
    """
    oversampling = max(1, math.ceil(least_rate / sampling_rate))
    rate = oversampling * sampling_rate
    n_samples = max(1, round(duration * sampling_rate)) * oversampling
    n_lead = math.ceil((settling_time(vehicle) if lead_in is None else lead_in) * sampling_rate) * oversampling
    inputs = excitation.samples(n_lead + n_samples, sampling_rate=rate, generator=generator, start=-n_lead / rate)
    return SampledInputs(inputs, rate, n_lead, sampling_rate, type(excitation).__name__)


def usual_excitation(vehicle: Structure) -> Excitation:
    """Return white excitation of every input: forces of 1 N, base displacements of 0.1 mm (standard deviation).

    Examples
    --------
    >>> from sprung.vehicles import chain, read_vehicle, structure
    >>> usual_excitation(chain()).standard_deviation
    1.0
    >>> usual_excitation(structure(read_vehicle("zafira"))).standard_deviation
    0.0001
    """
    check_type("vehicle", vehicle, Structure)
    moved = any(element.foot is not None for element in vehicle.elements)
    return RandomInputs(len(vehicle.inputs), standard_deviation=1e-4 if moved else 1.0)
