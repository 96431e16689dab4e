"""Who may do what: without accounts, with accounts of each role, with tokens; and from where."""

import pytest
from fastapi.routing import APIRoute
from starlette.routing import Mount, Route
from starlette.testclient import TestClient
from tests.online.site.conftest import NOW, PASSWORD, ROLES

from sprung.errors import ParameterError
from sprung.online.monitor import Site
from sprung.online.site import Context, Server, add_account, add_token, remove_account, remove_token
from sprung.online.site.accounts import SESSION, Allowed, FormOf, change_role, of_session
from sprung.online.site.app import ROUTERS

#: Routes without a role in their signature: who may log in, and whether the monitor is healthy. Tests of probes show
#: who may read figures.
FREE = {("GET", "/health"), ("GET", "/metrics"), ("POST", "/api/v1/session"), ("GET", "/log-in"), ("POST", "/log-in")}
#: Values of the parameters of paths.
VALUES = {"vehicle": "bus-1", "boot": "1", "number": "77", "name": "nobody", "figure": "fit", "version": "1"}
VALUES["action"] = "close"


def roles_of(route):
    """Roles on which a route insists."""
    waiting, roles = [route.dependant], []
    while waiting:
        one = waiting.pop()
        waiting += one.dependencies
        roles += [one.call.role] if isinstance(one.call, Allowed | FormOf) else []
    return roles


def routes_of(router):
    """Routes of a router, and of those that it includes."""
    for route in router.routes:
        if isinstance(route, APIRoute):
            yield route
        else:
            yield from routes_of(route.original_router)


ROUTES = [
    (method, prefix + route.path, roles_of(route))
    for prefix, router in ROUTERS
    for route in routes_of(router)
    for method in sorted(route.methods or ())
]
GUARDED = [(method, path, roles[0]) for method, path, roles in ROUTES if roles]


def test_every_route_has_one_role_or_is_free() -> None:
    assert len(ROUTES) > 40
    assert len(ROUTES) == len({(method, path) for method, path, _ in ROUTES})
    assert {(method, path) for method, path, roles in ROUTES if not roles} == FREE
    assert {len(roles) for _, _, roles in ROUTES} == {0, 1}


@pytest.mark.slow
@pytest.mark.parametrize("role", [None, *ROLES])
def test_roles_by_routes(serve, people, store, role) -> None:
    """Each role is refused exactly where it is below the least role of the route; a token as a session is."""
    _, client = serve()
    headers = {}
    if role is not None:
        _, secret = add_token(store, "test", role, days=None, who="test", now=NOW)
        headers = {"Authorization": f"Bearer {secret}"}
    for method, path, least in GUARDED:
        if path.endswith("/events"):
            continue  # it does not end: tests of live events
        answer = client.request(method, path.format(**VALUES), headers=headers, follow_redirects=False)
        status = answer.status_code
        expected = {401} if role is None else {403} if ROLES.index(role) < ROLES.index(least) else None
        assert status in expected if expected else status not in {401, 403}, (method, path, role, status)


def test_there_are_no_other_routes(serve) -> None:
    """The description of the interface and the files of the package are for everybody."""
    _, client = serve()
    app = client.app._app
    others = [
        route.path for route in app.routes if isinstance(route, Route | Mount) and not isinstance(route, APIRoute)
    ]
    assert sorted(others) == ["/api/v1/openapi.json", "/static"]
    found = {
        (method, route.path) for route in app.routes if isinstance(route, APIRoute) for method in route.methods or ()
    }
    assert found <= {(method, path) for method, path, _ in ROUTES}


def test_files_of_the_package_alone_are_free(serve, people) -> None:
    _, client = serve()
    assert client.get("/static/base.css").status_code == 200
    assert client.get("/static/plotly.js").status_code == 401
    for path in (
        "/static/",
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/..%2fapp.py",
        "/static//etc/passwd",
    ):
        assert client.get(path).status_code == 404, path


CHANGING = [(method, path) for method, path, _ in GUARDED if method != "GET"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["no token", "mark of another session", "token without the session"])
def test_requests_of_other_sites_change_nothing(serve, people, store, kind) -> None:
    """The browser of a person who is logged in sends them with the cookie, but they cannot have the mark."""
    _, client = serve()
    body = {"name": people["admin"], "password": PASSWORD}
    token = client.post("/api/v1/session", json=body).json()["csrf_token"]
    if kind == "mark of another session":
        assert client.post("/api/v1/session", json=body).json()["csrf_token"] != token
    elif kind == "token without the session":
        client.cookies.clear()
    given = "" if kind == "no token" else token
    before = (len(store.requests.audited()), store.alerts.find(), store.accounts.all(), store.accounts.tokens())
    assert len(CHANGING) > 20
    for method, path in CHANGING:
        url = path.format(**VALUES | {"number": "1", "name": "eve"})
        if path.startswith("/api/"):
            answer = client.request(method, url, json={}, headers={"X-CSRF-Token": given})
        else:
            answer = client.request(method, url, data={"csrf_token": given})
        assert answer.status_code == (401 if kind == "token without the session" else 403), (method, path)
        is_for_programs = path.startswith("/api/") or answer.status_code == 401
        assert ("sprung tokens add" in answer.text) is is_for_programs, answer.text
    after = (len(store.requests.audited()), store.alerts.find(), store.accounts.all(), store.accounts.tokens())
    assert after == before


