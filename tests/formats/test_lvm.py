"""LabVIEW measurement files: samples of LabVIEW, and small files with every option of the format."""

import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.formats import groups, read, read_blocks
from sprung.formats.settings import ReadSettings
from sprung.units import STANDARD_GRAVITY

END = "***End_of_Header***"


def segment(
    names,
    rows,
    *,
    x_columns="No",
    separator="\t",
    start="10:00:00.000000",
    step="0.010000",
    units=None,
    samples=None,
    x0="0.0",
    notes="",
    comment="",
):
    """Return a segment as text."""
    n = len(names)
    pad = separator * 2 if x_columns == "Multi" else separator
    steps = [step] * n if isinstance(step, str) else step
    lines = [
        *([f"Notes{separator}{notes}"] if notes else []),
        f"Channels{separator}{n}",
        "Samples" + separator + pad.join(map(str, samples or [len(rows)] * n)),
        "Date" + separator + pad.join(["2024/05/31"] * n),
        "Time" + separator + pad.join([start] * n),
        "Y_Unit_Label" + separator + pad.join(units or ["g"] * n),
        "X0" + separator + pad.join([x0] * n),
        "Delta_X" + separator + pad.join(steps),
        END,
    ]
    heads = [f"X_Value{separator}{name}" for name in names] if x_columns == "Multi" else ["X_Value", *names]
    lines.append(separator.join([*heads, "Comment"]))
    lines += [separator.join(row) + (separator + comment if comment and k == 0 else "") for k, row in enumerate(rows)]
    return "\n".join(lines) + "\n"


def lvm(*segments, x_columns="No", separator="Tab", decimal="Decimal_Separator\t.\n", encoding="utf-8", end="\n"):
    """Return a file."""
    character = {"Tab": "\t", "Comma": ","}[separator]
    head = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\t{separator}\n{decimal}"
        f"Multi_Headings\tYes\nX_Columns\t{x_columns}\nTime_Pref\tAbsolute\nOperator\tJo\n"
        f"Description\tA drive\n{END}\t\n\t\n"
    ).replace("\t", character)
    return (head + "\n".join(segments)).replace("\n", end).encode(encoding)


ROWS = [["", f"{k}.5", f"-{k}.25"] for k in range(12)]
VALUES = np.array([[k + 0.5 for k in range(12)], [-(k + 0.25) if k else -0.25 for k in range(12)]])


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_names_units_start_rate_and_comments(text_file, end) -> None:
    content = lvm(
        segment(["Fläche", "b"], ROWS, units=["m/s²", "Volts"], notes="left side", comment="wet road"),
        encoding="latin-1",
        end=end,
    )
    run = read(text_file(content, "run.lvm"))
    assert run.names == ("Fläche", "b")
    assert [channel.quantity for channel in run.channels] == ["acceleration", "unknown"]
    assert "b: unit 'Volts' is unknown, values as in the file" in run.history
    assert np.array_equal(run.samples, VALUES)
    assert run.sampling_rate == 100
    assert run.start == np.datetime64("2024-05-31T10:00:00", "ns").astype(int)
    assert run.comment == "A drive; operator Jo; left side; wet road; start in local time"
    assert np.array_equal(read(text_file(content, "run.dat")).samples, VALUES)


@pytest.mark.parametrize("stated", ["Decimal_Separator\t,\n", ""])
def test_decimal_comma(text_file, stated) -> None:
    rows = [[field.replace(".", ",") for field in row] for row in ROWS]
    text = segment(["a", "b"], rows, step="9,765625E-4", start="10:00:00,25")
    run = read(text_file(lvm(text, decimal=stated), "run.lvm"))
    assert run.samples == pytest.approx(STANDARD_GRAVITY * VALUES, rel=1e-15)
    assert run.sampling_rate == 1024
    assert run.start == np.datetime64("2024-05-31T10:00:00.25", "ns").astype(int)


def test_commas_between_fields(text_file) -> None:
    content = lvm(segment(["a", "b"], ROWS, separator=","), separator="Comma", decimal="Decimal_Separator\t.\n")
    run = read(text_file(content, "run.lvm"))
    assert (run.names, run.sampling_rate) == (("a", "b"), 100)
    assert run.samples == pytest.approx(STANDARD_GRAVITY * VALUES, rel=1e-15)


@pytest.mark.parametrize("x_columns", ["One", "Multi"])
def test_columns_of_times(text_file, x_columns) -> None:
    rows = []
    for k, (_, a, b) in enumerate(ROWS):
        time = f"{0.02 * k + (3 if k > 5 else 0):.6f}"
        rows.append([time, a, time, b] if x_columns == "Multi" else [time, a, b])
    run = read(text_file(lvm(segment(["a", "b"], rows, x_columns=x_columns), x_columns=x_columns), "run.lvm"))
    assert run.samples == pytest.approx(STANDARD_GRAVITY * VALUES, rel=1e-15)
    assert run.sampling_rate == 50
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(6, pytest.approx(3.0))]


