"""What was quarantined: the list of it, and its analysis by the present program."""

import pytest

from sprung.errors import ParameterError
from sprung.online.monitor.operations import quarantine_document
from sprung.online.store import Progress, StoredFrame, open_store
from sprung.results.tables import quarantine_table

NOW = 1_795_219_200_000_000_000
WATCH = {"watch": {"learning_windows": 2, "window_minutes": 2, "identify_every_minutes": 1, "calibrate": False}}


def put_in_quarantine(store, parts, *, payloads=None):
    """Quarantine frames of a boot, each part for a reason."""
    last = max(last for _, last, _ in parts)
    frames = [StoredFrame("car-1", 2, seq, NOW + seq, payloads[seq] if payloads else b"xy") for seq in range(last + 1)]
    store.inbox.add_frames(frames, now=NOW)
    for now, (first, end, reason) in enumerate(parts):
        store.quarantine.put_frames("car-1", 2, first, end, reason=reason, now=NOW + now)


def test_frames_in_a_row_are_one_entry(store) -> None:
    assert quarantine_document(store) == {"schema": "sprung.quarantine/1", "quarantined": []}
    put_in_quarantine(store, [(1, 3, "it fails"), (4, 4, "no room"), (6, 6, "it fails")])
    store.results.commit(Progress("car-1", 2, done_seq=6, snapshot=b"state"))
    store.quarantine.put_state("car-1", reason="damaged", now=NOW)
    document = quarantine_document(store)
    keys = ("kind", "boot", "first", "last", "begin", "size", "reason", "again")
    assert [tuple(entry[key] for key in keys) for entry in document["quarantined"]] == [
        ("raw", 2, 1, 3, NOW + 1, 6, "it fails", None),
        ("raw", 2, 4, 4, NOW + 4, 2, "no room", None),
        ("raw", 2, 6, 6, NOW + 6, 2, "it fails", None),
        ("state", 2, 6, 6, NOW, 5, "damaged", None),
    ]
    places = ["frames 1 to 3 of boot 2", "frame 4 of boot 2", "frame 6 of boot 2", "state after frame 6 of boot 2"]
    assert [row[1] for row in quarantine_table(document).rows] == places
    assert quarantine_document(store, vehicle="car-1") == document


def test_an_unknown_vehicle_is_refused(store) -> None:
    with pytest.raises(ParameterError, match="unknown vehicle 'car-7': see the list of vehicles"):
        quarantine_document(store, vehicle="car-7")


def test_frames_without_a_description_cannot_be_analysed(store) -> None:
    put_in_quarantine(store, [(0, 0, "it fails")])
    (entry,) = quarantine_document(store, is_analysed=True)["quarantined"]
    assert entry["again"] == "cannot be analysed: the vehicle has sent no description"


@pytest.mark.slow
def test_frames_are_analysed_from_the_baseline_on_and_nothing_is_stored(bench, drive, frames_of, tmp_path) -> None:
    one = bench(tmp_path, **WATCH)
    one.describe()
    one.send(frames_of(drive(0))[:240])
    assert len(one.store.results.baselines("car-1")) == 1
    one.close()
    payloads = frames_of(drive(0, "front_left.spring=-0.5"), boot=2)
    payloads[300] = b"no frame"
    with open_store(f"sqlite:///{tmp_path}/store.sqlite") as store:
        put_in_quarantine(store, [(10, 189, "it fails"), (280, 310, "no CBOR")], payloads=payloads)
        before = store.results.observations("car-1"), store.quarantine.find("car-1"), store.results.snapshot("car-1")
        whole, damaged = (entry["again"] for entry in quarantine_document(store, is_analysed=True)["quarantined"])
        after = store.results.observations("car-1"), store.quarantine.find("car-1"), store.results.snapshot("car-1")
    assert whole.startswith("can be analysed: 1 window, 3 identifications of modes; front-left spring ")
    assert damaged.startswith("fails at frame 300: ")
    assert after == before
