"""Write `docs/conformance.md` from tests that compare with standards: `python -m benchmarks.conformance`.

Tests compare through the fixture `conforms` of `tests/conftest.py`. This command runs them and keeps what they compared
in `benchmarks/data/conformance.jsonl`, from which the page is rendered; every later run of a test compares its largest
deviation with the one that is kept.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.validation import table

ROOT = Path(__file__).parents[1]
CLAIMS, PAGE = ROOT / "benchmarks" / "data" / "conformance.jsonl", ROOT / "docs" / "conformance.md"

_INTRODUCTION = """# Conformance

What Sprung computes by a standard or a paper, and how far the result is from it. Every row is a test: it compares with
printed values, a closed form or a second computation, and fails if the largest deviation exceeds the tolerance or is no
longer the one stated here. The tests of the last column run as `pytest TEST`. This page is written by
`python -m benchmarks.conformance`, which runs them all.

*relative*: deviations are over the expected value. *Rounding*: below the number in brackets, where the arithmetic of
the processor decides. A row says that what it names was compared, and nothing about other clauses of the standard.
"""

#: Standards and clauses that a reader may look for, with what is there instead.
NOT_IMPLEMENTED = {
    "EN 13848": "gauge, cross level, alignment and twist; isolated defects; alert and intervention limits; the "
    "validation of a recording car. Longitudinal level is computed.",
    "ISO 8608:2016": "fits of a spectrum by straight lines over octave bands (clause 5.2): roughness and waviness are "
    "estimated by least squares over 0.05 to 1 cycles per metre instead.",
    "ISO 2631-1:1997": "factors of feet and of other axes of a backrest; effects on health by RMS (equation B.1): the "
    "dose of B.2 and B.3.1 is used, no printed figure of it or of the motion sickness dose was compared.",
    "EN 12299": "complete method on seats, comfort on curve transitions and at discrete events. Of the words for "
    "comfort, no printed table was compared.",
    "EN 14363": "assessment over sections of a test route: exceedances of the limit by the running RMS are counted.",
    "OPC 10000-110:2022": "an OPC UA server: severities are numbered as in its table.",
}


def run_tests() -> list[dict[str, Any]]:
    """Return the claims of all tests that compare with a standard, in the order of their sources."""
    users = sorted(str(path) for path in (ROOT / "tests").rglob("test_*.py") if "conforms(" in path.read_text("utf-8"))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "claims.jsonl"
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *users]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"SPRUNG_CONFORMANCE": str(file)}, check=True)
        claims = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    return sorted(claims, key=lambda claim: claim["source"].casefold())


def page(claims: Iterable[Mapping[str, Any]]) -> str:
    """Return the page: one row of all cases of a test that compare the same."""
    rows: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for claim in claims:
        test, tolerance = claim["test"].partition("[")[0], in_unit(claim["tolerance"], claim["unit"])
        rows.setdefault((claim["source"], claim["clause"], claim["what"], tolerance, test), []).append(claim)
    parts = [_INTRODUCTION]
    for source in dict.fromkeys(key[0] for key in rows):
        cells = [
            [clause, what, str(sum(each["values"] for each in those)), tolerance, largest(those), f"`{test}`"]
            for (of, clause, what, tolerance, test), those in rows.items()
            if of == source
        ]
        heads = ["where", "compared", "values", "tolerance", "largest deviation", "test"]
        parts += [f"## {source}\n", table(heads, cells)]
    missing = [[name, text] for name, text in NOT_IMPLEMENTED.items()]
    parts += ["## Not implemented\n", table(["standard", "what is missing"], missing)]
    return "\n".join(part.strip("\n") + "\n" for part in parts)


def largest(claims: Sequence[Mapping[str, Any]]) -> str:
    """Return the largest deviation of some claims with the same unit."""
    deviation = max(claim["deviation"] for claim in claims)
    if deviation or not claims[0]["tolerance"]:
        return in_unit(deviation, claims[0]["unit"])
    return f"rounding ({max(claim['rounding'] for claim in claims):g})"


def in_unit(number: float, unit: str) -> str:
    """Return a deviation or tolerance with its unit; relative ones above a thousandth in per cent."""
    if unit == "relative":
        return f"{100 * number:.2g} %" if number >= 1e-3 else f"{number:.2g} relative"
    return f"{number:.3g} {unit}".strip()


def read_claims() -> list[dict[str, Any]]:
    """Return the claims that are kept."""
    return [json.loads(line) for line in CLAIMS.read_text(encoding="utf-8").splitlines()]


if __name__ == "__main__":
    found = run_tests()
    CLAIMS.write_text("".join(json.dumps(claim, ensure_ascii=False) + "\n" for claim in found), encoding="utf-8")
    PAGE.write_text(page(found), encoding="utf-8")
