import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from sprung.errors import ParameterError
from sprung.formats import read
from sprung.link.archive import ArchiveError, is_archive, read_archive, write_archive
from sprung.online.store import Retention

T0 = int(datetime(2024, 2, 29, 23, 59, 59, tzinfo=UTC).timestamp()) * 10**9 + 123
DAY = 86400 * 10**9
SAMPLES = np.array([[0.0, 0.5, 1.0], [1e-3, np.nan, -1e6]])


def write(folder, *, vehicle="zafira", boot=7, first_seq=3, t0=T0, samples=SAMPLES, channels=("fl", "fr"), rate=200.0):
    return write_archive(folder, vehicle, boot, first_seq, t0, samples=samples, channels=channels, sampling_rate=rate)


def test_file_holds_the_samples(tmp_path: Path) -> None:
    path = write(tmp_path)
    assert path == tmp_path / "zafira" / "2024-02-29" / "7-3.parquet"
    assert path.stat().st_mtime_ns == T0
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    table = pq.read_table(path)
    assert table.column_names == ["time", "fl", "fr"]
    assert [str(field.type) for field in table.schema] == ["double", "float", "float"]
    assert table.column("time").to_pylist() == [0.0, 0.005, 0.01]
    np.testing.assert_array_equal(table.column("fr").to_numpy(), SAMPLES[1].astype(np.float32))
    assert table.schema.metadata == {
        b"vehicle": b"zafira", b"boot": b"7", b"first_seq": b"3", b"t0": b"%d" % T0, b"sampling_rate": b"200.0"
    }  # fmt: skip
    assert pq.ParquetFile(path).metadata.row_group(0).column(1).compression == "ZSTD"


def test_file_is_a_recording(tmp_path: Path) -> None:
    rows = np.random.default_rng(1).standard_normal((2, 1000))
    recording = read(write(tmp_path, samples=rows, rate=128.0))
    assert recording.sampling_rate == pytest.approx(128.0)
    np.testing.assert_array_equal(recording.samples, rows.astype(np.float32))


def test_same_stretch_again_replaces_the_file(tmp_path: Path) -> None:
    first = write(tmp_path)
    assert write(tmp_path, samples=SAMPLES[:, :1]) == first
    assert pq.read_table(first).num_rows == 1


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "../a", "a b", "ä", "a\n", "x" * 65])
def test_names_that_are_no_folder_are_refused(tmp_path: Path, name) -> None:
    with pytest.raises(ParameterError, match="is not a valid name"):
        write(tmp_path, vehicle=name)
    assert list(tmp_path.iterdir()) == []


def test_arguments_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for channels in (("fl",), ("fl", "fl"), ("fl", "time")):
        with pytest.raises(ParameterError, match="must be 2 different names"):
            write(tmp_path, channels=channels)
    with pytest.raises(ParameterError, match="samples has 1 dimensions"):
        write(tmp_path, samples=SAMPLES[0])
    with pytest.raises(ParameterError, match="sampling_rate"):
        write(tmp_path, rate=0.0)
    with pytest.raises(ParameterError, match="first_seq=-1"):
        write(tmp_path, first_seq=-1)


def test_full_disk_leaves_no_part_of_a_file(small_disk) -> None:
    folder, _ = small_disk
    noise = np.random.default_rng(1).standard_normal((2, 400_000))
    with pytest.raises(ArchiveError, match=r"the archive cannot write .* \(No space left on device\): free space"):
        write(folder, samples=noise)
    assert list(folder.rglob("*.par*")) == []
    assert write(folder).exists()


def test_old_files_are_pruned(tmp_path: Path) -> None:
    paths = [write(tmp_path, first_seq=k, t0=T0 + k * DAY) for k in range(4)]
    write(tmp_path, vehicle="other", t0=T0)
    archive = Retention(tmp_path)
    assert archive.prune(before=T0) == 0
    assert archive.prune(before=T0 + 1) == 2
    assert [path.exists() for path in paths] == [False, True, True, True]
    assert not paths[0].parent.exists()
    assert archive.prune(before=0, max_bytes=2 * paths[1].stat().st_size) == 1
    assert [path.exists() for path in paths] == [False, False, True, True]
    assert archive.prune(before=0, max_bytes=0) == 2
    assert Retention(tmp_path / "absent").prune(before=T0) == 0


def test_pruning_leaves_other_files(tmp_path: Path) -> None:
    path = write(tmp_path)
    (path.parent / "notes.txt").touch()
    (tmp_path / "notes.parquet").touch()
    assert Retention(tmp_path).prune(before=T0 + DAY) == 1
    assert (path.parent / "notes.txt").exists()
    assert (tmp_path / "notes.parquet").exists()


def put(folder, *, vehicle, t0, size):
    """A file as the archive has it."""
    day = folder / vehicle / f"{datetime.fromtimestamp(t0 // 10**9, UTC):%Y-%m-%d}"
    day.mkdir(parents=True, exist_ok=True)
    path = day / f"1-{t0}.parquet"
    path.write_bytes(bytes(size))
    os.utime(path, ns=(t0, t0))
    return path


