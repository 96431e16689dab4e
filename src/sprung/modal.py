"""Poles and modes, and measures of their shapes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_type, freeze
from sprung._display import Drawable, Tabular, counted, in_short, listed
from sprung.errors import ParameterError

#: Half width of a 95 % interval in standard deviations of a normal variable, to two decimals.
INTERVAL_95 = 1.96


def natural_frequency(poles: Complex) -> Real:
    """Return the undamped natural frequency abs(pole) / 2 pi [Hz] of continuous poles [rad/s].

    Examples
    --------
    >>> natural_frequency(2 * np.pi * np.array([-0.6 + 0.8j, -3.0 + 4.0j])).round(6).tolist()
    [1.0, 5.0]
    """
    return np.abs(poles) / (2 * np.pi)


def damping_ratio(poles: Complex) -> Real:
    """Return the damping ratio -Re(pole) / abs(pole) of continuous poles [rad/s].

    Examples
    --------
    >>> damping_ratio(np.array([-0.6 + 0.8j, -3.0 + 4.0j])).round(6).tolist()
    [0.6, 0.6]
    """
    return -poles.real / np.abs(poles)


def mac(shapes: Complex | Real, others: Complex | Real) -> Real:
    """Return the modal assurance criterion (MAC) of every shape with every shape of another set.

    Parameters
    ----------
    shapes, others
        Mode shapes, complex or real, shapes (modes, channels) and (other modes, channels).

    Returns
    -------
    numpy.ndarray
        MAC, 0 to 1, shape (modes, other modes).

    Notes
    -----
    abs(a^H b)^2 / ((a^H a)(b^H b)): with the Hermitian transpose, as shapes are complex (F. Liu 2020, eq. 3-55,
    prints the plain one).

    References
    ----------
    R. J. Allemang and D. L. Brown (1982), A correlation coefficient for modal vector analysis, Proceedings of the 1st
    International Modal Analysis Conference, 110-116.

    Examples
    --------
    >>> import numpy as np
    >>> mac(np.array([[1, 1j]]), np.array([[1j, -1], [1, -1j]])).round(12) + 0.0
    array([[1., 0.]])
    """
    for name, value in (("shapes", shapes), ("others", others)):
        check_type(name, value, np.ndarray, advice="modes.mode_shapes")
    products = np.abs(np.conj(shapes) @ others.T) ** 2
    powers = np.outer(np.sum(np.abs(shapes) ** 2, axis=1), np.sum(np.abs(others) ** 2, axis=1))
    return products / np.maximum(powers, np.finfo(float).tiny)


def mpc(shapes: Complex) -> Real:
    """Return the modal phase collinearity (MPC) of each shape, 1 where all channels move in phase or antiphase.

    Parameters
    ----------
    shapes
        Mode shapes, shape (modes, channels).

    Returns
    -------
    numpy.ndarray
        MPC, 0 to 1, shape (modes,).

    Notes
    -----
    ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 with S the inner products of real and imaginary parts: independent of
    the shape's phase and scale.

    References
    ----------
    J.-N. Juang and R. S. Pappa (1985), An eigensystem realization algorithm for modal parameter identification and
    model reduction, Journal of Guidance, Control, and Dynamics 8, 620-627.

    R. S. Pappa, K. B. Elliott and A. Schenk (1993), Consistent-mode indicator for the eigensystem realization
    algorithm, Journal of Guidance, Control, and Dynamics 16, 852-858.

    Examples
    --------
    >>> collinear, travelling = [1, -2, 0.5], [1, 1j, 0]
    >>> mpc(np.array([collinear, travelling])).round(6).tolist()
    [1.0, 0.0]
    """
    power = np.sum(np.abs(shapes) ** 2, axis=1)
    return (np.abs(np.sum(shapes**2, axis=1)) / np.maximum(power, np.finfo(float).tiny)) ** 2


def unit_shapes(shapes: Complex) -> Complex:
    """Scale each shape to 1 at its largest channel.

    Parameters
    ----------
    shapes
        Mode shapes, shape (modes, channels).

    Returns
    -------
    numpy.ndarray
        Mode shapes whose component of largest modulus is 1 + 0j, shape (modes, channels): the normalisation of all mode
        shapes in sprung.

    Examples
    --------
    >>> unit_shapes(np.array([[2 + 0j, -4 + 0j, 1 + 0j]])).real.tolist()
    [[-0.5, 1.0, -0.25]]
    """
    largest = np.argmax(np.abs(shapes), axis=1)
    scale = shapes[np.arange(len(shapes)), largest]
    return shapes / np.where(scale == 0, 1, scale)[:, None]


@dataclass(frozen=True, eq=False, slots=True)
class Poles:
    """Oscillating poles of the realisations on all rungs of a ladder.

    Parameters
    ----------
    poles
        Continuous poles [rad/s], one of each conjugate pair (positive imaginary part), shape (poles,).
    mode_shapes
        Complex mode shapes of any scale, shape (poles, channels).
    rungs
        Index into `ladder` of each pole, shape (poles,).
    ladder
        Model order, or number of block rows, of each rung.
    channels
        Names of the channels.
    natural_frequency_std, damping_ratio_std
        Standard deviations from the spread of the blocks, shape (poles,); NaN where the correlations have one block,
        and of poles without `changes`; infinite while these can still be computed.
    changes
        First-order change of each pole with each block [rad/s], scaled so that the squares add up to the variance of
        independent blocks, shape (blocks, poles); no blocks where they are unknown, NaN for poles outside alignments.
    changes_of
        Function that returns the changes of poles by their indices, where they are computed only for those that need
        them (`sprung.identification.subspace.with_deviations`); None: `changes` holds them.

    Raises
    ------
    ParameterError
        If the shapes of the arrays are inconsistent.
    """

    poles: Complex
    mode_shapes: Complex
    rungs: Indices
    ladder: tuple[int, ...]
    channels: tuple[str, ...]
    natural_frequency_std: Real
    damping_ratio_std: Real
    changes: Complex = field(default_factory=lambda: np.zeros((0, 0), dtype=np.complex128))
    changes_of: Callable[[Indices], Complex] | None = None

    def __post_init__(self) -> None:
        freeze(self, natural_frequency_std=1, damping_ratio_std=1)
        freeze(self, poles=1, mode_shapes=2, changes=2, dtype=np.complex128)
        freeze(self, rungs=1, dtype=np.intp)
        if self.mode_shapes.shape != (len(self.poles), len(self.channels)):
            raise ParameterError(
                f"mode_shapes {self.mode_shapes.shape} must have one row for each of {len(self.poles)} poles"
                f" and one column for each of {len(self.channels)} channels"
            )

    @property
    def natural_frequency(self) -> Real:
        """Undamped natural frequencies [Hz]."""
        return natural_frequency(self.poles)

    @property
    def damping_ratio(self) -> Real:
        """Damping ratios."""
        return damping_ratio(self.poles)


class PoleStatus(IntEnum):
    """Status of a pole in the stabilisation diagram; all but SELECTED state why it was rejected."""

    SELECTED = 0
    INSIGNIFICANT = 1
    UNCONFIRMED = 2
    RARE = 3
    UNCERTAIN = 4
    HARMONIC = 5
    SHAPE_CHANGED = 6
    DAMPING_CHANGED = 7
    FREQUENCY_CHANGED = 8
    INCOHERENT_SHAPE = 9
    OUT_OF_BAND = 10
    UNPHYSICAL_DAMPING = 11
    NOT_PICKED = 12

    @property
    def sentence(self) -> str:
        """Status in words."""
        return _SENTENCES[self]


_SENTENCES = {
    PoleStatus.SELECTED: "part of a mode",
    PoleStatus.RARE: "stable at too few model orders",
    PoleStatus.INSIGNIFICANT: "its contribution to the correlations between channels is no larger than chance",
    PoleStatus.UNCONFIRMED: "found in too few subsets, or the same mode as a more stable alignment",
    PoleStatus.UNCERTAIN: "the uncertainty of its frequency is comparable with its bandwidth",
    PoleStatus.HARMONIC: "a harmonic of the excitation, not a mode",
    PoleStatus.SHAPE_CHANGED: "shape differs from the rung below",
    PoleStatus.DAMPING_CHANGED: "damping differs from the rung below",
    PoleStatus.FREQUENCY_CHANGED: "no pole of this frequency on the rung below",
    PoleStatus.INCOHERENT_SHAPE: "the channels of its shape move with arbitrary phases",
    PoleStatus.OUT_OF_BAND: "frequency outside the band",
    PoleStatus.NOT_PICKED: "selected automatically, but other modes were picked by hand",
    PoleStatus.UNPHYSICAL_DAMPING: "damping not above zero, or above the bound",
}


@dataclass(frozen=True, eq=False, slots=True)
class Modes(Tabular, Drawable):
    """Modes by rising natural frequency.

    Parameters
    ----------
    poles
        Continuous poles [rad/s], shape (modes,).
    mode_shapes
        Complex mode shapes, 1 at the largest channel (`unit_shapes`), shape (modes, channels).
    channels
        Names of the channels.
    natural_frequency_std, damping_ratio_std
        Standard deviations, shape (modes,); NaN where unknown.
    stable_rate
        Share of the rungs of the ladder with a stable pole of the mode, 0 to 1, shape (modes,).
    labels
        "bounce", "pitch", "roll", "wheel_hop" or None for each mode.
    mode_shape_std
        Standard deviations of the real parts (as real part) and of the imaginary parts (as imaginary part) of the mode
        shapes, shape (modes, channels); NaN where unknown, which is the default.

    Raises
    ------
    ParameterError
        If the shapes of the arrays are inconsistent.
    """

    poles: Complex
    mode_shapes: Complex
    channels: tuple[str, ...]
    natural_frequency_std: Real
    damping_ratio_std: Real
    stable_rate: Real
    labels: tuple[str | None, ...]
    mode_shape_std: Complex = field(default_factory=lambda: np.zeros((0, 0), dtype=np.complex128))

    def __post_init__(self) -> None:
        if np.size(self.mode_shape_std) == 0:
            object.__setattr__(self, "mode_shape_std", np.full(np.shape(self.mode_shapes), complex(np.nan, np.nan)))
        freeze(self, natural_frequency_std=1, damping_ratio_std=1, stable_rate=1)
        freeze(self, poles=1, mode_shapes=2, mode_shape_std=2, dtype=np.complex128)
        if self.mode_shapes.shape != (len(self.poles), len(self.channels)):
            raise ParameterError(
                f"mode_shapes {self.mode_shapes.shape} must be {len(self.poles)} modes by {len(self.channels)} channels"
            )
        if self.mode_shape_std.shape != self.mode_shapes.shape:
            raise ParameterError(
                f"mode_shape_std {self.mode_shape_std.shape} must have as many entries as mode_shapes"
                f" {self.mode_shapes.shape}"
            )

    def __len__(self) -> int:
        return len(self.poles)

    def __getitem__(self, place: int | slice) -> "Modes":
        """Return the mode or the modes at a place, in the order of frequency."""
        check_type("place", place, int, slice, np.integer, advice="a number or a slice: modes[0], modes[:3]")
        return self.take(np.atleast_1d(np.arange(len(self))[place]))

    def __repr__(self) -> str:
        """Return number, channels and values in words."""
        return in_short(f"Modes: {counted(len(self), 'mode')} of {listed(self.channels)}", self.in_words)

    @property
    def in_words(self) -> str:
        """Frequency, damping and label of each mode, such as "1.21 Hz 24.1 % bounce", of the first few of many."""
        return listed(
            f"{frequency:.4g} Hz {100 * ratio:.3g} %{f' {label}' if label else ''}"
            for frequency, ratio, label in zip(self.natural_frequency, self.damping_ratio, self.labels, strict=True)
        )

    @property
    def natural_frequency(self) -> Real:
        """Undamped natural frequencies [Hz]."""
        return natural_frequency(self.poles)

    @property
    def damping_ratio(self) -> Real:
        """Damping ratios."""
        return damping_ratio(self.poles)

    @property
    def mpc(self) -> Real:
        """Modal phase collinearity of each mode shape."""
        return mpc(self.mode_shapes)

    def take(self, chosen: Indices) -> "Modes":
        """Return the modes at the given indices, in that order."""
        arrays: dict[str, Any] = {name: getattr(self, name)[chosen] for name in _ARRAYS}
        return replace(self, **arrays, labels=tuple(self.labels[k] for k in chosen))


#: Fields of modes with an entry for each of them.
_ARRAYS = ("poles", "natural_frequency_std", "damping_ratio_std", "stable_rate", "mode_shapes", "mode_shape_std")


def join_modes(parts: Sequence[Modes]) -> Modes:
    """Return the modes of several parts, which have the same channels, one after another.

    Examples
    --------
    >>> poles, unknown = 2 * np.pi * np.array([-0.6 + 0.8j]), np.full(1, np.nan)
    >>> first = Modes(poles, np.ones((1, 1)), ("acc",), unknown, unknown, np.ones(1), ("bounce",))
    >>> second = replace(first, poles=5 * poles, labels=("wheel_hop",))
    >>> both = join_modes([first, second])
    >>> both.labels, both.natural_frequency.round(6).tolist()
    (('bounce', 'wheel_hop'), [1.0, 5.0])
    """

    arrays: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS}
    return replace(parts[0], **arrays, labels=tuple(label for part in parts for label in part.labels))