def test_different_times_of_channels_are_refused(text_file) -> None:
    rows = [[f"{0.01 * k}", a, f"{0.02 * k}", b] for k, (_, a, b) in enumerate(ROWS)]
    path = text_file(lvm(segment(["a", "b"], rows, x_columns="Multi"), x_columns="Multi"), "run.lvm")
    with pytest.raises(
        FormatError, match="channels 'a' and 'b' have different times: choose channels with a common time base"
    ):
        read(path)
    assert read(path, channels=["b"]).sampling_rate == 50


@pytest.mark.parametrize("relative", [True, False])
def test_segments_follow_one_another(text_file, relative) -> None:
    starts = ["10:00:00.0"] * 3 if relative else ["10:00:00.0", "10:00:00.12", "10:00:05.0"]
    offsets = ["0.0", "0.12", "5.0"] if relative else ["0.0"] * 3
    texts = [segment(["a", "b"], ROWS, start=start, x0=x0) for start, x0 in zip(starts, offsets, strict=True)]
    path = text_file(lvm(*texts), "run.lvm")
    run = read(path)
    assert run.samples == pytest.approx(STANDARD_GRAVITY * np.tile(VALUES, 3), rel=1e-15)
    assert run.sampling_rate == 100
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(24, pytest.approx(4.76))]
    part = read(path, channels=["b"], settings=ReadSettings(start=0.05, end=0.2))
    assert part.samples == pytest.approx(STANDARD_GRAVITY * np.tile(VALUES, 3)[1:, 5:20], rel=1e-15)


def test_channels_of_other_rates_and_lengths_are_groups(text_file) -> None:
    rows = [["", f"{k}.5", "", f"{k}.25" if k < 6 else "", "7.0"] for k in range(12)]
    text = segment(
        ["a", "unused", "b", "a"],
        rows,
        samples=[12, 0, 6, 12],
        step=["0.010000", "1.0", "0.020000", "0.010000"],
        units=["g"] * 4,
    )
    path = text_file(lvm(text), "run.lvm")
    assert [(group.name, group.headings, group.sampling_rate) for group in groups(path)] == [
        ("100 Hz, 12 samples", ("a", "a (2)"), 100),
        ("50 Hz, 6 samples", ("b",), 50),
    ]
    assert read(path, channels=["b"]).n_samples == 6
    with pytest.raises(ParameterError, match="2 groups of channels with different clocks"):
        read(path)


def test_damage_names_the_line(text_file) -> None:
    whole = lvm(segment(["a", "b"], ROWS))
    line = whole[: whole.index(b"\t7.5")].count(b"\n") + 1
    with pytest.raises(FormatError, match=rf"run.lvm, line {line}, column 'b': '-7.2x' is not a number: correct it"):
        read(text_file(whole.replace(b"-7.25", b"-7.2x"), "run.lvm"))
    with pytest.raises(FormatError, match=r"run.lvm cannot be read as a LabVIEW measurement: it has 1 header"):
        read(text_file(whole[:250], "run.lvm"))
    with pytest.raises(FormatError, match=r"channel 'a' has X0 '0.0' and Delta_X 'x': both must be numbers"):
        read(text_file(whole.replace(b"0.010000", b"x"), "run.lvm"))
    with pytest.raises(FormatError, match="channel 'a' has neither times nor a Delta_X above 0"):
        read(text_file(whole.replace(b"0.010000", b"0.0"), "run.lvm"))
    with pytest.raises(FormatError, match="states the decimal separator 'x'"):
        read(text_file(whole.replace(b"Decimal_Separator\t.", b"Decimal_Separator\tx"), "run.lvm"))


@pytest.mark.parametrize(
    ("name", "rate", "n_samples", "first"),
    [
        ("short", 25600, 10, [0.914018, 1.204792]),
        ("short_new_line_end", 25600, 10, [0.914018, 1.204792]),
        ("no_decimal_separator", 4000, 4, [-0.008807 * STANDARD_GRAVITY, -0.028189 * STANDARD_GRAVITY]),
        ("multi_time_column", 51200, 3, [-0.035229, 0.532608 * STANDARD_GRAVITY]),
        ("long_single_header_multi_ch", 1024, 16384, [0.052530 * STANDARD_GRAVITY, 0.234571]),
        ("with_empty_fields", 1000, 7, [-0.011923, 7.254639]),
    ],
)
def test_files_of_labview(real_file, name, rate, n_samples, first) -> None:
    path = real_file(f"formats/lvm/{name}.lvm")
    run = read(path)
    assert (run.sampling_rate, run.n_samples) == (pytest.approx(rate, rel=1e-9), n_samples)
    assert run.samples[:2, 0] == pytest.approx(first, rel=1e-12)
    joined = np.concatenate([piece.samples for piece in read_blocks(path, block_samples=1000)], axis=1)
    assert np.array_equal(joined, run.samples)


def test_comments_and_latin_letters(real_file) -> None:
    run = read(real_file("formats/lvm/with_comments.lvm"))
    assert run.names == ("Pressão ABS. (MPa)", "Temperatura (°C)", "Volume (ml)")
    assert run.channels[1].quantity == "temperature"
    assert "LOST COMMUNICATION" in run.comment
