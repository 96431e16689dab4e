"""Short texts, tables in notebooks, data frames, files and pictures of recordings, modes and results."""

import re
from html.parser import HTMLParser
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import sprung
from sprung._display import in_short
from sprung.calibration import CalibratedNumber
from sprung.results import tables
from sprung.results.documents import identification_document
from sprung.results.renderings import RENDERINGS, as_html, data_frame

pandas: Any = pytest.importorskip("pandas")
COMPONENTS = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())


def window(generator, time, *, change=0.0):
    values = 0.02 * generator.standard_normal(len(COMPONENTS))
    values[0] += change
    conditions = {"speed": 20.0, "roughness": 1e-6, "model_error": 0.02}
    return sprung.Observation(
        time, COMPONENTS, values, 0.02**2 * np.eye(len(values)), conditions, {"roll": (2.0, 0.2)}, (), vehicle="car"
    )


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    """Return a value of every type that people see."""
    car = sprung.read_vehicle("zafira")
    drive = sprung.simulate_drive(car, sprung.RoadDrive(duration=120.0), seed=1)
    chain = sprung.structure(sprung.read_description("chain3"))
    run = sprung.simulate(chain, sprung.usual_excitation(chain), duration=60.0, sampling_rate=200.0, seed=1)
    identification = sprung.cov_ssi(run)
    generator = np.random.default_rng(1)
    windows = [window(generator, 600.0 * k, change=-0.4 if k >= 8 else 0.0) for k in range(14)]
    baseline = sprung.learn(windows[:8])
    diagnosis = sprung.diagnose(windows, baseline)
    number = CalibratedNumber("body.mass", "body", "kg", 1400.0, 1450.0, 12.0, 60.0, True)
    errors = ((0.2, 0.1), (0.03, 0.02))
    grid = np.linspace(0.5, 20.0, 9)
    misfits = (np.full((1, 9), 0.2), np.full((1, 9), 0.02))
    return {
        "recording": run,
        "modes": identification.modes,
        "identification": identification,
        "diagram": identification.subsets[0].diagrams[0],
        "fit": sprung.fit_corners(drive.recording, car),
        "baseline": baseline,
        "diagnosis": diagnosis,
        "finding": diagnosis.findings[0],
        "findings": diagnosis.findings,
        "observation": windows[0],
        "observations": diagnosis.observations,
        "inspection": sprung.inspect(drive.recording),
        "tracked": sprung.track_modes([identification.modes] * 4),
        "spectra": identification.spectra,
        "track": sprung.track_modes([identification.modes] * 4).tracks[0],
        "drive": drive,
        "calibration": sprung.Calibration(
            car, (number,), ("bounce",), grid, *misfits, *errors, 40.0, (50, 60), ("note",)
        ),
    }


KINDS = (
    *("recording", "modes", "identification", "diagram", "fit", "baseline", "diagnosis", "finding", "findings"),
    *("observation", "observations", "inspection", "tracked", "calibration"),
)


@pytest.mark.parametrize("kind", [*KINDS, "spectra", "track", "drive"])
def test_repr_has_three_lines_at_most_and_no_arrays(values, kind) -> None:
    lines = repr(values[kind]).splitlines()
    assert 1 <= len(lines) <= 3
    assert all(0 < len(line) <= 120 for line in lines)
    assert "array(" not in repr(values[kind])
    assert lines[0].startswith(type(values[kind]).__name__.removesuffix("s"))


def test_repr_says_what_matters(values) -> None:
    assert repr(values["recording"]).splitlines()[:2] == [
        "Recording: 12000 samples at 200 Hz (60 s)",
        "acc_1 [m/s^2], acc_2 [m/s^2], acc_3 [m/s^2]",
    ]
    assert re.match(r"Modes: 3 modes of acc_1, acc_2, acc_3\n\d\.\d+ Hz [\d.]+ %, 19", repr(values["modes"]))
    assert repr(values["diagnosis"]).splitlines()[:2] == [
        "Diagnosis of 14 windows: change",
        values["finding"].sentence,
    ]
    assert repr(values["baseline"]).startswith("Baseline 1 of 'car' (first learning): 12 components from 8 windows")
    assert repr(values["observations"]) == "Observations of car: 14 windows, 14 conclusive"
    assert repr(values["tracked"]).startswith("TrackedModes: 3 tracks over 4 windows, 4 of them with modes")


