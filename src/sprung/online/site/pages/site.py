"""The site: settings, store, senders and state of the monitor itself."""

from collections.abc import Iterator, Mapping
from typing import Annotated

from fastapi import APIRouter, Path, Request
from fastapi.responses import RedirectResponse, Response

from sprung.online.site import site_views
from sprung.online.site.access import Viewer
from sprung.online.site.context import Shared
from sprung.online.site.pages.forms import EngineerForm
from sprung.online.site.pages.rendering import page
from sprung.online.site.people import Role
from sprung.online.site.site_models import FalseAlarms, FigureEntry

router = APIRouter()


@router.get("/site")
def show(request: Request, context: Shared, person: Viewer) -> Response:
    """Show the site."""
    detail = site_views.site_detail(context)
    return page(
        request,
        "site.html",
        section="/site",
        site=detail,
        may_test=person.role.includes(Role.ENGINEER),
        work=list(_work({each.name: each.value for each in detail.figures})),
        seen=_seen,
        bytes=_bytes,
        figure=_figure,
    )


@router.post("/site/senders/{name}/test")
def try_sender(context: Shared, form: EngineerForm, name: Annotated[str, Path(max_length=64)]) -> Response:
    """Send a test message; the page shows the outcome."""
    site_views.try_sender(context, name, who=form.person.name)
    return RedirectResponse("/site#senders", 303)


def _work(figures: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """Yield what the monitor does, and what waits, in words."""
    n_frames, n_windows = figures.get("sprung_backlog_frames"), figures.get("sprung_windows_total")
    if n_frames is not None:
        age = figures.get("sprung_backlog_age_seconds", 0.0)
        yield "waiting for analysis", f"{n_frames:,.0f} frames, the oldest for {age:.0f} s" if n_frames else "no frame"
    if n_windows is not None:
        seconds = figures.get("sprung_analysis_cpu_seconds_total", 0.0)
        each = f", each in {seconds / n_windows:.2g} s of processor time" if n_windows and seconds else ""
        n_failures = figures.get("sprung_failures_total", 0.0)
        yield "analysed since the start", f"{n_windows:,.0f} windows{each}; {n_failures:,.0f} jobs failed"


def _seen(alarms: FalseAlarms) -> str:
    """Return the rate of false alarms that verdicts show, with its interval."""
    if alarms.rate is None or alarms.interval is None:
        return "not known: no window was analysed"
    if not alarms.verdicts:
        return "not known: no alert has a verdict yet"
    low, high = alarms.interval
    most = "at most " if alarms.is_more else ""
    return f"{most}{alarms.rate:.2g} per vehicle and day of driving (95 % interval {low:.2g} to {high:.2g})"


def _bytes(number: int) -> str:
    """Return a number of bytes in a unit that is easy to read."""
    size, unit = float(number), "B"
    for larger in ("kB", "MB", "GB", "TB"):
        if size < 1000:
            break
        size, unit = size / 1000, larger
    return f"{size:.3g} {unit}" if unit != "B" else f"{number} B"


def _figure(figure: FigureEntry) -> str:
    """Return the value of a figure with its unit."""
    if "_seconds" in figure.name:
        return f"{figure.value:.1f} s"
    if figure.name.endswith("_bytes"):
        return _bytes(round(figure.value))
    if figure.name.endswith("_ratio"):
        return f"{100 * figure.value:.1f} %"
    return f"{figure.value:,.0f}"
