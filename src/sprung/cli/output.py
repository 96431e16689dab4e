"""What commands print and write: tables, sentences, JSON, reports and figures, the progress bar, logs of services.

Names from files are never interpreted as markup or control sequences.
"""

import json
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from sprung.cli.options import Figures, FileFormat, Group, Json, Page, check_file, check_folder, option
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console
    from rich.table import Table as Grid

    from sprung.cli.options import Reading
    from sprung.results.documents import Document
    from sprung.results.page import Inputs, Report
    from sprung.results.tables import Table


#: Columns where standard output is not a terminal and COLUMNS is not set.
_WIDTH_OF_A_FILE = 120


def write_json(document: "Document | Mapping[str, Any]", path: str) -> None:
    """Write a document to a file, or to standard output where `path` is "-"."""
    from sprung.results.documents import document_text, write_document

    if path == "-":
        sys.stdout.write(document_text(document))
        sys.stdout.flush()
    else:
        write_document(document, path)


def write_result(document: "Document | Mapping[str, Any]", json: str | None) -> bool:
    """Write a result to the path of `--json`, if given; return whether standard output is free for its tables."""
    if json is not None:
        write_json(document, json)
    return json != "-"


def write_pieces(pieces: Iterable[bytes], path: str) -> None:
    """Write the pieces of a text file in UTF-8, or of any file, to a file, or to standard output for "-"."""
    if path == "-":
        for piece in pieces:
            sys.stdout.write(piece.decode())
        sys.stdout.flush()
        return
    with open(path, "wb") as file:
        file.writelines(pieces)


def written(paths: "Iterable[Path | str]", json: str | None = None) -> list[str]:
    """Return a sentence for each file that was written, that of `--json` last."""
    return [f"wrote {path}" for path in (*paths, *([] if json is None else [json]))]


def show(*parts: "Table | Sequence[str]", heading: str = "") -> None:
    """Print tables and lists of sentences, with an empty line between them; an empty list is left out."""
    from sprung.results.tables import Table

    screen = console()
    if heading:
        screen.print(printable(heading), style="bold", soft_wrap=True)
    shown = [part for part in parts if isinstance(part, Table) or part]
    for number, part in enumerate(shown):
        if number:
            screen.print()
        screen.print(grid_of(part) if isinstance(part, Table) else _list(part))
        if isinstance(part, Table) and part.caption:
            screen.print(part.caption, style="dim")


def console() -> "Console":
    """Return the console that prints on standard output."""
    from rich.console import Console

    is_measured = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(markup=False, emoji=False, highlight=False, width=None if is_measured else _WIDTH_OF_A_FILE)


