"""Lateral signals of simulated drives of rail vehicles."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.errors import ParameterError
from sprung.excitation import SpeedProfile, SurfaceMotion, rail_alignment, rail_quality
from sprung.recording import Recording
from sprung.signals.conditioning import decimate
from sprung.simulation.linear import SMOOTH_RATE, response, with_derivatives, with_polynomial_inputs
from sprung.vehicles import Vehicle, state_space
from sprung.vehicles.lateral import critical_speed, lateral_outputs, lateral_system, with_lateral


def lateral_signals(
    recording: Recording,
    vehicle: Vehicle,
    *,
    log_ratios: Mapping[str, float],
    quality: str,
    speed: SpeedProfile,
    generator: np.random.Generator,
) -> Recording:
    """Return a recording with the signals of its lateral sensors.

    Parameters
    ----------
    recording
        Recording of all motion sensors, whose lateral channels are replaced.
    vehicle
        Vehicle with lateral tables.
    log_ratios
        ln(true value / value of the file) of lateral components.
    quality
        Quality of the track, as of `rail_quality`.
    speed
        Speed over time.
    generator
        Generator of the track.

    Notes
    -----
    The steady response at each of several speeds is weighted by how near the speed is to them, as a vehicle whose speed
    changes slowly moves. Alignment and cross level are independent.

    References
    ----------
    ERRI B176, Bogies with steered or steering wheelsets (1989).
    """
    true, outputs = with_lateral(vehicle, log_ratios), lateral_outputs(vehicle)
    oversampling = int(np.ceil(SMOOTH_RATE / recording.sampling_rate))
    rate = oversampling * recording.sampling_rate
    time = np.arange(-round(_lead(true, speed, recording.duration) * rate), recording.n_samples * oversampling) / rate
    inputs = _irregularities(true, time, quality, speed, generator)
    knots, weights = _near_speeds(np.asarray(speed.speed(time)))
    readings = np.zeros((len(outputs.channels), time.size))
    for knot, weight in zip(knots, weights, strict=True):
        continuous = state_space(lateral_system(true, speed=knot), outputs)
        readings += weight * response(with_polynomial_inputs(continuous, sampling_rate=rate), with_derivatives(inputs))
    kept = Recording(readings[:, time >= 0], rate, outputs.channels)
    lateral = kept if oversampling == 1 else decimate(kept, recording.sampling_rate)
    samples = recording.samples.copy()
    samples[[recording.index(name) for name in outputs.names]] = lateral.samples[:, : recording.n_samples]
    return replace(recording, samples=samples)


def _lead(vehicle: Vehicle, speed: SpeedProfile, duration: float) -> float:
    """Return the time in which lateral motion settles [s]; refuse a speed at which the vehicle hunts."""
    highest = float(np.max(speed.speed(np.linspace(0.0, duration, 1000))))
    slowest = -float(np.linalg.eigvals(lateral_system(vehicle, speed=highest).state_matrix()).real.max())
    if slowest <= 0:
        raise ParameterError(
            f"vehicle {vehicle.name!r} hunts at {highest:.3g} m/s, which linear motion does not survive: stay below "
            f"{critical_speed(vehicle) or highest:.3g} m/s"
        )
    return min(-np.log(1e-4) / slowest, duration)


def _irregularities(
    vehicle: Vehicle, time: Real, quality: str, speed: SpeedProfile, generator: np.random.Generator
) -> Real:
    """Return alignment [m] and roll [rad] of the track under each wheelset."""
    places = tuple(wheel.x for wheel in vehicle.wheels[::2])
    rails = [
        SurfaceMotion(track, places, speed, contact_length=0.01).at(time, generator).reshape(len(places), 2, -1)
        for track in (rail_alignment(quality), rail_quality(quality))
    ]
    return np.vstack(
        [rails[0].mean(axis=1), (rails[1][:, 0] - rails[1][:, 1]) / (2 * vehicle.bogie[0].contact_half_spacing)]
    )


def _near_speeds(speed: Real) -> tuple[Sequence[float], Real]:
    """Return the speeds to simulate, 3 % apart, and the weight of each over time."""
    low, high = max(float(speed.min()), 1.0), max(float(speed.max()), 1.0)
    n_steps = int(np.ceil(np.log(high / low) / 0.03))
    knots = np.geomspace(low, high, n_steps + 1) if n_steps else np.array([low])
    unit = np.eye(knots.size)
    return knots.tolist(), np.array([np.interp(speed, knots, row) for row in unit])
