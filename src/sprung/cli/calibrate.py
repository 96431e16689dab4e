"""The command `sprung calibrate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.checks import check_file, check_outputs, may_lack_sensors
from sprung.cli.options import INPUT, AllowMissing, Figures, FileFormat, Files, Json, Minutes, VehicleFile, option
from sprung.cli.output import show, write_result, written
from sprung.cli.pages import write_figures
from sprung.cli.progress import progress_bar
from sprung.cli.reading import reads_files

if TYPE_CHECKING:
    from sprung.formats import ReadSettings


@reads_files
def calibrate(
    files: Files,
    *,
    vehicle: VehicleFile,
    out: Annotated[Path, option("V2.toml", "Completed vehicle file to write.")],
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    window: Minutes = 10.0,
    mounts: Annotated[int, option("N", "Largest number of masses on mounts to add.", min=0, panel=INPUT)] = 3,
    modes: Annotated[
        bool, option(None, "Add torsion and bending where the drives show them.", "--modes/--no-modes", panel=INPUT)
    ] = True,
    figures: Figures = None,
    file_format: FileFormat = "png",
    json: Json = None,
) -> None:
    """Complete a vehicle file from healthy drives: sensors, wheels, masses on mounts, modes of the body."""
    from sprung.calibration import CalibrationSettings
    from sprung.calibration import calibrate as calibrated
    from sprung.diagnosis import windows
    from sprung.formats import read_records
    from sprung.results import tables
    from sprung.results.documents import calibration_document
    from sprung.vehicles import read_vehicle, write_vehicle

    check_file("--out", out, inputs=files)
    check_outputs(json=json, page=None, figures=figures, inputs=[*files, vehicle])
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    settings = CalibrationSettings(most_mounts=mounts, has_modes=modes)
    with progress_bar() as report:
        recordings = read_records(files, settings=reading, on_progress=report)
        parts = [part for _, part in windows(recordings, length=60 * window)]
        report(f"calibrating on {len(parts)} windows", 0.5)
        result = calibrated(parts, description, settings=settings, allow_missing=may_lack)
        source = ", ".join(path.name for path in files)
        paths = write_figures(
            figures,
            lambda drawn: {
                "misfit": drawn.misfit_figure(result, source=source),
                "learnt": drawn.learnt_figure(result, source=source),
            },
            file_format,
        )
    write_vehicle(result.vehicle, out)
    if write_result(calibration_document(result), json):
        sentences = tables.calibration_in_words(result)
        show(tables.calibration_table(result), [*sentences, *written([out, *paths], json)])
