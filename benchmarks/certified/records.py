"""The certified records: systems, sampling, noise and seeds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from benchmarks.certified.systems import Array, Sampled, System, accelerations, chain, velocities, with_modes
from scipy.linalg import block_diag, eigh

#: Counts of the files per RMS of the strongest channel: rounding adds noise 1/3,500 of it.
COUNTS = 1000


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of one sensor: RMS over that of its motion, and correlation of neighbouring samples (0: white)."""

    level: float
    correlation: float = 0.0

    def samples(self, n: int, rng: np.random.Generator) -> Array:
        """Return stationary noise of unit RMS."""
        white = rng.standard_normal(n)
        a = self.correlation
        if a == 0:
            return white
        noise = np.empty(n)
        noise[0] = white[0]
        for k in range(1, n):
            noise[k] = a * noise[k - 1] + np.sqrt(1 - a**2) * white[k]
        return noise


@dataclass(frozen=True, eq=False)
class Tone:
    """Sine at a frequency [Hz] with an amplitude in RMS of the motion of each channel."""

    frequency: float
    amplitude: Array


@dataclass(frozen=True, eq=False)
class Record:
    """Stationary response of a system, with the noise of its sensors.

    `sampled` is `velocities` (continuous white forces) or `accelerations` (forces held between samples).
    """

    title: str
    system: System
    sampled: Callable[[System, float], Sampled]
    rate: float
    n_samples: int
    noise: tuple[Noise, ...]
    seed: int
    tones: tuple[Tone, ...] = ()

    @property
    def quantity(self) -> tuple[str, str]:
        """Quantity of the channels and its unit."""
        return ("velocity", "m/s") if self.sampled is velocities else ("acceleration", "m/s^2")

    def samples(self, realisation: int = 0) -> Array:
        """Return the samples, shape (channels, n); realisation 0 is the certified one."""
        rng = np.random.default_rng((self.seed, realisation))
        model = self.sampled(self.system, self.rate)
        rms = model.rms()
        samples = model.run(self.n_samples, rng)
        for tone in self.tones:
            phase = 2 * np.pi * (tone.frequency * np.arange(self.n_samples) / self.rate + rng.uniform())
            samples += np.outer(rms * tone.amplitude * np.sqrt(2), np.sin(phase))
        noise = [
            level * each.level * each.samples(self.n_samples, rng) for level, each in zip(rms, self.noise, strict=True)
        ]
        return samples + np.array(noise)


@dataclass(frozen=True, eq=False)
class Decay:
    """Free vibration with white noise of a given RMS in every channel.

    `begin` holds the amplitudes of the decaying cosine and sine of each mode, shape (modes, 2).
    """

    title: str
    system: System
    begin: Array
    rate: float
    n_samples: int
    noise: float
    seed: int
    quantity: tuple[str, str] = ("displacement", "m")
    tones: tuple[Tone, ...] = field(default=(), init=False)

    def motion(self, frequency: Array, damping: Array, shapes: Array, begin: Array) -> Array:
        """Return the exact displacements of the sensors, shape (channels, n)."""
        omega, time = 2 * np.pi * frequency[:, None], np.arange(self.n_samples) / self.rate
        turning = np.sqrt(1 - damping[:, None] ** 2) * omega * time
        waves = np.exp(-damping[:, None] * omega * time) * (
            begin[:, :1] * np.cos(turning) + begin[:, 1:] * np.sin(turning)
        )
        return shapes @ waves

    def samples(self, realisation: int = 0) -> Array:
        """Return the samples, shape (channels, n); realisation 0 is the certified one."""
        rng = np.random.default_rng((self.seed, realisation))
        frequency, damping, shapes, _ = self.system.modal()
        motion = self.motion(frequency, damping, shapes, self.begin)
        return motion + self.noise * rng.standard_normal(motion.shape)


