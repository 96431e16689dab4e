"""Why a broker cannot be reached, in one sentence; and how long that is waited for."""

import gc
import socket
import ssl
import threading

import pytest

from sprung.errors import ParameterError
from sprung.link import Address, Link, LinkError

pytest.importorskip("paho.mqtt.client")

#: paho leaves the sockets that wake its thread to the garbage collector.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed <s:ResourceWarning")


@pytest.fixture(autouse=True)
def collected():
    """Let sockets go here, where that is allowed, and not in whatever test comes next."""
    yield
    gc.collect()


@pytest.fixture
def made():
    """Return a function from an address to a link, which is closed in the end."""
    links = []

    def link(url):
        links.append(Link(Address.parse(url), "lost", topics=[], on_message=print))
        return links[-1]

    yield link
    for one in links:
        one.close()


@pytest.fixture
def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


REFUSED = ConnectionRefusedError(111, "Connection refused")
NO_HOST = socket.gaierror(socket.EAI_NONAME, "Name or service not known")
ERRORS = [
    (NO_HOST, r"\(unknown host\): correct its name"),
    (socket.gaierror(socket.EAI_AGAIN, "Temporary failure"), r"\(its name cannot be resolved\): check the name"),
    (REFUSED, r"\(connection refused\): check that the broker is running on that port"),
    (TimeoutError("timed out"), r"\(the attempt timed out\): check that its machine is on"),
    (ssl.SSLError("WRONG_VERSION_NUMBER"), r"\(TLS failed: .*\): check ca, cert and key"),
    (OSError(113, "No route to host"), r"\(No route to host\): check that it runs there"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("error", "sentence"), ERRORS, ids=lambda value: type(value).__name__)
def test_each_cause_is_named_apart(made, monkeypatch: pytest.MonkeyPatch, error, sentence) -> None:
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(socket, "create_connection", fail)
    with pytest.raises(LinkError, match=f"^the broker mqtt://broker.example:1883 cannot be reached {sentence}"):
        made("mqtt://broker.example").open(timeout=0.5)


def test_refusal_of_a_real_port(made, free_port) -> None:
    with pytest.raises(LinkError, match=rf"127.0.0.1:{free_port} cannot be reached \(connection refused\)"):
        made(f"mqtt://127.0.0.1:{free_port}").open(timeout=30.0)


@pytest.mark.slow
def test_patience_waits_for_a_broker_that_is_not_there_yet(made, mosquitto) -> None:
    """The first attempt is refused, and the next one, a second later, is let in."""
    broker = mosquitto()
    broker.stop()
    later = threading.Timer(0.5, broker.restart)
    later.start()
    link = made(broker.address)
    link.open(timeout=20.0, is_patient=True)
    later.join()
    assert link.is_connected
    assert not link.problem


def test_one_who_listens_and_says_nothing(made) -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        link = made(f"mqtt://127.0.0.1:{mute.getsockname()[1]}")
        with pytest.raises(LinkError, match=r"cannot be reached \(no answer\): check that it runs there"):
            link.open(timeout=0.5)


def test_a_host_that_can_be_none_is_no_address() -> None:
    with pytest.raises(ParameterError, match=r"'mqtt://a\.\.b' is not the address of a broker"):
        Address.parse("mqtt://a..b")
