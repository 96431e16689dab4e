"""Smallest change of each component that a change test would have found."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from sprung._arrays import Real
from sprung._checks import check_number, check_type
from sprung.diagnosis.baseline import CONDITIONS, Baseline
from sprung.diagnosis.ratios import Compared, Hypotheses, Scores, dimensions_of, explained_by, scores_of
from sprung.vehicles import Component

#: Probability of an alert after a change of the size stated.
POWER = 0.95


@dataclass(frozen=True, slots=True)
class DetectabilitySettings:
    """Search for the smallest change that is found."""

    #: Steps of Newton's method on the evidence, which is nearly linear in the square of the size.
    steps: int = 6
    #: Number of terms of the evidence (onsets and hypotheses) that count at the threshold.
    largest: int = 96


SEARCH = DetectabilitySettings()


def detectable_changes(
    scores: Scores, hypotheses: Hypotheses, *, threshold: float, unexplained: float, power: float = POWER
) -> Real:
    """Return the smallest change of each component that raises an alert with a given power.

    Parameters
    ----------
    scores
        Scores of the windows.
    hypotheses
        Hypotheses about the components.
    threshold
        ln of the value of the e-detector at which it raises an alert.
    unexplained
        Sum of squares that no change explains, in variances.
    power
        Probability of an alert.

    Returns
    -------
    numpy.ndarray
        Changes [ln], above 0, shape (components,): of one component, before the first window.

    Notes
    -----
    The estimate x of a change d that begins with the first window has the information k = d^T K d. Given x, the onset t
    and hypothesis h explain x^2 g + v (e - g / k) in the mean: g = c^T (K_t + C^-1)^-1 c of the change, with
    c = D (mean of the score at t for a unit change), and of chance of the variance v the effective number of sizes e
    without the direction of the change. These give the evidence as a function of x^2, and Newton's method the x at the
    threshold. The ratio t = x / (v / k)^(1/2) exceeds its value t0 there with that power where its mean is
    t0 + 1.645 (1 + q t0^2 / 2)^(1/2): the second term is the doubt about v, of which the share n / (n + f) is estimated
    from the n degrees of freedom of the windows and the rest from the f of the baseline, q = n / (n + f) / f. It is the
    usual approximation of the noncentral distribution of Student, for a scale of which a part is known.

    References
    ----------
    N. L. Johnson, B. L. Welch, Applications of the non-central t-distribution, Biometrika 31 (1940) 362-389.
    """
    simple = hypotheses.without_pairs
    known = np.diagonal(scores.information[0])[:, None]
    variance = unexplained / scores.degrees
    # Scores of a unit change of each component from the first window on, shape (components, windows, components).
    gain, volumes = explained_by(np.moveaxis(scores.of_first, -1, 0), scores.information, simple)
    chance = np.maximum(0.0, dimensions_of(scores.information, simple) - gain / known[..., None])
    terms = _Terms(
        gain.reshape(len(known), -1),
        variance * chance.reshape(len(known), -1),
        np.broadcast_to(simple.log_prior - volumes, gain.shape).reshape(len(known), -1),
        known,
        unexplained,
        scores.degrees / 2,
    )
    squares = 2 * threshold * variance / known
    terms = terms.largest(squares)
    for _ in range(SEARCH.steps):
        evidence, slopes = terms.evidence(squares)
        rising = slopes > 0  # it does not rise where chance explains more than the change
        steps = np.where(rising, (threshold - evidence) / np.where(rising, slopes, 1.0), 3 * squares)
        squares = np.maximum(squares + steps, squares / 4)
    limit = np.sqrt(squares * known / variance)[:, 0]
    doubt = (1 - scores.of_baseline / scores.degrees) / scores.of_baseline
    mean = limit + ndtri(power) * np.sqrt(1 + doubt * limit**2 / 2)
    return np.asarray(mean * np.sqrt(variance / known[:, 0]), dtype=np.float64)


@dataclass(frozen=True, eq=False, slots=True)
class _Terms:
    """Terms of the evidence for each component (rows) and onset and hypothesis (columns)."""

    gain: Real
    chance: Real
    offsets: Real
    known: Real
    unexplained: float
    half: float

    def logs(self, squares: Real) -> Real:
        """Return ln of each term, at the squares of sizes, shape (components, 1)."""
        rest = self.unexplained + squares * self.known
        return self.half * np.log(rest / (rest - squares * self.gain - self.chance)) + self.offsets

    def evidence(self, squares: Real) -> tuple[Real, Real]:
        """Return ln of the sum of the terms, and its derivative by the squares, each of shape (components, 1)."""
        logs = self.logs(squares)
        evidence = np.logaddexp.reduce(logs, axis=1, keepdims=True)
        rest = self.unexplained + squares * self.known
        left = rest - squares * self.gain - self.chance
        slopes = self.half * (self.known / rest - (self.known - self.gain) / left)
        return evidence, np.sum(np.exp(logs - evidence) * slopes, axis=1, keepdims=True)

    def largest(self, squares: Real) -> "_Terms":
        """Return the largest terms only."""
        if self.gain.shape[1] <= SEARCH.largest:
            return self
        columns = np.argpartition(-self.logs(squares), SEARCH.largest, axis=1)[:, : SEARCH.largest]
        gain, chance, offsets = (
            np.take_along_axis(values, columns, axis=1) for values in (self.gain, self.chance, self.offsets)
        )
        return replace(self, gain=gain, chance=chance, offsets=offsets)


def detectable(
    baseline: Baseline,
    *,
    n_windows: int,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
    power: float = POWER,
) -> dict[Component, float]:
    """Return the smallest loss of each component that further windows would find.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    n_windows
        Number of windows with the change, at least 1, in the middle of the conditions of the baseline and as certain as
        its windows.
    false_alarms
        Rate of false alarms of a healthy vehicle, per day; above 0.
    windows_per_day
        Windows in a day of driving, above 0.
    power
        Probability of an alert after such a loss, above 0 and below 1.

    Returns
    -------
    dict
        Relative loss of each component: 0.07 for 7 %.

    Raises
    ------
    ParameterError
        If a number is out of its range.

    Examples
    --------
    The smallest loss that more windows would find is smaller:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> for n_windows in (2, 12):
    ...     losses = detectable(baseline, n_windows=n_windows)
    ...     print(f"{n_windows} windows: {100 * losses[parts[0]]:.0f} % of the {parts[0]}")
    2 windows: 16 % of the front_left.spring
    12 windows: 9 % of the front_left.spring
    """
    check_type("baseline", baseline, Baseline)
    check_number("n_windows", n_windows, at_least=1)
    check_number("false_alarms", false_alarms, above=0)
    check_number("windows_per_day", windows_per_day, above=0)
    check_number("power", power, above=0, at_most=1 - 1e-9)
    size = len(baseline.components)
    usual = Compared(
        time=0.0,
        model_error=0.0,
        residual=np.zeros(size),
        units=np.eye(1 + 2 * len(CONDITIONS))[0],
        information=np.asarray(np.linalg.inv(baseline.covariance + baseline.nuisance), dtype=np.float64),
        variances=np.ones(len(baseline.coordinates)),
    )
    scores = scores_of([usual] * n_windows, baseline.doubt_beyond(), baseline.degrees_of_freedom)
    threshold = float(np.log(windows_per_day / false_alarms))
    hypotheses = Hypotheses.of(baseline.components)
    # Windows as certain as those of the baseline add one variance for each of their degrees of freedom.
    changes = detectable_changes(scores, hypotheses, threshold=threshold, unexplained=scores.degrees, power=power)
    return dict(zip(baseline.components, losses(changes), strict=True))


def losses(changes: Real) -> list[float]:
    """Return relative losses of changes [ln]."""
    return [float(loss) for loss in -np.expm1(-changes)]
