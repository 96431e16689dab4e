"""Two sets of windows of one vehicle compared, without a baseline."""

from collections.abc import Iterable
from dataclasses import replace

from sprung._checks import check_each, check_number
from sprung.diagnosis.assessment import diagnose
from sprung.diagnosis.findings import Diagnosis
from sprung.diagnosis.learning import learn
from sprung.diagnosis.observation import Observation

#: Fewest windows of the first set: their scatter is then widened by Student's t.
_MIN_WINDOWS = 2


def compare(before: Iterable[Observation], after: Iterable[Observation], *, false_alarms: float = 0.01) -> Diagnosis:
    """Return whether two sets of windows of one vehicle differ, where, and by how much.

    Parameters
    ----------
    before, after
        Windows of each set, before and after what may have changed the vehicle.
    false_alarms
        Probability that two sets of an unchanged vehicle are called different, above 0.

    Returns
    -------
    Diagnosis
        That of the second set with a baseline of the first alone: findings are changes of the second from the first,
        and `detectable` is the smallest change that would have been found.

    Raises
    ------
    DataError
        If the first set has fewer than two usable windows.
    ParameterError
        If a number is out of range, or the windows are of several vehicles.

    Notes
    -----
    The test is `ChangeDetector`. With few windows in the first set, its mean and scatter are uncertain, and a change
    has to be larger to be found: that is part of the baseline (`learn`).

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((10, 12))
    >>> values[5:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> result = compare(windows[:5], windows[5:])
    >>> result.verdict, str(result.findings[0].corner), result.findings[0].component
    ('change', 'front_left', 'spring')
    """
    check_number("false_alarms", false_alarms, above=0)
    later = list(check_each("after", after, Observation))
    first = learn(before, min_windows=_MIN_WINDOWS, reason="first set of a comparison")
    # One comparison is one day: the rate of false alarms per day is the probability for the whole set.
    result = diagnose(later, first, false_alarms=false_alarms, windows_per_day=max(len(later), 1))
    return replace(result, notes=(f"compared with {first.n_windows} windows of the first set", *result.notes))
