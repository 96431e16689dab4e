"""The site: settings with where they come from, secrets that stay hidden, senders, false alarms, storage."""

import subprocess
from pathlib import Path

import pytest
from scipy.stats import chi2
from starlette.testclient import TestClient
from tests.online.site.conftest import NOW, PASSWORD

from sprung.online.monitor import Site, operations
from sprung.online.site import Context, application
from sprung.online.site.accounts import Person, Role
from sprung.online.site.site import false_alarms, senders, settings_of, site
from sprung.online.store import Progress

SECRET = "top-secret"
#: Senders with secrets.
SENDERS = {
    "webhook": [{"url": f"http://127.0.0.1:1/{SECRET}", "headers": {"Authorization": SECRET}}],
    "mail": [
        {
            "host": "127.0.0.1",
            "port": 1,
            "sender": "sprung@example.org",
            "recipients": ["depot@example.org"],
            "username": "sprung",
            "password": SECRET,
        }
    ],
    "apprise": [{"url": f"slack://{SECRET}/#depot"}],
}
#: A site in which everything has a secret that can have one.
SETTINGS = {
    "name": "Depot North",
    "broker": f"mqtts://monitor:{SECRET}@broker.example:8883",
    "url": f"https://user:{SECRET}@sprung.example.org",
    "watch": {"false_alarms_per_day": 0.01},
    "send": SENDERS,
}
#: Figures of a monitor, one loop of which stands still.
FIGURES = {
    "sprung_backlog_frames": 12.0,
    "sprung_backlog_age_seconds": 7.0,
    "sprung_windows_total": 200.0,
    "sprung_analysis_cpu_seconds_total": 250.0,
    "sprung_queue_bytes": 123_456.0,
    "sprung_window_age_seconds": 1.25,
    'sprung_heartbeat_age_seconds{loop="station"}': 0.5,
    'sprung_heartbeat_age_seconds{loop="analysis"}': 300.0,
    'sprung_heartbeat_age_seconds{loop="post mail 1"}': 2.0,
    'sprung_refusals_total{vehicle="bus-1",reason="overload"}': 3.0,
}


@pytest.fixture
def opened(serve):
    """Context and client of a site with secrets, whose monitor has a problem."""
    return serve(figures=FIGURES, problems=["the broker has not answered yet"], **SETTINGS)


@pytest.fixture
def context(opened):
    return opened[0]


@pytest.fixture
def client(opened):
    return opened[1]


def test_settings_have_values_defaults_and_where_they_come_from(context) -> None:
    entries = {each.key: each for each in settings_of(context.site)}
    assert len(entries) == 51
    assert all(each.description for each in entries.values())
    rate = entries["watch.false_alarms_per_day"]
    assert (rate.value, rate.default, rate.source) == ("0.01", "0.001", "site file")
    assert (entries["watch.method"].value, entries["watch.method"].source) == ('"cov"', "default")
    assert entries["watch.calibrate"].value == "-"
    assert entries["broker"].source == "site file or --broker"
    assert entries["broker"].value == '"mqtts://monitor:(hidden)@broker.example:8883"'
    assert entries["send.webhook 1.url"].value == '"http://127.0.0.1:1/(hidden)"'
    assert entries["send.webhook 1.headers"].value == '{"Authorization": "(hidden)"}'
    assert entries["send.mail 1.password"].value == '"(hidden)"'
    assert entries["send.apprise 1.url"].value == '"slack://(hidden)"'
    assert (entries["send.mail 1.host"].default, entries["send.mail 1.port"].default) == ("required", "587")


@pytest.mark.parametrize(
    ("store", "shown"),
    [
        ("sqlite:///folder/a.sqlite", "sqlite:///folder/a.sqlite"),
        ("postgresql://u:top-secret@host/name", "postgresql://u:(hidden)@host/name"),
        ("postgresql://u:top-secret@x@host/name", "postgresql://u:(hidden)@host/name"),
        ("postgresql://u@host/name?password=top-secret&a=1", "postgresql://u@host/name?password=(hidden)&a=1"),
    ],
)
def test_passwords_of_stores_are_hidden(store, shown) -> None:
    entries = {each.key: each.value for each in settings_of(Site(store=store))}
    assert entries["store"] == f'"{shown}"'


@pytest.mark.slow
def test_page_and_interface_have_the_same_values_and_no_secret(client, context) -> None:
    text = client.get("/site", headers={"Accept": "text/html"}).text
    document = client.get("/api/v1/site").json()
    assert SECRET not in text
    assert SECRET not in str(document)
    assert document["sentence"] in text
    assert document["sentence"] == "1 thing at this site needs attention."
    assert document["problems"] == ["the broker has not answered yet"]
    for entry in document["settings"]:
        assert f"<code>{entry['key']}</code>" in text
    for entry in document["versions"]:
        assert f"<dt>{entry['name']}</dt><dd>{entry['version']}</dd>" in text
    assert {"Sprung", "Python", "schema of the store", "SQLite"} <= {each["name"] for each in document["versions"]}
    assert document["vehicles"] == 3
    assert {each["table"]: each["rows"] for each in document["store"]["tables"]}["observations"] == 5
    assert document["store"]["size"] == context.store.size()


