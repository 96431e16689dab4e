"""Texts with markup from vehicles and people in a real browser: no script of theirs runs, none becomes an element."""

import pytest
from tests.journeys.conftest import serving
from tests.online.site.conftest import store
from tests.online.site.test_pages import HOSTILE, KNOWN, PAGES, SAVED, put_hostile_texts

pytestmark = pytest.mark.slow

__all__ = ["store"]

_ADDRESSES = [
    path.format(**(KNOWN | {"number": number, "vehicle": "bus-1"}))
    for path, _ in PAGES
    if path not in SAVED
    for number in ("1", "3", "4")
    if (number == "1" or "{num" in path) and not path.endswith((".js", ".json"))
]
_FOREIGN = "img[src='x'], a[href^='javascript:'], script:not([src]):not([type='application/json'])"


@pytest.fixture
def hostile(store, tmp_path):
    """A monitor of a store in which every text is hostile that a vehicle or person can set."""
    fields = put_hostile_texts(store)
    del fields["web"]  # no server starts with such a certificate
    with serving(f"sqlite:///{tmp_path}/store.sqlite", **fields) as monitor:
        yield monitor


def test_hostile_texts_are_shown_and_not_run(hostile, visit) -> None:
    page = visit(hostile)
    n_shown = 0
    for address in _ADDRESSES:
        page.goto(address)
        page.wait_for_timeout(100)
        assert page.locator(_FOREIGN).count() == 0, address
        n_shown += HOSTILE[:20] in page.locator("body").inner_text()
    assert n_shown >= 5