def settle(folder, *, at):
    """Let the folders of days have been as they are since a time."""
    for day in folder.glob("*/*"):
        os.utime(day, ns=(at, at))


def kept(files, *, before, max_bytes):
    """What remains, found the long way; {path: (begin, size)}."""
    left = dict(sorted(files.items(), key=lambda item: (item[1][0], str(item[0]))))
    for path, (begin, _) in list(left.items()):
        if begin < before or sum(size for _, size in left.values()) > max_bytes:
            del left[path]
    return left


@pytest.mark.parametrize("is_restarted", [False, True])
def test_what_remains_is_what_a_look_at_every_file_leaves(tmp_path: Path, is_restarted) -> None:
    generator = np.random.default_rng(5)
    archive, files = Retention(tmp_path), {}
    for step in range(60):
        for _ in range(generator.integers(0, 6)):
            t0, size = T0 + int(generator.integers(-DAY, DAY)) + step * DAY // 20, int(generator.integers(1, 1000))
            path = put(tmp_path, vehicle=f"car-{generator.integers(0, 4)}", t0=t0, size=size)
            files[path] = (t0, size)
        if files and step % 7 == 0:  # by hand
            path = list(files)[generator.integers(0, len(files))]
            path.unlink()
            del files[path]
        archive = Retention(tmp_path) if is_restarted else archive
        rules = {"before": T0 + (step - 30) * DAY // 20, "max_bytes": int(generator.integers(5_000, 40_000))}
        left = kept(files, **rules)
        assert archive.prune(**rules) == len(files) - len(left)
        assert set(tmp_path.glob("*/*/*")) == set(left)
        files = left


def test_only_what_changed_or_must_go_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for vehicle in range(20):
        for k in range(3):
            put(tmp_path, vehicle=f"car-{vehicle}", t0=T0 + k * DAY + vehicle, size=10)
    settle(tmp_path, at=T0)
    opened, scandir = list[Path](), os.scandir

    def noted(path):
        opened.append(Path(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", noted)

    def looks(archive, **rules):
        """Folders of days that were opened, and files that went."""
        opened.clear()
        n_deleted = archive.prune(before=0, **rules)
        return len([path for path in opened if path.parent.parent == tmp_path]), n_deleted

    archive = Retention(tmp_path)
    assert looks(archive) == (60, 0)
    assert looks(archive) == (0, 0)
    put(tmp_path, vehicle="car-7", t0=T0 + 5, size=10)
    assert looks(archive) == (1, 0)
    assert looks(archive) == (1, 0), "it may have changed again within a tick of the disk's clock"
    settle(tmp_path, at=T0 + 1)
    assert looks(archive) == (60, 0)
    assert looks(archive, max_bytes=600) == (1, 1)
    assert looks(Retention(tmp_path), max_bytes=600) == (59, 0)


def test_a_full_disk_gets_room(small_disk) -> None:
    folder, _ = small_disk
    noise = np.random.default_rng(1).standard_normal((2, 20_000))
    days = (write(folder, samples=noise, t0=T0 + k * DAY) for k in range(100))
    with pytest.raises(ArchiveError, match="No space left on device"):
        list(days)
    archive = Retention(folder)
    assert archive.prune(before=0, max_bytes=10**6) > 0
    left = sorted(folder.rglob("*.parquet"))
    assert sum(path.stat().st_size for path in left) <= 10**6
    assert left[0].parent.name > "2024-03-01"
    assert write(folder, samples=noise, first_seq=1000, t0=T0 + 1000 * DAY).exists()
    assert archive.prune(before=T0 + 1000 * DAY) > 0
    assert len(list(folder.rglob("*.parquet"))) == 1


def test_vehicle_and_quantities_come_back(tmp_path: Path) -> None:
    path = write_archive(
        tmp_path,
        "zafira",
        7,
        3,
        T0,
        samples=SAMPLES,
        channels=("fl", "v"),
        sampling_rate=200.0,
        quantities=("acceleration", "speed"),
    )
    kept = read_archive(path)
    assert (kept.vehicle, kept.quantities, kept.t0) == ("zafira", ("acceleration", "speed"), T0)
    assert read_archive(write(tmp_path, first_seq=4)).quantities == ()


def test_files_of_the_archive_are_recognised(tmp_path: Path) -> None:
    assert is_archive(write(tmp_path))
    pq.write_table(pq.read_table(write(tmp_path)).replace_schema_metadata({"vehicle": "zafira"}), tmp_path / "other.pq")
    (tmp_path / "short.parquet").write_bytes(b"PAR1PAR1")
    assert not any(map(is_archive, (tmp_path / "other.pq", tmp_path / "short.parquet", tmp_path, tmp_path / "none")))