@pytest.mark.slow
def test_the_page_warns_that_messages_have_no_link(serve) -> None:
    words = "Messages about alerts have no link"
    assert words in serve()[1].get("/site").text
    assert words not in serve(url="https://sprung.example.org")[1].get("/site").text


@pytest.mark.slow
def test_loops_that_stand_still_are_marked(client) -> None:
    loops = {each["name"]: (each["age"], each["limit"]) for each in client.get("/api/v1/site").json()["loops"]}
    assert loops == {"station": (0.5, 15.0), "analysis": (300.0, 240.0), "post mail 1": (2.0, 300.0)}
    text = client.get("/site", headers={"Accept": "text/html"}).text
    assert text.count(" stopped</span>") == 1
    for words in (
        "12</td>",
        "123 kB</td>",
        "1.2 s</td>",
        "12 frames, the oldest for 7 s",
        "200 windows, each in 1.2 s",
    ):
        assert words in text


def test_a_certificate_is_shown_with_its_end(store, tmp_path: Path) -> None:
    words = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "20000", "-subj", "/CN=a"]
    path, key = tmp_path / "a.crt", tmp_path / "a.key"
    subprocess.run([*words, "-keyout", key, "-out", path], check=True, capture_output=True)
    settings = Site.model_validate({"web": {"certificate": str(path), "key": str(key)}})

    def detail(now):
        context = Context(store, settings, figures=dict, problems=list, clock=lambda: now)
        return site(context, Person("anna", Role.VIEWER))

    (certificate,) = detail(NOW).certificates
    assert certificate.problem is None
    assert certificate.expires is not None
    assert detail(NOW).sentence == "The monitor works: no problem is known."
    assert "expires at" in detail(certificate.expires - 1).problems[0]


def test_false_alarms_from_verdicts(context, store) -> None:
    """One false alarm in 48 windows of ten minutes, a day of driving; the interval by the chi-squared distribution."""
    observations = tuple((k, NOW, {"time": k}) for k in range(10, 53))  # besides five of the fixture
    store.results.commit(Progress("bus-1", 1, done_seq=8, observations=observations, now=NOW))
    none = false_alarms(context)
    assert (none.vehicle_days, none.verdicts, none.rate) == (pytest.approx(1.0), 0, 0.0)
    assert none.interval == (0.0, pytest.approx(chi2.ppf(0.975, 2) / 2))
    for verdict in ("confirmed", "nothing found"):
        operations.add_verdict(store, 1, verdict=verdict, who="eve", now=NOW)
    operations.add_verdict(store, 2, verdict="nothing found", who="eve", now=NOW)  # a silent vehicle is no false alarm
    alarms = false_alarms(context)
    assert (alarms.configured, alarms.verdicts, alarms.false) == (0.01, 1, 1)
    assert alarms.rate == pytest.approx(1.0)
    assert alarms.interval == pytest.approx((chi2.ppf(0.025, 2) / 2, chi2.ppf(0.975, 4) / 2))
    operations.add_verdict(store, 1, verdict="not looked at", who="eve", now=NOW)
    assert false_alarms(context).verdicts == 0


def test_senders_are_tested_from_the_page(store, people, receiver) -> None:
    handler, url = receiver
    settings = Site.model_validate({"send": {**SENDERS, "webhook": [{"url": f"{url}/{SECRET}"}]}})
    context = Context(store, settings, figures=dict, problems=list, clock=lambda: NOW)
    with TestClient(application(context), base_url="http://127.0.0.1:8737") as client:
        token = client.post("/api/v1/session", json={"name": "eve", "password": PASSWORD}).json()["csrf_token"]
        assert client.get("/site").text.count("Send a test</button>") == 3
        for name in ("webhook 1", "mail 1"):
            answer = client.post(f"/site/senders/{name}/test", data={"csrf_token": token}, follow_redirects=False)
            assert (answer.status_code, answer.headers["location"]) == (303, "/site#senders")
        text = client.get("/site").text
        unknown = client.post("/site/senders/mail 7/test", data={"csrf_token": token})
        assert (unknown.status_code, "unknown sender" in unknown.json()["detail"]) == (404, True)
    assert len(handler.received) == 1
    assert "mail server 127.0.0.1:1 cannot be reached (Connection refused)" in text
    found = {each.name: each for each in senders(context)}
    hook = found["webhook 1"]
    assert (hook.tested, hook.tested_by, hook.problem) == (NOW, "eve", None)
    assert "cannot be reached" in (found["mail 1"].problem or "")
    assert found["log"].tested is None
    assert SECRET not in str(store.requests.audited())
