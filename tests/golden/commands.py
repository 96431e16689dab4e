"""Commands run in this process, and what they show and write."""

import contextlib
import io
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from tests.golden.freezing import html_lines, text_lines

from sprung.cli import main

#: 2026-11-21, UTC ns: the present time of all cases.
NOW = 1_795_219_200_000_000_000
#: Endings of files of which no more than the name is frozen.
_BINARY = {".npz", ".parquet", ".mat", ".h5", ".sqlite", ".uff"}


def run_command(line: str, folder: Path, *, now: int = NOW) -> dict[str, Any]:
    """Run a command in a folder; return what it prints, its exit code, and the files that it writes."""
    words = shlex.split(line)
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "120")
        patch.setattr("time.time_ns", lambda: now)
        patch.setattr("getpass.getuser", lambda: "anna")
        with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(words)
    is_document = "--json -" in line and out.getvalue().startswith(("{", "["))
    seen: dict[str, Any] = {"command": f"sprung {line}", "exit": code}
    seen["out"] = json.loads(out.getvalue()) if is_document else text_lines(out.getvalue())
    seen["err"] = text_lines(err.getvalue())
    written = [path for path in sorted(folder.iterdir()) if path.stat().st_mtime_ns != before.get(path.name)]
    seen["files"] = {path.name: _content(path) for path in written if path.is_file()}
    return {key: value for key, value in seen.items() if value or key == "exit"}


def _content(path: Path) -> Any:
    """Return what a person reads in a file."""
    if path.suffix in _BINARY:
        return "binary"
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        return json.loads(text)
    if path.suffix == ".html":
        return html_lines(text)
    lines = text_lines(text)
    return [*lines[:4], f".. {len(lines)} lines"] if path.suffix == ".csv" else lines
