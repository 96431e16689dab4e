"""The spool: nothing that was kept is lost before it is acknowledged, and never too many bytes."""

from pathlib import Path

import pytest

from sprung.link import Key, Spool, SpoolError, message
from sprung.link.spool import _record


def filled(folder, count, *, max_bytes=1 << 20, size=100):
    spool = Spool(folder, max_bytes=max_bytes)
    for _ in range(count):
        spool.append(lambda boot, seq: f"{boot}/{seq}/".encode().ljust(size, b"."))
    return spool


def held(spool):
    return [(boot, seq) for boot, seq, _ in spool.frames()]


def test_a_spool_belongs_to_one_box(tmp_path: Path) -> None:
    first = filled(tmp_path, 3)
    with pytest.raises(SpoolError, match="in use by another box"):
        Spool(tmp_path)
    first.close()
    assert Spool(tmp_path).boot == 1


def test_oldest_go_first_and_are_counted(tmp_path: Path) -> None:
    spool = filled(tmp_path, 400, max_bytes=16_384)
    assert spool.n_bytes <= 16_384
    kept = [seq for _, seq in held(spool)]
    assert kept == list(range(kept[0], 400))
    assert spool.dropped == kept[0] > 200
    assert spool.boots == {0: kept[0]}


def test_a_flipped_bit_hides_no_other_file(tmp_path: Path) -> None:
    filled(tmp_path, 200, max_bytes=65_536).close()
    first = sorted(tmp_path.glob("*.spool"))[0]
    data = bytearray(first.read_bytes())
    data[150] ^= 1
    first.write_bytes(data)
    found = held(Spool(tmp_path, max_bytes=65_536))
    assert found[0] == (0, 0)
    assert found[-1] == (0, 199)
    assert len(found) > 160


def test_a_new_disk_counts_on_from_the_time(tmp_path: Path) -> None:
    first = Spool(tmp_path / "a", boot_from=1_700_000_000)
    assert first.boot == 1_700_000_000
    first.close()
    assert Spool(tmp_path / "a", boot_from=5).boot == 1_700_000_001


def frame(boot, seq):
    """A message of one second, as far as a spool reads it."""
    start = 10**18 + seq * 10**9
    return message({Key.BOOT: boot, Key.SEQ: seq, Key.START: start, Key.INTERVAL: 10**7, Key.N_SAMPLES: 100})


def lossy(folder, count):
    """A spool of a few kB, in which frames of a second were put."""
    spool = Spool(folder, max_bytes=8192)
    for _ in range(count):
        spool.append(frame)
    return spool


def test_a_frame_in_two_files_is_lost_once(tmp_path: Path) -> None:
    """Its record could neither be synced nor cut off, and was written into the next file once more."""
    lossy(tmp_path, 60).close()
    first, second = sorted(tmp_path.glob("*.spool"))[:2]
    begin = int(second.stem.split("-")[1], 16)
    with first.open("ab") as file:
        file.write(_record(0, begin, frame(0, begin)))
    again = Spool(tmp_path, max_bytes=8192)
    assert [seq for _, seq in held(again)].count(begin) == 2
    while [seq for boot, seq in held(again) if boot == 0][:1] <= [begin]:
        again.append(frame)
    (loss,) = again.losses
    assert loss.n_frames == loss.last - loss.first + 1
    assert loss.last >= begin


def test_losses_of_several_starts_are_kept_apart(tmp_path: Path) -> None:
    lossy(tmp_path, 300).close()
    again = lossy(tmp_path, 300)
    kept = len(held(again))
    first, second = again.losses
    assert (first.boot, first.first, first.last, first.n_frames) == (0, 0, 299, 300)
    assert (second.boot, second.n_frames) == (1, 300 - kept)


@pytest.mark.parametrize("content", ["", "0", "a b c d e f", "1 2 3 4 5 6 7", "\0"])
def test_a_damaged_list_of_losses_keeps_no_box_from_starting(tmp_path: Path, content) -> None:
    lossy(tmp_path, 3).close()
    (tmp_path / "losses").write_text(content, encoding="ascii")
    assert Spool(tmp_path).losses == ()


def test_ends_of_earlier_boots_outlast_their_frames(tmp_path: Path) -> None:
    """The monitor may have frames of later boots, which wait for those that the box has no more."""
    for count in (2, 1, 3, 0):
        filled(tmp_path, count).close()
    for path in tmp_path.glob("*.spool"):
        path.unlink()
    assert Spool(tmp_path).boots == {0: 2, 1: 1, 2: 3, 4: 0}


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
