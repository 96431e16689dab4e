"""What is wanted of an identification, and what is chosen for it from the data."""

from dataclasses import dataclass, field

import numpy as np

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.identification.stabilisation import StabilityCriteria
from sprung.signals.cepstrum import Lifter
from sprung.signals.harmonics import Harmonic

#: A mode has at least this many periods in the lags, and lies below this share of the sampling rate (where
#: decimation passes everything).
_LEAST_PERIODS, _HIGHEST_MODE = 1.2, 0.4


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """How to identify; None means chosen from the data.

    Parameters
    ----------
    band
        Lowest and highest natural frequency wanted [Hz]; slower motion is filtered off.
    decimate_to
        Sampling rate for the identification [Hz].
    segment
        Length of the segments [s].
    n_subsets
        J of CoSS-SSI.
    has_equal_counts
        Subsets of CoSS-SSI hold equally many segments, instead of spanning equal ranges of level (thesis).
    is_biased
        Correlations are divided by the number of samples (thesis), not of products: see
        `sprung.identification.correlation.average`.
    block_rows
        i: block rows of the block matrix.
    max_order
        Largest model order of the ladder, which takes every even order.
    lifter
        For cepstrum editing; None: none. The damping that an `Exponential` lifter adds is subtracted again.
    references
        Names of the reference channels; None: all.
    has_disjoint_references
        Take outputs and references from disjoint sets of channels, in several splits: for sensor noise that fills
        the modes' own band.
    row_ladder
        First and last number of block rows: the thesis' ladder instead of that over orders.
    is_hankel
        Correlations as data in block Hankel matrices (thesis) instead of directly in the block Toeplitz matrix.
    is_weighted
        Canonical variates (see `sprung.identification.subspace.realise`).
    criteria
        For stable poles and modes.
    harmonics
        Lines that are known to be no modes; None: sought, which takes most of the time of an identification.
    """

    band: tuple[float, float] | None = None
    decimate_to: float | None = None
    segment: float | None = None
    n_subsets: int = 3
    has_equal_counts: bool = False
    is_biased: bool = False
    block_rows: int | None = None
    max_order: int | None = None
    lifter: Lifter | None = None
    references: tuple[str, ...] | None = None
    has_disjoint_references: bool = False
    row_ladder: tuple[int, int] | None = None
    is_hankel: bool = False
    is_weighted: bool = True
    criteria: StabilityCriteria = field(default_factory=StabilityCriteria)
    harmonics: tuple[Harmonic, ...] | None = None

    def __post_init__(self) -> None:
        if self.band is not None and not 0 <= self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from 0 or more")
        for name in ("decimate_to", "segment"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0)
        for name in ("block_rows", "max_order"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), at_least=2)
        check_number("n_subsets", self.n_subsets, at_least=1, at_most=50)
        if self.row_ladder is not None and not 2 <= self.row_ladder[0] <= self.row_ladder[1]:
            raise ParameterError(f"row_ladder {self.row_ladder[0]} to {self.row_ladder[1]} must rise from 2 or more")
        if self.references == ():
            raise ParameterError("references are empty: name at least one channel, or leave them out to use all")
        if self.references is not None and self.has_disjoint_references:
            raise ParameterError("references are chosen by the splits when they are disjoint: leave out one of both")


@dataclass(frozen=True, slots=True)
class Plan:
    """What is chosen once and done to every record.

    Parameters
    ----------
    channels
        Names of the outputs.
    speed
        Name of the speed channel, None without.
    factors
        For each output what makes its RMS 1.
    sampling_rate
        Of the first record before decimation [Hz].
    settings
        With the choices made.
    band
        In which motion is expected [Hz], given or chosen.
    spectrum_segment
        Length of the segments of spectra [s].
    notes
        The choices, in words.
    """

    channels: tuple[str, ...]
    speed: str | None
    factors: dict[str, float]
    sampling_rate: float
    settings: IdentificationSettings
    band: tuple[float, float]
    spectrum_segment: float
    notes: tuple[str, ...]

    @property
    def mode_band(self) -> tuple[float, float]:
        """Natural frequencies that the settings want and that lags and sampling rate can tell [Hz]."""
        rate = self.settings.decimate_to or 0.0
        low, high = self.settings.band or (0.0, np.inf)
        return max(low, _LEAST_PERIODS * rate / self.n_lags), min(high, _HIGHEST_MODE * rate)

    @property
    def n_lags(self) -> int:
        """Lags that the largest block matrix needs."""
        rows = self.settings.row_ladder[1] if self.settings.row_ladder else self.settings.block_rows
        return (3 if self.settings.is_hankel else 2) * int(rows or 0)
