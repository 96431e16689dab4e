"""Results of an identification: modes, and the correlations and diagrams that led to them."""

from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_one_of, freeze
from sprung._display import Drawable, Savable, Tabular, counted, in_short
from sprung.identification.correlation import Correlations
from sprung.identification.ladders import BlockRowLadder
from sprung.identification.levels import LevelTrends
from sprung.identification.refinement import Refinement
from sprung.identification.settings import KINDS, IdentificationSettings, Plan
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import SpectralMatrix


@dataclass(frozen=True, eq=False, slots=True)
class SubsetModes:
    """Modes of one subset of segments.

    Parameters
    ----------
    level
        Range of levels: RMS of the channels, each relative to its own RMS in the first record (of the thesis: smallest
        RMS of the correlations); None where nothing is sorted.
    n_segments
        Number of segments averaged, or the equivalent number for products sorted one by one.
    modes
        Modes identified from the average.
    diagrams
        Stabilisation diagrams behind the modes, one for each split of outputs and references.
    alignments
        Number of the alignment behind each mode in each diagram, -1 for none; shape (modes, diagrams).
    """

    level: tuple[float, float] | None
    n_segments: int
    modes: Modes
    diagrams: tuple[StabilisationDiagram, ...]
    alignments: Indices

    def __post_init__(self) -> None:
        freeze(self, alignments=2, dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class Identification(Tabular, Savable, Drawable):
    """Modes of one condition, with everything that led to them.

    Parameters
    ----------
    method
        "cov", "acs", "coss", "plscf" or "fdd".
    channels
        Outputs, in the order of the mode shapes.
    sampling_rate
        Sampling rate of the correlations [Hz].
    modes
        Modes by rising frequency, merged over the subsets.
    subsets
        Modes of each subset.
    members
        Index of the subset's mode for each mode and subset, -1 for none; shape (modes, subsets).
    harmonics
        Lines of the excitation, which are not modes.
    spectra, edited_spectra
        Spectral matrices before and after cepstrum editing (None without editing).
    settings
        Settings as given.
    plan
        Decisions made from the settings and the data.
    notes
        Choices, omissions and warnings, one sentence each.
    refinement
        What the refinement changed in each mode; None without it.
    sources
        Method that gave each mode: "ssi", "plscf" or "fdd", or "road_likelihood" for a mode of the vehicle file fitted
        to the spectra of a drive. Left out: all by the method itself.
    setups
        Set-ups of roving sensors that are merged, each with its own identification, and no subsets; None: one set-up.
    level_trends
        Dependence of the modes on the level, with the test whether there is one (CoSS-SSI); None where it is unknown.
    """

    method: str
    channels: tuple[Channel, ...]
    sampling_rate: float
    modes: Modes
    subsets: tuple[SubsetModes, ...]
    members: Indices
    harmonics: tuple[Harmonic, ...]
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    settings: IdentificationSettings
    plan: Plan
    notes: tuple[str, ...]
    refinement: Refinement | None = None
    sources: tuple[str, ...] = ()
    setups: "RovingSetups | None" = None
    level_trends: LevelTrends | None = None

    def __post_init__(self) -> None:
        freeze(self, members=2, dtype=np.intp)
        object.__setattr__(self, "sources", self.sources or (KINDS[self.method].source,) * len(self.modes))

    @property
    def band(self) -> tuple[float, float]:
        """Band in which motion is expected [Hz]: given, around the vehicle's modes, or where channels move together."""
        return self.plan.preparation.band

    @property
    def effective_settings(self) -> IdentificationSettings:
        """Settings with the choices from the data filled in."""
        plan = self.plan
        settings = replace(self.settings, decimate_to=plan.preparation.decimate_to, segment=plan.segment)
        if isinstance(plan.ladder, BlockRowLadder):
            return settings
        return replace(settings, block_rows=plan.ladder.block_rows, max_order=plan.ladder.max_order)

    def __repr__(self) -> str:
        """Return method, channels, modes and the first note in words."""
        channels = f"{counted(len(self.channels), 'channel')} at {self.sampling_rate:.5g} Hz"
        notes = f"{counted(len(self.notes), 'note')}: {self.notes[0]}" if self.notes else ""
        head = f"Identification by {self.method} from {channels}: {counted(len(self.modes), 'mode')}"
        return in_short(head, self.modes.in_words, notes)

    def __str__(self) -> str:
        """Return the modes as a table: values with their standard deviations, rate of stable points, label."""
        modes = self.modes
        lines = [f"{'frequency [Hz]':>21} {'damping [%]':>19} {'stable':>7}  label"]
        for k, label in enumerate(modes.labels):
            frequency = f"{modes.natural_frequency[k]:10.4g} ± {modes.natural_frequency_std[k]:<8.2g}"
            damping = f"{100 * modes.damping_ratio[k]:8.3g} ± {100 * modes.damping_ratio_std[k]:<8.2g}"
            lines.append(f"{frequency} {damping} {modes.stable_rate[k]:7.2f}  {label or ''}".rstrip())
        return "\n".join(lines)


@dataclass(frozen=True, eq=False, slots=True)
class SetUp:
    """One set-up of roving sensors.

    Parameters
    ----------
    number
        Number of the set-up as given, from 1.
    channels
        Names of its channels in the merged mode shapes.
    identification
        Its own modes, and everything that led to them.
    members
        Index of its own mode for each merged mode, -1 for none; shape (modes,).
    mac
        MAC of its own mode with the merged one on its channels, shape (modes,); NaN without an own mode.
    """

    number: int
    channels: tuple[str, ...]
    identification: Identification
    members: Indices
    mac: Real

    def __post_init__(self) -> None:
        freeze(self, members=1, dtype=np.intp)
        freeze(self, mac=1)


@dataclass(frozen=True, eq=False, slots=True)
class RovingSetups:
    """Set-ups of roving sensors behind merged modes.

    Parameters
    ----------
    references
        Names of the channels over which the set-ups are merged.
    parts
        The set-ups.
    """

    references: tuple[str, ...]
    parts: tuple[SetUp, ...]


@dataclass(frozen=True, eq=False, slots=True)
class CorrelationSummary:
    """Correlations from which modes are identified: far smaller than the samples, and nearly sufficient.

    Parameters
    ----------
    method
        "cov", "acs", "coss" or "plscf".
    settings
        Settings as given.
    plan
        Decisions made from the settings and the data.
    channels
        Outputs.
    subsets
        Range of level (None where segments are not sorted) and correlations of each subset.
    average
        Correlations of all segments, without bias.
    harmonics
        Lines of the excitation, which are not modes.
    """

    method: str
    settings: IdentificationSettings
    plan: Plan
    channels: tuple[Channel, ...]
    subsets: tuple[tuple[tuple[float, float] | None, Correlations], ...]
    average: Correlations
    harmonics: tuple[Harmonic, ...]

    def __post_init__(self) -> None:
        check_one_of("method", self.method, list(KINDS))
