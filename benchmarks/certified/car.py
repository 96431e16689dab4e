"""The certified drive: a linear car of seven degrees of freedom on a Gaussian road, sampled exactly.

The road under each wheel is integrated white noise (waviness 2) above 0.01 cycles/m. White noise w_c common to both
tracks passes a low-pass L = b / (s + b), that of each track 1 - L: as |L|^2 + |1 - L|^2 = 1 both tracks have the stated
roughness, and their cross spectrum is |L|^2 of it, 1 / (1 + (n / n_b)^2) over the spatial frequency n. The rear wheels
pass the same points a whole number of samples later.
"""

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.certified.bounds import Complex, information
from benchmarks.certified.systems import Array, delayed_pair
from scipy.linalg import expm

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
PARTS = ("spring", "damper", "tyre")
RATE, DURATION, SNR, SEED = 100.0, 150.0, 10.0, 12
#: Speeds [m/s] of the stretches and the samples by which the rear wheels follow: wheelbase * RATE / speed.
DELAYS = {13.5: 20, 18.0: 15, 22.5: 12}
#: Roughness G(n0) [m^3] at n0 = 0.1 cycles/m (class C of ISO 8608), lowest spatial frequency and that of half the
#: correlation between the tracks [cycles/m].
ROUGHNESS, LOWEST, HALF_COHERENT = 256e-6, 0.01, 0.46
_BEFORE = 6000


@dataclass(frozen=True, eq=False)
class Car:
    """Masses, geometry, and springs, dampers and tyres of the corners, in the order of `CORNERS` and `PARTS`."""

    mass: float = 1400.0
    pitch_inertia: float = 2100.0
    roll_inertia: float = 480.0
    x: tuple[float, float] = (1.2, -1.5)
    half_track: float = 0.75
    unsprung_mass: tuple[float, float] = (40.0, 40.0)
    components: tuple[float, ...] = (30e3, 1900.0, 200e3) * 2 + (26e3, 1700.0, 200e3) * 2

    def matrices(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return M, C, K, the forces of the road's heights and the rows of the corners of the body."""
        corners = np.array([[1.0, -x, side * self.half_track] for x in self.x for side in (1, -1)])
        stretch = np.hstack([corners, -np.eye(4)])
        spring, damper, tyre = np.reshape(self.components, (4, 3)).T
        M = np.diag([self.mass, self.pitch_inertia, self.roll_inertia, *np.repeat(self.unsprung_mass, 2)])
        K = (stretch.T * spring) @ stretch
        K[3:, 3:] += np.diag(tyre)
        return (
            M,
            (stretch.T * damper) @ stretch,
            K,
            np.vstack([np.zeros((3, 4)), np.diag(tyre)]),
            np.hstack([corners, np.zeros((4, 4))]),
        )


NOMINAL = Car()
#: What drives: a soft spring, a worn damper, a tyre with too much pressure.
FACTORS = {"front_left.spring": 0.80, "rear_right.damper": 0.70, "rear_left.tyre": 1.10}
NAMES = tuple(f"{corner}.{part}" for corner in CORNERS for part in PARTS)
DRIVEN = replace(
    NOMINAL,
    components=tuple(round(FACTORS.get(name, 1.0) * v, 6) for name, v in zip(NAMES, NOMINAL.components, strict=True)),
)


@dataclass(frozen=True, eq=False)
class Stretch:
    """x[k+1] = A x[k] + F e[k] + R e[k - delay], accelerations of the body's corners y[k] = C x[k]."""

    A: Array
    F: Array
    R: Array
    C: Array
    delay: int

    def spectra(self, z: Complex) -> Complex:
        """Return the spectral matrix at z on the unit circle, shape (len(z), 4, 4)."""
        entering = self.F + self.R * (z[:, None, None] ** -self.delay)
        response = self.C @ np.linalg.solve(z[:, None, None] * np.eye(len(self.A)) - self.A, entering)
        return response @ response.conj().swapaxes(1, 2)

    def run(self, n: int, rng: np.random.Generator) -> Array:
        """Return n samples after a minute of driving, shape (4, n)."""
        n_all = n + _BEFORE
        e = rng.standard_normal((n_all + self.delay, self.F.shape[1]))
        steps = e[self.delay :] @ self.F.T + e[:n_all] @ self.R.T
        state, states = np.zeros(len(self.A)), np.empty((n_all, len(self.A)))
        for k, step in enumerate(steps):
            states[k] = state
            state = self.A @ state + step
        return self.C @ states[_BEFORE:].T


def stretch(car: Car, speed: float, *, roughness: float = ROUGHNESS, half_coherent: float = HALF_COHERENT) -> Stretch:
    """Return the drive of a car at one of the speeds."""
    M, damping, K, tyres, rows = car.matrices()
    n = len(M)
    b, a = 2 * np.pi * speed * np.array([half_coherent, LOWEST])
    profile = np.diag([-b, -b, -b, -a, -a])  # low-passed w_c, w_l, w_r; heights of left and right
    profile[3, :2], profile[4, [0, 2]] = [1.0, -1.0], [1.0, -1.0]
    intensity = np.sqrt(2 * np.pi**2 * roughness * 0.1**2 * speed)
    source = intensity * np.array([[b, 0, 0], [0, b, 0], [0, 0, b], [0, 1, 0], [0, 0, 1]])
    heights = np.zeros((4, 10))
    heights[[0, 1, 2, 3], [3, 4, 8, 9]] = 1.0
    accelerations = np.linalg.solve(M, np.hstack([-K, -damping, tyres @ heights]))
    A = np.zeros((2 * n + 10, 2 * n + 10))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n] = accelerations
    A[2 * n : 2 * n + 5, 2 * n : 2 * n + 5] = A[2 * n + 5 :, 2 * n + 5 :] = profile
    front, rear = np.zeros((len(A), 3)), np.zeros((len(A), 3))
    front[2 * n : 2 * n + 5], rear[2 * n + 5 :] = source, source
    both = delayed_pair(A, front, rear, 1 / RATE)
    return Stretch(expm(A / RATE), both[: len(A)], both[len(A) :], rows @ accelerations, DELAYS[speed])


