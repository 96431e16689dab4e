"""Time histories in universal files: every layout of dataset 58, against pyuff and the same numbers as CSV."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.formats import groups, read, write
from sprung.formats.settings import ReadSettings
from sprung.recording import Channel, Gap, Recording

MARK = "    -1\n"
VALUES = np.array([1.5, -2.25, 3e-12, -4.0, 5.125e10, 6.0, -7.0])


def dataset(
    values=VALUES,
    *,
    binary="",
    data_type=4,
    kind=1,
    spacing=1,
    first=0.0,
    step=0.01,
    ids=("acc", "NONE", "NONE", "NONE", "NONE"),
    entity="NONE",
    node=1,
    direction=3,
    abscissa=17,
    ordinate=(12, "m/s^2"),
    n_values=None,
    body=None,
):
    """Return a dataset 58 as bytes; `body` replaces the values."""
    n_values = len(values) if n_values is None else n_values
    lines = [
        f"{58:6d}{binary}",
        *(f"{line:<80}" for line in ids),
        f"{kind:5d}{0:10d}{0:5d}{0:10d} {entity:<10}{node:10d}{direction:4d} {'NONE':<10}{0:10d}{0:4d}",
        f"{data_type:10d}{n_values:10d}{spacing:10d}{first:13.5e}{step:13.5e}{0:13.5e}",
        f"{abscissa:10d}{0:5d}{0:5d}{0:5d} {'Time':<20} {'s':<20}",
        f"{ordinate[0]:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {ordinate[1]:<20}",
        *[f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}"] * 2,
    ]
    if body is None:
        body = "".join(f"{value:20.11e}" + "\n" * (k % 4 == 3) for k, value in enumerate(values)).encode() + b"\n"
    return (MARK + "\n".join(lines) + "\n").encode() + body + MARK.encode()


def binary_header(order=1, representation=2):
    return f"b{order:6d}{representation:6d}{11:12d}{0:12d}{0:6d}{0:6d}{0:12d}{0:12d}"


def units(length=1000.0, force=1000.0):
    return (
        f"{MARK}{164:6d}\n{5:10d}{'mm':<20}{2:10d}\n"
        + "".join(f"{value:25.17E}".replace("E", "D") for value in (length, force, 1.0))
        + f"\n{273.15:25.17E}\n{MARK}"
    ).encode()


@pytest.fixture
def file(tmp_path):
    def make(*parts, name="run.uff"):
        (tmp_path / name).write_bytes(b"".join(parts))
        return tmp_path / name

    return make


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_text_of_fixed_columns(file, end) -> None:
    joined = ["".join(f"{value:13.5e}".replace("e", "D") for value in VALUES[k : k + 6]) for k in (0, 6)]
    negative = ["".join(f"{value:13.6e}" for value in -abs(VALUES[k : k + 6])) for k in (0, 6)]
    assert " " not in negative[0]
    path = file(
        dataset(data_type=2, body="\n".join([*joined, ""]).encode()).replace(b"\n", end),
        dataset(data_type=2, ids=("b", *["NONE"] * 4), body="\n".join([*negative, ""]).encode()).replace(b"\n", end),
    )
    run = read(path)
    assert run.samples == pytest.approx(np.stack([VALUES, -abs(VALUES)]), rel=1e-15)
    assert run.sampling_rate == 100


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("gap", [b"", b"\n", b"\r\n"])
def test_binary_in_both_byte_orders(file, order, width, gap) -> None:
    number, data_type = 1 + (order == ">"), {4: 2, 8: 4}[width]
    body = VALUES.astype(f"{order}f{width}").tobytes() + gap
    path = file(
        dataset(binary=binary_header(number), data_type=data_type, body=body), dataset(ids=("b", *["NONE"] * 4))
    )
    run = read(path)
    assert run.samples[0] == pytest.approx(VALUES.astype(f"f{width}"), rel=0)
    assert run.samples[1] == pytest.approx(VALUES, rel=1e-11)


@pytest.mark.parametrize("abscissa", ["<f4", "<f8", "text"])
def test_every_value_with_its_own_time(file, abscissa) -> None:
    times = np.array([0.0, 0.01, 0.02, 0.03, 5.0, 5.01, 5.02])
    if abscissa == "text":
        lines = [f"{t:13.5e}{v:20.11e}" for t, v in zip(times, VALUES, strict=True)]
        body = "\n".join("".join(lines[k : k + 2]) for k in range(0, 7, 2)).encode() + b"\n"
        path = file(dataset(spacing=0, step=0.0, body=body))
    else:
        pairs = np.array(list(zip(times, VALUES, strict=True)), dtype=[("t", abscissa), ("v", "<f8")])
        path = file(dataset(spacing=0, step=0.0, binary=binary_header(), body=pairs.tobytes()))
    run = read(path)
    assert run.samples[0] == pytest.approx(VALUES, rel=1e-11)
    assert run.sampling_rate == pytest.approx(100, rel=1e-6)
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(4, pytest.approx(4.96, abs=1e-6))]


def test_different_times_in_one_group_are_refused(file) -> None:
    pairs = [np.column_stack([np.arange(7) * 0.01 * k, VALUES]).tobytes() for k in (1, 2)]
    path = file(
        *(
            dataset(ids=(f"c{k}", *["NONE"] * 4), spacing=0, step=0.0, binary=binary_header(), body=body)
            for k, body in enumerate(pairs)
        )
    )
    with pytest.raises(FormatError, match="datasets 1 and 2 have different times"):
        read(path)
    assert read(path, channels=["c1"]).sampling_rate == 50


@pytest.mark.parametrize("name", ["Sample_UFF58_ascii", "Sample_UFF58b_bin", "MPSTD_Set001_2024_10_08_10_27_07"])
def test_same_values_as_pyuff(real_file, name) -> None:
    pyuff = pytest.importorskip("pyuff")
    path = real_file(f"formats/uff/{name}.uff")
    run = read(path)
    sets = pyuff.UFF(str(path)).read_sets()
    sets = sets if isinstance(sets, list) else [sets]
    assert np.array_equal(run.samples, np.stack([each["data"] for each in sets]))
    assert run.sampling_rate == pytest.approx(1 / sets[0]["abscissa_inc"], rel=2e-6)


def test_what_real_files_state(real_file) -> None:
    run = read(real_file("formats/uff/MPSTD_Set001_2024_10_08_10_27_07.uff"))
    assert run.names == tuple(f"MPS set1 Dof{k}" for k in (1, 2, 3, 4))
    assert [channel.comment for channel in run.channels] == [f"response {k}+Z" for k in (1, 2, 3, 1)]
    assert {channel.quantity for channel in run.channels} == {"acceleration"}
    assert (run.sampling_rate, run.n_samples) == (3200, 222_400)
    assert np.datetime64(run.start, "ns") == np.datetime64("2024-10-08T10:27:07")
    assert run.comment == "start in local time"
    sound = read(real_file("formats/uff/Sample_UFF58b_bin.uff"))
    assert (sound.names, sound.channels[0].quantity, sound.sampling_rate) == (("Mic 01",), "pressure", 65536)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sample_dataset58_psd", r"power spectral densities \(1\)"),
        ("non_ascii_header", r"frequency response functions \(1\)"),
        ("heat_engine_housing", r"headers \(2\), nodes and elements \(2\), results at nodes \(1\)"),
        ("mesh_Oros-modal_uff15_uff2412", r"nodes and elements \(3\)"),
    ],
)
def test_files_without_time_histories_say_what_they_hold(real_file, name, words) -> None:
    with pytest.raises(FormatError, match=f"{name}.uff holds {words}, but no time histories: export"):
        read(real_file(f"formats/uff/{name}.uff"))


def test_names_are_those_that_distinguish_the_channels(file) -> None:
    none = ("NONE",) * 5
    same = ("Time history", *none[1:])
    named = {"1:+Z": (1, 3), "1:-X": (1, -1), "7:+RY": (7, 5), "8": (8, 0)}
    places = [{"node": node, "direction": direction} for node, direction in named.values()]
    assert read(file(*(dataset(ids=same, **place) for place in places))).names == tuple(named)
    entities = read(file(*(dataset(ids=same, entity=f"point {k}", **places[k]) for k in range(2))))
    assert entities.names == ("point 0", "point 1")
    assert entities.channels[0].comment == "Time history"
    first_lines = [dataset(ids=(f"line {k}", *none[1:]), entity="body", **places[0]) for k in range(2)]
    assert read(file(*first_lines)).names == ("line 0", "line 1")
    assert read(file(*first_lines)).channels[1].comment == "response body"


def test_groups_by_abscissae_dates_and_repeated_names(file) -> None:
    dates = ("01-Jan-24 10:00:00", "01-Jan-24 10:00:01", "01-Jan-24 10:05:00")
    parts = [
        dataset(step=1.0, ids=(name, "NONE", date, "NONE", "NONE"))
        for name, date in zip(("a", "b", "c"), dates, strict=True)
    ]
    faster = dataset(step=0.5, ids=("d", "NONE", dates[0], "NONE", "NONE"))
    path = file(*parts, faster, parts[0])
    found = {group.name: group.headings for group in groups(path)}
    assert found == {
        f"1 Hz, 7 samples, {dates[0]}": ("a", "b"),
        f"1 Hz, 7 samples, {dates[2]}": ("c",),
        f"2 Hz, 7 samples, {dates[0]}": ("d",),
        f"1 Hz, 7 samples, {dates[0]} (2)": ("a",),
    }
    with pytest.raises(ParameterError, match="4 groups of channels with different clocks"):
        read(path)
    assert read(path, channels=["c"]).start == np.datetime64("2024-01-01T10:05", "ns").astype(int)
    assert read(path, settings=ReadSettings(groups=[f"1 Hz, 7 samples, {dates[0]}"])).names == ("a", "b")


@pytest.mark.parametrize(
    ("text", "date"),
    [
        ("08-Oct-24 10:27:07", "2024-10-08T10:27:07"),
        ("8-OCT-1971 1:27:07", "1971-10-08T01:27:07"),
        ("08-Oct-70 10:27:07.25", "1970-10-08T10:27:07.25"),
        ("08-Oct-69 10:27:07 UTC", "2069-10-08T10:27:07"),
        ("31-Feb-24 10:27:07", None),
        ("08-Okt-24 10:27:07", None),
        ("99-Oct-24 99:99:99", None),
    ],
)
def test_dates(file, text, date) -> None:
    run = read(file(dataset(first=2.5, ids=("a", "NONE", text, "NONE", "NONE"))))
    expected = None if date is None else np.datetime64(date, "ns").astype(int) + 2_500_000_000
    assert run.start == expected
    assert run.comment == ("" if date is None or "UTC" in text else "start in local time")


@pytest.mark.parametrize(
    ("ordinate", "direction", "quantity", "factor"),
    [
        ((12, "NONE"), 3, "acceleration", 1e-3),
        ((8, ""), 1, "displacement", 1e-3),
        ((9, "NONE"), 3, "force", 1e-3),
        ((15, "NONE"), 0, "pressure", 1e3),
        ((11, "NONE"), -5, "angular_velocity", 1.0),
        ((11, "m/s"), 3, "velocity", 1.0),
        ((0, "m/s"), 3, "speed", 1.0),
        ((12, "g"), 3, "acceleration", 9.80665),
        ((12, "Volts"), 3, "unknown", 1.0),
        ((0, "NONE"), 3, "unknown", 1.0),
    ],
)
def test_units_by_label_then_by_the_units_of_the_file(file, ordinate, direction, quantity, factor) -> None:
    run = read(file(units(), dataset(ordinate=ordinate, direction=direction)))
    assert run.channels[0].quantity == quantity
    assert run.samples[0] == pytest.approx(factor * VALUES, rel=1e-11)
    if ordinate[1] == "Volts":
        assert "acc: unit 'Volts' is unknown, values as in the file" in run.history


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (dataset(n_values=8), "dataset 1 declares 8 values, but holds 7"),
        (dataset(n_values=999_999_999), "dataset 1 declares 999999999 values, but holds 141 bytes"),
        (dataset(n_values=-3), "declares -3 values in steps of 0.01: both must be above 0"),
        (dataset(step=0.0), "declares 7 values in steps of 0: both must be above 0"),
        (dataset()[:-20], "dataset 1 has no end: the file is incomplete"),
        (dataset()[:300], "dataset 1 has an incomplete header"),
        (dataset(body=b"1.0 2.0 x\n", n_values=3), "dataset 1 is not of numbers after byte"),
        (dataset(binary=binary_header(), body=VALUES.tobytes()[:-1]), "declares 7 values, but does not end after them"),
        (dataset(binary=binary_header(), n_values=10**9, body=VALUES.tobytes()), "declares 1000000000 values"),
        (dataset(binary=binary_header(1, 3), body=VALUES.tobytes()), "not in the representation of IEEE 754"),
        (dataset() + dataset().replace(b"    58", b"    5x"), "dataset 2 begins with '5x' in place of its type"),
        (dataset()[:-7] + dataset(), "dataset 2 begins with '' in place of its type"),
    ],
)
def test_damaged_files_name_the_dataset(file, part, words) -> None:
    with pytest.raises(FormatError, match=f"run.uff cannot be read as a universal file: .*{words}"):
        read(file(part))


@pytest.mark.parametrize("gaps", [(), (Gap(40, 1.5),)])
def test_everything_that_is_written_is_read(tmp_path, gaps) -> None:
    channels = (
        Channel(
            "Größe vorn", "acceleration", direction=(0.0, 0.0, -1.0), comment="on the axle", calibration="2024, 1%"
        ),
        Channel("v", "velocity"),
        Channel("speed", "speed"),
        Channel("omega", "angular_velocity", direction=(0.0, 1.0, 0.0)),
        Channel("eps", "strain", direction=(0.6, 0.8, 0.0)),
        Channel("raw"),
    )
    samples = np.random.default_rng(5).standard_normal((6, 100))
    run = Recording(samples, 104.36, channels, start=1_700_000_000_123_456_789, gaps=gaps, comment="a drive on Sunday")
    write(run, tmp_path / "run.unv")
    again = read(tmp_path / "run.unv")
    assert np.array_equal(again.samples, samples)
    assert again.channels == tuple(replace(channel, direction=None) for channel in channels)
    assert again.sampling_rate == pytest.approx(104.36, rel=1e-9)
    assert (again.start, again.comment) == (run.start, run.comment)
    assert (again.channels[0].comment, again.channels[0].calibration) == ("on the axle", "2024, 1%")
    assert [gap.index for gap in again.gaps] == [gap.index for gap in gaps]


@pytest.mark.parametrize("gaps", [(), (Gap(40, 1.5),)])
def test_other_programs_read_what_is_written(tmp_path, gaps) -> None:
    pyuff = pytest.importorskip("pyuff")
    samples = np.random.default_rng(5).standard_normal((2, 100))
    channels = (Channel("a", "acceleration", direction=(0.0, 0.0, -1.0)), Channel("b", "velocity"))
    write(Recording(samples, 104.36, channels, start=0, gaps=gaps, comment="x" * 100), tmp_path / "run.uff")
    header, unit, *sets = pyuff.UFF(str(tmp_path / "run.uff")).read_sets()
    assert header["description"] == "x" * 76 + " ..."
    assert (unit["units_code"], unit["length"], unit["temp_offset"]) == (1, 1.0, 273.15)
    seconds = np.arange(100) / 104.36 + np.where(np.arange(100) >= 40, sum(gap.duration for gap in gaps), 0)
    for number, (each, values) in enumerate(zip(sets, samples, strict=True), 1):
        assert np.array_equal(each["data"], values)
        assert each["x"] == pytest.approx(seconds, abs=1e-8)
        assert (each["func_type"], each["rsp_node"], each["rsp_dir"]) == (1, number, [-3, 0][number - 1])
        assert (each["id1"], each["id3"]) == ("ab"[number - 1], "01-Jan-70 00:00:00.000000000 UTC")
        assert each["ordinate_axis_units_lab"] == ["m/s^2", "m/s"][number - 1]
        assert each["ordinate_spec_data_type"] == [12, 11][number - 1]


@pytest.mark.parametrize("name", ["a" * 81, "NONE", "two  blanks"])
def test_names_that_the_format_cannot_hold_are_refused(tmp_path, name) -> None:
    with pytest.raises(ParameterError, match="would not be read back from a universal file"):
        write(Recording(np.zeros((1, 20)), 10.0, (Channel(name),)), tmp_path / "run.uff")