@pytest.mark.parametrize("value", ["x", "Bearer", "", "Bearer sprung_x"])
def test_a_header_without_a_valid_token_does_not_replace_the_mark(log_in, store, value) -> None:
    client, _ = log_in("engineer")
    headers = {"Authorization": value}
    assert client.post("/api/v1/alerts/1/acknowledge", json={}, headers=headers).status_code == 401
    assert client.post("/alerts/1/acknowledge", data={"csrf_token": ""}, headers=headers).status_code == 401
    assert not store.alerts.row(1).is_acknowledged


@pytest.mark.slow
@pytest.mark.parametrize(
    ("origin", "status"),
    [
        (None, 200),
        ("http://127.0.0.1:8737", 200),
        ("https://Sprung.example.org", 200),
        ("https://evil.example.org", 403),
        ("http://127.0.0.1:8000", 403),
        ("null", 403),
    ],
)
def test_another_site_does_not_log_people_in(serve, people, origin, status) -> None:
    """Otherwise its pages could give a browser a session of somebody else."""
    _, client = serve(url="https://sprung.example.org")
    headers = {} if origin is None else {"Origin": origin}
    body = {"name": "anna", "password": PASSWORD}
    assert client.post("/api/v1/session", json=body, headers=headers).status_code == status
    answer = client.post("/log-in", data=body, headers=headers, follow_redirects=False)
    assert answer.status_code == (303 if status == 200 else status)
    assert ("set-cookie" in answer.headers) == (status == 200)


def test_a_session_ends_with_its_account_and_with_its_role(serve, people, store) -> None:
    _, client = serve()
    for act in (
        lambda: remove_account(store, "eve", who="ada", now=NOW),
        lambda: add_account(store, "eve", "viewer", PASSWORD, who="ada", now=NOW),
        lambda: change_role(store, "eve", "engineer", who="ada", now=NOW),
    ):
        if store.accounts.find("eve") is None:
            add_account(store, "eve", "engineer", PASSWORD, who="ada", now=NOW)
        token = client.post("/api/v1/session", json={"name": "eve", "password": PASSWORD}).json()["csrf_token"]
        assert client.get("/api/v1/vehicles").status_code == 200
        act()
        assert client.get("/api/v1/vehicles").status_code == 401
        assert client.post("/alerts/1/acknowledge", data={"csrf_token": token}).status_code == 401
        page = client.get("/alerts", headers={"Accept": "text/html"}, follow_redirects=False)
        assert (page.status_code, page.headers["location"]) == (303, "/log-in?next=%2Falerts")


@pytest.mark.slow
def test_what_a_token_may_ends_with_it(serve, people, store) -> None:
    _, client = serve()
    _, old = add_token(store, "old", "admin", days=1, who="ada", now=NOW - 24 * 3600 * 10**9)
    number, revoked = add_token(store, "revoked", "admin", days=None, who="ada", now=NOW)
    remove_token(store, number, who="ada", now=NOW)
    for kind, value in (("Bearer", "sprung_x"), ("Basic", "YTpi"), ("Bearer", "")):
        assert client.get("/api/v1/session", headers={"Authorization": f"{kind} {value}"}).status_code == 401
    for secret in (old, revoked):
        for method, path, _ in GUARDED:
            if not path.endswith("/events"):
                url, headers = path.format(**VALUES), {"Authorization": f"Bearer {secret}"}
                answer = client.request(method, url, headers=headers, follow_redirects=False)
                assert answer.status_code == 401, (method, path)


def test_without_accounts_this_machine_may_do_everything_from_a_page_of_its_own(serve) -> None:
    _, client = serve()
    assert client.get("/api/v1/session").json() == {
        "name": "local",
        "role": "admin",
        "has_account": False,
        "csrf_token": "",
    }
    refused = client.post("/api/v1/alerts/1/acknowledge", json={})
    assert (refused.status_code, refused.json()["detail"]) == (
        403,
        "send Authorization: Bearer TOKEN, with a token that `sprung tokens add NAME --role engineer` prints, or a "
        "session with its x-csrf-token; on a page: reload it",
    )
    secret = "a" * 43
    client.cookies.set("sprung_session", secret)
    token = client.get("/api/v1/session").json()["csrf_token"]
    done = client.post("/api/v1/alerts/1/acknowledge", json={}, headers={"X-CSRF-Token": token})
    assert done.json()["alert"]["state"] == "acknowledged"


@pytest.mark.parametrize("name", ["evil.example", "127.0.0.1.evil.example", "", "192.0.2.1"])
def test_other_names_for_this_machine_are_refused(serve, name) -> None:
    """A page of another site could otherwise give its own name this machine's address."""
    _, client = serve(url="https://sprung.example.org")
    assert client.get("/api/v1/session", headers={"Host": name}).status_code == 421
    for own in ("localhost:8737", "127.0.0.1", "[::1]:8737", "sprung.example.org"):
        assert client.get("/api/v1/session", headers={"Host": own}).status_code == 200


