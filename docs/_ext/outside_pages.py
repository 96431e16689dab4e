"""Links of pages to files outside this folder that are pages here, such as CONTRIBUTING.md."""

import re
from typing import Any

from sphinx.application import Sphinx

#: Page of each file, which the page includes.
PAGES = {
    "README.md": "start",
    "CHANGELOG.md": "release-notes",
    "CONTRIBUTING.md": "contributing",
    "CODE_OF_CONDUCT.md": "code-of-conduct",
    "SECURITY.md": "security",
    "deploy/README.md": "deploy",
}
_NAMES = "|".join(re.escape(name) for name in PAGES)
_TO_PAGE = re.compile(rf"\]\((?:\.\./)*({_NAMES})(#[^)]*)?\)")
_INTO_DOCS = re.compile(r"\]\((?:\.\./)?docs/([^)]*)\)")


def _page(match: re.Match[str]) -> str:
    """Return the link to the page of a file."""
    return f"](/{PAGES[match[1]]}.md{match[2] or ''})"


def _read(_app: Sphinx, _name: str, source: list[str]) -> None:
    source[0] = _TO_PAGE.sub(_page, source[0])


def _include(_app: Sphinx, _path: Any, _name: str, source: list[str]) -> None:
    source[0] = _TO_PAGE.sub(_page, _INTO_DOCS.sub(r"](/\1)", source[0]))


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the events."""
    app.connect("source-read", _read)
    app.connect("include-read", _include)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
