"""The spool: nothing that was kept is lost before it is acknowledged, and never too many bytes."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from sprung.link import Key, Loss, Spool, SpoolError, message
from sprung.link.spool import Disk


def filled(folder, count, *, most_bytes=1 << 20, size=100):
    spool = Spool(folder, most_bytes=most_bytes)
    for _ in range(count):
        spool.append(lambda boot, seq: f"{boot}/{seq}/".encode().ljust(size, b"."))
    return spool


def held(spool):
    return [(boot, seq) for boot, seq, _ in spool.frames()]


def test_frames_come_back_in_order_after_a_restart(tmp_path: Path) -> None:
    first = filled(tmp_path, 30)
    first.acknowledge(first.boot, 9)
    first.close()
    second = filled(tmp_path, 5)
    assert second.boot == first.boot + 1
    found = held(second)
    assert found[-25:] == [(0, seq) for seq in range(10, 30)] + [(1, seq) for seq in range(5)]
    assert second.boots[1] == 0
    assert [payload[:5] for _, _, payload in second.frames(boot=1, after=2)] == [b"1/3/.", b"1/4/."]


def test_a_spool_belongs_to_one_box(tmp_path: Path) -> None:
    first = filled(tmp_path, 3)
    with pytest.raises(SpoolError, match="in use by another box"):
        Spool(tmp_path)
    first.close()
    assert Spool(tmp_path).boot == 1


def test_oldest_go_first_and_are_counted(tmp_path: Path) -> None:
    spool = filled(tmp_path, 400, most_bytes=16_384)
    assert spool.n_bytes <= 16_384
    kept = [seq for _, seq in held(spool)]
    assert kept == list(range(kept[0], 400))
    assert spool.dropped == kept[0] > 200
    assert spool.boots == {0: kept[0]}


@pytest.mark.parametrize("cut", range(0, 126 * 3, 7))
def test_a_torn_end_loses_the_torn_frame_only(tmp_path: Path, cut) -> None:
    filled(tmp_path, 3).close()
    (path,) = tmp_path.glob("*.spool")
    data = path.read_bytes()
    path.write_bytes(data[:cut])
    again = filled(tmp_path, 1)
    record = len(data) // 3
    assert held(again) == [(0, seq) for seq in range(cut // record)] + [(1, 0)]


def test_a_flipped_bit_hides_no_other_file(tmp_path: Path) -> None:
    filled(tmp_path, 200, most_bytes=65_536).close()
    first = sorted(tmp_path.glob("*.spool"))[0]
    data = bytearray(first.read_bytes())
    data[150] ^= 1
    first.write_bytes(data)
    found = held(Spool(tmp_path, most_bytes=65_536))
    assert found[0] == (0, 0)
    assert found[-1] == (0, 199)
    assert len(found) > 160


def test_a_new_disk_counts_on_from_the_time(tmp_path: Path) -> None:
    first = Spool(tmp_path / "a", boot_from=1_700_000_000)
    assert first.boot == 1_700_000_000
    first.close()
    assert Spool(tmp_path / "a", boot_from=5).boot == 1_700_000_001


def test_a_disk_that_refuses_drops_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spool = filled(tmp_path, 3)
    shutil.rmtree(tmp_path)
    spool.close()
    assert not spool.append(lambda *_: b"x")
    assert spool.dropped == 4
    tmp_path.mkdir()
    assert spool.append(lambda *_: b"x")
    assert held(spool) == [(0, 4)]
    with pytest.raises(SpoolError, match="give another folder"):
        Spool(tmp_path / next(tmp_path.iterdir()).name)


def test_where_the_boot_before_ended_is_known(tmp_path: Path) -> None:
    first = filled(tmp_path, 7)
    assert first.previous is None
    first.acknowledge(0, 6)
    first.close()
    for boot in (1, 2):
        idle = Spool(tmp_path)
        assert (idle.boot, idle.previous) == (boot, (0, 7))
        assert idle.boots[0] == 7 or boot > 0
        assert (idle.last_frame() or b"").startswith(b"0/6/")
        idle.close()
    third = filled(tmp_path, 2)
    third.close()
    assert Spool(tmp_path).previous == (3, 2)


def frame(boot, seq):
    """A message of one second, as far as a spool reads it."""
    start = 10**18 + seq * 10**9
    return message({Key.BOOT: boot, Key.SEQ: seq, Key.START: start, Key.INTERVAL: 10**7, Key.N_SAMPLES: 100})


def lossy(folder, count):
    """A spool of a few kB, in which frames of a second were put."""
    spool = Spool(folder, most_bytes=8192)
    for _ in range(count):
        spool.append(frame)
    return spool


def test_what_was_dropped_and_when_it_was_is_known_across_restarts_until_it_is_acknowledged(tmp_path: Path) -> None:
    spool = lossy(tmp_path, 600)
    first = held(spool)[0][1]
    loss = Loss(0, 0, first - 1, first, 10**18, 10**18 + first * 10**9)
    assert first > 300
    assert spool.losses == spool.unreported_losses == (loss,)
    spool.close()
    again = Spool(tmp_path, most_bytes=8192)
    assert again.losses == again.unreported_losses == (loss,)
    again.acknowledge(0, first - 2)
    assert again.unreported_losses == (loss,), "the monitor has not heard of all"
    again.acknowledge(0, first - 1)
    assert again.unreported_losses == ()
    assert again.losses == (loss,), "people read of it in the end"
    again.close()
    assert Spool(tmp_path, most_bytes=8192).losses == ()


def test_losses_of_several_starts_are_kept_apart(tmp_path: Path) -> None:
    lossy(tmp_path, 300).close()
    again = lossy(tmp_path, 300)
    kept = len(held(again))
    first, second = again.losses
    assert (first.boot, first.first, first.last, first.n_frames) == (0, 0, 299, 300)
    assert (second.boot, second.n_frames) == (1, 300 - kept)


def test_frames_that_a_crash_kept_from_being_dropped_are_not_lost(tmp_path: Path) -> None:
    """The loss is written first: a crash before the file is removed leaves both."""
    lossy(tmp_path, 20).close()
    (tmp_path / "losses").write_text("0 0 4 5 1000 2000\n7 3 3 1 0 0\n", encoding="ascii")
    assert Spool(tmp_path, most_bytes=8192).losses == (Loss(7, 3, 3, 1),)


@pytest.mark.parametrize("content", ["", "0", "a b c d e f", "1 2 3 4 5 6 7", "\0"])
def test_a_damaged_list_of_losses_keeps_no_box_from_starting(tmp_path: Path, content) -> None:
    lossy(tmp_path, 3).close()
    (tmp_path / "losses").write_text(content, encoding="ascii")
    assert Spool(tmp_path).losses == ()


def test_a_frame_that_the_disk_refuses_is_a_loss(tmp_path: Path) -> None:
    spool = lossy(tmp_path, 0)
    shutil.rmtree(tmp_path)
    assert not spool.append(frame)
    assert spool.losses == (Loss(0, 0, 0, 1, 10**18, 10**18 + 10**9),)


class Forgetful(Disk):
    """A disk whose folder has, after a power cut, the names and contents that it had when they were last synced."""

    def __init__(self) -> None:
        self.durable: dict[str, int] = {}
        self.sizes: dict[int, int] = {}

    def sync(self, handle: int) -> None:
        status = os.fstat(handle)
        self.sizes[status.st_ino] = status.st_size

    def sync_folder(self, folder: Path) -> None:
        self.durable = {path.name: path.stat().st_ino for path in folder.iterdir()}

    def cut_power(self, folder: Path) -> None:
        for path in list(folder.iterdir()):
            if self.durable.get(path.name) != path.stat().st_ino:
                path.unlink()
            else:
                os.truncate(path, self.sizes.get(path.stat().st_ino, 0))


def test_a_power_cut_takes_neither_frames_nor_the_number_of_the_boot(tmp_path: Path) -> None:
    """Without the names of its files a box would number new frames as those that the monitor already has."""
    for boot in (0, 1):
        disk = Forgetful()
        spool = Spool(tmp_path, disk=disk)
        assert spool.boot == boot
        spool.append(lambda boot, seq: f"{boot}/{seq}".encode())
        spool.acknowledge(boot, 0)
        spool.close()
        disk.cut_power(tmp_path)
    again = Spool(tmp_path)
    assert (again.boot, again.previous) == (2, (1, 1))
    assert held(again) == [(0, 0), (1, 0)]


def test_a_power_cut_takes_no_frame_that_was_read_at_a_start(tmp_path: Path) -> None:
    """Later boots say how many frames there were, and the monitor waits for all of them."""
    disk = Forgetful()
    for is_synced in (False, True):  # the first start ends before the disk has its frames
        spool = Spool(tmp_path, is_synced=is_synced, disk=disk)
        for _ in range(2):
            spool.append(lambda *_: b"x" * 100)
        spool.close()
    disk.cut_power(tmp_path)
    assert held(Spool(tmp_path)) == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_frames_that_were_there_at_a_start_and_are_gone_are_a_loss(tmp_path: Path) -> None:
    for count in (3, 2):
        filled(tmp_path, count).close()
    oldest = min(tmp_path.glob("*.spool"))
    oldest.write_bytes(oldest.read_bytes()[:-200])
    for _ in range(2):
        spool = Spool(tmp_path)
        assert [tuple(loss)[:4] for loss in spool.unreported_losses] == [(0, 1, 2, 2)]
        spool.close()


def test_a_loss_behind_frames_that_are_held_is_known_after_a_restart(broken) -> None:
    spool, disk = broken
    disk.failing = {"write of frames"}
    first = held(spool)[-1][1] + 1
    assert not spool.append(lambda *_: b"x" * 100)
    (loss,) = spool.losses
    assert loss.last == first
    left = [seq for _, seq in held(spool)]
    assert left
    assert spool.boots == {0: left[0]}
    spool.close()
    again = Spool(spool._folder)
    assert again.losses == (loss,)
    again.acknowledge(0, left[-1])
    assert again.boots == {0: first + 1, 1: 0}


def test_ends_of_earlier_boots_outlast_their_frames(tmp_path: Path) -> None:
    """The monitor may have frames of later boots, which wait for those that the box has no more."""
    for count in (2, 1, 3, 0):
        filled(tmp_path, count).close()
    for path in tmp_path.glob("*.spool"):
        path.unlink()
    assert Spool(tmp_path).boots == {0: 2, 1: 1, 2: 3, 4: 0}


def test_the_end_of_a_boot_stays_where_its_last_frame_is_torn(tmp_path: Path) -> None:
    """The boot after it has said how many frames it had, and waits for them."""
    filled(tmp_path, 2).close()
    filled(tmp_path, 1).close()
    oldest = min(tmp_path.glob("*.spool"))
    oldest.write_bytes(oldest.read_bytes()[:-1])
    spool = Spool(tmp_path)
    assert spool.boots[0] == 0
    spool.acknowledge(0, 0)
    assert spool.boots[0] == 2


def test_the_end_of_a_boot_stays_while_frames_of_the_next_are_held(tmp_path: Path) -> None:
    """A box may start any number of times without a monitor, which then waits for what the disk has lost."""
    for _ in range(40):
        filled(tmp_path, 2).close()
    oldest = min(tmp_path.glob("*.spool"))
    oldest.write_bytes(oldest.read_bytes()[:-1])
    spool = Spool(tmp_path)
    assert [tuple(loss)[:4] for loss in spool.unreported_losses] == [(0, 1, 1, 1)]
    oldest.unlink()
    spool.close()
    spool = Spool(tmp_path)
    assert (spool.boots[0], len(spool.boots)) == (2, 41)
    for boot in range(39):
        spool.acknowledge(boot, 1)
    assert sorted(spool.boots) == [0, *range(24, 40), 41]  # the loss is not yet acknowledged


def test_the_end_of_a_boot_stays_until_its_loss_is_known(tmp_path: Path) -> None:
    ends = " ".join(f"{boot} 5" for boot in range(20))
    (tmp_path / "boot").write_text(f"20 {ends}")
    (tmp_path / "losses").write_text("0 0 1 2 0 0")
    spool = Spool(tmp_path)
    assert [tuple(loss)[:4] for loss in spool.losses] == [(0, 0, 1, 2)]
    assert spool.boots == dict.fromkeys((0, *range(4, 20)), 5) | {21: 0}


def test_a_boot_that_was_dropped_as_a_whole_is_known_after_a_restart(broken) -> None:
    """Those of its frames that the monitor has wait for the others."""
    spool, disk = broken
    disk.failing = {"write of frames"}
    assert not spool.append(lambda *_: b"x" * 100)
    while held(spool):
        assert not spool.append(lambda *_: b"x" * 100)
    assert spool.previous is None
    spool.close()
    assert Spool(spool._folder).previous == (0, 20)


class Broken(Disk):
    """A disk on which some calls fail, after a part of what is to be written."""

    def __init__(self) -> None:
        self.failing: set[str] = set()

    def _fail(self, call: str) -> None:
        if call in self.failing:
            raise OSError(errno.EROFS, "Read-only file system")

    def write(self, handle: int, data: bytes) -> int:
        if "write" in self.failing:
            super().write(handle, data[: len(data) // 2])
        self._fail("write")
        if len(data) > 50:
            self._fail("write of frames")
        return super().write(handle, data)

    def read(self, path: Path) -> bytes:
        self._fail("read")
        return super().read(path)

    def truncate(self, file: int | Path, size: int) -> None:
        self._fail("truncate")
        super().truncate(file, size)

    def remove(self, path: Path) -> None:
        self._fail("remove")
        super().remove(path)


@pytest.fixture
def broken(tmp_path: Path):
    disk = Broken()
    spool = Spool(tmp_path, most_bytes=4096, disk=disk)
    for _ in range(20):
        assert spool.append(lambda boot, seq: f"{boot}/{seq}/".encode().ljust(100, b"."))
    return spool, disk


def test_a_disk_that_becomes_read_only_does_not_end_the_box(broken) -> None:
    spool, disk = broken
    disk.failing = {"write", "truncate", "remove"}
    spool.acknowledge(0, 9)
    assert [seq for _, seq in held(spool)] == list(range(10, 20))
    for _ in range(3):
        assert not spool.append(lambda *_: b"x")
    disk.failing = set()
    assert spool.append(lambda *_: b"x")
    assert held(spool)[-1] == (0, 23)
    spool.acknowledge(0, 19)
    assert spool.boots == {0: 23}, "frames that were never written are not held"


def test_what_a_torn_write_left_hides_no_frame(broken, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second attempt writes to a file of the same name."""
    spool, disk = broken
    disk.failing = {"write", "truncate"}
    assert not spool.append(lambda *_: b"x" * 100)

    def recovers(_path: Path) -> None:
        disk.failing = set()
        raise OSError(errno.EROFS, "Read-only file system")

    disk.failing = {"write", "truncate"}
    monkeypatch.setattr(disk, "remove", recovers)
    assert spool.append(lambda *_: b"y" * 100)
    assert held(spool)[-1] == (0, 21)


def test_frames_that_cannot_be_read_wait(broken) -> None:
    spool, disk = broken
    disk.failing = {"read"}
    assert held(spool) == []
    assert spool.last_frame() is None
    disk.failing = set()
    assert len(held(spool)) == 20
