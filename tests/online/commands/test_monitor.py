"""What is said at the start of a monitor is true, and enough to go on."""

from sprung.link import Address
from sprung.online.commands.monitor import start_in_words
from sprung.online.monitor import Site


def said(n_vehicles=0, **site):
    settings = Site.model_validate(site)
    broker = Address.parse(site.get("broker", "mqtt://127.0.0.1:1883"))
    return start_in_words(settings, broker, http=("127.0.0.1", 8737), n_vehicles=n_vehicles)


def test_a_monitor_without_settings() -> None:
    settings = Site()
    assert start_in_words(settings, Address("127.0.0.1", 1883), http=settings.http_address, n_vehicles=0) == [
        "boxes reach this monitor at mqtt://127.0.0.1:1883 (embedded, for programs of this user only)",
        "pages: http://127.0.0.1:8737/; no log-in is needed on this machine until there is an account (sprung accounts "
        "add)",
        "interface: http://127.0.0.1:8737/api, health: http://127.0.0.1:8737/health, figures for Prometheus: "
        "http://127.0.0.1:8737/metrics",
        "store: sqlite:///sprung-data/sprung.sqlite; samples of the last 2 days in sprung-data/raw",
        "alerts go to this log and to MQTT only: add [[send.mail]] or [[send.webhook]] to the site file",
        "next: connect a box (sprung box --help), or replay a recording: sprung replay FILE --vehicle-id ID "
        "--vehicle V.toml --broker mqtt://127.0.0.1:1883; then sprung vehicles shows the progress",
    ]


def test_a_site_with_broker_server_and_recipients() -> None:
    mail = {"host": "mail", "sender": "a@example.org", "recipients": ["b@example.org", "c@example.org"]}
    broker, pages, _, store, alerts, following = said(
        broker="mqtts://broker.example.org",
        store="postgresql://user:secret@host/sprung",
        keep={"raw_days": 0},
        send={
            "mail": [mail],
            "webhook": [{"url": "https://example.org/x"}],
            "apprise": 2 * [{"url": "json://example.org"}],
        },
        web={"certificate": "pages.crt", "key": "pages.key"},
        n_vehicles=2,
    )
    assert broker == "boxes reach this monitor at mqtts://broker.example.org:8883"
    assert pages.startswith("pages: https://127.0.0.1:8737/; no log-in is needed")
    assert store == "store: postgresql://user:***@host/sprung; samples are not kept"
    assert alerts == (
        "alerts go to this log, to MQTT, and by mail to b@example.org, c@example.org and 1 webhook and 2 apprise "
        "services: test it with sprung monitor --test-senders"
    )
    assert following == (
        "next: sprung vehicles --store postgresql://user:***@host/sprung shows the progress of 2 known vehicles"
    )


def test_an_address_of_version_6_is_in_brackets() -> None:
    (_, page, *_) = start_in_words(Site(), Address("::1", 1883), http=("::1", 8737), n_vehicles=1, has_accounts=True)
    assert page == "pages: http://[::1]:8737/"
