"""From values to a page: templates, marks, times and links."""

import re
import secrets
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any
from urllib.parse import quote, urlencode

from fastapi import Request
from fastapi.responses import HTMLResponse, Response
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from pydantic import BaseModel

from sprung import __version__
from sprung.modal import INTERVAL_95
from sprung.online.site.accounts import Person, Role, find_person, set_session
from sprung.online.site.shared import context_of
from sprung.results.tables.wording import format_age, format_time
from sprung.road import road_class_of
from sprung.state import STEPS, PartState, Verdict

#: Sign of each step of severity, and of each state of a vehicle: none is known by its colour alone.
MARKS = {"note": "○", "low": "△", "medium": "◇", "high": "■", "critical": "✖"}
STATE_MARKS = {
    Verdict.CHANGE: "■",
    Verdict.FAULT: "■",
    Verdict.STALE: "◌",
    Verdict.LEARNING: "…",
    Verdict.INCONCLUSIVE: "?",
    Verdict.NO_CHANGE_DETECTED: "✓",
    Verdict.WAITING: "◌",
}
#: Half widths of the axis of changes [%], the smallest one that holds all intervals is used.
_AXES = (5, 10, 20, 30, 50, 100)
#: Width of the axis of changes in its picture.
_WIDTH = 240
#: Pages of a vehicle.
_TABS = {
    "": "Overview",
    "/diagrams": "Spectra and diagrams",
    "/windows": "Windows",
    "/data": "Data quality",
    "/baseline": "Baseline",
}
#: A date, perhaps with its time.
_DATE = re.compile(r"(\d{4}-\d\d-\d\d)(?: (\d\d:\d\d))?( UTC)?")
#: Width below which intervals have a decimal [percentage points].
_NARROW = 2.0
#: Digits of powers.
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: Sections of the site, and the least role that sees each.
_SECTIONS = (
    ("/", "Fleet", Role.VIEWER),
    ("/alerts", "Alerts", Role.VIEWER),
    ("/outcomes", "Outcomes", Role.VIEWER),
    ("/runs", "Runs", Role.VIEWER),
    ("/site", "Site", Role.VIEWER),
    ("/audit", "Audit trail", Role.ENGINEER),
    ("/people", "People", Role.ADMIN),
    ("/api", "Interface", Role.VIEWER),
)


def page(
    request: Request, template: str, *, status: int = 200, section: str = "", notice: str = "", **values: Any
) -> HTMLResponse:
    """Return a page.

    Parameters
    ----------
    request
        Request that it answers.
    template
        Name of the template.
    status
        Status of the answer.
    section
        Path of the section that it belongs to.
    notice
        Sentence at the top, such as the outcome of an action.
    values
        Values of the template.
    """
    context, person = context_of(request), find_person(request)
    secret = ""
    if person is not None and not person.has_account and not person.secret:
        # A browser on a machine without accounts: its forms need a CSRF token, too.
        secret = secrets.token_urlsafe(32)
        person = Person(person.name, person.role, secret, has_account=False)
    text = _environment().get_template(template)
    body = text.render(
        person=person,
        section=section,
        notice=notice,
        navigation=[
            (path, name)
            for path, name, role in _SECTIONS
            if person and person.role.includes(role) and (path != "/runs" or context.site.keep.results)
        ],
        site_name=context.site.name,
        now=context.clock(),
        **values,
    )
    answer = HTMLResponse(body, status, headers={"cache-control": "no-store"})
    if secret:
        set_session(answer, context, secret)
    return answer


def path_of(vehicle: str) -> str:
    """Return the path of the pages of a vehicle."""
    return f"/vehicles/{quote(vehicle, safe='')}"


def vehicle_page(request: Request, template: str, vehicle: str, *, tab: str, **values: Any) -> Response:
    """Return a page about a vehicle."""
    return page(
        request,
        template,
        vehicle=vehicle,
        path=path_of(vehicle),
        minutes=f"{request.app.state.context.site.watch.window_minutes:g} minutes",
        tab=tab,
        tabs=_TABS.items(),
        width=_WIDTH,
        x=_x,
        **values,
    )


def axis_of(parts: Sequence[PartState]) -> int:
    """Return half the width of the axis that shows all changes with their intervals [%]."""
    reach = max((100 * abs(end) for part in parts for end in (*part.interval, part.change)), default=0.0)
    return next((half for half in _AXES if reach <= half), _AXES[-1])


def _x(change: float, axis: int) -> float:
    """Return the place of a change on the axis, within its ends."""
    return round(_WIDTH / 2 * (1 + max(-1.0, min(1.0, 100 * change / axis))), 1)


