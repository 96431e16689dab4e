"""The description of the interface: complete, with the roles on which the routes insist."""

import json
import shlex

import pytest
from tests.online.site.test_access import ROUTES

from sprung.online.site.interface import operations, shapes

ADDRESS = "https://sprung.example.org"


@pytest.fixture
def document(serve):
    _, client = serve()
    return client.get("/api/v1/openapi.json").json()


def all_operations(document):
    return [each for group in operations(document, address=ADDRESS).values() for each in group]


def test_every_operation_is_described_with_its_role(document) -> None:
    described = {(each.method, each.path): each.role for each in all_operations(document)}
    expected = {
        (method, path): str(roles[0]) if roles else ""
        for method, path, roles in ROUTES
        if path.startswith("/api/v1/") or path in {"/health", "/metrics"}
    }
    assert described == expected


def test_every_operation_and_object_is_on_the_page_once(serve, document) -> None:
    _, client = serve()
    text = client.get("/api").text
    described = all_operations(document)
    for each in described:
        assert text.count(f'id="{each.anchor}"') == 1
        assert each.summary, each.path
    named = {shape.name for shape in shapes(document)}
    for name in named:
        assert text.count(f'id="shape-{name}"') == 1
    mentioned = {value.shape for each in described for value in each.parameters} | {each.shape for each in described}
    assert mentioned - {""} <= named
    assert "HTTPValidationError" not in text


def test_examples_are_commands_with_all_that_is_required(document) -> None:
    for each in all_operations(document):
        words = shlex.split(each.example)
        assert words[0] == "curl"
        assert words[-1].startswith(f"{ADDRESS}/")
        assert ("Authorization: Bearer TOKEN" in words) == bool(each.role)
        body = json.loads(words[words.index("-d") + 1]) if "-d" in words else {}
        assert {value.name for value in each.parameters if value.place == "body" and value.is_required} <= body.keys()


def test_types_are_worded(document) -> None:
    (shelf,) = [shape for shape in shapes(document) if shape.name == "Shelf"]
    hours, comment = shelf.fields
    assert (hours.name, hours.kind, hours.is_required) == ("hours", "number, above 0.0, at most 8784.0", True)
    assert (comment.name, comment.kind, comment.is_required) == ("comment", "text, at most 4000 characters", False)
    (detail,) = [shape for shape in shapes(document) if shape.name == "AlertDetail"]
    kinds = {value.name: (value.kind, value.shape) for value in detail.fields}
    assert kinds["alert"] == ("AlertEntry", "AlertEntry")
    assert kinds["history"] == ("list of HistoryEntry", "HistoryEntry")
    assert kinds["evidence"] == ("object", "")
