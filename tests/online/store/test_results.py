from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import ParameterError
from sprung.online.store import BaselineRow, Cursor, Entry, Progress, Snapshot, StoredFrame, StoreError
from sprung.online.store.schema import Packed

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=20,
)
documents = st.dictionaries(st.text(max_size=9), values, max_size=4)

PROGRESS = Progress(
    "zafira",
    7,
    done_seq=3,
    delete_through_seq=1,
    observations=((0, 100, {"level": 0.5}), (1, 200, {"level": 0.25})),
    modes=((0, 100, {"bounce": 1.52}),),
    findings=((1, 200, {"what": "spring"}), (1, 200, {"what": "tyre"})),
    baselines=((1, 200, "first learning", {"mean": [0.0, None]}),),
    snapshot=b"\x00state",
)


@pytest.fixture
def filled(store):
    """A store with five frames."""
    store.inbox.add_frames([StoredFrame("zafira", 7, seq, seq, b"x") for seq in range(5)], now=0)
    return store


def everything(store):
    return (
        store.results.observations("zafira"),
        store.results.modes("zafira"),
        store.results.findings("zafira"),
        store.results.baselines("zafira"),
        store.results.snapshot("zafira"),
        store.inbox.cursors(),
        store.inbox.pending("zafira", 7, after=-1, limit=10),
    )


def test_progress_is_stored(filled) -> None:
    filled.results.commit(PROGRESS)
    assert everything(filled) == (
        [Entry("zafira", 7, 0, 100, {"level": 0.5}), Entry("zafira", 7, 1, 200, {"level": 0.25})],
        [Entry("zafira", 7, 0, 100, {"bounce": 1.52})],
        [Entry("zafira", 7, 1, 200, {"what": "spring"}), Entry("zafira", 7, 1, 200, {"what": "tyre"})],
        [BaselineRow("zafira", 1, 200, "first learning", {"mean": [0.0, None]})],
        Snapshot("zafira", 7, 3, b"\x00state"),
        {("zafira", 7): Cursor(contiguous=4, done=3, lost=0)},
        [StoredFrame("zafira", 7, seq, seq, b"x") for seq in (2, 3, 4)],
    )


def test_same_progress_again_changes_nothing(filled) -> None:
    filled.results.commit(PROGRESS)
    once = everything(filled)
    filled.results.commit(PROGRESS)
    assert everything(filled) == once
    filled.results.commit(Progress("zafira", 7, done_seq=4, observations=((2, 300, {}),), snapshot=b"later"))
    later = everything(filled)
    filled.results.commit(PROGRESS)
    assert everything(filled) == later
    assert filled.results.snapshot("zafira") == Snapshot("zafira", 7, 4, b"later")


def test_progress_is_stored_as_a_whole_or_not_at_all(filled) -> None:
    before = everything(filled)
    with pytest.raises(StoreError, match=r"the store cannot hold this: Out of range float values"):
        filled.results.commit(replace(PROGRESS, baselines=((1, 200, "", {"mean": float("nan")}),)))
    assert everything(filled) == before


def test_frames_worked_up_and_deleted_do_not_come_back(filled) -> None:
    filled.results.commit(PROGRESS)
    assert filled.inbox.add_frames([StoredFrame("zafira", 7, 0, 0, b"x")], now=9) == {("zafira", 7): 4}
    assert [frame.seq for frame in filled.inbox.pending("zafira", 7, after=-1, limit=10)] == [2, 3, 4]


def test_progress_beyond_the_frames_is_refused(filled) -> None:
    with pytest.raises(ParameterError, match=r"done_seq=5 .* must be at most 4, up to where its frames are complete"):
        filled.results.commit(Progress("zafira", 7, done_seq=5))
    with pytest.raises(ParameterError, match="must be at most -1"):
        filled.results.commit(Progress("other", 0, done_seq=0))
    with pytest.raises(ParameterError, match="delete_through_seq=3 is beyond done_seq=2"):
        Progress("zafira", 7, done_seq=2, delete_through_seq=3)


def test_snapshot_of_a_new_boot_replaces_the_old(filled) -> None:
    filled.results.commit(PROGRESS)
    filled.inbox.add_frames([StoredFrame("zafira", 2, 0, 0, b"")], now=0)
    filled.results.commit(Progress("zafira", 2, done_seq=0, snapshot=b"new"))
    assert filled.results.snapshot("zafira") == Snapshot("zafira", 2, 0, b"new")
    assert filled.results.snapshot("other") is None


