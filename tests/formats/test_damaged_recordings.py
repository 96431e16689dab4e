"""Damaged recordings of measurement systems: hundreds of mutations of small files, each read to its end or refused.

The readers of these formats are foreign code, partly compiled: every format is tried in a process of its own.
"""

import importlib
import random
import resource
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sprung.errors import SprungError
from sprung.formats import ReadSettings, groups, read

N_MUTATIONS = 300
#: Address space that the readers may take, most of it for the code of libraries.
MOST_BYTES = 4 << 30


def mutation(content: bytes, generator: random.Random) -> bytes:
    """Return a file with flipped bits, extreme numbers, moved, lost or added bytes, or without its end."""
    changed = bytearray(content)
    for _ in range(generator.choice((1, 1, 2, 8))):
        place = max(8, int(generator.random() ** generator.choice((1, 3)) * (len(changed) - 16)))
        width = generator.choice((2, 4, 8))
        numbers = (-1, 0, (1 << 63) - 1, 1 << generator.randrange(64), generator.randrange(len(changed)))
        word = struct.pack("<q", generator.choice(numbers) % (1 << 63))[:width]
        kind = generator.randrange(6)
        if kind == 0:
            changed[place] ^= 1 << generator.randrange(8)
        elif kind == 1:
            changed[place : place + width] = word
        elif kind == 2:
            del changed[max(64, generator.randrange(len(changed))) :]
        elif kind == 3:
            changed[place : place + 100] = changed[generator.randrange(len(changed)) :][:100]
        elif kind == 4:
            del changed[place : place + generator.randrange(1, 64)]
        else:
            changed[place:place] = generator.randbytes(generator.randrange(1, 32))
        changed.extend(bytes(max(0, 64 - len(changed))))
    return bytes(changed)


def mdf(path: Path, version: str) -> Path:
    """Write two groups of signals."""
    from asammdf import MDF, Signal

    stamps = np.arange(200) / 100
    state = {"val_0": 0, "val_1": 1, "text_0": b"off", "text_1": b"on", "default": b"?"}
    scaled = Signal(np.arange(200, dtype=np.int16), stamps, name="force", unit="N", conversion={"a": 0.5, "b": 1.0})
    switch = Signal(np.arange(200, dtype=np.int16) % 2, stamps, name="state", conversion=state)
    with MDF(version=version) as file:
        file.append([Signal(np.sin(stamps), stamps, name="acc", unit="g"), scaled, switch], common_timebase=True)
        file.append([Signal(stamps[::4], stamps[::4], name="speed", unit="km/h")])
        return Path(file.save(path, overwrite=True)).rename(path)


def tdms(path: Path) -> Path:
    """Write two segments."""
    nptdms: Any = pytest.importorskip("nptdms")
    scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear", "NI_Scale[0]_Linear_Slope": 0.5}
    scale |= {"NI_Scale[0]_Linear_Y_Intercept": 1.0, "wf_increment": 0.01, "unit_string": "N"}
    channels = [
        nptdms.ChannelObject("g", "force", np.arange(200, dtype=np.int16), scale),
        nptdms.ChannelObject("g", "acc", np.sin(np.arange(200.0)), {"wf_increment": 0.01, "unit_string": "g"}),
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([*channels, nptdms.ChannelObject("g", "note", ["a", "b"])])
        writer.write_segment(channels)
    return path


def ide(path: Path) -> Path:
    """Write two channels."""
    return importlib.import_module("test_ide").written(path)[0]


WRITERS = {
    "mdf3": lambda folder: mdf(folder / "run.mf4", "3.30"),
    "mdf4": lambda folder: mdf(folder / "run.mf4", "4.10"),
    "tdms": lambda folder: tdms(folder / "run.tdms"),
    "ide": lambda folder: ide(folder / "run.ide"),
}


def outcome(path: Path) -> str:
    """Return "read" or "refused"; raise on any other error, and on a message without the name of the file."""
    try:
        for group in groups(path):
            for _ in group.open(None).blocks():
                pass
            read(path, settings=ReadSettings(groups=[group.name]))
    except SprungError as error:
        if path.name not in str(error) or "\n" in str(error):
            raise AssertionError(str(error)) from error
        return "refused"
    return "read"


def main(kind: str, folder: Path) -> None:
    """Try the mutations of one format, with limited memory; print the number of those refused."""
    generator = random.Random(kind)
    path = WRITERS[kind](folder)
    content = path.read_bytes()
    assert outcome(path) == "read"
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    outcomes = []
    for number in range(N_MUTATIONS):
        path.write_bytes(mutation(content, generator))
        try:
            outcomes.append(outcome(path))
        except Exception as error:
            raise AssertionError(f"mutation {number}") from error
    sys.stdout.write(str(outcomes.count("refused")))


@pytest.mark.slow
@pytest.mark.parametrize("kind", WRITERS)
def test_mutations_are_read_or_refused(tmp_path: Path, kind) -> None:
    command = [sys.executable, "-W", "error", __file__, kind, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.stderr == ""
    assert result.returncode == 0
    assert int(result.stdout) > N_MUTATIONS / 4


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
