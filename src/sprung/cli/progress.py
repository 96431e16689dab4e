"""The progress bar, shown on a terminal only."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from sprung.cli.output import printable


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
