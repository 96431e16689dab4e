"""Spectra of records from which identified modes are refined."""

from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import freeze
from sprung.identification.settings import Plan
from sprung.likelihood.modal_spectra import LineSums, block_sums, line_edges, line_sums
from sprung.recording import Recording

#: Spectra reach from this share of the lowest mode that is resolved to this share of the sampling rate.
_LOWEST, _HIGHEST = 0.5, 0.4
#: The record's duration over the length of the segments of its Welch spectra; bins of blocks over their frequency.
_SPECTRUM_SEGMENTS, _BLOCK_WIDTH = 24.0, 0.004
#: Numbers of blocks, and of the entries of all their matrices.
_MOST_BLOCKS, _FEWEST_BLOCKS, _MOST_ENTRIES = 48, 8, 3e6


@dataclass(frozen=True, eq=False, slots=True)
class RecordSpectra:
    """Spectra from which modes are refined: of whole records, and of blocks of them for their scatter.

    Parameters
    ----------
    lines
        Sums over all stretches.
    blocks
        Sums over each block.
    records
        Number of the record of each block, shape (blocks,).
    sampling_rate
        Sampling rate of the records before decimation [Hz].
    """

    lines: LineSums
    blocks: tuple[LineSums, ...]
    records: Indices
    sampling_rate: float

    def __post_init__(self) -> None:
        freeze(self, records=1, dtype=np.intp)

    def __add__(self, other: "RecordSpectra") -> "RecordSpectra":
        """Add a record; where there are too many blocks, neighbours are joined."""
        blocks = [*self.blocks, *other.blocks]
        records = np.concatenate([self.records, other.records + self.records.max(initial=-1) + 1])
        joined = replace(self, lines=self.lines + other.lines, blocks=tuple(blocks), records=records)
        return joined.with_fewer_blocks()

    def scaled(self, factors: Real) -> "RecordSpectra":
        """Return the spectra of channels multiplied by factors, shape (channels,)."""
        blocks = tuple(block.scaled(factors) for block in self.blocks)
        return replace(self, lines=self.lines.scaled(factors), blocks=blocks)

    def with_fewer_blocks(self) -> "RecordSpectra":
        """Return the spectra with at most as many blocks as the size of their matrices allows."""
        blocks, records = list(self.blocks), self.records
        if not blocks:
            return self
        most = int(np.clip(_MOST_ENTRIES / blocks[0].matrices.size, _FEWEST_BLOCKS, _MOST_BLOCKS))
        while len(blocks) > most:
            pairs = [blocks[k : k + 2] for k in range(0, len(blocks), 2)]
            blocks = [pair[0] + pair[1] if len(pair) == 2 else pair[0] for pair in pairs]
            records = records[::2]
        return replace(self, blocks=tuple(blocks), records=records)


def record_spectra(motion: Recording, plan: Plan) -> RecordSpectra:
    """Return the spectra of one prepared record for the refinement of modes.

    Parameters
    ----------
    motion
        Prepared record.
    plan
        Decisions of the identification; all records of one plan have the same bins.
    """
    low = _LOWEST * plan.mode_band[0]
    high = max(_HIGHEST * plan.preparation.decimate_to, 2 * low)
    duration = _SPECTRUM_SEGMENTS * plan.preparation.spectrum_segment
    block = max(2 * plan.segment, plan.preparation.spectrum_segment)
    blocks = block_sums(motion, line_edges(low, high, duration=block, relative_width=_BLOCK_WIDTH), duration=block)
    lines = line_sums(motion, line_edges(low, high, duration=duration))
    numbers = np.zeros(len(blocks), dtype=np.intp)
    return RecordSpectra(lines, tuple(blocks), numbers, plan.preparation.sampling_rate).with_fewer_blocks()
