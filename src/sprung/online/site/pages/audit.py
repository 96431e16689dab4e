"""The audit trail: who did what to what."""

import json
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from sprung.online.site.access import Engineer
from sprung.online.site.context import Shared
from sprung.online.site.models import AuditEntry
from sprung.online.site.pages.rendering import page

router = APIRouter()

#: Entries on a page.
_LIMIT = 100


@router.get("/audit")
def show(
    request: Request, context: Shared, _: Engineer, before: Annotated[int | None, Query(ge=1, lt=2**63)] = None
) -> Response:
    """Show the audit trail, the latest action first."""
    rows = context.store.requests.audited(before=before, limit=_LIMIT + 1)
    entries = [AuditEntry.model_validate(row) for row in reversed(rows)]
    return page(
        request,
        "audit.html",
        section="/audit",
        entries=entries[:_LIMIT],
        following=entries[_LIMIT - 1].id if len(entries) > _LIMIT else None,
        before=before,
        limit=_LIMIT,
        days=context.site.keep.audit_days,
        written=_written,
    )


def _written(entry: AuditEntry) -> str:
    """Return the detail of an entry in words."""
    detail = entry.detail
    if detail is None or isinstance(detail, str):
        return detail or ""
    if isinstance(detail, dict):
        return ", ".join(
            f"{name}: {value if isinstance(value, str) else json.dumps(value)}" for name, value in detail.items()
        )
    return json.dumps(detail)
