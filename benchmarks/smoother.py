"""The road by a Rauch-Tung-Striebel smoother of the fitted car, beside the spectral inverse: see `benchmarks.road`."""

import numpy as np
import scipy.linalg

from sprung.likelihood import CornerFit
from sprung.likelihood.coordinates import TYPICAL_NOISE
from sprung.likelihood.corners import fitted_structure
from sprung.vehicles.system import state_space
from sprung.vehicles.window import Window

#: Relative error of the model, as noise, and spatial frequencies [1/m] below which the mean of the tracks and their
#: difference have no power.
ERROR, ENDS = 0.02, (0.01, 0.07)


def smoothed(window: Window, fit: CornerFit) -> np.ndarray:
    """Return the heights of both tracks under the front axle at each sample [m], shape (2, samples).

    States are those of the car, and the last heights of mean and difference of the tracks until the rear axle has
    passed: its wheels repeat the front ones with the delay of the speed, between samples. Heights are first-order
    processes in space, straight between samples; the filter runs forward, and the smoother backward in the form of
    Bryson and Frazier, which gives the estimates of Rauch, Tung and Striebel and stores no covariances.
    (G. J. Bierman, Fixed interval smoothing with discrete measurements, International Journal of Control 18 (1973) 65.)
    """
    recording, rate = window.motion, window.motion.sampling_rate
    car = fitted_structure(fit.model, fit.parameters)
    names, values = [str(name) for name in fit.model.names], dict(zip(fit.model.names, fit.parameters, strict=True))
    space = state_space(car.system, car.outputs)
    size, n_inputs = space.input_matrix.shape
    held = np.zeros((size + 2 * n_inputs,) * 2)
    held[:size, :size], held[:size, size : size + n_inputs] = space.state_matrix / rate, space.input_matrix / rate
    held[size : size + n_inputs, size + n_inputs :] = np.eye(n_inputs)
    step, first, second = np.split(scipy.linalg.expm(held)[:size], [size, size + n_inputs], axis=1)
    speed = np.maximum(window.recording.samples[window.recording.index(window.speed or "")], 3.0)
    wheels = [wheel.x for wheel in window.vehicle.wheels]
    base = max(wheels) - min(wheels)
    delay = base / speed * rate * np.exp(values.get("delay", 0.0))
    n = int(np.ceil(delay.max())) + 2
    sides = np.array([0.5 if wheel.y > 0 else -0.5 for wheel in window.vehicle.wheels])
    is_rear = np.array(wheels) < max(wheels) - 0.5 * base
    # White slopes of the roughness G(n0) at n0 = 0.1 / m, of waviness 2: the mean has half of the power of a track.
    slopes = 2 * np.pi**2 * 0.1**2 * np.exp(values["roughness"]) * np.array([0.5, 2.0])
    y = recording.select(list(fit.model.layout.names)).samples
    noise = [np.exp(values[name]) * TYPICAL_NOISE[2] ** 2 * rate / 2 for name in names if name.startswith("noise_")]
    R = np.diag(np.array(noise) + ERROR**2 * y.var(axis=1))
    own = size + np.array([0, n])

    def heights(k: int) -> np.ndarray:
        """Heights under all wheels for one unit of each state, shape (wheels, states)."""
        of = np.zeros((n_inputs, size + 2 * n))
        whole, part = int(delay[k]), delay[k] % 1
        for wheel, side in enumerate(sides):
            for start, factor in ((size, 1.0), (size + n, side)):
                if is_rear[wheel]:
                    of[wheel, start + whole], of[wheel, start + whole + 1] = factor * (1 - part), factor * part
                else:
                    of[wheel, start] = factor
        return of

    shift = np.zeros((size + 2 * n,) * 2)
    shift[size:, size:] = scipy.linalg.block_diag(np.eye(n, k=-1), np.eye(n, k=-1))
    x, P, before = np.zeros(size + 2 * n), 1e-4 * np.eye(size + 2 * n), heights(0)
    states, rows, kept = [], [], []
    for k in range(y.shape[1]):
        now, along = heights(k), speed[k] / rate
        F = shift.copy()
        F[own, own] = np.exp(-2 * np.pi * np.array(ENDS) * along)
        F[:size] = second @ now @ F + first @ before - second @ before
        F[:size, :size] += step
        entry = np.zeros((size + 2 * n, 2))
        entry[own, [0, 1]] = 1.0
        entry[:size] = second @ now[:, own]
        x, P = F @ x, F @ P @ F.T + (entry * slopes * along) @ entry.T
        H = space.feedthrough @ now
        H[:, :size] += space.output_matrix
        innovation, S = y[:, k] - H @ x, H @ P @ H.T + R
        gain = np.linalg.solve(S, H @ P).T
        weighed = H.T @ np.linalg.solve(S, innovation)
        states.append(x[own])
        rows.append(P[own])
        kept.append((F, gain, H, weighed))
        x, P = x + gain @ innovation, P - gain @ (H @ P)
        P, before = (P + P.T) / 2, now
    back, found = np.zeros(size + 2 * n), np.zeros((2, y.shape[1]))
    for k in range(y.shape[1] - 1, -1, -1):
        F, gain, H, weighed = kept[k]
        back = weighed + back - H.T @ (gain.T @ back)
        mean, difference = states[k] + rows[k] @ back
        found[:, k] = mean + difference / 2, mean - difference / 2
        back = F.T @ back
    return found
