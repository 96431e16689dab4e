"""Requests made from the interface's own document: whatever is sent, the answer is one that the document has."""

from collections import Counter
from itertools import count
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema_rs import Draft202012Validator
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.core.result import Ok
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    status_code_conformance,
)
from starlette.testclient import TestClient
from tests.online.site.conftest import NOW, PASSWORD, run_row, write_run

from sprung.online.monitor import Site
from sprung.online.site import Context, add_account, add_token, application
from sprung.online.store import StoreError

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
]
#: Names and numbers that the store has, for the paths.
KNOWN: dict[str, list[Any]] = {
    "vehicle": ["bus-1", "bus-2"],
    "boot": [1],
    "number": [1, 2],
    "name": ["eve", "log", "webhook 1"],
}
#: Left to tests of their own: the stream does not end, and a report draws figures for seconds.
OTHERS = {"/api/v1/events", "/api/v1/vehicles/{vehicle}/report"}
#: Answered without those parts of the store that have vehicles and alerts.
FREE = {"/health", "/metrics", "/api/v1/advice", "/api/v1/session", "/api/v1/accounts", "/api/v1/tokens"}


@pytest.fixture
def shared(store, tmp_path):
    """What requests share, with accounts and results of a run; the clock of the limits is always hours later."""
    add_account(store, "ada", "admin", PASSWORD, who="test", now=NOW)
    add_account(store, "eve", "engineer", PASSWORD, who="test", now=NOW)
    write_run(tmp_path / "fleet", [run_row("bus-1", "change", "high")])
    hours = count(0, 3600)
    return Context(
        store,
        Site.model_validate({"url": "http://testserver", "keep": {"results": str(tmp_path / "fleet")}}),
        figures=lambda: {"sprung_store_writable": 1.0},
        problems=list,
        clock=lambda: NOW,
        timer=lambda: float(next(hours)),
    )


def cases(operation):
    """Requests that follow the description, and others."""
    modes = [GenerationMode.POSITIVE]
    if operation.path_parameters or operation.query or operation.body:
        modes.append(GenerationMode.NEGATIVE)
    return st.one_of([operation.as_strategy(generation_mode=mode) for mode in modes])


def checker(operation, headers, statuses, *, n_examples):
    """Function that sends generated requests of an operation, and counts the statuses of the answers."""

    @settings(max_examples=n_examples, database=None, suppress_health_check=list(HealthCheck))
    @given(case=cases(operation), data=st.data())
    def check(case, data):
        for name in set(case.path_parameters or {}) & KNOWN.keys():
            if data.draw(st.integers(0, 3)):
                case.path_parameters[name] = data.draw(st.sampled_from(KNOWN[name]))
        answer = case.call(headers=headers)
        statuses[answer.status_code] += 1
        case.validate_response(answer, checks=CHECKS, headers=headers)
        described = operation.definition.raw["responses"][str(answer.status_code)]
        content = described.get("content", {}).get(answer.headers["content-type"][0], {})
        if schema := content.get("schema"):
            named = {"components": operation.schema.raw_schema["components"]}
            Draft202012Validator(schema | named).validate(answer.json())

    return check


#: Requests of every operation as a role (None: nobody), and statuses that are among the answers.
ROLES: dict[str | None, tuple[int, set[int]]] = {
    None: (2, {401}),
    "viewer": (2, {200, 403, 404, 422}),
    "engineer": (2, {200, 403, 404, 409, 422}),
    "admin": (30, {200, 202, 400, 401, 404, 409, 422}),
}


@pytest.mark.slow
def test_answers_are_as_described(shared) -> None:
    schema = schemathesis.openapi.from_asgi("/api/v1/openapi.json", application(shared))
    statuses: dict[str | None, Counter[int]] = {role: Counter() for role in ROLES}
    for found in schema.get_all_operations():
        assert isinstance(found, Ok)
        operation = found.ok()
        if operation.path in OTHERS:
            continue
        for role, (n_examples, _) in ROLES.items():
            headers = {}
            if role is not None:  # anew for each: requests also revoke tokens
                _, secret = add_token(shared.store, "test", role, days=None, who="test", now=NOW)
                headers["Authorization"] = f"Bearer {secret}"
            checker(operation, headers, statuses[role], n_examples=n_examples)()
    for role, (_, answered) in ROLES.items():
        assert answered <= statuses[role].keys(), role


@pytest.mark.slow
def test_a_store_that_does_not_answer_is_described(shared, monkeypatch) -> None:
    def fail(*_args, **_fields):
        raise StoreError("the disk is full: free some space")

    _, secret = add_token(shared.store, "test", "admin", days=None, who="test", now=NOW)
    for part in ("alerts", "fleet", "requests", "results", "verdicts", "inbox"):
        kind = type(getattr(shared.store, part))
        for name in [name for name in vars(kind) if not name.startswith("_")]:
            monkeypatch.setattr(kind, name, fail)
    client = TestClient(application(shared), base_url="http://testserver", raise_server_exceptions=False)
    document = client.get("/api/v1/openapi.json").json()
    for path, methods in document["paths"].items():
        if "get" not in methods or path in OTHERS or path in FREE:
            continue
        url = path.format(vehicle="bus-1", boot=1, number=1, name="log", figure="fit", version=1)
        answer = client.get(url, headers={"Authorization": f"Bearer {secret}"})
        assert (answer.status_code, "503" in methods["get"]["responses"]) == (503, True), path
        assert answer.json() == {"detail": "the disk is full: free some space"}
        assert answer.headers["retry-after"] == "5"
