"""All pages: what they may load, and that no text of a vehicle or person becomes markup."""

import re
from html.parser import HTMLParser

import pytest
from tests.online.site.conftest import NOW, PASSWORD, ROLES, raise_alert
from tests.online.site.test_access import ROUTES, VALUES

from sprung.online.alerts import AlertSettings
from sprung.online.monitor import operations
from sprung.online.monitor.alert_book import AlertBook
from sprung.online.site import add_account, add_token
from sprung.online.site.app import routes_of

#: A text that runs a script where it is taken for markup, for a value of an attribute, or for an address.
HOSTILE = """"'><script>alert(1)</script><img src=x onerror=alert(1)><a href=javascript:alert(1)>{{7*7}}</a>"""
#: Pages that everybody sees who may, with the least role.
PAGES = [(path, roles[0] if roles else None) for method, path, roles in ROUTES if method == "GET"]
PAGES = [(path, role) for path, role in PAGES if not path.startswith("/api/") and path not in {"/health", "/metrics"}]
#: Values of the parameters of paths that exist.
KNOWN = VALUES | {"number": "1"}
#: Pages to keep and to print, which link nothing; what a browser saves.
ALONE = {"/vehicles/{vehicle}/report", "/alerts/{number}/job-card"}
SAVED = {"/vehicles/{vehicle}/export", "/alerts/{number}/job-card.pdf"}


