"""Reports and figures that commands write with --report and --figures."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sprung.formats import ReadSettings
    from sprung.results.page import Inputs, Report


def write_page(
    page: Path | None,
    report: "Callable[[Inputs], Report]",
    files: Sequence[Path],
    *,
    reading: "ReadSettings",
    others: Mapping[str, object],
    has_recordings: bool = True,
) -> list[Path]:
    """Write a report where one is wanted, and return its path.

    Parameters
    ----------
    page
        File to write; None: no report.
    report
        Function from the facts about the files to the report.
    files
        Recordings, which are read once more for those facts.
    reading
        Settings with which the command reads the files.
    others
        Further files by purpose; None for those not given.
    has_recordings
        Whether the files are recordings; their channels are not listed otherwise.
    """
    if page is None:
        return []
    from sprung.results.page import Inputs, inspected, render

    given = {purpose: str(name) for purpose, name in others.items() if name is not None}
    inputs = Inputs(tuple(files), {}, given)
    if has_recordings:
        inputs = inspected(files, settings=reading, others=given)
    page.write_text(render(report(inputs)), encoding="utf-8")
    return [page]


def write_figures(folder: Path | None, draw: "Callable[[Any], Mapping[str, Figure]]", file_format: str) -> list[Path]:
    """Write figures by name where a folder for them is given; `draw` receives `sprung.results.figures`."""
    if folder is None:
        return []
    from sprung.results import figures

    return figures.saving.save(draw(figures), folder, file_format=file_format)
