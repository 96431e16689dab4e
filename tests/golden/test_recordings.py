"""Commands on recordings print and write what they did when it was frozen."""

import pytest
from tests.golden.commands import run_command
from tests.golden.freezing import NOISE, check
from tests.golden.recordings import RECORDINGS, disturbed

import sprung


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDINGS)
def test_recording(name, tmp_path) -> None:
    case = RECORDINGS[name]
    if case.needs:
        pytest.importorskip(case.needs)
    seen = []
    for step in case.steps:
        if not isinstance(step, str):
            step(tmp_path)
            continue
        seen.append(run_command(step, tmp_path))
        if NOISE and step.startswith("simulate "):
            for path in tmp_path.iterdir():
                if str(path) == str(tmp_path / seen[-1]["command"].split("--out ")[1].split()[0]):
                    sprung.write(disturbed(sprung.read(path)), path)
    check(name, seen, digits=case.digits)
