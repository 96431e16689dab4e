"""Settings of an identification, and the plan that is made from them and the data."""

from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of, settings_of
from sprung.errors import ParameterError
from sprung.identification.ladders import BlockRowLadder, Ladder
from sprung.identification.stabilisation import THESIS_CRITERIA, StabilityCriteria
from sprung.signals.harmonics import Harmonic
from sprung.signals.spectrum import Lifter


@dataclass(frozen=True, slots=True)
class Method:
    """What distinguishes a method of identification from the others.

    Parameters
    ----------
    name
        Name in results and on the command line.
    title
        What people call it.
    source
        Source of its modes in results.
    has_own_segments
        Whether both factors of a product of samples lie in the same segment.
    is_sorted
        Whether the products are sorted by the level of the motion.
    has_polynomials
        Whether the ladder is over orders of polynomials, in place of realisations.
    has_long_spectra
        Whether modes are those of the spectra, whose segments are as long as possible.
    """

    name: str
    title: str
    source: str = "ssi"
    has_own_segments: bool = False
    is_sorted: bool = False
    has_polynomials: bool = False
    has_long_spectra: bool = False


COV = Method("cov", "Cov-SSI")
ACS = Method("acs", "ACS-Cov-SSI", has_own_segments=True)
COSS = Method("coss", "CoSS-SSI", has_own_segments=True, is_sorted=True)
PLSCF = Method("plscf", "pLSCF", source="plscf", has_polynomials=True)
FDD = Method("fdd", "Enhanced FDD", source="fdd", has_long_spectra=True)
#: Methods by their names.
KINDS = MappingProxyType({method.name: method for method in (COV, ACS, COSS, PLSCF, FDD)})

