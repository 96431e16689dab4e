"""The documentation builds without warnings, loads nothing from elsewhere, and its links lead somewhere."""

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from sprung.vehicles.sections import Axle

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parents[2]
#: Attributes by which a page loads something.
_LOADED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "object": "data"}


class Page(HTMLParser):
    """What a page loads, the links that it has, and the places that links can lead to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.without_text: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if _LOADED.get(tag) in values:
            self.loaded.append(values[_LOADED[tag]])
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag == "img" and "alt" not in values:
            self.without_text.append(values.get("src", ""))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the built pages, without tutorials and docstrings of packages."""
    root = tmp_path_factory.mktemp("site")
    shutil.copytree(REPOSITORY / "docs", root / "docs", ignore=shutil.ignore_patterns("gallery", "__pycache__"))
    for path in (*REPOSITORY.glob("*.md"), REPOSITORY / "deploy"):
        (root / path.name).symlink_to(path)
    words = ["-W", "--keep-going", "-q", "-b", "html", "-t", "quick", str(root / "docs"), str(root / "html")]
    done = subprocess.run([sys.executable, "-m", "sphinx", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return root / "html"


@pytest.fixture(scope="module")
def pages(site):
    """Return all pages by their paths."""
    return {path.resolve(): Page(path) for path in site.rglob("*.html")}


def test_pages_load_nothing_from_elsewhere(site, pages) -> None:
    assert len(pages) > 30
    foreign = {
        (path.name, address)
        for path, page in pages.items()
        for address in page.loaded
        if urlsplit(address).netloc or urlsplit(address).scheme not in {"", "data"}
    }
    assert not foreign
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet.name


def test_links_and_anchors_exist(pages) -> None:
    missing = []
    for path, page in pages.items():
        for link in (link for link in page.links if not urlsplit(link).scheme and not urlsplit(link).netloc):
            parts = urlsplit(link)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchors = {"", *pages[target].anchors} if target in pages else {parts.fragment}
            if not target.exists() or unquote(parts.fragment) not in anchors:
                missing.append((path.name, link))
    assert not missing


def test_pictures_have_a_text(pages) -> None:
    assert not {path.name: page.without_text for path, page in pages.items() if page.without_text}


def words_of(site, page: str) -> str:
    """Return the text of a page."""
    return re.sub(r"<[^>]+>", "", (site / page).read_text(encoding="utf-8"))


def test_generated_pages_show_what_the_code_has(site) -> None:
    commands = words_of(site, "reference/commands.html")
    assert "sprung alerts verdict" in commands
    assert "--false-alarms RATE" in commands
    vehicle = words_of(site, "reference/vehicle-fields.html")
    assert all(field in vehicle for field in Axle.model_fields)
    assert "watch" in words_of(site, "reference/site-fields.html")
    assert "sprung_backlog_age_seconds" in words_of(site, "reference/wire.html")
    assert "sprung/v1/VEHICLE/ack" in words_of(site, "reference/wire.html")
    assert "relative_to_nominal" in words_of(site, "reference/json-schemas.html")


def test_equations_need_no_script(site) -> None:
    path = site / "explanation" / "method.html"
    assert path.read_text(encoding="utf-8").count("<math") > 20
    assert not any("mathjax" in address.lower() for address in Page(path).loaded)