def test_entries_are_read_since_a_time_and_the_last_of_them(filled) -> None:
    windows = tuple((number, 100 * number, {"n": number}) for number in range(10))
    filled.results.commit(Progress("zafira", 7, done_seq=0, observations=windows, modes=windows[::-1]))
    assert [entry.number for entry in filled.results.observations("zafira", limit=3)] == [7, 8, 9]
    assert [entry.number for entry in filled.results.modes("zafira", since=800)] == [8, 9]
    assert [entry.number for entry in filled.results.modes("zafira", since=300, limit=2)] == [8, 9]
    assert filled.results.observations("other") == []


def test_old_results_are_deleted(filled) -> None:
    filled.results.commit(PROGRESS)
    done, still_open = (filled.requests.add_command("eve", "zafira", "learn", now=k) for k in range(2))
    filled.requests.command_done(done, 150)
    assert filled.delete_older(200) == 5
    assert [entry.number for entry in filled.results.observations("zafira")] == [1]
    assert filled.results.modes("zafira") == []
    assert len(filled.results.findings("zafira")) == 2
    assert len(filled.results.baselines("zafira")) == 1
    assert [command.id for command in filled.requests.open_commands()] == [still_open]
    assert filled.delete_older(200) == 0


def test_results_of_an_old_recording_stay_as_long_as_others(filled) -> None:
    filled.results.commit(replace(PROGRESS, now=1000))
    assert filled.delete_older(1000) == 0
    assert filled.results.n_observations("zafira") == len(filled.results.observations("zafira")) == 2
    assert filled.delete_older(1001) == 5


def test_the_last_status_of_a_vehicle_is_kept(filled) -> None:
    assert filled.results.status("zafira") is None
    for n_learnt in (1, 2):
        filled.results.commit(replace(PROGRESS, status={"n_learnt": n_learnt}))
    assert filled.results.status("zafira") == {"n_learnt": 2}


def test_documents_of_later_programs_are_refused(store) -> None:
    from sqlalchemy import text

    store.results.commit(Progress("zafira", 7, done_seq=-1, modes=((0, 100, {"modes": []}),)))
    with store.writing() as connection:
        connection.execute(text("UPDATE modes SET document = :later"), {"later": b"\x09later"})
    with pytest.raises(StoreError, match="install the newer sprung that wrote it"):
        store.results.modes("zafira")


@settings(max_examples=50)
@given(documents)
def test_packed_documents_come_back(document) -> None:
    packed = Packed()
    assert packed.process_result_value(packed.process_bind_param(document, None), None) == document


def test_documents_of_a_vehicle_take_little() -> None:
    """Three modes at four channels, with six digits."""
    shape = {"real": [0.948875, 1.0, 0.190684, 0.241913], "imag": [-0.00452708, 0.0, -0.572947, -0.568215]}
    mode = {
        "natural_frequency": 1.58405,
        "natural_frequency_std": 0.0286296,
        "damping_ratio": 0.170005,
        "damping_ratio_std": 0.0187829,
        "mode_shape": shape,
        "mode_shape_std": None,
        "mpc": 0.29394,
        "label": "bounce",
        "stable_rate": 0.6,
    }
    assert len(Packed().process_bind_param({"modes": [mode], "reason": ""}, None) or b"") < 100


def test_one_window_is_found_with_its_findings_and_the_next(filled) -> None:
    filled.results.commit(PROGRESS)
    results = filled.results
    assert results.observation("zafira", 7, 1) == Entry("zafira", 7, 1, 200, {"level": 0.25})
    assert results.observation("zafira", 8, 1) is None
    assert [entry.document["what"] for entry in results.findings_of("zafira", 7, 1)] == ["spring", "tyre"]
    assert results.findings_of("zafira", 7, 0) == []
    assert results.first_observation("zafira", after=100) == Entry("zafira", 7, 1, 200, {"level": 0.25})
    assert results.first_observation("zafira", after=200) is None
    assert results.first_observation("other", after=0) is None


def test_last_modes_of_each_window(filled) -> None:
    """Three identifications of one window, one of the next, and one of the next boot."""
    modes = tuple((k, 100 if k < 3 else 200, {"k": k}) for k in range(4))
    filled.results.commit(replace(PROGRESS, modes=modes))
    filled.results.commit(Progress("zafira", 9, done_seq=-1, modes=((0, 300, {"k": 9}),)))
    last = filled.results.last_modes
    assert [entry.document["k"] for entry in last("zafira")] == [2, 3, 9]
    assert [entry.document["k"] for entry in last("zafira", limit=2)] == [3, 9]
    assert [entry.document["k"] for entry in last("zafira", since=200, until=200)] == [3]
    assert last("other") == []
