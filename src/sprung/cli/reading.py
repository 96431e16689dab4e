"""Options of every command that reads recordings."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sprung.cli.checks import names
from sprung.cli.options import Group, declared

if TYPE_CHECKING:
    from sprung.formats import ReadSettings
    from sprung.recording import Recording
    from sprung.vehicles.usable import AnyVehicle


_PANEL = "Reading"


@dataclass(frozen=True, slots=True)
class Reading(Group):
    """What to read of recordings, and how."""

    channels: str | None = declared(
        "A,B,..", "Channels to read, including the speed channel if it is needed. Default: all.", panel=_PANEL
    )
    group: str | None = declared(
        "A,B,..",
        "Groups of channels to read from a file with several; the first sets the times. sprung info lists them.",
        panel=_PANEL,
    )
    begin: float | None = declared("SECONDS", "Start of the part to read.", "--from", panel=_PANEL)
    end: float | None = declared("SECONDS", "End of the part to read.", "--to", panel=_PANEL)
    sampling_rate: float | None = declared(
        "HZ", "Sampling rate of files without a time column, or with an inconsistent one.", panel=_PANEL
    )
    time: str | None = declared("NAME", "Time column. Default: found by name and steps.", panel=_PANEL)
    time_unit: str | None = declared("UNIT", "Unit of the time column: s, ms, us or ns.", panel=_PANEL)
    bridge: float | None = declared("SECONDS", "Longest gap to interpolate across. Default: 0.", panel=_PANEL)
    dbc: list[Path] | None = declared("F.dbc", "Database that decodes raw CAN frames; may be repeated.", panel=_PANEL)
    name_table: Path | None = declared(
        "F.toml", "Names of channels and what they measure, in addition to those known.", "--names", panel=_PANEL
    )

    @property
    def settings(self) -> "ReadSettings":
        """Settings of the readers."""
        from sprung.formats import ReadSettings

        return ReadSettings(
            channels=names(self.channels),
            groups=names(self.group) or (),
            start=self.begin,
            end=self.end,
            sampling_rate=self.sampling_rate,
            time=self.time,
            time_unit=self.time_unit,
            bridge=self.bridge or 0.0,
            databases=tuple(self.dbc or ()),
            names=self.name_table,
        )

    def records(self, files: Iterable[Path], report: Callable[[str, float], None]) -> "Iterable[Recording]":
        """Return the recordings of files, read one after the other."""
        from sprung.formats import read_records

        return read_records(list(files), settings=self.settings, on_progress=report)

    def may_lack(self, vehicle: "AnyVehicle | None", *, allow_missing: bool) -> bool:
        """Return whether recordings may lack sensors of a vehicle: as allowed, or left out with --channels.

        Raises
        ------
        ParameterError
            If one of the chosen channels looks like a sensor that is not among them, without permission.
        """
        from sprung.vehicles.sensor_layout import check_present

        chosen = names(self.channels)
        if chosen is not None and vehicle is not None:
            check_present(chosen, vehicle.sensor, allow_missing=allow_missing, is_choice=True)
        return allow_missing or chosen is not None
