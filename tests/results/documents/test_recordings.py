"""Documents of recordings: inspections and the truth of a simulation."""

import pytest

import sprung
from sprung.errors import FormatError
from sprung.results.documents import inspection_document, truth_document


def test_inspections_are_read_as_they_were_written(drive, plain, tmp_path) -> None:
    facts = {"run.csv": sprung.inspect(drive.recording)}
    sprung.write_inspections(facts, tmp_path / "info.json")
    assert sprung.read_inspections(tmp_path / "info.json") == facts
    (file,) = plain(inspection_document(facts))["files"]
    assert file["path"] == "run.csv"
    assert file["channels"][0]["is_dead"] is False


def test_the_truth_is_read_as_it_was_written(drive, plain, tmp_path) -> None:
    sprung.write_truth({**drive.truth, "kind": "road"}, tmp_path / "truth.json")
    document = sprung.read_truth(tmp_path / "truth.json")
    assert plain(document) == {**drive.truth, "kind": "road"}
    assert document.faults == {"front_left.spring": -0.3}
    with pytest.raises(FormatError, match="the truth of a simulation: modes is not valid"):
        truth_document({**drive.truth, "modes": 3})
