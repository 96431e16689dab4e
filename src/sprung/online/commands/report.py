"""The command `sprung report`."""

import time
from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.checks import check_file
from sprung.cli.options import OUTPUT, Json, Since, Until, option
from sprung.cli.output import show, write_result, written
from sprung.errors import ParameterError
from sprung.online.commands.stores import DEFAULT_STORE, StoreUrl, existing_store

#: Endings of the files that can be written.
_ENDINGS = (".html", ".htm", ".pdf")


def report(
    vehicle: Annotated[str, typer.Argument(metavar="ID", help="Name of the vehicle.", show_default=False)],
    *,
    out: Annotated[
        Path | None, option("FILE.html", "Page to write; .pdf needs the extra pdf.", "--out", panel=OUTPUT)
    ] = None,
    since: Since = None,
    until: Until = None,
    store: StoreUrl = DEFAULT_STORE,
    json: Json = None,
) -> None:
    """Write a page about a monitored vehicle and a period: changes, trends, alerts, modes, conditions, data."""
    from sprung.online.monitor.vehicle_report import vehicle_report
    from sprung.results.page import pdf_of, render
    from sprung.results.periods import parse_period

    check_file("--out", out)
    check_file("--json", json)
    if out is None and json is None:
        raise ParameterError("there is no file to write: give --out FILE.html or --json PATH")
    if out is not None and out.suffix.lower() not in _ENDINGS:
        raise ParameterError(f"--out {out} must be an HTML or PDF file: name it {out.with_suffix('.html').name}")
    period = parse_period(since, until)
    with existing_store(store) as opened:
        content = vehicle_report(opened, vehicle, period=period, now=time.time_ns())
    if out is not None:
        page = render(content)
        out.write_bytes(pdf_of(page) if out.suffix.lower() == ".pdf" else page.encode())
    if write_result(content.document or {}, json):
        show([content.verdict, *written([] if out is None else [out], json)])
