"""Work orders for a workshop, `sprung.work-order/1`."""

from typing import Any, Literal

from pydantic import Field

from sprung.results.documents.document import Document, Pair


class WorkOrderDocument(Document):
    """The inspection or repair that a workshop is to do, and the reason; times are nanoseconds UTC since 1970."""

    schema_name: Literal["sprung.work-order/1"] = Field(alias="schema")
    key: str
    alert: int
    created: int
    created_by: str
    vehicle: str
    corner: str | None
    part: str
    change: float | None
    interval: Pair | None
    since: int
    since_interval: tuple[int, int] | None
    severity: int
    step: str
    urgency: str
    sentence: str
    runner_up: str
    state: str
    raised: int
    assignee: str | None
    evidence: dict[str, Any]
    link: str | None