def test_a_session_begins_with_a_password_and_ends(serve, people, store) -> None:
    context, client = serve()
    assert client.get("/api/v1/vehicles").status_code == 401
    answer = client.post("/api/v1/session", json={"name": "eve", "password": PASSWORD})
    cookie = answer.headers["set-cookie"]
    assert all(word in cookie for word in ("HttpOnly", "SameSite=strict", "Path=/", "Max-Age=43200"))
    token = {"X-CSRF-Token": answer.json()["csrf_token"]}
    assert client.get("/api/v1/vehicles").status_code == 200
    assert client.post("/api/v1/alerts/1/acknowledge", json={}).status_code == 403
    assert client.post("/api/v1/alerts/1/acknowledge", json={}, headers={"X-CSRF-Token": "0" * 64}).status_code == 403
    assert client.post("/api/v1/alerts/1/acknowledge", json={}, headers=token).status_code == 200
    assert store.alerts.history(1)[-1].who == "eve"
    secret = client.cookies["sprung_session"]
    person = of_session(store, secret, now=NOW + SESSION - 1)
    assert person is not None
    assert of_session(store, secret, now=NOW + SESSION) is None
    assert client.delete("/api/v1/session", headers=token).status_code == 200
    assert of_session(store, secret, now=NOW) is None
    assert context.store.requests.audited()[-1].act == "ack"


def test_passwords_are_tried_five_times(serve, people) -> None:
    _, client = serve()
    wrong = [client.post("/api/v1/session", json={"name": "ada", "password": "wrong"}) for _ in range(6)]
    unknown = client.post("/api/v1/session", json={"name": "nobody", "password": PASSWORD})
    assert (unknown.status_code, unknown.json()) == (wrong[0].status_code, wrong[0].json())
    assert [answer.status_code for answer in wrong] == [401] * 5 + [429]
    assert int(wrong[-1].headers["retry-after"]) > 0
    again = client.post("/api/v1/session", json={"name": "ada", "password": PASSWORD})
    assert again.status_code == 429


def test_nobody_locks_out_another_person(serve, people) -> None:
    """The attempts of one address to a name leave those of others, however often it tries."""
    _, client = serve()
    for name in ("ada", "ada", "ada", "eve", "anna", "ada", "ada", "ada", "ada"):
        client.post("/api/v1/session", json={"name": name, "password": "wrong"})
    elsewhere = TestClient(client.app, base_url=str(client.base_url), client=("192.0.2.7", 50_000))
    assert elsewhere.post("/api/v1/session", json={"name": "ada", "password": PASSWORD}).status_code == 200
    assert client.post("/api/v1/session", json={"name": "eve", "password": PASSWORD}).status_code == 200


@pytest.mark.slow
def test_the_form_has_the_same_limit(serve, people) -> None:
    _, client = serve()
    tried = [client.post("/log-in", data={"name": "ada", "password": "wrong"}) for _ in range(6)]
    assert [answer.status_code for answer in tried] == [401] * 5 + [429]
    assert "too many attempts: try again in 30 s" in tried[-1].text


def test_the_first_account_is_an_administrator(serve, store) -> None:
    _, client = serve()
    client.cookies.set("sprung_session", "a" * 43)
    token = {"X-CSRF-Token": client.get("/api/v1/session").json()["csrf_token"]}
    first = {"name": "ada", "role": "viewer", "password": PASSWORD}
    assert client.put("/api/v1/accounts", json=first, headers=token).status_code == 400
    assert client.put("/api/v1/accounts", json=first | {"role": "admin"}, headers=token).status_code == 200
    assert client.get("/api/v1/vehicles").status_code == 401
    assert PASSWORD not in str(store.accounts.find("ada").password)


@pytest.mark.parametrize(
    ("fields", "is_peopled", "words"),
    [
        ({"http": "0.0.0.0:0"}, False, "add an account first"),
        ({"http": "0.0.0.0:0"}, True, "unencrypted"),
        ({"http": "[::]:0"}, True, "unencrypted"),
    ],
)
def test_other_machines_need_accounts_and_encryption(store, fields, is_peopled, words) -> None:
    if is_peopled:
        add_account(store, "ada", "admin", PASSWORD, who="test", now=NOW)
    with pytest.raises(ParameterError, match=words):
        Server(Context(store, Site(**fields), figures=dict, problems=list))


def test_behind_a_proxy_cookies_are_for_encrypted_connections_only(store, serve, people) -> None:
    _, client = serve(http="0.0.0.0:0", web={"behind_proxy": True})
    answer = client.post("/api/v1/session", json={"name": "eve", "password": PASSWORD})
    assert answer.headers["set-cookie"].startswith("__Host-sprung_session=")
    assert "Secure" in answer.headers["set-cookie"]
    assert "strict-transport-security" in answer.headers
