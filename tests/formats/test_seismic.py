"""miniSEED, versions 2 and 3: channels, gaps and records in any order."""

import numpy as np
import pytest

from sprung.errors import FormatError, ParameterError
from sprung.formats import groups, read, read_blocks
from sprung.formats.settings import ReadSettings

pymseed = pytest.importorskip("pymseed")

START = 1_700_000_000_000_000_000
VALUES = np.random.default_rng(31).integers(-(2**20), 2**20, (3, 5000))
NAMES = tuple(f"XX.CAR1.00.HN{axis}" for axis in "ENZ")
SECOND = 10**9


def write_file(path, *pieces, version=2, overwrite=True, kind="i"):
    """Write pieces (channel, samples, rate, start) as records of 512 bytes."""
    traces = pymseed.MS3TraceList()
    encoding = {"i": "STEIM2", "f": "FLOAT32", "d": "FLOAT64"}[kind]
    for channel, samples, rate, start in pieces:
        identifier = "FDSN:XX_CAR1_00_" + "_".join(channel)
        array = np.asarray(samples, dtype={"i": "i4", "f": "f4", "d": "f8"}[kind])
        traces.add_data(identifier, array, kind, rate, starttime=start)
    options = {"format_version": version, "max_record_length": 512, "encoding": pymseed.DataEncoding[encoding]}
    traces.to_file(path, overwrite=overwrite, **options)
    return path


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("kind", ["i", "f", "d"])
def test_channels_of_one_clock_with_a_gap(tmp_path, version, kind) -> None:
    pieces = [
        (f"HN{axis}", VALUES[k, part], 200.0, start)
        for k, axis in enumerate("ENZ")
        for part, start in ((slice(0, 2000), START), (slice(2000, None), START + 22 * SECOND))
    ]
    path = write_file(tmp_path / "run.mseed", *pieces, version=version, kind=kind)
    run = read(path)
    assert run.names == NAMES
    assert np.array_equal(run.samples, VALUES)
    assert (run.sampling_rate, run.start) == (200, START)
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(2000, pytest.approx(12))]
    assert f"{NAMES[0]}: unit 'counts' is unknown, values as in the file" in run.history
    pieces_again = list(read_blocks(path, block_samples=1000))
    assert np.array_equal(np.concatenate([piece.samples for piece in pieces_again], axis=1), VALUES)
    part = read(path, channels=[NAMES[2]], settings=ReadSettings(start=5.0, end=23.0))
    assert np.array_equal(part.samples, VALUES[2:, 1000:2200])
    assert part.start == START + 5 * SECOND
    assert np.array_equal(read(path.rename(tmp_path / "run.bin")).samples, VALUES)


def test_records_in_any_order(tmp_path) -> None:
    path = write_file(tmp_path / "run.mseed", ("HNZ", VALUES[0], 200.0, START))
    content = path.read_bytes()
    records = [content[k : k + 512] for k in range(0, len(content), 512)]
    assert len(records) > 10
    path.write_bytes(b"".join([*records[::-1], records[3]]))  # the same one twice
    assert np.array_equal(read(path).samples, VALUES[:1])


def test_only_common_times_of_channels_are_joined(tmp_path) -> None:
    path = write_file(
        tmp_path / "run.mseed",
        ("HNE", VALUES[0, :3000], 200.0, START),
        ("HNN", VALUES[1, 100:1000], 200.0, START + SECOND // 2),
        ("HNN", VALUES[1, 1400:4000], 200.0, START + 7 * SECOND),
    )
    assert [(group.headings, group.n_rows) for group in groups(path)] == [(NAMES[:2], 900 + 1600)]
    run = read(path)
    assert np.array_equal(run.samples, np.concatenate([VALUES[:2, 100:1000], VALUES[:2, 1400:3000]], axis=1))
    assert run.start == START + SECOND // 2
    assert [(gap.index, gap.duration) for gap in run.gaps] == [(900, pytest.approx(2))]
    assert np.array_equal(read(path, channels=[NAMES[0]]).samples, VALUES[:1, :3000])


def test_other_rates_times_and_phases_are_groups(tmp_path) -> None:
    path = write_file(
        tmp_path / "run.mseed",
        ("HNE", VALUES[0], 200.0, START),
        ("HNN", VALUES[1], 200.0, START + SECOND // 800),
        ("HNZ", VALUES[2], 200.0, START + 3600 * SECOND),
        ("LNZ", VALUES[2, :50], 1.0, START),
    )
    found = {group.name: (group.headings, group.sampling_rate) for group in groups(path)}
    assert found == {
        "200 Hz": (NAMES[:1], 200),
        "200 Hz (2)": (NAMES[1:2], 200),
        "200 Hz (3)": (NAMES[2:], 200),
        "1 Hz": (("XX.CAR1.00.LNZ",), 1),
    }
    with pytest.raises(ParameterError, match="4 groups of channels with different clocks"):
        read(path)
    assert read(path, settings=ReadSettings(groups=["1 Hz"])).n_samples == 50


def test_overlaps_and_damage(tmp_path) -> None:
    path = write_file(tmp_path / "run.mseed", ("HNZ", VALUES[0], 200.0, START))
    whole = path.read_bytes()
    with pytest.raises(FormatError, match=r"run.mseed cannot be read as miniSEED"):
        read((path.write_bytes(whole[:-100]), path)[1])
    path.write_bytes(whole[:512] + b"\xff" * 512 + whole[1024:])
    with pytest.raises(FormatError, match=r"run.mseed cannot be read as miniSEED"):
        read(path)
    path.write_bytes(whole)
    write_file(path, ("HNZ", VALUES[0], 200.0, START + SECOND), overwrite=False)
    with pytest.raises(FormatError, match=r"run.mseed: records of XX.CAR1.00.HNZ overlap at 2023-11-14T22:13:21"):
        read(path)
