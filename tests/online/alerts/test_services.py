"""The sender for services of apprise."""

import json
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import ClassVar

import pytest

from sprung.errors import ParameterError
from sprung.online.alerts import Message, SendError, ServiceSender, trial_message

#: apprise loads a module of the standard library that Python is going to remove.
pytestmark = pytest.mark.filterwarnings("ignore:'imghdr' is deprecated:DeprecationWarning")


class _Service(BaseHTTPRequestHandler):
    """A server that takes what apprise posts, and answers with its `status`."""

    status = 200
    received: ClassVar[list[dict[str, str]]] = []

    def do_POST(self) -> None:
        self.received.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(self.status)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Write nothing."""


@pytest.fixture
def service():
    """The server's class and its address, as apprise writes it."""
    pytest.importorskip("apprise")
    handler = type("Service", (_Service,), {"received": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        yield handler, f"json://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("what", "severity", "kind"),
    [("raised", 900, "failure"), ("raised", 500, "warning"), ("raised", 100, "info"), ("cleared", 900, "success")],
)
def test_subject_text_and_kind_arrive(service, what, severity, kind) -> None:
    handler, url = service
    message = Message("car-1", what, severity, "a subject", "text\nof two lines", 0, {})
    ServiceSender(url).send(message)
    (posted,) = handler.received
    assert (posted["title"], posted["message"], posted["type"]) == ("a subject", "text\nof two lines", kind)


def test_a_service_that_refuses_is_named_without_its_secret(service) -> None:
    handler, url = service
    handler.status = 500
    with pytest.raises(SendError, match="the service json did not accept the notification") as caught:
        ServiceSender(url.replace("json://", "json://user:secret@")).send(trial_message(0))
    assert "secret" not in str(caught.value)


def test_unknown_services() -> None:
    pytest.importorskip("apprise")
    with pytest.raises(SendError, match="apprise does not know the address of the service nosuch") as caught:
        ServiceSender("nosuch://secret").send(trial_message(0))
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("url", ["", "slack", "slack://", "://x", "secret token"])
def test_addresses_that_are_none(url) -> None:
    with pytest.raises(ParameterError, match="url of the service must be like slack://"):
        ServiceSender(url)


def test_a_missing_package_is_a_failure_of_the_sender(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "apprise", None)
    with pytest.raises(SendError, match=r"the service slack needs the package apprise: .*sprung\[apprise\]"):
        ServiceSender("slack://x").send(trial_message(0))
