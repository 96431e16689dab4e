"""Every page as PNG, light, dark and on a phone: `make screenshots` writes them to build/screenshots."""

from pathlib import Path
from typing import Any

import pytest
from tests.journeys.conftest import PHONE
from tests.journeys.routes import addresses

FOLDER = Path(__file__).parents[2] / "build" / "screenshots"
DESK = {"width": 1280, "height": 900}
LOOKS: dict[str, dict[str, Any]] = {
    "light": {"viewport": DESK, "color_scheme": "light"},
    "dark": {"viewport": DESK, "color_scheme": "dark"},
    "phone": {"viewport": PHONE, "device_scale_factor": 2, "color_scheme": "light"},
}


@pytest.mark.parametrize("look", LOOKS)
def test_screenshots(shown, visit, watch, look) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    watch.expected = {403}
    people = {role: visit(shown, role=role, **LOOKS[look]) for role in ("", "viewer", "engineer", "admin")}
    for name, (address, role) in addresses(shown).items():
        page = people[role]
        page.goto(address)
        if name in {"vehicle", "vehicle-learning"}:
            page.wait_for_selector("#part-trends .main-svg")
        page.wait_for_timeout(300)
        page.screenshot(path=FOLDER / f"{name}-{look}.png", full_page=True)