def with_others(sentence: str, others: Mapping[str, int]) -> str:
    """Return a sentence with how many others are in each of some states.

    Examples
    --------
    >>> with_others("None of 3 vehicles needs attention.", {"silent": 1, "learning": 0})
    'None of 3 vehicles needs attention. 1 is silent.'
    """
    parts = (f"{number} {'is' if number == 1 else 'are'} {word}." for word, number in others.items() if number)
    return " ".join((sentence, *parts))


def filter_link(path: str, wanted: BaseModel) -> Callable[..., str]:
    """Return a function from changes of a filter to the address of its page, which begins with the first entry."""
    given = wanted.model_dump(exclude_defaults=True, exclude={"cursor"})

    def link(**changes: Any) -> str:
        kept = {name: value for name, value in (given | changes).items() if value not in (None, [], "", False)}
        return path + (f"?{urlencode(kept, doseq=True)}" if kept else "")

    return link


@cache
def static(name: str) -> str:
    """Return the address of a file of the package, which changes with its contents."""
    content = (resources.files("sprung.online.site") / "static" / name).read_bytes()
    return f"/static/{name}?{sha256(content).hexdigest()[:12]}"


def plotly_file() -> Traversable:
    """Return the library of the charts in the installed package."""
    return resources.files("plotly") / "package_data" / "plotly.min.js"


@cache
def plotly_styles() -> tuple[str, ...]:
    """Return the contents of the `<style>` elements that the library of the charts adds: one stays empty."""
    return "", *re.findall(r"\.textContent='([^'\\]+)'", plotly_file().read_text(encoding="utf-8"))


@cache
def _environment() -> Environment:
    """Return the templates with what all of them use."""
    made = Environment(
        loader=PackageLoader("sprung.online.site"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    made.filters.update(
        iso=_iso,
        utc=lambda time: f"{format_time(time)} UTC",
        duration=_duration,
        unbroken=_unbroken,
        brief=lambda sentence: "; ".join(sentence.split("; ")[:2]),
        ago=lambda time, now: format_age(time, now=now),
        rounded=_rounded,
        road=_road,
    )
    made.globals.update(
        static=static,
        marks=MARKS,
        state_marks=STATE_MARKS,
        steps=STEPS[::-1],
        version=__version__,
        signed=_signed,
        span=_span,
        mode_span=_mode_span,
        three_digits=_three_digits,
        half_width=INTERVAL_95,
    )
    return made


def _iso(time: int) -> str:
    """Return a time [UTC ns] as pages' scripts read it."""
    return f"{format_time(time).replace(' ', 'T')}:{time // 10**9 % 60:02d}Z"


def _duration(length: int) -> str:
    """Return a length of time [ns] in one unit."""
    return format_age(0, now=length).removesuffix(" ago").replace("just now", "less than a minute")


def _unbroken(sentence: str) -> Markup:
    """Return a sentence as markup: dates are not broken at the end of a line, times change to the reader's zone."""
    return Markup(_DATE.sub(_date, str(escape(sentence))))


def _date(found: re.Match[str]) -> str:
    """Return a date as markup; with its time, if that is stated as UTC, as one that the browser converts."""
    day, time, zone = found.groups()
    if time and zone:
        return f'<time class="date" datetime="{day}T{time}:00Z">{found[0]}</time>'
    return f'<span class="date">{found[0]}</span>'


def _signed(change: float, interval: tuple[float, float]) -> str:
    """Return a change [%] with its sign, and as many digits as its interval deserves."""
    digits = 1 if 100 * abs(interval[1] - interval[0]) < _NARROW else 0
    value = round(100 * change, digits)
    return f"{value:+.{digits}f}".replace("-", "−") if value else f"{0:.{digits}f}"


def _rounded(value: float, digits: int = 0) -> str:
    """Return a number with a number of decimals, and no sign where it rounds to 0."""
    return f"{value:z.{digits}f}".replace("-", "−")


def _road(roughness: float) -> str:
    """Return a roughness G(n0) [m^3] in a word, with its class of ISO 8608."""
    letter = road_class_of(roughness)
    return f"{'smooth' if letter in 'AB' else 'normal' if letter == 'C' else 'rough'} ({letter})"


def _span(interval: tuple[float, float]) -> str:
    """Return the ends of an interval of a change [%]."""
    return f"{_signed(interval[0], interval)} to {_signed(interval[1], interval)}"


def _mode_span(value: float, std: float | None, factor: float = 1.0) -> str:
    """Return a value of a mode with its 95 % interval, in three digits."""
    text = f"{factor * value:#.3g}"
    if std is None:
        return text
    digits = len(text.partition(".")[2])
    low, high = (f"{factor * (value + half):.{digits}f}" for half in (-INTERVAL_95 * std, INTERVAL_95 * std))
    return f"{text} ({low} to {high})"


def _three_digits(value: float) -> str:
    """Return a value in three digits, a small or large one with its power of ten."""
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    power = f" · 10{str(int(exponent)).translate(_RAISED)}" if exponent else ""
    return mantissa.replace("-", "−") + power
