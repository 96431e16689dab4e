"""Commands on recordings print and write what they did when it was frozen."""

import pytest
from tests.golden.commands import run_command
from tests.golden.freezing import NOISE, check
from tests.golden.recordings import RECORDINGS, disturbed

import sprung
from sprung import diagnosis, identification
from sprung.diagnosis import observation
from sprung.results.documents import DOCUMENTS


@pytest.fixture(autouse=True)
def _fits_once(fits_once, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fit equal samples once: several commands of a case show the same fit."""
    monkeypatch.setattr(diagnosis, "observe_window", fits_once["observe_window"])
    monkeypatch.setattr(observation, "fit_drive", fits_once["fit_drive"])
    monkeypatch.setattr(identification, "METHODS", fits_once)


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDINGS)
def test_recording(name, tmp_path, check_document) -> None:
    case = RECORDINGS[name]
    if case.needs:
        pytest.importorskip(case.needs)
    seen = []
    for step in case.steps:
        if not isinstance(step, str):
            step(tmp_path)
            continue
        seen.append(run_command(step, tmp_path))
        for document in (seen[-1].get("out"), *seen[-1].get("files", {}).values()):
            if isinstance(document, dict):
                check_document(document)
                assert DOCUMENTS[document["schema"]].model_validate(document).as_json() == document
        if NOISE and step.startswith("simulate "):
            for path in tmp_path.iterdir():
                if str(path) == str(tmp_path / seen[-1]["command"].split("--out ")[1].split()[0]):
                    sprung.write(disturbed(sprung.read(path)), path)
    check(name, seen, digits=case.digits)