def grid_of(table: "Table") -> "Grid":
    """Return a table as printed: a column other than the first is left out where all its cells are empty."""
    from rich import box
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid(
        title=Text(table.title) if table.title else None,
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    cells = [[printable_lines(cell) for cell in row] for row in table.rows]
    for k in table.shown:
        has_words = table.has_words(k)
        grid.add_column(
            table.columns[k], justify="left" if has_words else "right", overflow="fold", no_wrap=not has_words
        )
    for row in cells:
        grid.add_row(*(Text(row[k]) for k in table.shown))
    return grid


def _list(sentences: Iterable[str]) -> "Grid":
    """Return sentences as a list with one bullet each."""
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid.grid(padding=(0, 1))
    for sentence in sentences:
        grid.add_row("-", Text(printable(sentence), overflow="fold"))
    return grid


def printable(text: str) -> str:
    """Return `text` in one line, without control characters."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def printable_lines(text: str) -> str:
    """Return `text` without control characters in its lines."""
    return "\n".join(printable(line) for line in text.split("\n"))


@dataclass(slots=True)
class Output(Group):
    """Where a command puts its result besides the terminal, and the files that it wrote."""

    figures: Figures = None
    file_format: FileFormat = "png"
    page: Page = None
    json: Json = None
    paths: list[Path] = field(default_factory=list, init=False)

    def check(self, *inputs: str | Path | None) -> None:
        """Refuse files that cannot be written, or would overwrite an input; None of the inputs is not given."""
        given = [path for path in inputs if path is not None]
        check_file("--json", self.json, inputs=given)
        check_file("--report", self.page, inputs=given)
        if self.page is not None and self.page.suffix.lower() not in {".html", ".htm"}:
            name = self.page.with_suffix(".html").name
            raise ParameterError(f"--report {self.page} must be an HTML file: name it {name}")
        check_folder("--figures", self.figures)

    def draw(self, figures: "Callable[[Any], Mapping[str, Figure]]") -> None:
        """Write figures by name where a folder for them is given; `figures` receives `sprung.results.figures`."""
        if self.figures is not None:
            from sprung.results import figures as drawn
            from sprung.results.figures.saving import save

            self.paths += save(figures(drawn), self.figures, file_format=self.file_format)

    def report(
        self,
        report: "Callable[[Any, Inputs], Report]",
        files: "Sequence[Path]",
        reading: "Reading | None",
        **others: object,
    ) -> None:
        """Write the report, if there is to be one, as a self-contained page.

        Parameters
        ----------
        report
            Function from `sprung.results.page` and the facts about the files to the report.
        files
            Recordings behind the result.
        reading
            How they were read; None: they are no recordings, and have no facts.
        others
            Further files behind it by their purpose; None: not given.
        """
        if self.page is None:
            return
        from sprung.results import page as pages

        given = {purpose: str(name) for purpose, name in others.items() if name is not None}
        inputs = pages.Inputs(tuple(files), {}, given)
        if reading is not None:
            inputs = pages.inspected(files, settings=reading.settings, others=given)
        self.page.write_text(pages.render(report(pages, inputs)), encoding="utf-8")
        self.paths.append(self.page)

    def show(
        self,
        document: "Document | Mapping[str, Any]",
        *parts: "Table | Sequence[str]",
        notes: Iterable[str] = (),
        heading: str = "",
    ) -> None:
        """Write the JSON document, and show tables and sentences, notes and the files written where that is free."""
        if write_result(document, self.json):
            show(*parts, [*notes, *written(self.paths, self.json)], heading=heading)


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Yield a callback that receives the current step and the share that is done (0 to 1; 0 if unknown)."""
    if not sys.stderr.isatty():
        yield lambda step, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)
        yield lambda step, share: bar.update(
            task, description=printable(step), completed=share, total=1.0 if share else None
        )


LOG = logging.getLogger("sprung")

LogFormat = Annotated[str, option("text|json", "Format of the log on standard error.", "--log")]

_USUAL = set(logging.makeLogRecord({}).__dict__) | {"message", "asctime", "taskName"}


def log_to(form: str) -> None:
    """Log to standard error: "text", or "json" with one object a line."""
    from sprung._checks import check_one_of

    check_one_of("--log", form, ("text", "json"))
    handler = logging.StreamHandler()
    handler.setFormatter(JsonLines() if form == "json" else Text())
    root = logging.getLogger("sprung")
    root.handlers, root.propagate = [handler], False
    root.setLevel(logging.INFO)


def extras(record: logging.LogRecord) -> dict[str, object]:
    """Return the fields of a record besides its message."""
    return {name: value for name, value in record.__dict__.items() if name not in _USUAL}


class Text(logging.Formatter):
    """Time, level, message and further fields in one line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return a line."""
        more = "".join(f" {name}={value}" for name, value in extras(record).items())
        return f"{_time(record)} {record.levelname.lower():7} {record.getMessage()}{more}"


class JsonLines(logging.Formatter):
    """One JSON object a line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return a line."""
        fields = {"time": _time(record), "level": record.levelname.lower(), "message": record.getMessage()}
        return json.dumps({**fields, **extras(record)}, default=str)


def _time(record: logging.LogRecord) -> str:
    """Return the time of a record, ISO 8601."""
    return datetime.fromtimestamp(record.created, tz=UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def stop_on_signals(*, within: float | None = None) -> threading.Event:
    """Return an event that SIGINT and SIGTERM set.

    Parameters
    ----------
    within
        Longest time from the first signal to the end of the process [s], after which it ends with status 1, its child
        processes first; None: no limit.
    """
    stopping = threading.Event()

    def stop() -> None:
        if stopping.is_set():
            return
        stopping.set()
        if within is not None:
            timer = threading.Timer(within, _end, (within,))
            timer.daemon = True
            timer.start()

    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread: if this one holds the lock of the event when the signal comes, it would deadlock.
        signal.signal(number, lambda *_: threading.Thread(target=stop).start())
    return stopping


def _end(within: float) -> None:
    """End the process whatever its threads wait for: results are in the store, transaction by transaction."""
    import multiprocessing

    LOG.error(f"no clean stop within {within:g} s, as the store or a disk does not answer: process ended")
    for child in multiprocessing.active_children():
        child.kill()
        child.join(1.0)
    os._exit(1)