@dataclass(frozen=True, eq=False)
class Friction:
    """Free swing of one mass with viscous damping and dry friction, read by displacement sensors with white noise.

    `sticking` is the friction force over the stiffness [m], `begin` the first turn [m]. Between two turns the motion is
    linear around the sticking displacement on the side from which it comes; it ends at the first turn within it.
    """

    title: str
    system: System
    sticking: float
    begin: float
    rate: float
    n_samples: int
    noise: float
    seed: int
    quantity: tuple[str, str] = ("displacement", "m")
    tones: tuple[Tone, ...] = field(default=(), init=False)

    def motion(self, frequency: float, damping: float, sticking: float, gains: Array) -> Array:
        """Return the exact displacements of the sensors, shape (channels, n)."""
        omega = 2 * np.pi * frequency
        turning = omega * np.sqrt(1 - damping**2)
        time, half, turn = np.arange(self.n_samples) / self.rate, np.pi / turning, self.begin
        motion, start = np.empty(self.n_samples), 0.0
        while abs(turn) > sticking and start <= time[-1]:
            centre = sticking * np.sign(turn)
            part = (time >= start) & (time < start + half)
            after = time[part] - start
            wave = np.cos(turning * after) + damping * omega / turning * np.sin(turning * after)
            motion[part] = centre + (turn - centre) * np.exp(-damping * omega * after) * wave
            turn = centre - (turn - centre) * np.exp(-damping * omega * half)
            start += half
        motion[time >= start] = turn
        return np.outer(gains, motion)

    def samples(self, realisation: int = 0) -> Array:
        """Return the samples, shape (channels, n); realisation 0 is the certified one."""
        rng = np.random.default_rng((self.seed, realisation))
        frequency, damping, shapes, _ = self.system.modal()
        motion = self.motion(float(frequency[0]), float(damping[0]), self.sticking, shapes[:, 0] / shapes[0, 0])
        return motion + self.noise * rng.standard_normal(motion.shape)


def white(level: float, n: int) -> tuple[Noise, ...]:
    """Return the same white noise for n sensors."""
    return (Noise(level),) * n