def noise_levels() -> Array:
    """Return the RMS of the noise of each sensor: that of its motion at the middle speed over the SNR."""
    nu, weights = _grid()
    power = np.einsum("z,zcc->c", 2 * weights, stretch(DRIVEN, 18.0).spectra(np.exp(2j * np.pi * nu))).real
    return np.sqrt(power) / SNR


def samples(realisation: int = 0) -> list[Array]:
    """Return accelerations of the four corners and the speed of each stretch, shape (5, n)."""
    rng, n, noise = np.random.default_rng((SEED, realisation)), int(DURATION * RATE), noise_levels()[:, None]
    runs = []
    for speed in DELAYS:
        motion = stretch(DRIVEN, speed).run(n, rng) + noise * rng.standard_normal((4, n))
        runs.append(np.vstack([motion, np.full(n, speed)]))
    return runs


def covariance(*, n_nodes: int = 8) -> Array:
    """Return the inverse Fisher information of ln(component), shape (12, 12).

    Unknown besides: the unsprung mass of each axle, the roughness in each stretch, the spatial frequency of half the
    correlation of the tracks, the noise of each sensor. Known: geometry, body, waviness, speed. `n_nodes` in each panel
    of the quadrature.
    """
    nu, weights = _grid(n_nodes)
    z, noise = np.exp(2j * np.pi * nu), noise_levels() ** 2
    total = np.zeros((22, 22))
    for number, speed in enumerate(DELAYS):
        seen = np.array([*range(15), 15 + number, *range(18, 22)])

        def spectra(logs: Array, speed: float = speed) -> Complex:
            components, masses, half_coherent, roughness, levels = np.split(np.exp(logs), [12, 14, 15, 16])
            car = replace(
                DRIVEN,
                components=tuple(components * DRIVEN.components),
                unsprung_mass=tuple(masses * DRIVEN.unsprung_mass),
            )
            S = stretch(car, speed, half_coherent=HALF_COHERENT * float(half_coherent[0])).spectra(z) * roughness
            S[:, range(4), range(4)] += noise * levels
            return S

        total[np.ix_(seen, seen)] += information(spectra, np.zeros(20), np.full(20, 0.5), DURATION * RATE * weights)
    return np.linalg.inv(total)[:12, :12]


def modes(car: Car) -> tuple[Array, Array]:
    """Return natural frequencies [Hz] and damping ratios of the seven modes, by rising frequency."""
    M, damping, K, _, _ = car.matrices()
    n = len(M)
    poles = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, damping)]])
    )
    poles = poles[poles.imag > 0]
    poles = poles[np.argsort(np.abs(poles))]
    return np.abs(poles) / (2 * np.pi), -poles.real / np.abs(poles)


def modal_deviations(of_logs: Array) -> tuple[Array, Array]:
    """Return the bounds of the modes' frequencies and damping ratios that bounds of ln(component) imply."""
    slopes = []
    for k in range(12):
        sides = []
        for step in (1e-5, -1e-5):
            factors = np.ones(12)
            factors[k] += step
            sides.append(np.array(modes(replace(DRIVEN, components=tuple(factors * DRIVEN.components)))))
        slopes.append((sides[0] - sides[1]) / 2e-5)
    J = np.array(slopes)
    frequency, damping = np.sqrt(np.einsum("kvm,kl,lvm->vm", J, of_logs, J))
    return frequency, damping


def _grid(n_nodes: int = 8) -> tuple[Array, Array]:
    """Return nodes and weights of panels of 0.25 Hz: the delay of the rear wheels turns once in 5 Hz."""
    nodes, weights = np.polynomial.legendre.leggauss(n_nodes)
    edges = np.unique(np.concatenate([np.linspace(0, 2, 41), np.arange(2, RATE / 2 + 0.25, 0.25)])) / RATE
    half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
    return (middle + half * nodes).ravel(), (half * weights).ravel()