def test_an_inconclusive_window_and_a_recording_with_gaps_say_so() -> None:
    nothing = sprung.Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), "sensors are exchanged")
    assert repr(nothing) == "Observation at 0 s: inconclusive: sensors are exchanged"
    gap = sprung.Gap(5, 2.0)
    run = sprung.Recording(np.zeros((1, 10)), 10.0, (sprung.Channel("a\nb"),), start=10**18, gaps=(gap,))
    assert repr(run) == ("Recording: 10 samples at 10 Hz (1 s), 1 gap, from 2001-09-09 01:46:40 UTC\na b [?]")


def test_long_lines_are_shortened_and_empty_ones_left_out() -> None:
    assert in_short("", "a", "", "b", "c", "d") == "a\nb\nc"
    assert len(in_short("word " * 100)) <= 120


class Cells(HTMLParser):
    """Text of the cells of all tables."""

    def __init__(self) -> None:
        super().__init__()
        self.cells: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)
        if tag in {"td", "th"}:
            self.cells.append("")
        if tag == "br":
            self.cells[-1] += "\n"

    def handle_data(self, data: str) -> None:
        if self.cells:
            self.cells[-1] += data


def cells_of(html: str) -> Cells:
    parser = Cells()
    parser.feed(html)
    return parser


@pytest.mark.parametrize("kind", KINDS)
def test_notebooks_show_a_table(values, kind) -> None:
    parser = cells_of(values[kind]._repr_html_())
    assert {"table", "th", "td"} <= set(parser.tags)


def test_notebooks_show_the_tables_of_the_command_line(values) -> None:
    expected = tables.identification_tables(values["identification"])
    cells = cells_of(values["identification"]._repr_html_()).cells
    for table in expected:
        for row in table.rows:
            assert all(row[k] in "\n".join(cells) for k in table.shown)
    assert f"<li>{values['identification'].notes[0]}</li>" in values["identification"]._repr_html_()


def test_names_from_files_are_no_markup() -> None:
    run = sprung.Recording(np.ones((1, 10)), 10.0, (sprung.Channel("<script>alert(1)</script>"),))
    assert "<script>" not in run._repr_html_()
    assert "&lt;script&gt;" in run._repr_html_()


@pytest.mark.parametrize("kind", KINDS)
def test_every_value_has_its_renderings_in_the_table(values, kind) -> None:
    renderings = RENDERINGS[type(values[kind]).__name__]
    assert renderings.columns
    assert renderings.parts
    assert bool(renderings.document) == hasattr(values[kind], "save")
    assert bool(renderings.picture) == hasattr(values[kind], "plot")


FUNCTIONS = {
    name
    for each in RENDERINGS.values()
    for name in (each.document, each.columns, *each.parts, each.picture)
    if ":" in name
}


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_every_rendering_exists(name) -> None:
    assert callable(resolve_name(f"sprung.results.{name}"))


