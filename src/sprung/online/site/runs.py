"""Results of a run over the fleet, from the table that `sprung fleet run` writes: values, no markup."""

import threading
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from sprung.errors import DataError, ParameterError
from sprung.online.alerts import STEPS
from sprung.online.site.models import Answer
from sprung.online.store import StoreError

if TYPE_CHECKING:
    import pyarrow as pa

VerdictName = Literal["change", "no_change_detected", "inconclusive"]
#: Pattern of the place after which a page of results begins.
CURSOR = r"^[01]~[0-5]~.{1,200}$"
#: Time for which results are not looked up again [s].
_FRESH = 10.0
#: Name of the table, and its columns that are shown.
_TABLE = "diagnoses"
_COLUMNS = (
    "vehicle",
    "type",
    "verdict",
    "healthy",
    "severity",
    "e_value",
    "is_discovery",
    "n_windows",
    "since",
    "until",
    "reason",
)
#: Order of the rows.
_ORDER = (("is_discovery", "descending"), ("step", "descending"), ("vehicle", "ascending"))


class WantedRuns(BaseModel):
    """Which results are listed; the address of the page states it."""

    model_config = ConfigDict(frozen=True)

    text: str = Field("", max_length=64, description="part of the vehicle's name")
    verdict: list[VerdictName] = Field([], description="verdicts; empty: all")
    is_discovery: bool = Field(False, description="only vehicles that stand out from the fleet")


class RunVehicle(Answer):
    """The diagnosis of a vehicle by the last run."""

    vehicle: str
    type: str = Field(description="type of the vehicle: those with the same vehicle file apart from the name")
    verdict: VerdictName
    healthy: bool | None
    severity: str | None = Field(description="of the most severe finding: low, medium, high or critical")
    e_value: float | None = Field(description="ln of the e-value of a change")
    is_discovery: bool = Field(description="whether it stands out at the fleet's rate of false discoveries")
    windows: int = Field(description="windows that count")
    since: int | None = Field(description="start of the first window that was compared with the baseline")
    until: int | None = Field(description="start of the last one")
    reason: str = Field(description="why it is inconclusive; empty if it is not")
    is_known: bool = Field(description="whether this monitor knows the vehicle")


class RunPage(Answer):
    """Vehicles by the last run: discoveries first, then by severity."""

    total: int = Field(description="vehicles of the run")
    discoveries: int
    verdicts: dict[str, int] = Field(description="number of vehicles by verdict")
    vehicles: tuple[RunVehicle, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


class RunResults:
    """The last results of runs; from any thread.

    Parameters
    ----------
    location
        Folder or URL that the runs write to; None: no results.
    timer
        Present time [s] of a monotonic clock.

    Notes
    -----
    Rows are kept until a run has replaced them, without their documents.
    """

    def __init__(self, location: str | None, timer: Callable[[], float]) -> None:
        self._location, self._timer = location, timer
        self._lock = threading.Lock()
        self._looked = float("-inf")
        self._version = -1
        self._rows: Any = None

    def rows(self) -> "pa.Table":
        """Return the vehicles of the last run in order, with the `step` of their severity; none before the first run.

        Raises
        ------
        StoreError
            If the results cannot be read.
        """
        with self._lock:
            if self._rows is None or self._timer() - self._looked >= _FRESH:
                try:
                    self._read()
                except DataError as error:
                    raise StoreError(str(error)) from None
                self._looked = self._timer()
            return self._rows

    def _read(self) -> None:
        """Read the table if it has changed."""
        import pyarrow as pa

        from sprung.fleet.lake import Table

        table = None if self._location is None else Table(f"{self._location.rstrip('/')}/{_TABLE}", _schema())
        version = -1 if table is None else table.version
        if self._rows is not None and version == self._version:
            return
        rows = _schema().empty_table() if table is None else table.rows(_COLUMNS)
        numbers = [0 if word is None else STEPS.index(word) + 1 for word in rows["severity"].to_pylist()]
        discoveries = rows["is_discovery"].fill_null(False)
        rows = rows.set_column(_COLUMNS.index("is_discovery"), "is_discovery", discoveries)
        self._rows = rows.append_column("step", pa.array(numbers, pa.int8())).sort_by(list(_ORDER))
        self._version = version


def run_page(
    rows: "pa.Table",
    wanted: WantedRuns,
    *,
    cursor: str | None,
    limit: int,
    known: Callable[[Collection[str]], Collection[str]],
) -> RunPage:
    """Return vehicles of a run, from a cursor on.

    Parameters
    ----------
    rows
        Rows of `RunResults`.
    wanted
        Filter for the vehicles.
    cursor
        Place after which the page begins; None: the first page.
    limit
        Largest number of vehicles.
    known
        Function that returns those of some vehicles that the monitor knows.

    Raises
    ------
    ParameterError
        If the cursor is not one of this list.
    """
    import pyarrow.compute as pc

    verdicts = {entry["values"]: entry["counts"] for entry in pc.value_counts(rows["verdict"]).to_pylist()}
    chosen = rows.filter(_rule(wanted, cursor))
    shown = chosen.slice(0, limit).to_pylist()
    names = known([row["vehicle"] for row in shown])
    vehicles = tuple(
        RunVehicle(
            **{name: row[name] for name in _COLUMNS if name not in {"n_windows", "reason", "type"}},
            type=row["type"] or "",
            windows=row["n_windows"] or 0,
            reason=row["reason"] or "",
            is_known=row["vehicle"] in names,
        )
        for row in shown
    )
    return RunPage(
        total=rows.num_rows,
        discoveries=pc.sum(rows["is_discovery"]).as_py() or 0,
        verdicts=verdicts,
        vehicles=vehicles,
        next=_cursor(shown[-1]) if chosen.num_rows > limit else None,
    )


def _rule(wanted: WantedRuns, cursor: str | None) -> Any:
    """Return what rows must fulfil, as an expression of `pyarrow.compute`."""
    import pyarrow.compute as pc

    vehicle, step, is_discovery = pc.field("vehicle"), pc.field("step"), pc.field("is_discovery")
    rule = pc.match_substring(vehicle, wanted.text, ignore_case=True)
    if wanted.verdict:
        rule &= pc.field("verdict").isin(list(wanted.verdict))
    if wanted.is_discovery:
        rule &= is_discovery
    if cursor is not None:
        discovery, own_step, own_vehicle = _place(cursor)
        after = (step < own_step) | ((step == own_step) & (vehicle > own_vehicle))
        rule &= ((is_discovery == discovery) & after) | (~is_discovery if discovery else pc.scalar(False))
    return rule


def _cursor(row: dict[str, Any]) -> str:
    """Return the text of the place of a row."""
    return f"{int(row['is_discovery'])}~{row['step']}~{row['vehicle']}"


def _place(cursor: str) -> tuple[bool, int, str]:
    """Return the place of a text.

    Raises
    ------
    ParameterError
        If it is no cursor.
    """
    discovery, _, rest = cursor.partition("~")
    step, _, vehicle = rest.partition("~")
    if discovery not in {"0", "1"} or not (step.isascii() and step.isdigit()):
        raise ParameterError(f"cursor {cursor!r} is not one of this list: omit it for the first page")
    return discovery == "1", int(step[:2]), vehicle


def _schema() -> "pa.Schema":
    """Return the columns that are shown, with their types."""
    import pyarrow as pa

    kinds = {"healthy": pa.bool_(), "is_discovery": pa.bool_(), "e_value": pa.float64()}
    counts = {"n_windows", "since", "until"}
    return pa.schema([(name, kinds.get(name, pa.int64() if name in counts else pa.string())) for name in _COLUMNS])
