"""Results of bounce tests, and differences between two of them."""

from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung._display import Drawable, Savable, Tabular, counted, in_short
from sprung.identification.free_response import FreeFit
from sprung.identification.friction import FrictionFit
from sprung.identification.transients import Transient
from sprung.modal import INTERVAL_95, Modes, mac
from sprung.recording import Recording
from sprung.vehicles import Component


@dataclass(frozen=True, slots=True)
class BounceRules:
    """Which motions count as tests, and which model describes them."""

    #: RMS of what free modes leave without a search, over that of the motion, above which they cannot describe it.
    hopeless: float = 0.3
    #: Most modes of a test.
    max_modes: int = 4
    #: Largest RMS that free modes may leave of the motion where noise explains no more; largest smallest damping ratio.
    max_linear_residual: float = 0.25
    max_damping: float = 0.75
    #: RMS of what linear modes leave, over the motion and over the noise at rest, from which friction is tried.
    nonlinear: float = 0.01
    tried_beyond_noise: float = 1.5
    #: The same, over the noise, from which a motion is not free.
    beyond_noise: float = 3.0
    #: Largest share of noise in a motion that counts as a test.
    max_noise: float = 0.45
    #: Largest RMS of what a swing with friction leaves, over the motion; below the second it is not tried any later.
    max_residual: float = 0.12
    good_residual: float = 0.08
    #: Values nearer to the end of the range of a channel than this share of it, and dwelling there for such a share of
    #: the samples, are those of an end stop.
    stop_range: float = 0.02
    stop_dwell: float = 0.05
    #: Largest damping ratio of a swing, friction included: more leaves too little of it after a period.
    max_swing_damping: float = 0.6
    #: Largest standard deviation of its damping ratio over itself.
    max_deviation: float = 0.5
    #: Least frequency of a linear mode beside a swing with friction over that of the swing: three times of it is a part
    #: of the swing. Largest standard deviation of its damping ratio over itself.
    faster: float = 3.5
    max_fast_deviation: float = 0.2
    #: Turns at which a swing with friction may begin.
    max_turns: int = 5
    #: Smallest motion of a test over the largest.
    min_size: float = 0.3
    #: Prior standard deviations of ln(value / nominal value): springs and dampers, tyres.
    prior_std: tuple[float, float] = (0.7, 0.15)
    #: Largest standard deviation of a component that is identifiable.
    max_std: float = 0.3
    #: Largest frequency of a mode of the body over the largest in the vehicle file.
    body_reach: float = 1.6
    #: Mean square deviation of modes from those of the vehicle, over that by chance, that is noted.
    poor_fit: float = 4.0
    #: Largest relative difference of the frequencies of one mode before and after, and what another shape adds to it.
    same_mode: float = 0.3
    other_shape: float = 0.1
    #: Size of a change over its standard deviation from which it is significant: 1 % by chance.
    significant: float = 2.58


RULES = BounceRules()


@dataclass(frozen=True, eq=False, slots=True)
class BounceTest:
    """One push, drop or release.

    Parameters
    ----------
    recording
        Number of the recording, from 0.
    transient
        Times in the recording.
    part
        Samples from the begin to the end of the fit.
    fitted
        Fitted motion, shape of the samples, about the same offsets.
    modes
        Modes of this test: of the linear fit, or those of swings with friction, described without it.
    frictions
        Swing with friction behind each mode; None for a linear mode.
    residual
        RMS of what the fit leaves over that of the motion.
    """

    recording: int
    transient: Transient
    part: Recording
    fitted: Real
    modes: Modes
    frictions: tuple[FrictionFit | None, ...]
    residual: float

    def __post_init__(self) -> None:
        freeze(self, fitted=2)

    @property
    def is_significant(self) -> bool:
        """Whether the test shows friction beyond chance."""
        return any(fit is not None and fit.is_significant for fit in self.frictions)


@dataclass(frozen=True, slots=True)
class CornerValue:
    """Spring or damper of a corner by the modes of the body.

    Parameters
    ----------
    component
        Spring or damper.
    nominal
        Value in the vehicle file.
    log_ratio, std
        ln(value / nominal value) and its standard deviation.
    """

    component: Component
    nominal: float
    log_ratio: float
    std: float

    @property
    def is_identifiable(self) -> bool:
        """Whether the tests determine it."""
        return self.std < RULES.max_std

    @property
    def value(self) -> float:
        """Value [N/m, N s/m]."""
        return self.nominal * float(np.exp(self.log_ratio))


