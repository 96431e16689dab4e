"""Tables of results, which any SQL engine reads."""

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from sprung.fleet.lake import Table, absolute_location

_TEXT, _NUMBER, _COUNT, _FLAG, _TIME = pa.string(), pa.float64(), pa.int64(), pa.bool_(), pa.int64()


def _struct(**fields: pa.DataType) -> pa.DataType:
    """Return a structure of fields."""
    return pa.struct([pa.field(name, kind) for name, kind in fields.items()])


def _schema(**columns: pa.DataType) -> pa.Schema:
    return pa.schema([pa.field(name, kind) for name, kind in columns.items()])


#: What identifies the analysis of a window: `digest` of its samples, and that of the vehicle file (empty without one).
KEY = ("vehicle", "start", "digest", "vehicle_file")
_OF_WINDOW = {
    "date": pa.date32(),  # of the first sample, UTC; the partition
    "vehicle": _TEXT,
    "start": _TIME,  # time of the first sample, UTC ns since 1970
    "digest": _TEXT,
    "vehicle_file": _TEXT,
    "duration": _NUMBER,  # [s]
    "reason": _TEXT,  # why there is no result; empty where there is one
}
#: Statistics of the residual test, with the segments of windows that a baseline may be learnt from.
_RESIDUALS = _struct(
    channels=pa.list_(_TEXT),
    sampling_rate=_NUMBER,
    segment=_NUMBER,
    n_segments=_COUNT,
    mean=pa.binary(),
    segments=pa.binary(),
)
#: Schemas of the tables. Those of windows have one row for each window and vehicle file, and grow; the others have one
#: row for each vehicle, type or finding, and are replaced as a whole.
SCHEMAS: Mapping[str, pa.Schema] = {
    "identifications": _schema(
        **_OF_WINDOW,
        modes=pa.list_(
            _struct(
                label=_TEXT,
                natural_frequency=_NUMBER,  # [Hz]
                natural_frequency_std=_NUMBER,
                damping_ratio=_NUMBER,
                damping_ratio_std=_NUMBER,
            )
        ),
        document=_TEXT,  # sprung.identification/1
    ),
    "corners": _schema(
        **_OF_WINDOW,
        components=pa.list_(
            _struct(
                corner=_TEXT,
                component=_TEXT,
                value=_NUMBER,  # [N/m] or [N s/m]
                std=_NUMBER,
                relative_to_nominal=_NUMBER,
                is_identifiable=_FLAG,
            )
        ),
        model_error=_NUMBER,
        document=_TEXT,  # sprung.corners/1
    ),
    "windows": _schema(
        **_OF_WINDOW,
        is_valid=_FLAG,  # conclusive, and no sensor fails
        conditions=pa.map_(_TEXT, _NUMBER),
        sensor_faults=pa.list_(_struct(channel=_TEXT, kind=_TEXT)),
        document=_TEXT,  # as one of the windows of sprung.diagnosis/1
        residuals=_RESIDUALS,
    ),
    "baselines": _schema(
        vehicle=_TEXT,
        type=_TEXT,
        vehicle_file=_TEXT,
        n_windows=_COUNT,
        until=_TIME,  # start of the last window learnt from, UTC ns
        document=_TEXT,  # sprung.baseline/1
        state=_TEXT,  # digest of the windows learnt from
    ),
    "types": _schema(
        type=_TEXT,  # digest of the vehicle file without its name
        name=_TEXT,
        n_vehicles=_COUNT,
        n_windows=_COUNT,
        document=_TEXT,  # sprung.type_baseline/1
        state=_TEXT,  # digest of the baselines of its vehicles
    ),
    "diagnoses": _schema(
        vehicle=_TEXT,
        type=_TEXT,
        vehicle_file=_TEXT,
        n_windows=_COUNT,  # with results
        n_valid=_COUNT,  # conclusive, and no sensor fails
        n_left_out=_COUNT,  # windows that overlap earlier ones
        since=_TIME,  # start of the first and last window that was compared, UTC ns
        until=_TIME,
        verdict=_TEXT,  # change, no_change_detected or inconclusive
        severity=_TEXT,  # of the most severe finding
        e_value=_NUMBER,  # ln of the e-value of a change, over a year
        is_discovery=_FLAG,  # at the rate of false discoveries in the fleet
        reason=_TEXT,  # why it is inconclusive, or has no baseline
        document=_TEXT,  # sprung.diagnosis/1
        state=_TEXT,  # digest of the vehicle's windows and the settings
        type_state=_TEXT,  # of the type that the vehicle is compared with, or of the scatter that its baselines show
    ),
    "findings": _schema(
        vehicle=_TEXT,
        corner=_TEXT,
        component=_TEXT,
        change=_NUMBER,  # relative: -0.2 for a loss of 20 %
        lower=_NUMBER,  # 95 % interval
        upper=_NUMBER,
        since=_NUMBER,  # UTC s since 1970
        score=_NUMBER,
        severity=_TEXT,
        is_discovery=_FLAG,
    ),
    "passes": _schema(
        vehicle=_TEXT,
        start=_TIME,  # of the drive, UTC ns
        n_windows=_COUNT,
        reason=_TEXT,  # why the road under it has no survey; empty where there is one
    ),
    "roads": _schema(
        begin=_NUMBER,  # address on the ways [m]
        end=_NUMBER,
        n_passes=_COUNT,
        **{
            f"{side}_{name}": kind
            for side in ("left", "right")
            for name, kind in {
                "iri": _NUMBER,  # International Roughness Index [m/km], standard deviation of the mean, of passes
                "iri_std": _NUMBER,
                "iri_scatter": _NUMBER,
                "road_class": _TEXT,  # ISO 8608
                "roughness": _NUMBER,  # G(n0) [m^3]
                "waviness": _NUMBER,
            }.items()
        },
        begin_latitude=_NUMBER,  # [degrees]
        begin_longitude=_NUMBER,
        end_latitude=_NUMBER,
        end_longitude=_NUMBER,
    ),
    "road_events": _schema(
        at=_NUMBER,  # address on the ways [m]
        side=_TEXT,
        kind=_TEXT,  # pothole, bump or joint; of a track dip or hump
        depth=_NUMBER,  # [m]
        length=_NUMBER,
        n_passes=_COUNT,
        latitude=_NUMBER,
        longitude=_NUMBER,
    ),
    "runs": _schema(
        run=_TEXT,
        finished=_TIME,  # UTC ns
        n_windows=_COUNT,
        n_vehicles=_COUNT,
        seconds=_NUMBER,  # from begin to end
        identifications_seconds=_NUMBER,  # processor time of all windows together, by table
        corners_seconds=_NUMBER,
        windows_seconds=_NUMBER,
    ),
}
#: Rows in a group of a compacted file: a group is written from memory, and a row may have 200 kB.
_ROWS_IN_GROUP = 256
#: Tables with one row for each window, by the step that makes them; they are partitioned by date.
OF_STEP = {"identify": "identifications", "corners": "corners", "observe": "windows"}


class Results:
    """Tables of the results of a fleet.

    Parameters
    ----------
    location
        Folder, or URL of an object store.
    """

    def __init__(self, location: str | Path) -> None:
        self.location = absolute_location(location)
        self._tables = {
            name: Table(f"{self.location}/{name}", schema, partition_by=["date"] if name in OF_STEP.values() else [])
            for name, schema in SCHEMAS.items()
        }

    def __getitem__(self, name: str) -> Table:
        """Return a table by its name, a key of `SCHEMAS`."""
        return self._tables[name]

    def compact(self) -> None:
        """Rewrite small files of the tables of windows, and of runs, as large ones."""
        for name in (*OF_STEP.values(), "runs"):
            self._tables[name].compact(largest_group=_ROWS_IN_GROUP)

    def vacuum(self, *, hours: float = 24.0) -> int:
        """Delete files of interrupted runs and of replaced results, and return their number."""
        return sum(table.vacuum(hours=hours) for table in self._tables.values())
