"""The spool of a box: frames on disk until the monitor has them, in bounded space."""

import fcntl
import os
import shutil
import struct
import zlib
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from sprung._checks import check_number
from sprung.errors import SprungError
from sprung.link.messages import Loss, loss_of

_HEADER = struct.Struct("<2sQQI")
_MARK = b"sp"
_SUFFIX = ".spool"
#: File of the text that is remembered.
_TEXT = "remembered"
#: Smallest number of files of a full spool, of which the oldest is dropped for new ones.
_FILES = 16
#: Largest file [bytes].
_LARGEST = 1 << 20
#: Number of earlier boots whose ends are declared although nothing of them may be left.
_MAX_ENDS = 16


class Disk:
    """System calls of a spool, one in each method, which tests replace; every method raises OSError where it fails."""

    def make_folder(self, folder: Path) -> None:
        """Create a folder for this user alone where it is missing, with its parents."""
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)

    def lock(self, path: Path) -> int | None:
        """Return a file that is locked by this process until it closes it or ends; None if another one holds it."""
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            return None
        return handle

    def names(self, folder: Path) -> list[str]:
        """Return the names of the files in a folder, sorted."""
        return sorted(os.listdir(folder))

    def read(self, path: Path) -> bytes:
        """Return the content of a file."""
        return path.read_bytes()

    def open(self, path: Path) -> int:
        """Return a file to append to, created if it is missing."""
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def write(self, handle: int, data: bytes) -> int:
        """Append data to an open file, and return how many bytes of it were taken."""
        return os.write(handle, data)

    def sync(self, handle: int) -> None:
        """Wait until the data of an open file are on the disk."""
        os.fdatasync(handle)

    def sync_folder(self, folder: Path) -> None:
        """Wait until the names of the files in a folder are on the disk."""
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    def truncate(self, file: int | Path, size: int) -> None:
        """Cut a file to a size [bytes]."""
        os.truncate(file, size)

    def close(self, handle: int) -> None:
        """Close a file."""
        os.close(handle)

    def rename(self, old: Path, new: Path) -> None:
        """Give a file another name, which replaces the file that had it."""
        old.rename(new)

    def remove(self, path: Path) -> None:
        """Remove a file, if it is there."""
        path.unlink(missing_ok=True)

    def free(self, folder: Path) -> int:
        """Return the free space on the disk of a folder [bytes]."""
        return shutil.disk_usage(folder).free


class SpoolError(SprungError):
    """A spool that cannot be written."""


@dataclass(slots=True)
class _File:
    """A file of records of one boot, with the first and last sequence number in it."""

    path: Path
    boot: int
    first: int
    last: int
    size: int