def test_what_has_no_table_and_no_rows_is_refused() -> None:
    with pytest.raises(sprung.ParameterError, match=r"^a float has no tables"):
        as_html(1.0)
    with pytest.raises(sprung.ParameterError, match=r"^a float has no rows"):
        data_frame(1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_data_frames_have_units_in_the_names_of_their_columns(values, kind) -> None:
    frame = values[kind].to_dataframe()
    assert len(frame) > 0
    numbers = [name for name in frame.columns if frame[name].dtype.kind in "fc"]
    in_own_unit = {"inspection", "calibration"}  # a column states the unit of the row
    assert kind in in_own_unit or all(re.search(r" \[.+\]$", name) for name in numbers)
    assert kind not in in_own_unit or "unit" in frame.columns


def test_numbers_in_data_frames_are_those_of_the_values(values) -> None:
    modes = values["modes"]
    frame = modes.to_dataframe()
    np.testing.assert_array_equal(frame["natural_frequency [Hz]"], modes.natural_frequency)
    np.testing.assert_array_equal(frame["mode_shape acc_2 [-]"], modes.mode_shapes[:, 1])
    fit = values["fit"].to_dataframe().set_index(["corner", "component"])
    assert fit.loc[("front_left", "spring"), "value [N/m, N s/m]"] == pytest.approx(values["fit"].values[0])
    windows = values["observations"].to_dataframe()
    assert windows["speed [m/s]"].tolist() == [20.0] * 14
    first = str(COMPONENTS[0])
    assert windows[f"{first} change_from_nominal [-]"].tolist() == pytest.approx(
        [np.expm1(one.log_ratios[0]) for one in values["observations"]]
    )
    findings = values["diagnosis"].to_dataframe()
    assert findings.loc[0, "change [-]"] == values["finding"].change
    assert findings.loc[0, "since [s]"] == values["finding"].since


def test_the_index_of_a_recording_is_its_time_with_gaps() -> None:
    gaps = (sprung.Gap(2, 1.5),)
    channels = (sprung.Channel("acc", "acceleration"), sprung.Channel("x"))
    run = sprung.Recording(np.arange(8.0).reshape(2, 4), 10.0, channels, gaps=gaps)
    frame = run.to_dataframe()
    assert list(frame.columns) == ["acc [m/s^2]", "x"]
    assert frame.index.name == "time [s]"
    assert frame.index.tolist() == pytest.approx([0.0, 0.1, 1.7, 1.8])
    dated = sprung.Recording(run.samples, 10.0, channels, start=10**18, gaps=gaps).to_dataframe()
    assert str(dated.index.tz) == "UTC"
    assert dated.index[2] == pandas.Timestamp("2001-09-09 01:46:41.7", tz="UTC")


def test_a_data_frame_needs_pandas(values, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(sprung.MissingPackageError, match=r"pip install 'sprung\[notebook\]'"):
        values["modes"].to_dataframe()


SAVED = ("identification", "fit", "baseline", "diagnosis", "inspection", "tracked", "calibration")
READERS = {
    "identification": sprung.read_identification,
    "fit": sprung.read_corners,
    "baseline": sprung.read_baseline,
    "diagnosis": sprung.read_diagnosis,
    "inspection": sprung.read_inspections,
    "tracked": sprung.read_tracking,
    "calibration": sprung.read_calibration,
}


@pytest.mark.parametrize("kind", SAVED)
def test_results_are_saved_as_their_published_document(values, kind, tmp_path, check_document) -> None:
    path = tmp_path / "result.json"
    values[kind].save(path)
    document = sprung.read_document(path)
    check_document(document.as_json())
    assert len(repr(document).splitlines()) <= 3
    document.save(tmp_path / "again.json")
    assert sprung.read_document(tmp_path / "again.json").as_json() == document.as_json()
    assert READERS[kind](path) is not None


def test_a_saved_result_can_be_used(values, tmp_path) -> None:
    path = tmp_path / "result.json"
    values["identification"].save(path)
    read = sprung.read_identification(path)
    frame = read.to_dataframe()
    expected = values["modes"].to_dataframe()
    np.testing.assert_allclose(frame["natural_frequency [Hz]"], expected["natural_frequency [Hz]"])
    np.testing.assert_allclose(frame["mode_shape acc_1 [-]"], expected["mode_shape acc_1 [-]"])
    assert read.as_channels() == values["identification"].channels
    assert isinstance(read.plot(), Figure)
    assert "<table>" in read._repr_html_()

    values["diagnosis"].save(path)
    diagnosis = sprung.read_diagnosis(path)
    assert diagnosis.to_dataframe().equals(values["diagnosis"].to_dataframe())
    assert sprung.diagnose(diagnosis.observations, values["baseline"]).verdict == "change"

    for kind, reader in (("fit", sprung.read_corners), ("tracked", sprung.read_tracking)):
        values[kind].save(path)
        pandas.testing.assert_frame_equal(
            reader(path).to_dataframe(), values[kind].to_dataframe(), check_dtype=False, check_names=False
        )


def test_a_document_of_an_earlier_version_has_no_places(values, tmp_path) -> None:
    path = tmp_path / "result.json"
    fields = identification_document(values["identification"]).as_json()
    del fields["sensors"]
    sprung.write_document(fields, path)
    read = sprung.read_identification(path)
    assert read.as_channels() == tuple(sprung.Channel(name) for name in ("acc_1", "acc_2", "acc_3"))
    assert isinstance(read.plot(), Figure)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["recording", "modes", "identification", "fit", "diagnosis", "tracked", "calibration"])
def test_the_obvious_picture_is_drawn_and_shown_in_notebooks(values, kind) -> None:
    figure: Any = values[kind].plot()
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_what_has_no_picture_is_refused() -> None:
    with pytest.raises(sprung.ParameterError, match=r"^a float has no picture of its own"):
        sprung.results.figures.picture_of(1.0)


def test_a_vehicle_shows_kind_sensors_and_coordinates() -> None:
    lines = repr(sprung.read_vehicle("zafira")).splitlines()
    assert lines[0] == "Vehicle 'zafira' of kind road"
    assert lines[1] == "sensors: acc_fl, acc_fr, acc_rl, acc_rr"
    assert lines[2].startswith("coordinates: bounce, pitch, roll, ")
