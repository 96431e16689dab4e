"""Windows of frames: those that the monitor analyses, whatever the order of arrival and the division into batches."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import FormatError
from sprung.fleet.lake import recording_of, window_of_recording
from sprung.link import Frame, Key, decode, encode, frame_block, message, quantised
from sprung.link import windows as link_windows
from sprung.link.windows import FrameInbox, WindowAssembly
from sprung.online.monitor import MonitorSettings, Observed, VehicleMonitor
from sprung.vehicles import read_vehicle

CAR, RATE, DURATION = "car-1", 20, 60.0
START = 1_767_225_600 * 10**9  # 2026-01-01
SCALE = np.array([0.001, 0.002])


@dataclass
class Messages:
    """A list of messages in memory."""

    held: list[bytes] = field(default_factory=list)

    def get(self) -> list[bytes]:
        return list(self.held)

    def put(self, messages: list[bytes]) -> None:
        self.held = list(messages)

    def append(self, messages: list[bytes]) -> None:
        self.held += messages


@dataclass
class Kept:
    """What is kept for a vehicle, in memory."""

    window: Messages = field(default_factory=Messages)
    waiting: Messages = field(default_factory=Messages)
    progress: str = ""

    def get_progress(self) -> str:
        return self.progress

    def put_progress(self, progress: str) -> None:
        self.progress = progress


def frame(boot, seq, *, start, n_samples=100, previous=None, names=("acc_fl", "acc_fr"), vehicle=CAR, noise=True):
    rng = np.random.default_rng([boot, seq])
    samples = rng.normal(size=(len(names), n_samples)) if noise else np.zeros((len(names), n_samples))
    counts, scale, flags = quantised(samples, scale=np.resize(SCALE, len(names)))
    return encode(
        Frame(
            vehicle=vehicle,
            boot=boot,
            seq=seq,
            start=start,
            interval=10**9 // RATE,
            channels=tuple(names),
            scale=scale,
            counts=counts,
            flags=flags,
            previous=previous,
        )
    )


def drive():
    """Return frames of three boots in order: 5 s each, a gap at each boot, other channels in the last one."""
    frames, start = [], START
    for boot, (count, names) in enumerate(
        [(9, ("acc_fl", "acc_fr")), (30, ("acc_fl", "acc_fr")), (14, ("acc_fl", "acc_fr", "acc_rl"))]
    ):
        previous = None if boot == 0 else (boot - 1, (9, 30)[boot - 1])
        for seq in range(count):
            frames.append(frame(boot, seq, start=start, previous=previous, names=names))
            start += 5 * 10**9
        start += 40 * 10**9
    return frames


def seen_by_monitor(frames):
    """Return the windows that the monitor analyses of frames in order."""
    monitor = VehicleMonitor(read_vehicle("zafira"), settings=MonitorSettings(window=DURATION, identify_every=0))
    events = [event for payload in frames for event in monitor.update(frame_block(decode(payload), {}))]
    return [digest(event.recording) for event in events if isinstance(event, Observed)]


def digests(batches, kept=None):
    """Return the digests of the windows of batches, each with an assembly of its own as after a restart."""
    kept = kept or Kept()
    windows = (window for batch in batches for window in WindowAssembly(CAR, kept, duration=DURATION).update(batch))
    return [digest(window) for window in windows]


def digest(recording):
    """Return the digest of a window as a row of a lake."""
    return window_of_recording(CAR, recording).row["digest"]


@pytest.fixture(scope="module")
def expected():
    windows = seen_by_monitor(drive())
    assert len(windows) == 4
    return windows


class TestWindowAssembly:
    def test_windows_are_those_of_the_monitor(self, expected):
        assert digests([drive()]) == expected
        assert digests([[payload] for payload in drive()]) == expected

    @pytest.mark.slow
    @settings(max_examples=25, deadline=None)
    @given(data=st.data())
    def test_order_duplicates_and_batches_do_not_matter(self, expected, data):
        frames = drive()
        twice = data.draw(st.lists(st.sampled_from(frames), max_size=20))
        arriving = data.draw(st.permutations([*frames, *twice]))
        cuts = sorted(data.draw(st.lists(st.integers(0, len(arriving)), max_size=4)))
        bounds = [0, *cuts, len(arriving)]
        kept = Kept()
        batches = [arriving[first:last] for first, last in pairwise(bounds)]
        assert digests(batches, kept) == expected
        assert kept.waiting.get() == []
        assert digests([arriving], kept) == []

    def test_a_window_is_a_row_of_a_lake_with_its_gaps(self):
        window, *_ = WindowAssembly(CAR, Kept(), duration=DURATION).update(drive())
        recording = recording_of(window_of_recording(CAR, window).row)
        assert (recording.start, recording.n_samples, recording.sampling_rate) == (START, 1200, RATE)
        assert [(gap.index, gap.duration) for gap in recording.gaps] == [(900, pytest.approx(40.0))]
        first = decode(drive()[0])
        np.testing.assert_allclose(recording.samples[:, :100], first.samples, rtol=1e-9)

    def test_frames_longer_than_a_window_are_divided_as_by_the_monitor(self):
        frames = [frame(0, seq, start=START + seq * 170 * 10**9, n_samples=170 * RATE) for seq in range(3)]
        assert len(seen_by_monitor(frames)) == 8
        assert digests([frames]) == digests([[payload] for payload in frames]) == seen_by_monitor(frames)

    def test_a_recording_that_is_replayed_does_not_count_again(self):
        frames = [frame(1, seq, start=START + seq * 5 * 10**9) for seq in range(30)]
        replayed = [encode(replace(decode(payload), boot=7, seq=seq)) for seq, payload in enumerate(frames)]
        assert len(digests([frames])) == 2
        assert digests([frames, replayed]) == digests([frames]) == seen_by_monitor([*frames, *replayed])

    def test_what_is_kept_is_one_window(self):
        kept = Kept()
        sizes = []
        for payload in drive()[:39]:
            list(WindowAssembly(CAR, kept, duration=DURATION).update([payload]))
            sizes.append(len(kept.window.get()))
        assert max(sizes) == 11
        assert len(kept.progress) < 1000

    def test_invalid_messages_are_counted_and_the_others_analysed(self, expected):
        frames = drive()
        strange = [
            b"",
            frames[3][:-1],
            frame(0, 3, start=START, vehicle="another"),
            message({0: 1, "boots": 3, "lost": 1}),
        ]
        assembly = WindowAssembly(CAR, Kept(), duration=DURATION)
        assert [digest(window) for window in assembly.update([*strange, *frames])] == expected
        assert assembly.refused.total() == len(strange)

    def test_a_window_that_is_too_large_is_refused(self):
        names = tuple(f"c{k}" for k in range(200))
        assembly = WindowAssembly(CAR, Kept(), duration=9_000.0)
        assert list(assembly.update([frame(0, 0, start=START, names=names, n_samples=20)])) == []
        assert "too large" in next(iter(assembly.refused))


class TestFrameInbox:
    @staticmethod
    def taken(order):
        return [(decode(payload).boot, decode(payload).seq) for payload in order.ready()]

    def test_frames_wait_for_earlier_ones_and_boots_for_the_previous_boot(self):
        frames = drive()
        order = FrameInbox(CAR)
        for payload in frames[1:]:
            order.add(payload)
        assert self.taken(order) == []
        order = FrameInbox(CAR, order.waiting, order.state)
        order.add(frames[0])
        assert self.taken(order) == [(boot, seq) for boot, count in enumerate((9, 30, 14)) for seq in range(count)]

    def test_frames_stated_as_lost_are_not_waited_for(self):
        order = FrameInbox(CAR)
        for seq in (0, 1, 5, 6):
            order.add(frame(3, seq, start=START + seq))
        order.add(frame(4, 0, start=START + 9, previous=(3, 8)))
        assert self.taken(order) == [(3, 0), (3, 1)]
        order.add(message({Key.VERSION: 1, "boots": [], "lost": [[3, 2, 4, 3, 0, 0]]}))
        order = FrameInbox(CAR, order.waiting, order.state)
        assert self.taken(order) == [(3, 5), (3, 6)]
        order.add(message({Key.VERSION: 1, "boots": [], "lost": [[3, 7, 7, 1, 0, 0]]}))
        assert self.taken(order) == [(4, 0)]
        assert order.state["lost"] == []
        order.add(frame(3, 4, start=START))
        assert self.taken(order) == []

    def test_a_gap_is_lost_when_many_frames_wait_behind_it(self, monkeypatch):
        monkeypatch.setattr(link_windows, "MAX_WAITING", 10)
        order = FrameInbox(CAR)
        for seq in range(100, 110):
            order.add(frame(2, seq, start=START + seq, n_samples=2))
        assert self.taken(order) == []
        order.add(frame(2, 110, start=START + 110, n_samples=2))
        assert self.taken(order) == [(2, seq) for seq in range(100, 111)]
        for seq in range(11):
            order.add(frame(3, seq, start=START + seq, n_samples=2, previous=(2, 500)))
        assert self.taken(order) == [(3, seq) for seq in range(11)]

    def test_boots_long_ago_are_forgotten_and_stay_analysed(self, monkeypatch):
        monkeypatch.setattr(link_windows, "MAX_BOOTS", 3)
        order = FrameInbox(CAR)
        for boot in range(6):
            order.add(frame(boot, 0, start=START + boot, n_samples=2))
        assert len(self.taken(order)) == 6
        assert len(order.state["done"]) == 3
        order.add(frame(1, 0, start=START + 1, n_samples=2))
        order.add(frame(6, 0, start=START + 7, n_samples=2, previous=(2, 1)))
        assert self.taken(order) == [(6, 0)]

    def test_reports_of_on_board_identification_keep_their_place(self):
        order = FrameInbox(CAR)
        order.add(frame(0, 0, start=START))
        order.add(frame(0, 2, start=START))
        order.add(message({Key.VERSION: 1, Key.VEHICLE: CAR, Key.KIND: "corr", Key.BOOT: 0, Key.SEQ: 1, Key.START: 1}))
        order.add(message({Key.VERSION: 1, "description": "of another topic"}))
        assert self.taken(order) == [(0, 0), (0, 2)]
        with pytest.raises(FormatError, match="another"):
            order.add(
                message(
                    {Key.VERSION: 1, Key.VEHICLE: "another", Key.KIND: "modes", Key.BOOT: 0, Key.SEQ: 3, Key.START: 1}
                )
            )