class Spool:
    """Frames on disk until they are acknowledged; the oldest are dropped when space runs out.

    Parameters
    ----------
    folder
        Folder of this spool alone; created if missing.
    max_bytes
        Largest size [bytes].
    is_synced
        Whether each append reaches the disk before it returns.
    boot_from
        Lowest number of this boot, such as the time in seconds, so that numbers still rise on a new disk.
    disk
        Disk of the folder; None: that of this machine.

    Raises
    ------
    ParameterError
        If the size is out of range.
    SpoolError
        If the folder cannot be used, or another box uses it.

    Notes
    -----
    A file of records: mark, boot, sequence number, length, payload, CRC-32 of all of that. An incomplete end is
    cut off when the spool is opened.
    """

    def __init__(
        self,
        folder: Path,
        *,
        max_bytes: int = 1 << 28,
        is_synced: bool = True,
        boot_from: int = 0,
        disk: Disk | None = None,
    ) -> None:
        check_number("max_bytes", max_bytes, at_least=4096)
        self._folder = folder
        self._disk = disk or Disk()
        self._most = int(max_bytes)
        self._is_synced = is_synced
        self._dropped = 0
        self._acknowledged: dict[int, int] = {}
        self._losses: dict[int, Loss] = {}
        self._handle: int | None = None
        try:
            self._disk.make_folder(folder)
            self._lock = self._locked()
            names = [name for name in self._disk.names(folder) if name.endswith(_SUFFIX)]
            self._files = [found for name in names if (found := self._scanned(folder / name)) is not None]
            self._losses = self._losses_before()
            last, self._ends = self._boots_before()
            self._boot = max(last + 1, int(boot_from))
            self._write_boot()
            self._lose_vanished()
        except OSError as error:
            raise SpoolError(f"the spool {folder} cannot be used ({error.strerror}): give another folder") from None
        self._seq = 0
        self._remembered = ""
        with suppress(OSError, ValueError):
            self._remembered = self._disk.read(folder / _TEXT).decode()

    @property
    def remembered(self) -> str:
        """Text that was remembered last, by this start of the box or an earlier one; empty if there is none."""
        return self._remembered

    @property
    def boot(self) -> int:
        """Number of this start of the box, higher than all before."""
        return self._boot

    @property
    def previous(self) -> tuple[int, int] | None:
        """Number of the last earlier boot with frames, and number of its frames; None if there is none."""
        return max(((boot, end) for boot, end in self._ends.items() if boot < self._boot), default=None)

    @property
    def next_seq(self) -> int:
        """Sequence number of the next frame."""
        return self._seq

    @property
    def dropped(self) -> int:
        """Number of frames dropped since this start, as there was no space or the disk failed."""
        return self._dropped

    @property
    def losses(self) -> tuple[Loss, ...]:
        """Frames dropped since this start, and earlier ones unknown to the monitor, by rising boot."""
        return tuple(loss for _, loss in sorted(self._losses.items()))

    @property
    def unreported_losses(self) -> tuple[Loss, ...]:
        """Those of `losses` beyond which the monitor has acknowledged nothing; they outlast a restart."""
        return tuple(loss for loss in self.losses if self._acknowledged.get(loss.boot, -1) < loss.last)

    @property
    def n_bytes(self) -> int:
        """Size on disk [bytes]."""
        return sum(file.size for file in self._files)

    @property
    def free(self) -> int:
        """Free space on the disk of the spool [bytes]."""
        return self._disk.free(self._folder)

    @property
    def boots(self) -> dict[int, int]:
        """First sequence number of every boot that is still held or expected."""
        known = self._acknowledged
        held = {
            file.boot: max(file.first, known.get(file.boot, -1) + 1)
            for file in reversed(self._files)
            if file.last > known.get(file.boot, -1)
        }
        beyond = {loss.boot: max(loss.last + 1, self._ends.get(loss.boot, 0)) for loss in self.losses}
        ends = _last_ends(self._ends, min(held, default=self._boot))
        return {**ends, **beyond, self._boot: self._seq, **held}

    def last_frame(self) -> bytes | None:
        """Return the payload of the newest frame, of this boot or an earlier one; None if the spool is empty."""
        newest = deque(self._records(self._files[-1].path), maxlen=1) if self._files else ()
        return next((payload for _, _, payload in newest), None)

    def append(self, encoded: Callable[[int, int], bytes]) -> bool:
        """Keep the next frame.

        Parameters
        ----------
        encoded
            Function that returns the payload for a boot and a sequence number.

        Returns
        -------
        bool
            Whether it was kept; one that cannot be written counts as dropped.
        """
        payload = encoded(self._boot, self._seq)
        record = _record(self._boot, self._seq, payload)
        self._seq += 1
        while self._files and self.n_bytes + len(record) > self._most:
            self._drop_oldest()
        for _ in range(2):
            try:
                self._write(record)
            except OSError:
                self._close()
                if not self._files:
                    break
                self._drop_oldest()
            else:
                return True
        self._dropped += 1
        self._lose(loss_of(self._boot, self._seq - 1, self._seq - 1, [payload]))
        return False

    def remember(self, text: str) -> None:
        """Keep a text about the frames across restarts; on a disk that fails the one before is kept."""
        if text != self._remembered:
            with suppress(OSError):
                self._write_whole(_TEXT, text)
                self._remembered = text

    def acknowledge(self, boot: int, seq: int) -> None:
        """Forget the frames of a boot up to a sequence number."""
        was_unreported = boot in (loss.boot for loss in self.unreported_losses)
        self._acknowledged[boot] = max(seq, self._acknowledged.get(boot, -1))
        if was_unreported:
            self._write_losses()
        # The newest file stays: after a restart it shows where the boot before ended.
        for done in [file for file in self._files[:-1] if file.boot == boot and file.last <= seq]:
            self._remove(done)

    def frames(self, *, boot: int = 0, after: int = -1) -> Iterator[tuple[int, int, bytes]]:
        """Yield boot, sequence number and payload of unacknowledged frames, in order, after a given one."""
        for file in list(self._files):
            if file.last <= self._acknowledged.get(file.boot, -1) or (file.boot, file.last) <= (boot, after):
                continue
            for frame_boot, seq, payload in self._records(file.path):
                if (frame_boot, seq) > (boot, after) and seq > self._acknowledged.get(frame_boot, -1):
                    yield frame_boot, seq, payload

    def close(self) -> None:
        """Close the file that is written, and release the spool."""
        self._close()
        if self._lock >= 0:
            self._disk.close(self._lock)
            self._lock = -1

    def _write(self, record: bytes) -> None:
        """Append a record to the newest file, or begin one."""
        newest = self._files[-1] if self._files else None
        if self._handle is None or newest is None or newest.size + len(record) > min(self._most // _FILES, _LARGEST):
            self._close()
            path = self._folder / f"{self._boot:016x}-{self._seq - 1:016x}{_SUFFIX}"
            self._handle = self._disk.open(path)
            self._disk.truncate(self._handle, 0)  # an attempt that failed may have left something in it
            newest = _File(path, self._boot, self._seq - 1, self._seq - 1, 0)
            self._files.append(newest)
        written = 0
        try:
            while written < len(record):
                written += self._disk.write(self._handle, record[written:])
            if self._is_synced:
                self._disk.sync(self._handle)
                if newest.size == 0:
                    self._disk.sync_folder(self._folder)  # the name of a new file is not on the disk otherwise
        except OSError:
            # A torn record would hide all that follow it; if it stays, the next one goes into a new file.
            with suppress(OSError):
                self._disk.truncate(self._handle, newest.size)
            if newest.size == 0:
                self._remove(newest)
            raise
        newest.last = self._seq - 1
        newest.size += len(record)

    def _drop_oldest(self) -> None:
        """Remove the oldest file and count what was not acknowledged in it."""
        oldest, following = self._files[0], self._files[1:2]
        first = max(oldest.first, self._acknowledged.get(oldest.boot, -1) + 1)
        # A last frame that could neither be synced nor cut off is in the next file once more.
        last = min([oldest.last, *(file.first - 1 for file in following if file.boot == oldest.boot)])
        if first <= last:
            self._dropped += last - first + 1
            payloads = (payload for _, seq, payload in self._records(oldest.path) if first <= seq <= last)
            self._lose(loss_of(oldest.boot, first, last, payloads))
        self._remove(oldest)
        if first <= last:
            self._write_losses()  # again, as there may have been no space for it before

        if not self._files:  # no file shows any more how many frames its boot had
            self._ends[oldest.boot] = oldest.last + 1
            with suppress(OSError):
                self._write_boot()

    def _lose(self, loss: Loss) -> None:
        """Remember dropped frames."""
        known = self._losses.get(loss.boot)
        self._losses[loss.boot] = loss if known is None else known.joined(loss)
        self._write_losses()

    def _write_losses(self) -> None:
        """Write the losses unknown to the monitor; on a disk that fails they are remembered until the end."""
        lines = [" ".join(map(str, loss)) for loss in self.unreported_losses]
        with suppress(OSError):
            self._write_whole("losses", "\n".join(lines))

    def _losses_before(self) -> dict[int, Loss]:
        """Return the losses of earlier starts, without frames that a crash kept from being dropped."""
        losses = {}
        with suppress(OSError, ValueError, TypeError):
            for line in self._disk.read(self._folder / "losses").splitlines():
                loss = Loss(*map(int, line.split()))
                last = loss.last
                for file in reversed(self._files):
                    if file.boot == loss.boot and file.first <= last <= file.last:
                        last = file.first - 1
                if loss.first <= last:
                    n_kept = loss.last - last
                    losses[loss.boot] = loss._replace(last=last, n_frames=max(1, loss.n_frames - n_kept))
        return losses

    def _lose_vanished(self) -> None:
        """Remember the frames at the ends of boots that were there at an earlier start, and that the disk has lost."""
        for boot, last in {file.boot: file.last for file in self._files}.items():
            known = self._losses.get(boot)
            first = last + 1 if known is None else max(last, known.last) + 1
            if first < self._ends.get(boot, 0):
                self._lose(loss_of(boot, first, self._ends[boot] - 1, ()))

    def _remove(self, file: _File) -> None:
        """Remove a file; one that a failing disk keeps is sent again after the next start."""
        if file is self._files[-1]:
            self._close()
        self._files.remove(file)
        with suppress(OSError):
            self._disk.remove(file.path)

    def _close(self) -> None:
        """Close the newest file."""
        if self._handle is not None:
            self._disk.close(self._handle)
            self._handle = None

    def _boots_before(self) -> tuple[int, dict[int, int]]:
        """Return the number of the last boot, -1 for none, and how many frames the last ones with frames had."""
        numbers: list[int] = []
        with suppress(FileNotFoundError, ValueError):
            numbers = [int(word) for word in self._disk.read(self._folder / "boot").split()]
        ends = dict(zip(numbers[1::2], numbers[2::2], strict=False))
        for file in self._files:
            ends[file.boot] = max(file.last + 1, ends.get(file.boot, 0))
        last = max([*numbers[:1], *ends], default=-1)
        known = {boot: end for boot, end in ends.items() if boot in self._losses}
        return last, known | _last_ends(ends, min((file.boot for file in self._files), default=last))

    def _write_boot(self) -> None:
        """Write the number of this boot, and the ends of those before."""
        self._write_whole("boot", " ".join(map(str, (self._boot, *chain(*self._ends.items())))))

    def _write_whole(self, name: str, text: str) -> None:
        """Write a file of the folder as a whole, so that a crash leaves the old or the new one."""
        part = self._folder / f"{name}.part"
        self._disk.remove(part)
        handle = self._disk.open(part)
        try:
            content = text.encode()
            while content:
                content = content[self._disk.write(handle, content) :]
            self._disk.sync(handle)
        finally:
            self._disk.close(handle)
        self._disk.rename(part, self._folder / name)
        # A number that a power cut takes back would be given twice, and the monitor drops frames that it knows.
        self._disk.sync_folder(self._folder)

    def _locked(self) -> int:
        """Return a file that is locked by this process until it ends."""
        handle = self._disk.lock(self._folder / "lock")
        if handle is None:
            raise SpoolError(f"the spool {self._folder} is in use by another box: stop it, or give another folder")
        return handle

    def _scanned(self, path: Path) -> _File | None:
        """Return the contents of a file; one without an intact record is removed."""
        records = [(boot, seq, len(payload)) for boot, seq, payload in _intact(self._disk.read(path))]
        if not records:
            self._disk.remove(path)
            return None
        size = sum(_HEADER.size + 4 + length for _, _, length in records)
        self._disk.truncate(path, size)
        handle = self._disk.open(path)
        try:
            self._disk.sync(handle)  # a power cut must not take what is sent, and counted, from here on
        finally:
            self._disk.close(handle)
        return _File(path, records[0][0], records[0][1], records[-1][1], size)

    def _records(self, path: Path) -> Iterator[tuple[int, int, bytes]]:
        """Yield the intact records of a file, up to the first incomplete one; none while it cannot be read."""
        with suppress(OSError):
            yield from _intact(self._disk.read(path))


def _last_ends(ends: Mapping[int, int], oldest: int) -> dict[int, int]:
    """Return the ends of the last boots, and of all from the one before the oldest of which frames are held.

    The frames of a boot state the end of the one before, and the monitor waits for its frames: it must hear which of
    them are gone, however many boots ago that was.
    """
    boots = sorted(ends)
    first = min(bisect_left(boots, oldest) - 1, len(boots) - _MAX_ENDS)
    return {boot: ends[boot] for boot in boots[max(first, 0) :]}


def _record(boot: int, seq: int, payload: bytes) -> bytes:
    """Return a record of a file."""
    body = _HEADER.pack(_MARK, boot, seq, len(payload)) + payload
    return body + struct.pack("<I", zlib.crc32(body))


def _intact(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield the intact records of a file's content, up to the first incomplete one."""
    place = 0
    while place + _HEADER.size + 4 <= len(data):
        mark, boot, seq, length = _HEADER.unpack_from(data, place)
        end = place + _HEADER.size + length
        if mark != _MARK or end + 4 > len(data):
            return
        if struct.unpack_from("<I", data, end)[0] != zlib.crc32(data[place:end]):
            return
        yield boot, seq, data[place + _HEADER.size : end]
        place = end + 4