def rotation(*angles: float) -> Array:
    """Return an orthonormal matrix: turns by the angles [rad] in the planes (0, 1), (1, 2) and so on."""
    result = np.eye(len(angles) + 1)
    for k, angle in enumerate(angles):
        turn = np.eye(len(result))
        turn[k : k + 2, k : k + 2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        result = result @ turn
    return result


def floor_sensors() -> Array:
    """Return four sensors on a stiff floor that sways in two directions and twists: rows (x, y, twist times 3 m)."""
    return np.array([[1.0, 0.0, -0.8], [1.0, 0.0, 0.8], [0.0, 1.0, -0.6], [0.0, 1.0, 0.6]])


def bogie() -> System:
    """Return a bogie frame on four primary suspensions: bounce, pitch, roll; forces at and sensors above the boxes."""
    mass, pitch, roll, half_base, half_track = 2615.0, 1476.0, 1722.0, 0.9, 1.0
    corners = np.array([[1.0, -x, y] for x in (half_base, -half_base) for y in (half_track, -half_track)])
    stiffness, damping = 800e3, 6e3
    return System(
        np.diag([mass, pitch, roll]), damping * corners.T @ corners, stiffness * corners.T @ corners, corners.T, corners
    )


def beam(n_sensors: int = 12) -> System:
    """Return five sine-shaped modes of a beam on two supports, read by sensors at equal distances."""
    places = np.arange(1, n_sensors + 1) / (n_sensors + 1)
    sensors = np.array([np.sin((k + 1) * np.pi * places) for k in range(5)]).T
    return with_modes([1.31, 2.07, 2.9, 3.7, 4.4], [0.012, 0.010, 0.011, 0.009, 0.012], np.eye(5), sensors)


def building() -> System:
    """Return the 12-DOF structure of phase I of the IASC-ASCE benchmark, with its 16 accelerometers at mid-sides.

    Its four floors move along y, along x and in torsion; masses [kg; kg m^2] are from the ground up, the stiffness
    [N/m; N m] is that of every storey (E. A. Johnson, H. F. Lam, L. S. Katafygiotis, J. L. Beck, Phase I IASC-ASCE
    structural health monitoring benchmark problem using simulated data, Journal of Engineering Mechanics 130 (2004)
    3-15). Damping ratios are 1 %. Forces act at the accelerometers, so that all modes move.
    """
    sway, twist = [3452.4, 2652.4, 2652.4, 1809.9], [3819.4, 2986.1, 2986.1, 2056.9]
    parts = [
        chain(np.array(masses), np.full(4, stiffness), np.zeros(4))
        for masses, stiffness in ((sway, 67.90e6), (sway, 106.60e6), (twist, 232.02e6))
    ]
    mass, stiffness = block_diag(*(part.mass for part in parts)), block_diag(*(part.stiffness for part in parts))
    squares, shapes = eigh(stiffness, mass)
    damping = mass @ (shapes * (2 * 0.01 * np.sqrt(squares))) @ shapes.T @ mass
    places = np.array([[0.0, 1.0, -1.25], [0.0, 1.0, 1.25], [1.0, 0.0, -1.25], [1.0, 0.0, 1.25]])
    sensors = np.kron(places, np.eye(4))
    return System(mass, damping, stiffness, sensors.T, sensors)


CHAIN = chain(np.ones(3), np.full(3, 9800.0), np.full(3, 5.0))
FRAME = chain(np.full(3, 1000.0), np.array([2.4e6, 2.0e6, 1.6e6]), np.array([2.4e3, 2.0e3, 1.6e3]) * 0.9)
TOWER = with_modes([3.00, 3.06, 4.50], [0.010, 0.012, 0.015], rotation(0.6, 0.3), floor_sensors())
DAMPED = with_modes([1.20, 2.60, 4.30], [0.20, 0.15, 0.10], rotation(0.5, 0.7), rotation(0.5, 0.7))
LIGHT = with_modes([2.5, 4.1, 6.7], [0.003, 0.003, 0.003], rotation(0.5, 0.6), np.eye(3))

RECORDS: Mapping[str, Record | Decay | Friction] = {
    "chain-snr10": Record("Chain of three masses, SNR 10", CHAIN, accelerations, 100.0, 6000, white(0.1, 3), 1),
    "chain-snr05": Record("The same chain, SNR 0.5", CHAIN, accelerations, 100.0, 6000, white(2.0, 3), 2),
    "close-modes": Record(
        "Two modes 2 % apart and a third, 4 channels", TOWER, velocities, 25.0, 15_000, white(0.1, 4), 3
    ),
    "heavy-damping": Record("Damping ratios of 20, 15 and 10 %", DAMPED, velocities, 25.0, 15_000, white(0.1, 3), 4),
    "light-damping": Record("Damping ratios of 0.3 %", LIGHT, velocities, 25.0, 15_000, white(0.1, 3), 5),
    "many-channels": Record("Five modes in 12 channels, SNR 5", beam(), velocities, 20.0, 6000, white(0.2, 12), 6),
    "short": Record("Frame, 20 periods of its first mode", FRAME, velocities, 50.0, 306, white(0.1, 3), 7),
    "correlated-noise": Record(
        "The frame with correlated noise, as strong as the motion, in one channel",
        FRAME,
        velocities,
        50.0,
        9000,
        (Noise(0.1), Noise(1.0, 0.9), Noise(0.1)),
        8,
    ),
    "tone": Record(
        "The frame with a tone 0.3 Hz above its second mode",
        FRAME,
        velocities,
        50.0,
        9000,
        white(0.1, 3),
        9,
        (Tone(8.87, np.array([1.0, 0.6, 0.8])),),
    ),
    "bogie": Record("Bogie frame: bounce, pitch, roll", bogie(), accelerations, 100.0, 12_000, white(0.05, 4), 10),
    "iasc-asce": Record(
        "Building of four storeys, 12 modes in 16 channels (IASC-ASCE, phase I)",
        building(),
        accelerations,
        250.0,
        10_000,
        white(0.1, 16),
        13,
    ),
    "free-decay": Decay(
        "Free decay of three modes",
        FRAME,
        np.array([[1.0, 0.0], [0.4, 0.3], [0.2, -0.2]]),
        50.0,
        1500,
        2e-4,
        11,
    ),
    "friction": Friction(
        "Swing of one mass with viscous damping and dry friction",
        with_modes([1.5], [0.08], np.eye(1), np.array([[1.0], [-0.6]])),
        1.5e-3,
        20e-3,
        100.0,
        400,
        1e-4,
        12,
    ),
}
