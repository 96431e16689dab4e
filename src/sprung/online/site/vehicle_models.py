"""Values about one vehicle, as the interface returns and the pages show them. Times are UTC ns, changes relative."""

from typing import Literal

from pydantic import Field

from sprung.online.site.models import Answer, BaselineEntry, WindowEntry
from sprung.results.documents.document import Pair
from sprung.state import Verdict


class PartChange(Answer):
    """The change of a spring, damper or tyre against the reference."""

    part: str = Field(description="CORNER.KIND")
    corner: str
    kind: str
    change: float = Field(description="relative, -0.2 for a loss of a fifth")
    interval: Pair = Field(description="95 % interval of the change, by which it is decided")
    interval_with_common: Pair = Field(description="95 % interval with effects common to the corners, such as payload")
    detectable: float | None = Field(description="smallest relative loss that would have been found; null: unknown")
    verdict: Verdict
    alert: int | None = Field(description="number of the active alert that names the part")
    step: str | None = Field(description="step of severity of that alert")


class Changes(Answer):
    """Verdict on a vehicle, and changes of all parts, averaged over windows."""

    verdict: Verdict
    sentence: str
    reference: str = Field(description="what windows are compared with")
    baseline: int | None = Field(description="version of the baseline; null: the vehicle file")
    n_windows: int
    since: int | None
    until: int | None
    parts: tuple[PartChange, ...]
    notes: tuple[str, ...]


class PartTrend(Answer):
    """A part over time; null if there is no value."""

    part: str
    change: tuple[float | None, ...]
    low: tuple[float | None, ...]
    high: tuple[float | None, ...]
    band: Pair | None = Field(description="range of 95 % of usual single windows; null without a baseline")
    detectable: float | None = Field(description="smallest relative loss that would have been found; null: unknown")


class ModeTrend(Answer):
    """Natural frequency [Hz] and damping ratio of a mode over time; null if it was not identified."""

    label: str
    natural_frequency: tuple[float | None, ...]
    natural_frequency_std: tuple[float | None, ...]
    damping_ratio: tuple[float | None, ...]
    damping_ratio_std: tuple[float | None, ...]


class TimeMark(Answer):
    """An event on the time axis."""

    time: int
    kind: Literal["baseline", "verdict", "alert"]
    text: str
    link: str


class Trends(Answer):
    """Parts and modes over time, oldest first; null values are inconclusive windows, and gaps without samples."""

    reference: str
    since: int | None = Field(description="beginning of the range; null: the first window")
    until: int
    times: tuple[int, ...] = Field(description="starts of the windows of `parts`")
    windows: tuple[str | None, ...] = Field(description="BOOT/NUMBER of each; null: a gap")
    remarks: tuple[str, ...] = Field(description="why a window has no value")
    parts: tuple[PartTrend, ...]
    mode_times: tuple[int, ...]
    modes: tuple[ModeTrend, ...]
    marks: tuple[TimeMark, ...]
    is_cut: bool = Field(description="whether older windows of the range are omitted")


class BodyMode(Answer):
    """A mode of the body: how its four corners move, as complex numbers of any common scale."""

    label: str
    natural_frequency: float
    natural_frequency_std: float | None
    damping_ratio: float
    damping_ratio_std: float | None
    real: tuple[float, ...] = Field(description="vertical motion of each of the corners, real part")
    imag: tuple[float, ...]
    explained: float = Field(description="share of the shape that a rigid body explains")


class BodyModes(Answer):
    """The modes of the body that were identified last."""

    time: int | None = Field(description="start of their window")
    corners: tuple[tuple[float, float, float], ...] = Field(
        description="front left, front right, rear right, rear left [m]"
    )
    modes: tuple[BodyMode, ...]
    note: str = Field(description="why there is none; empty otherwise")


class ChannelCheck(Answer):
    """Result of the checks of one kind on a channel."""

    name: str
    n_faults: int = Field(description="windows with such a fault")
    last: int | None = Field(description="start of the last of them")
    text: str = Field(description="that fault in words")
    is_present: bool = Field(description="whether the last window has it")


class ChannelQuality(Answer):
    """Data quality of a channel."""

    channel: str
    quantity: str
    checks: tuple[ChannelCheck, ...]
    is_good: bool = Field(description="whether the last window has no fault of it")


class DataQuality(Answer):
    """Data quality of a vehicle over its last windows; unknown values are omitted."""

    since: int | None
    until: int | None
    last_seen: int
    is_parked: bool
    n_windows: int
    n_inconclusive: int
    reasons: tuple[tuple[str, int], ...] = Field(description="why windows are inconclusive, with their number")
    lost_frames: int
    unanalysed_frames: int = Field(description="quarantined because their analysis failed")
    channels: tuple[ChannelQuality, ...]
    notes: tuple[str, ...]


class Condition(Answer):
    """A condition of driving."""

    name: str
    value: float
    unit: str


class ModeValue(Answer):
    """A mode in a window."""

    label: str
    natural_frequency: float
    natural_frequency_std: float | None
    damping_ratio: float
    damping_ratio_std: float | None


class WindowDetail(Answer):
    """A window: conditions, parts, modes, findings and sensor faults."""

    vehicle: str
    window: WindowEntry
    reason: str = Field(description="why it is inconclusive; empty if it is conclusive")
    conditions: tuple[Condition, ...]
    reference: str
    parts: tuple[PartChange, ...]
    modes: tuple[ModeValue, ...]
    findings: tuple[str, ...]
    sensor_faults: tuple[str, ...]
    notes: tuple[str, ...]
    before: str | None = Field(description="BOOT/NUMBER of the window before")
    after: str | None


class ConditionRange(Answer):
    """Lowest and highest value of a condition in the windows of a baseline."""

    name: str
    low: float
    high: float
    unit: str


class BaselineVersion(BaselineEntry):
    """A version of a baseline: start of use, reason, requester, and conditions met."""

    who: str | None = Field(description="who requested it; null: the monitor by itself, or no longer known")
    refused: int | None = Field(description="windows not used for learning")
    ranges: tuple[ConditionRange, ...] = Field(description="conditions of its windows")
    is_restorable: bool = Field(description="whether it can be returned to")


class BaselineDetail(Answer):
    """Learning and baselines of a vehicle."""

    is_learning: bool
    windows_learnt: int
    windows_needed: int
    progress: str = Field(description="progress of learning in words")
    is_requested: bool = Field(description="whether a request for a new baseline is pending")
    requested_version: int | None = Field(description="earlier version to which a return is pending")
    versions: tuple[BaselineVersion, ...]
    ranges: tuple[ConditionRange, ...]
    detectable: dict[str, dict[str, float]] = Field(
        description="smallest relative loss of each part by number of windows"
    )
    notes: tuple[str, ...]
