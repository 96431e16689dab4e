"""Every page: no serious finding of axe-core, nothing wider than a narrow phone, little to load."""

from typing import Any

import pytest
from tests.journeys.axe import axe_source
from tests.journeys.conftest import PHONE
from tests.journeys.routes import addresses, load
from tests.online.site.test_pages import PAGES, SAVED

from sprung.online.site.app import ROUTERS

pytestmark = pytest.mark.slow

#: Most that a page may load, without the library of charts [bytes].
_MOST = 300_000
_DESK = {"width": 1280, "height": 900}
_RUN = """async (rules) => {
  const only = rules.length ? { runOnly: { type: "rule", values: rules } } : {};
  const result = await axe.run(document, { resultTypes: ["violations"], ...only });
  return result.violations.filter((each) => ["serious", "critical"].includes(each.impact)).map(
    (each) => `${each.id}: ${each.nodes.map((node) => `${node.target} ${node.failureSummary}`).slice(0, 4).join(" | ")}`
  );
}"""


def test_all_pages_are_visited(shown) -> None:
    visited = {address.partition("?")[0] for address, _ in addresses(shown).values()}
    matched = {
        path
        for path, _ in PAGES
        if any(_fits(path, address) for address in visited)
        or path in SAVED
        or path.endswith((".js", ".json"))  # no pages
    }
    assert matched == {path for path, _ in PAGES}
    assert ROUTERS


def _fits(path: str, address: str) -> bool:
    """Return whether an address is of a route."""
    parts, given = path.split("/"), address.split("/")
    return len(parts) == len(given) and all(
        part == own or part.startswith("{") for part, own in zip(parts, given, strict=True)
    )


#: The elements that reach beyond the right edge of the window.
_WIDEST = """() => [...document.querySelectorAll("main *")].filter(
  (each) => each.getBoundingClientRect().right > innerWidth + 1 && !each.closest(".scroll, pre")
).slice(0, 5).map((each) => `${each.tagName}.${each.className}`)"""


def test_pages_are_accessible_light_and_no_wider_than_a_phone(shown, visit, watch) -> None:
    """All rules of axe on a phone and a desk, contrast in the dark, too; less than 300 kB with all that a page loads.

    The library of charts is not counted.
    """
    watch.expected = {403}
    source = axe_source()
    findings, sizes, too_wide = [], {}, {}
    for name, (address, role) in addresses(shown).items():
        # Past the policy of the pages, which lets no script in but their own.
        page = visit(shown, role=role, viewport=PHONE, bypass_csp=True)
        sizes[name] = load(page, address).n_bytes
        _wait_for_charts(page, name)
        width = page.evaluate("document.documentElement.scrollWidth")
        if width > PHONE["width"]:
            too_wide[name] = (width, page.evaluate(_WIDEST))
        page.add_script_tag(content=source)
        for scheme, size, rules in (
            ("light", PHONE, []),
            ("dark", PHONE, ["color-contrast"]),
            ("dark", _DESK, ["color-contrast"]),
            ("light", _DESK, []),
        ):
            page.emulate_media(color_scheme=scheme)
            page.set_viewport_size(size)
            findings += [f"{name} {scheme} {size['width']}: {finding}" for finding in page.evaluate(_RUN, rules)]
        page.context.close()
    assert not findings, "\n".join(findings)
    assert not too_wide
    report = sizes.pop("report")
    assert not {name: size for name, size in sizes.items() if size > _MOST}
    assert report < 2 * 10**6  # a page to keep and to send, with its figures inside


def _wait_for_charts(page: Any, name: str) -> None:
    """Wait until the trends of a vehicle are drawn."""
    if name in {"vehicle", "vehicle-learning"}:
        page.wait_for_selector("#part-trends .main-svg")
