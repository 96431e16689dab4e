"""Freeze anew what users see: `python tests/golden/regenerate.py [CASE...]`, and read the difference by `git diff`.

Without a case, all are frozen anew. With `--noise`, nothing is written: the recordings are disturbed by 1e-9 of their
values and compared with what was frozen; a case that fails then hangs on a decision that another machine may take
otherwise, and needs another seed or fewer digits.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path


def main() -> int:
    """Run the tests, which write instead of compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="*", help="name of a case, such as chain-csv")
    parser.add_argument("--noise", action="store_true", help="compare disturbed recordings instead of writing")
    given = parser.parse_args()
    repository = Path(__file__).parents[2]
    variables = {"SPRUNG_GOLDEN_NOISE": "1e-9"} if given.noise else {"SPRUNG_GOLDEN": "write"}
    chosen = ["-k", " or ".join(f"[{case}]" for case in given.case)] if given.case else []
    words = [sys.executable, "-m", "pytest", "-q", "tests/golden", *chosen]
    code = subprocess.run(words, cwd=repository, env={**os.environ, **variables}, check=False).returncode
    subprocess.run(["git", "diff", "--stat", "--", "tests/golden/frozen"], cwd=repository, check=False)
    return code


if __name__ == "__main__":
    raise SystemExit(main())
