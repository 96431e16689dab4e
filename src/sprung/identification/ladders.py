"""Ladders: over model orders, over numbers of block rows as in the thesis, or over orders of polynomials (pLSCF)."""

from dataclasses import dataclass
from typing import ClassVar

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.identification.correlation import Correlations
from sprung.identification.plscf import PolynomialLadder
from sprung.identification.subspace import block_row_ladder, poles_of_orders, realise
from sprung.modal import Poles


@dataclass(frozen=True, slots=True)
class OrderLadder:
    """Every even model order of one realisation.

    The realisation is that of a block Toeplitz matrix of correlations without bias, weighted for canonical variates.

    Parameters
    ----------
    block_rows
        Number i of block rows, at least 2.
    max_order
        Largest model order, at least 2.

    Raises
    ------
    ParameterError
        If the block rows or the largest order are below 2.
    """

    #: Number of lags for each block row, and whether correlations are divided by the number of samples.
    lags_per_row: ClassVar[int] = 2
    is_biased: ClassVar[bool] = False

    block_rows: int
    max_order: int

    def __post_init__(self) -> None:
        check_number("block_rows", self.block_rows, at_least=2)
        check_number("max_order", self.max_order, at_least=2)

    @property
    def n_lags(self) -> int:
        """Number of lags of the block matrix."""
        return self.lags_per_row * self.block_rows

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all orders."""
        realisation = realise(correlations, block_rows=self.block_rows, max_order=self.max_order)
        return poles_of_orders(realisation, range(2, self.max_order + 1, 2))


@dataclass(frozen=True, slots=True)
class BlockRowLadder:
    """One realisation for each number of block rows, the model order following it: the ladder of the thesis.

    Each realisation is that of correlations as data in block Hankel matrices, without weights. The correlations are
    divided by the number of samples (1/N), not of products.

    Parameters
    ----------
    first, last
        Smallest and largest number of block rows, 2 <= first <= last.

    Raises
    ------
    ParameterError
        If the block rows do not rise from 2 or more.

    References
    ----------
    F. Liu (2020), eq. 3-35 to 3-45 and sections 4.3 and 7.3.
    """

    lags_per_row: ClassVar[int] = 3
    is_biased: ClassVar[bool] = True

    first: int
    last: int

    def __post_init__(self) -> None:
        if not 2 <= self.first <= self.last:
            raise ParameterError(f"block rows {self.first} to {self.last} must rise from 2 or more")

    @property
    def n_lags(self) -> int:
        """Number of lags of the largest block matrix."""
        return self.lags_per_row * self.last

    def poles(self, correlations: Correlations) -> Poles:
        """Return the poles of all realisations."""
        return block_row_ladder(correlations, range(self.first, self.last + 1), is_hankel=True)


Ladder = OrderLadder | BlockRowLadder | PolynomialLadder