@dataclass(frozen=True, slots=True)
class BounceChange:
    """Difference of one number between two series of tests, or between the sides of an axle.

    Parameters
    ----------
    part
        Mode, such as "bounce" or "1.52 Hz", or component, such as "front_left.damper" or "front.damper".
    quantity
        "natural_frequency" or "damping_ratio" of a mode, "value" of a component; "left_over_right" of an axle.
    change, interval
        Relative change and its 95 % interval.
    score
        Size of the change over its standard deviation.
    """

    part: str
    quantity: str
    change: float
    interval: tuple[float, float]
    score: float

    @property
    def is_significant(self) -> bool:
        """Whether the change is beyond chance."""
        return self.score > RULES.significant


@dataclass(frozen=True, eq=False, slots=True)
class Bounce(Tabular, Savable, Drawable):
    """Result of one or several bounce tests of a vehicle.

    Parameters
    ----------
    tests
        Tests in the order of the recordings.
    modes
        Modes of all linear tests together; of those with friction if one of these moves most.
    fit
        Free responses of all linear tests fitted together; None if the largest motion has friction.
    corners
        Springs and dampers, where vehicle file and sensors allow; those that are not identifiable too.
    sides
        Left over right of each axle's springs and dampers, where the tests determine it.
    changes
        Differences from an earlier test.
    notes
        What was left out, and limits.
    """

    tests: tuple[BounceTest, ...]
    modes: Modes
    fit: FreeFit | None = None
    corners: tuple[CornerValue, ...] = ()
    sides: tuple[BounceChange, ...] = ()
    changes: tuple[BounceChange, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return number of tests, modes, and the first note in words."""
        head = f"Bounce: {counted(len(self.tests), 'test')}, {counted(len(self.modes), 'mode')}"
        return in_short(head, self.modes.in_words, *self.notes[:1])

    def changed_since(self, before: "Bounce") -> "Bounce":
        """Return the result with the differences from an earlier one."""
        return replace(self, changes=bounce_changes(before, self))


def bounce_changes(before: Bounce, after: Bounce) -> tuple[BounceChange, ...]:
    """Return the differences of modes and components between two results.

    Parameters
    ----------
    before, after
        Results of the same vehicle with the same sensors.

    Returns
    -------
    tuple of BounceChange
        Frequency and damping of each mode that both have, matched one by one by frequency and shape, and identifiable
        components.
    """
    changes = []
    old, new = before.modes, after.modes
    distances = np.abs(np.log(new.natural_frequency[:, None] / old.natural_frequency))
    if old.channels == new.channels:
        distances = distances + RULES.other_shape * (mac(new.mode_shapes, old.mode_shapes) < 0.5)
    pairs = {}
    while distances.min(initial=np.inf) < RULES.same_mode:
        row, column = (int(each) for each in np.unravel_index(np.argmin(distances), distances.shape))
        distances[row], distances[:, column] = np.inf, np.inf
        pairs[row] = column
    for k, j in sorted(pairs.items()):
        frequency = new.natural_frequency[k]
        part = new.labels[k] or f"{frequency:.3g} Hz"
        for name in ("natural_frequency", "damping_ratio"):
            was, now = float(getattr(old, name)[j]), float(getattr(new, name)[k])
            stds = float(getattr(old, f"{name}_std")[j]) / was, float(getattr(new, f"{name}_std")[k]) / now
            changes.append(relative_change(part, name, float(np.log(now / was)), float(np.hypot(*stds))))
    earlier = {str(value.component): value for value in before.corners}
    for value in after.corners:
        other = earlier.get(str(value.component))
        if other is not None and value.is_identifiable and other.is_identifiable:
            std = float(np.hypot(value.std, other.std))
            changes.append(relative_change(str(value.component), "value", value.log_ratio - other.log_ratio, std))
    return tuple(changes)


def relative_change(part: str, quantity: str, logarithm: float, std: float) -> BounceChange:
    """Return a relative change with its interval."""
    low, high = (float(np.expm1(logarithm + side * INTERVAL_95 * std)) for side in (-1, 1))
    return BounceChange(part, quantity, float(np.expm1(logarithm)), (low, high), abs(logarithm) / std)
