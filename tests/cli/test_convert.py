"""Files converted on the command line."""

import h5py
import numpy as np
import pytest

from sprung.formats import WRITERS, read, write
from sprung.recording import Channel, Recording

LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tNo
Time_Pref\tAbsolute
***End_of_Header***\t
\t
Channels\t1
Samples\t4
Y_Unit_Label\t°C
X_Dimension\tTime
X0\t0.0
Delta_X\t0.5
***End_of_Header***\t
X_Value\tOil (°C)\tComment
\t20.5
\t21.5
\t22.25
\t23.5
"""


@pytest.fixture
def run(tmp_path):
    samples = np.random.default_rng(1).normal(size=(2, 600))
    channels = (Channel("acc", "acceleration", comment="sill"), Channel("speed", "speed"))
    write(Recording(samples, 100.0, channels, start=10**18, comment="wet"), tmp_path / "run.parquet")
    return tmp_path / "run.parquet"


@pytest.mark.parametrize("ending", WRITERS)
def test_every_format_that_is_written(sprung, run, tmp_path, ending) -> None:
    target = tmp_path / f"out{ending}"
    outcome = sprung("convert", run, target)
    assert (outcome.code, outcome.err) == (0, "")
    assert f"wrote{target}" in "".join(outcome.out.split())
    again, wanted = read(target), read(run)
    np.testing.assert_allclose(again.samples, wanted.samples, rtol=1e-12, equal_nan=False)
    assert (again.start, again.comment) == (wanted.start, wanted.comment)
    assert [(c.name, c.quantity, c.comment) for c in again.channels] == [
        (c.name, c.quantity, c.comment) for c in wanted.channels
    ]


def test_parts_and_channels(sprung, run, tmp_path) -> None:
    sprung("convert", run, tmp_path / "part.npz", "--from", 1, "--to", 3, "--channels", "speed")
    part = read(tmp_path / "part.npz")
    assert part.names == ("speed",)
    assert part.samples == pytest.approx(read(run).samples[1:, 100:300])
    assert part.start == 10**18 + 10**9


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run.parquet"], "is the only path"),
        (["run.parquet", "run.parquet"], "would overwrite an input"),
        (["run.parquet", "out.xyz"], "recordings are written as"),
        (["run.parquet", "run.parquet", "out.csv"], "is one file for 2 recordings"),
        (["run.parquet", "run.parquet", "out"], "convert them one by one"),
        (["run.parquet", "out", "--ending", ".doc"], "must be one of .csv"),
        (["run.parquet", "out.csv", "--from", "5", "--to", "2"], "end=2 must be above start=5"),
        (
            ["run.parquet", "out.csv", "--time-unit", "weeks"],
            "time_unit 'weeks' is not one of HHMMSS, HHMMSScc",
        ),
    ],
)
def test_bad_words(sprung, run, monkeypatch, words, message) -> None:
    monkeypatch.chdir(run.parent)
    outcome = sprung("convert", *words)
    assert outcome.code == 2
    assert message in " ".join(outcome.err.split())


def test_info_lists_groups_and_reads_one(sprung, tmp_path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for name, rate in (("body", 100), ("drive", 10)):
            file.create_group(name)["t_s"] = np.arange(5 * rate) / rate
            file[name]["x"] = np.random.default_rng(1).normal(size=5 * rate)
        file.create_group("clock")["time_s"] = np.arange(50) / 10
        file["clock"]["epoch_ms"] = np.arange(50) * 100
    files = sprung("info", path, "--json", "-").document()["files"]
    assert "holds no channel of motion: 'epoch_ms' (a clock)" in " ".join(sprung("info", path).out.split())
    assert [(facts["group"], facts["n_samples"]) for facts in files] == [("body", 500), ("drive", 50)]
    (facts,) = sprung("info", path, "--group", "drive", "--json", "-").document()["files"]
    assert facts["n_samples"] == 50


def test_names_that_end_with_their_unit_are_written_without_it(sprung, tmp_path) -> None:
    (tmp_path / "run.lvm").write_text(LVM)
    outcome = sprung("convert", tmp_path / "run.lvm", tmp_path / "run.csv")
    assert (outcome.code, outcome.err) == (0, "")
    assert "'Oil (°C)' 'Oil'" in " ".join(outcome.out.split())
    (channel,) = read(tmp_path / "run.csv").channels
    assert (channel.name, channel.quantity) == ("Oil", "temperature")
