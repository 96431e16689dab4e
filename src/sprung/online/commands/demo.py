"""The command `sprung demo`."""

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import option
from sprung.cli.output import console, show
from sprung.cli.stopping import stop_on_signals

if TYPE_CHECKING:
    from rich.table import Table

    from sprung.online.demo import CarState

#: Longest time from a signal to the end [s].
_GRACE = 10.0


def demo(
    *,
    pace: Annotated[float, option("X", "Speed, as a multiple of real time.", min=1, max=120)] = 60.0,
    minutes: Annotated[float, option("M", "Longest time to find both faults, in minutes.", min=0.1)] = 5.0,
    once: Annotated[
        bool, typer.Option("--once", help="End after the findings, as without a terminal; default: serve until Ctrl-C.")
    ] = False,
) -> None:
    """Monitor a small simulated fleet on web pages: a spring softens, a sensor dies, and both raise alerts.

    Three cars send frames by MQTT to a monitor in this terminal, which learns baselines from their first 40 minutes.

    Then one loses a quarter of its front-left spring stiffness, and a sensor of another dies.
    """
    from rich.live import Live

    from sprung.online.demo import open_demo

    logging.getLogger("sprung").addHandler(logging.NullHandler())
    screen = console()
    is_kept = screen.is_terminal and not once
    stopping = stop_on_signals(within=_GRACE)
    with open_demo(pace=pace) as demonstration:
        screen.print(f"pages of this monitor: {demonstration.page}", style="bold", soft_wrap=True)
        with Live(console=screen, auto_refresh=False, transient=not screen.is_terminal) as live:

            def report(seconds: float, cars: "Sequence[CarState]") -> None:
                if screen.is_terminal:
                    live.update(_grid(seconds, cars), refresh=True)

            sentences = demonstration.find_faults(60 * minutes, is_stopped=stopping.is_set, on_progress=report)
        show(sentences or ["stopped before both faults were found"])
        if not sentences:
            raise typer.Exit(130)
        if is_kept:
            words = f"the fleet keeps driving, see {demonstration.page}; Ctrl-C ends it"
            screen.print(words, style="bold", soft_wrap=True)
            demonstration.run(stopping.is_set)


def _grid(seconds: float, cars: "Sequence[CarState]") -> "Table":
    """Return a table of the fleet."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    table = Table(title=f"{seconds:.0f} s: {len(cars)} cars", title_justify="left", expand=False)
    for heading in ("vehicle", "window", "baseline windows", "state"):
        table.add_column(heading)
    for car in cars:
        progress = ProgressBar(100, 100 * car.status.share, width=20)
        table.add_row(car.name, progress, f"{car.status.n_learnt} of {car.status.n_needed}", car.state)
    return table
