"""Poles of free responses by least squares, with the shapes of every record free: where the search for modes begins."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.free_response import FreeLines
from sprung.likelihood.search import least_squares


@dataclass(frozen=True, slots=True)
class _PoleRules:
    """How poles are searched."""

    #: Bounds of the damping ratios.
    damping: tuple[float, float] = (1e-4, 0.95)
    #: Frequencies in each octave, and damping ratios, among which a further pole is sought.
    per_octave: int = 8
    further: tuple[float, ...] = (0.03, 0.1, 0.2, 0.4)
    #: Longest step of a logarithm.
    longest: float = 0.5
    #: Gain of the log likelihood at which the search ends: another one begins from the poles.
    gain: float = 0.01


_RULES = _PoleRules()
#: Least part of a further pole beside those that are there, in power.
_LEAST_PART = 1e-9


@dataclass(frozen=True, eq=False)
class FreePoles:
    """Poles of free responses whose residues are free in every record and channel.

    Parameters
    ----------
    data
        Lines of the records.
    poles
        Continuous poles [rad/s], shape (poles,).

    Notes
    -----
    The lines are linear in the residues, which least squares over each record give. Only frequencies and damping ratios
    are searched (variable projection); each channel counts by the inverse power of what is left of it.

    References
    ----------
    G. H. Golub and V. Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
    variables separate, SIAM Journal on Numerical Analysis 10 (1973), 413-432; derivatives as in L. Kaufman, A variable
    projection method for solving separable nonlinear least squares problems, BIT 15 (1975), 49-57.
    """

    data: FreeLines
    poles: Complex

    @cached_property
    def noise(self) -> Real:
        """Power of the lines that is left of each channel, shape (channels,)."""
        left = sum(np.sum(part.left**2, axis=0) for part in self._parts)
        power = np.sum(np.abs(self.data.values) ** 2, axis=0)
        return np.asarray(np.maximum(left, 1e-26 * power) / len(self.data.values))

    @cached_property
    def mode_shapes(self) -> Complex:
        """Shapes of largest amplitude over the records, of any scale, shape (poles, channels)."""
        n, scale = len(self.poles), np.sqrt(self.noise)
        residues = np.array([part.residues[:n] + 1j * part.residues[n:] for part in self._parts]) / scale
        return np.asarray([np.linalg.svd(residues[:, k])[2][0] * scale for k in range(n)]).reshape(n, -1)

    def refined(self) -> "FreePoles":
        """Return the poles of largest likelihood near these."""
        return least_squares(self, gain=_RULES.gain)

    @cached_property
    def criterion(self) -> float:
        """Minus the log likelihood, but for a constant."""
        return float(len(self.data.values) * np.sum(np.log(self.noise)))

    def with_another(self, *, nearer: float = np.inf) -> "FreePoles":
        """Return these poles and the one of a grid that explains most of what they leave.

        Parameters
        ----------
        nearer
            Largest distance of the logarithm of its frequency from that of one of these poles.
        """
        low, high = np.log2([self.data.frequencies.min(), self.data.frequencies.max()])
        octaves = np.arange(low - 1, high, 1 / _RULES.per_octave)
        xi = np.repeat(_RULES.further, octaves.size)
        grid = 2 * np.pi * np.tile(2**octaves, len(_RULES.further)) * (1j * np.sqrt(1 - xi**2) - xi)
        if np.isfinite(nearer):
            near = np.min(np.abs(np.log(np.abs(grid / self.poles[:, None]))), axis=0) < nearer
            grid = grid[near] if near.any() else grid  # poles may have left the band
        gains = np.zeros(grid.size)
        for number, part in enumerate(self._parts):
            further = _stacked(self._columns(number, grid)[0])
            further = further - part.basis @ (part.basis.T @ further)
            first, second = further[:, : grid.size], further[:, grid.size :]
            crossed = np.sum(first * second, axis=0)
            powers = np.sum(first**2, axis=0), np.sum(second**2, axis=0)
            left = (part.left / np.sqrt(self.noise)).T
            with_first, with_second = left @ first, left @ second
            gains += np.sum(
                powers[1] * with_first**2 + powers[0] * with_second**2 - 2 * crossed * with_first * with_second, axis=0
            ) / (powers[0] * powers[1] * (1 + _LEAST_PART) - crossed**2)
        return FreePoles(self.data, np.append(self.poles, grid[np.argmax(gains)]))

    def moved(self, step: Real) -> "FreePoles":
        """Return poles after a step of the logarithms of frequencies, then damping ratios, shape (2 poles,)."""
        step = np.clip(step, -_RULES.longest, _RULES.longest).reshape(2, -1)
        f, xi = np.abs(self.poles) * np.exp(step[0]), -self.poles.real / np.abs(self.poles) * np.exp(step[1])
        f = np.clip(f, np.pi * self.data.frequencies.min(), 2 * np.pi * self.data.frequencies.max())
        xi = np.clip(xi, *_RULES.damping)
        return FreePoles(self.data, f * (1j * np.sqrt(1 - xi**2) - xi))

    @property
    def errors(self) -> Real:
        """What is left of all lines, real and imaginary parts over the noise, shape (errors,)."""
        return np.concatenate([(part.left / np.sqrt(self.noise)).ravel() for part in self._parts])

    def slopes(self) -> Real:
        """Return the derivatives of the errors by logarithms of frequencies and damping ratios."""
        n, xi = len(self.poles), -self.poles.real / np.abs(self.poles)
        steps = np.stack([self.poles, np.abs(self.poles) * (-xi - 1j * xi**2 / np.sqrt(1 - xi**2))])
        rows = []
        for number, part in enumerate(self._parts):
            slopes = [_stacked(each) for each in self._columns(number, self.poles, steps)]
            moved = np.stack([slope[:, k::n] @ part.residues[k::n] for slope in slopes for k in range(n)], axis=-1)
            flat = moved.reshape(len(moved), -1)
            flat = flat - part.basis @ (part.basis.T @ flat)
            rows.append(-(flat.reshape(moved.shape) / np.sqrt(self.noise)[:, None]).reshape(-1, 2 * n))
        return np.concatenate(rows)

    @cached_property
    def _parts(self) -> "list[_Part]":
        """Each record at these poles."""
        parts = []
        for number in range(self.data.n_records):
            wanted = _stacked(self.data.values[self.data.of_records[number]])
            basis, triangle = np.linalg.qr(_stacked(self._columns(number, self.poles)[0]))
            inside = basis.T @ wanted
            parts.append(_Part(basis, triangle, inside, wanted - basis @ inside))
        return parts

    def _columns(self, number: int, poles: Complex, steps: Complex | None = None) -> list[Complex]:
        """Return a record's lines of unit real and imaginary residues, or their derivatives; (lines, 2 poles)."""
        own, rate = self.data.of_records[number], self.data.sampling_rate
        turn = self.data.turn[own]
        z, gains = np.exp(poles / rate), self.data.gains[own, None]
        ahead, behind = gains / (1 - z * turn), gains / (1 - z.conj() * turn)
        if steps is None:
            return [np.hstack([ahead + behind, 1j * (ahead - behind)])]
        ahead, behind = ahead**2 * z * turn / (rate * gains), behind**2 * z.conj() * turn / (rate * gains)
        moved = [(ahead * step, behind * step.conj()) for step in steps]
        return [np.hstack([forward + backward, 1j * (forward - backward)]) for forward, backward in moved]


@dataclass(frozen=True, eq=False)
class _Part:
    """One record: basis and triangle (QR) of its lines at the poles, its lines in the basis, and what is left."""

    basis: Real
    triangle: Real
    inside: Real
    left: Real

    @cached_property
    def residues(self) -> Real:
        """Real parts of the residues above the imaginary ones, shape (2 poles, channels)."""
        return np.asarray(np.linalg.lstsq(self.triangle, self.inside, rcond=1e-12)[0], dtype=np.float64)


def _stacked(lines: Complex) -> Real:
    """Return real parts above imaginary ones."""
    return np.concatenate([lines.real, lines.imag])
