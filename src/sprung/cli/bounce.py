"""The command `sprung bounce`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.checks import check_outputs, may_lack_sensors
from sprung.cli.options import INPUT, AllowMissing, Figures, FileFormat, Files, Json, Page, complete_vehicles, option
from sprung.cli.output import progress_bar, show, write_figures, write_page, write_result, written
from sprung.cli.reading import reads_files

if TYPE_CHECKING:
    from sprung.formats import ReadSettings


@reads_files
def bounce(
    files: Files,
    *,
    vehicle: Annotated[
        str | None,
        option(
            "V.toml|NAME",
            "Vehicle file or name of a shipped vehicle: names of modes, springs and dampers.",
            autocompletion=complete_vehicles,
            panel=INPUT,
        ),
    ] = None,
    before: Annotated[
        list[Path] | None,
        option(
            "FILE", "Earlier test of the same vehicle, with which this one is compared; may be repeated.", panel=INPUT
        ),
    ] = None,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    figures: Figures = None,
    file_format: FileFormat = "png",
    page: Page = None,
    json: Json = None,
) -> None:
    """Find pushes, drops and releases, and state frequency, damping and friction of the free motion after them."""
    from sprung.bounce_tests import bounce as bounced
    from sprung.formats import read_records
    from sprung.results import tables
    from sprung.results.documents import bounce_document
    from sprung.results.page import bounce_report
    from sprung.vehicles import read_description

    check_outputs(json=json, page=page, figures=figures, inputs=[*files, *(before or ()), vehicle])
    with progress_bar() as report:
        description = None if vehicle is None else read_description(vehicle)
        sensors = () if description is None else description.sensor
        may_lack = may_lack_sensors(sensors, allow_missing=allow_missing, channels=reading.channels)
        recordings = read_records(files, settings=reading, on_progress=report)
        earlier = read_records(before, settings=reading) if before else None
        report("fitting the free motions", 0.5)
        result = bounced(recordings, vehicle=description, before=earlier, allow_missing=may_lack)
        source = ", ".join(path.name for path in files)
        paths = write_figures(
            figures, lambda drawn: {"bounce": drawn.bounce.bounce_figure(result, source=source)}, file_format
        )
        document = bounce_document(result)
        paths += write_page(
            page,
            lambda inputs: bounce_report(result, inputs, document=document),
            files,
            reading=reading,
            others={"vehicle": vehicle},
        )
    if write_result(document, json):
        heading = f"{source}: {tables.bounce_in_words(result)}"
        show(*tables.bounce_tables(result), [*result.notes, *written(paths, json)], heading=heading)