#: Block rows of the thesis for the chain of three masses.
THESIS_ROWS = (12, 45)


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Settings of an identification; fields that are None are chosen from the data.

    Parameters
    ----------
    band
        Lowest and highest natural frequency of interest [Hz]; slower motion is filtered out.
    decimate_to
        Sampling rate for the identification [Hz].
    segment
        Length of the segments [s].
    n_subsets
        Number J of subsets of CoSS-SSI, 1 to 50.
    block_rows
        Number i of block rows of the block matrix, at least 2.
    max_order
        Largest model order, at least 2; the ladder takes every even order up to it.
    ladder
        Ladder of the thesis over numbers of block rows; None: ladder over model orders.
    lifter
        Lifter for cepstrum editing; None: no editing. The damping that an `Exponential` lifter adds is subtracted
        from the poles.
    references
        Names of the reference channels; None: all channels.
    has_disjoint_references
        Whether outputs and references are disjoint sets of channels, in several splits: for sensor noise within the
        band of the modes.
    criteria
        Criteria for stable poles and for modes.
    harmonics
        Known harmonics of the excitation; None: they are searched for, which takes most of the time of an
        identification.
    refine
        Whether modes are refined to the largest likelihood of the records' spectra.
    kind
        "random" for records of stationary random motion, "free" for free motion after pushes, drops or releases;
        "auto": free where records are quiet but for motions that begin suddenly, die away, and are those of free modes.
    has_road_modes
        Whether bounce, pitch, roll and wheel hop of a vehicle on a road are those of the vehicle file fitted to the
        spectra, where the speed is recorded: SSI misses some of them, as the rear wheels repeat the road of the front
        ones.
    has_own_levels
        Whether CoSS-SSI sorts segments by the level of the very correlations that it averages (the form of the thesis),
        which biases damping, even in a linear system: high at low level, low at high level. False: products are sorted
        by the level predicted from the past.
    allow_missing
        Whether recordings may lack sensors of the vehicle file; a note then says which.

    Raises
    ------
    ParameterError
        If a setting is out of range, or two settings are mutually exclusive.
    """

    band: tuple[float, float] | None = None
    decimate_to: float | None = None
    segment: float | None = None
    n_subsets: int = 3
    block_rows: int | None = None
    max_order: int | None = None
    ladder: BlockRowLadder | None = None
    lifter: Lifter | None = None
    references: tuple[str, ...] | None = None
    has_disjoint_references: bool = False
    criteria: StabilityCriteria = field(default_factory=StabilityCriteria)
    harmonics: tuple[Harmonic, ...] | None = None
    refine: bool = True
    kind: str = "auto"
    has_road_modes: bool = True
    has_own_levels: bool = False
    allow_missing: bool = False

    def __post_init__(self) -> None:
        if self.band is not None and not 0 <= self.band[0] < self.band[1]:
            raise ParameterError(f"band {self.band[0]:g} to {self.band[1]:g} Hz must rise from 0 or more")
        check_one_of("kind", self.kind, ("auto", "random", "free"))
        for name in ("decimate_to", "segment"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0)
        for name in ("block_rows", "max_order"):
            value = getattr(self, name)
            if value is not None:
                check_number(name, value, at_least=2)
                if self.ladder is not None:
                    raise ParameterError(
                        f"{name}={value} excludes a ladder over block rows, which sets them: leave one of them out"
                    )
        check_number("n_subsets", self.n_subsets, at_least=1, at_most=50)
        if self.references == ():
            raise ParameterError("references is empty: name at least one channel, or leave it out to use all channels")
        if self.references is not None and self.has_disjoint_references:
            raise ParameterError(
                "references excludes has_disjoint_references, which chooses the references: leave one of them out"
            )


def as_in_thesis(
    settings: IdentificationSettings | None = None,
    *,
    rows: tuple[int, int] = THESIS_ROWS,
    stable_rate: float = THESIS_CRITERIA.stable_rate,
) -> IdentificationSettings:
    """Return settings with the ladder, the correlations and the criteria of the thesis, without refinement.

    Parameters
    ----------
    settings
        Settings of everything else; default: `IdentificationSettings()`.
    rows
        Smallest and largest number of block rows.
    stable_rate
        Smallest rate of stable points of a mode, delta of eq. 3-57.

    Returns
    -------
    IdentificationSettings

    Raises
    ------
    ParameterError
        If `rows` do not rise from 2, or the settings give `block_rows` or `max_order`.

    Notes
    -----
    Correlations are divided by the number of samples N (biased), not by the number of products (N - m at lag m): 1/N is
    the form of the thesis. It falls off with the lag, which reads as additional damping where segments are short.
    CoSS-SSI sorts segments by the level of the correlations that it averages, which selects segments of much or little
    excitation: even in a linear system, damping comes out high at low level and low at high level.

    References
    ----------
    F. Liu (2020), eq. 3-35 to 3-57 and 4-1.

    Examples
    --------
    >>> settings = as_in_thesis(rows=(20, 60))
    >>> settings.ladder
    BlockRowLadder(first=20, last=60)
    >>> settings.refine
    False
    """
    given = settings_of(IdentificationSettings, settings)
    criteria = replace(THESIS_CRITERIA, stable_rate=stable_rate)
    return replace(
        given,
        ladder=BlockRowLadder(*rows),
        criteria=criteria,
        has_road_modes=False,
        has_own_levels=True,
        refine=False,
    )


@dataclass(frozen=True, slots=True)
class PreparationPlan:
    """Decisions on the preparation of all records, made from the first.

    Parameters
    ----------
    channels
        Names of the outputs.
    factors
        Factor for each output that makes its RMS 1.
    sampling_rate
        Sampling rate of the first record before decimation [Hz].
    decimate_to
        Sampling rate for the identification [Hz].
    high_pass
        Edge below which motion is filtered out [Hz]; 0 for no filter.
    band
        Band in which motion is expected [Hz], given or chosen.
    spectrum_segment
        Length of the segments of spectra [s].
    notes
        The decisions in words.
    trend
        Degree of the trend that is removed: 0 for the mean (as in the thesis), 1 for a straight line.
    is_drive
        Whether the band was chosen for a vehicle that drives.
    """

    channels: tuple[str, ...]
    factors: dict[str, float]
    sampling_rate: float
    decimate_to: float
    high_pass: float
    band: tuple[float, float]
    spectrum_segment: float
    notes: tuple[str, ...]
    trend: int = 1
    is_drive: bool = False

    @property
    def scales(self) -> Real:
        """Factors in the order of the channels, shape (channels,)."""
        return np.array([self.factors[name] for name in self.channels])


@dataclass(frozen=True, slots=True)
class Plan:
    """All decisions of an identification.

    Parameters
    ----------
    preparation
        Decisions on the preparation.
    segment
        Length of the segments [s].
    ladder
        Ladder with its block rows and orders.
    mode_band
        Natural frequencies [Hz] that are of interest and that the lags and the sampling rate resolve.
    """

    preparation: PreparationPlan
    segment: float
    ladder: Ladder
    mode_band: tuple[float, float]
