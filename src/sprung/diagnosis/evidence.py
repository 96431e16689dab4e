"""The body's modes before and after a change, as the finding implies them and as measured in the windows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.findings import Finding
from sprung.diagnosis.observation import Observation
from sprung.modal import mac, unit_shapes
from sprung.vehicles import Vehicle, structure
from sprung.vehicles.labels import MOTIONS


@dataclass(frozen=True, eq=False, slots=True)
class ModeChange:
    """A mode of the body before and after a change, as the finding implies: computed, not measured.

    Parameters
    ----------
    label
        "bounce", "pitch" or "roll".
    frequency, damping
        Natural frequency [Hz] and damping ratio, before and after.
    mac
        Modal assurance criterion of the two shapes, 0 to 1.
    channels
        Channels of the shapes.
    shapes
        Moduli of the shapes before and after, shape (2, channels), 1 at the largest channel of each.
    measured_before, measured_since
        Natural frequency [Hz] and damping ratio of the vehicle as fitted to each window, median over the windows before
        the onset and since then; None without such windows.
    """

    label: str
    frequency: tuple[float, float]
    damping: tuple[float, float]
    mac: float
    channels: tuple[str, ...]
    shapes: Real
    measured_before: tuple[float, float] | None = None
    measured_since: tuple[float, float] | None = None


def mode_changes(
    vehicle: Vehicle, finding: Finding, baseline: Baseline | None = None, *, observations: Sequence[Observation] = ()
) -> tuple[ModeChange, ...]:
    """Return the changes of the body's modes that a finding implies.

    Parameters
    ----------
    vehicle
        Vehicle as its file describes it.
    finding
        Change of one part, of both sides of an axle or of all corners; an unmodelled one changes no mode.
    baseline
        Normal state before the change; None: the vehicle file.
    observations
        Windows of the diagnosis, for the measured modes.

    Returns
    -------
    tuple of ModeChange
        Bounce, pitch and roll, as far as the vehicle has them.

    Notes
    -----
    Exact modes of the vehicle with the baseline's components, and with the finding's change applied to them: they
    illustrate the finding and are not evidence for it. The measured modes also vary with the payload.

    Examples
    --------
    A front-left spring that has lost 30 % of its stiffness lowers the frequencies of all modes of the body:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> (finding,) = sprung.diagnose(windows[8:], sprung.learn(windows[:8])).findings
    >>> changes = mode_changes(sprung.read_vehicle("zafira"), finding)
    >>> [(change.label, change.frequency[1] < change.frequency[0]) for change in changes]
    [('bounce', True), ('pitch', True), ('roll', True)]
    """
    if finding.change is None:
        return ()
    nominal = structure(vehicle)
    before = {} if baseline is None else dict(zip(baseline.components, np.exp(baseline.mean).tolist(), strict=True))
    after = dict(before)
    for component in nominal.components():
        if component.kind == finding.component and finding.corner in {component.corner, component.axle, "all"}:
            after[component] = before.get(component, 1.0) * (1 + finding.change)
    healthy, changed = (nominal.changed(factors).modes() for factors in (before, after))
    sound = [window for window in observations if window.is_conclusive and not window.sensor_faults]
    earlier = [window for window in sound if window.time < finding.since]
    later = [window for window in sound if window.time >= finding.since]
    changes = []
    for label in (label for label in MOTIONS if label in healthy.labels):
        row = healthy.labels.index(label)
        likeness = mac(healthy.mode_shapes[row : row + 1], changed.mode_shapes)[0]
        distance = np.abs(np.log(changed.natural_frequency / healthy.natural_frequency[row]))
        match = int(np.argmax(likeness - distance))
        changes.append(
            ModeChange(
                label,
                (float(healthy.natural_frequency[row]), float(changed.natural_frequency[match])),
                (float(healthy.damping_ratio[row]), float(changed.damping_ratio[match])),
                float(likeness[match]),
                tuple(healthy.channels),
                np.abs(unit_shapes(np.array([healthy.mode_shapes[row], changed.mode_shapes[match]]))),
                _measured(earlier, label),
                _measured(later, label),
            )
        )
    return tuple(changes)


def _measured(observations: Sequence[Observation], label: str) -> tuple[float, float] | None:
    """Return the median frequency and damping of a mode over windows."""
    modes = [observation.modes[label] for observation in observations if label in observation.modes]
    if not modes:
        return None
    frequency, damping = np.median(modes, axis=0)
    return float(frequency), float(damping)