class Reader(HTMLParser):
    """Elements and attributes of a page, and the text of its scripts."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.scripts, self._in_script = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        self._in_script = tag == "script"

    def handle_data(self, data):
        if self._in_script and data.strip():
            self.scripts.append((self.elements[-1][1].get("type"), data))

    def handle_endtag(self, tag):
        self._in_script = False


def check_markup(text):
    """Check that a page runs scripts of this server only, and loads nothing from elsewhere."""
    reader = Reader(text)
    assert {kind for kind, _ in reader.scripts} <= {"application/json"}
    for tag, attributes in reader.elements:
        assert not [name for name in attributes if name.startswith("on")], (tag, attributes)
        assert tag not in {"base", "iframe", "object", "embed"}
        if tag == "script" and attributes.get("type") != "application/json":
            assert attributes["src"].startswith("/static/"), attributes
        for name in ("src", "href", "action", "formaction"):
            address = attributes.get(name, "/")
            assert address.startswith(("/", "#", "?", "data:image/")), (tag, address)
            assert not address.startswith("//"), (tag, address)
    return reader


def shown(client, path, role, headers):
    """The page at a path, checked; None for what is no page, such as a download, which no browser runs."""
    answer = client.get(path.format(**KNOWN), headers={"Accept": "text/html", **headers})
    assert answer.status_code == 200, (path, answer.text)
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    rules = dict(rule.split(maxsplit=1) for rule in answer.headers["content-security-policy"].split("; "))
    assert [name for name, sources in rules.items() if "unsafe-inline" in sources] == ["style-src-attr"]
    if path.startswith("/static/"):
        return None
    if not answer.headers["content-type"].startswith("text/html"):
        assert answer.headers["content-type"].split(";")[0] in {"text/plain", "application/json", "text/csv"} or (
            "attachment" in answer.headers["content-disposition"]
        )
        return None
    assert answer.headers["cache-control"] == "no-store"
    assert len(answer.content) < 300_000
    check_markup(answer.text)
    assert not re.findall(r"<th\b[^>]*>\s*(?:<[^>]+>\s*)*</th>", answer.text), "a heading without words"
    return answer.text


@pytest.mark.slow
@pytest.mark.parametrize("role", ROLES)
def test_pages_of_each_role(serve, people, store, role) -> None:
    """Pages link only what the role may see; pages above it answer with a page that says so."""
    _, client = serve()
    _, secret = add_token(store, "test", role, days=None, who="test", now=NOW)
    headers = {"Authorization": f"Bearer {secret}"}
    sections = {"/site": "viewer", "/api": "viewer", "/audit": "engineer", "/people": "admin"}
    for path, least in PAGES:
        if least is not None and ROLES.index(role) < ROLES.index(least):
            answer = client.get(path.format(**KNOWN), headers={"Accept": "text/html", **headers})
            assert (answer.status_code, "<h1>Not allowed</h1>" in answer.text) == (403, True)
            check_markup(answer.text)
            continue
        text = shown(client, path, role, headers)
        if text is not None and path not in ALONE:
            linked = {section for section in sections if f'<a href="{section}"' in text}
            assert linked >= {name for name, least in sections.items() if ROLES.index(role) >= ROLES.index(least)}
            assert ("/people" in linked, "/audit" in linked) == (role == "admin", role != "viewer")


def test_nobody_is_sent_to_log_in_and_back(serve, people) -> None:
    _, client = serve()
    for path, role in PAGES:
        answer = client.get(path.format(**KNOWN), headers={"Accept": "text/html"}, follow_redirects=False)
        assert answer.status_code == (200 if role is None else 303)
        if role is not None:
            assert answer.headers["location"].startswith("/log-in?next=%2F")


def put_hostile_texts(store):
    """Make every text hostile that a vehicle or person can set; return such settings of a site."""
    for name in ("bus-1", "bus-3"):
        store.inbox.put_vehicle(
            name, configuration=HOSTILE, description=HOSTILE, channels=[[HOSTILE, HOSTILE]], now=NOW
        )
    evidence = {HOSTILE: HOSTILE, "change": -0.2, "interval": [-0.22, -0.18], "notes": [HOSTILE], "channel": HOSTILE}
    raise_alert(store, "bus-3", f"sensor:{HOSTILE}", 900, HOSTILE, evidence=evidence)
    AlertBook(store, AlertSettings()).report("bus-1", "lost", HOSTILE, now=NOW)
    for row in store.alerts.find():
        operations.add_comment(store, row.number, who=HOSTILE, comment=HOSTILE, now=NOW)
        operations.assign(store, row.number, assignee=HOSTILE, who=HOSTILE, comment=HOSTILE, now=NOW)
        operations.shelve(store, row.number, hours=1, who=HOSTILE, comment=HOSTILE, now=NOW)
        operations.add_verdict(
            store, row.number, verdict="another part", part=HOSTILE, action=HOSTILE, who=HOSTILE, now=NOW
        )
    operations.relearn(store, "bus-1", reason=HOSTILE, who=HOSTILE, now=NOW)
    add_token(store, HOSTILE[:64], "viewer", days=None, who=HOSTILE, now=NOW)
    store.requests.audit(HOSTILE, "sender tested", "webhook 1", HOSTILE, now=NOW)
    store.requests.audit(HOSTILE, HOSTILE, HOSTILE, {HOSTILE: [HOSTILE]}, now=NOW)
    return {
        "name": HOSTILE[:64],
        "send": {"webhook": [{"url": "https://example.org/x", "headers": {HOSTILE: HOSTILE}}]},
        "web": {"certificate": HOSTILE, "key": HOSTILE},
    }


@pytest.fixture
def hostile(serve, store):
    """A client without accounts, and a store in which every text is hostile that a vehicle or person can set."""
    return serve(figures={}, problems=[HOSTILE], **put_hostile_texts(store))[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "number"),
    [(path, number) for path, _ in PAGES for number in ("1", "3", "4") if number == "1" or "{num" in path],
)
def test_no_text_becomes_markup(hostile, path, number) -> None:
    """Alerts 1 and 4 are about bus-1, 3 is about a sensor."""
    values = KNOWN | {"number": number, "vehicle": "bus-1"}
    answer = hostile.get(path.format(**values), headers={"Accept": "text/html"})
    assert answer.status_code == 200
    if answer.headers["content-type"].startswith("text/html"):
        reader = check_markup(answer.text)
        assert "img" not in [tag for tag, attributes in reader.elements if attributes.get("src") == "x"]
        assert "<script>alert" not in answer.text
        assert "49</a>" not in answer.text


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [
        "/?text={}",
        "/?step={}&assignee={}",
        "/?cursor={}",
        "/audit?before={}",
        "/people?done={}",
        "/vehicles/{}",
        "/alerts/{}",
        "/{}",
        "/log-in?next={}",
    ],
)
def test_no_part_of_an_address_becomes_markup(serve, store, path) -> None:
    _, client = serve()
    if "log-in" in path:
        add_account(store, "ada", "admin", PASSWORD, who="test", now=NOW)
    for text in (HOSTILE[:60], "javascript:alert(1)", "//evil.example/x"):
        answer = client.get(path.replace("{}", text), headers={"Accept": "text/html"})
        if answer.headers["content-type"].startswith("text/html"):
            check_markup(answer.text)
        assert "<script>alert" not in answer.text


def test_a_form_that_fails_shows_the_name_as_text(serve, people) -> None:
    _, client = serve()
    fields = {"name": HOSTILE[:60], "password": "wrong", "next": HOSTILE}
    answer = client.post("/log-in", data=fields, headers={"Accept": "text/html"})
    assert answer.status_code == 401
    check_markup(answer.text)
    assert "<script>alert" not in answer.text


@pytest.mark.slow
def test_names_of_accounts_are_text(serve, people, store) -> None:
    _, client = serve()
    add_account(store, HOSTILE[:60], "viewer", PASSWORD, who=HOSTILE, now=NOW)
    _, secret = add_token(store, HOSTILE[:60], "admin", days=None, who=HOSTILE, now=NOW)
    for path in ("/people", "/audit"):
        text = client.get(path, headers={"Accept": "text/html", "Authorization": f"Bearer {secret}"}).text
        check_markup(text)
        assert "<script>alert" not in text
        assert "&lt;script&gt;alert" in text


def test_dates_in_headings_are_not_broken_and_texts_stay_texts() -> None:
    from sprung.online.site.rendering import _environment

    text = _environment().from_string("{{ text|unbroken }}").render(text="<b> since 2026-11-19 06:10 UTC; in 2026")
    time = '<time class="date" datetime="2026-11-19T06:10:00Z">2026-11-19 06:10 UTC</time>'
    assert text == f"&lt;b&gt; since {time}; in 2026"


@pytest.mark.slow
def test_every_route_is_listed_once_with_its_role(serve) -> None:
    _, client = serve()
    document = client.get("/api/v1/openapi.json").json()
    listed = list(routes_of(document))
    expected = {
        (method, path): str(roles[0]) if roles else ""
        for method, path, roles in ROUTES
        if path.startswith("/api/v1/") or path in {"/health", "/metrics"}
    }
    assert {(method, path): role for _, method, path, _, role in listed} == expected
    text = client.get("/api").text
    assert text.count('<tr class="route">') == len(expected)
    assert all(meaning for _, _, _, meaning, _ in listed)
    assert "/api/v1/openapi.json" in text
