"""What every client of TLS refuses: certificates that are expired, foreign, weak or of another host, and old TLS."""

import socket
import socketserver
import ssl
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from sprung.link import Address, Link, LinkError
from sprung.online.alerts import MailSender, Message, SendError, WebhookSender

#: paho leaves the sockets that wake its thread to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore:unclosed <s:ResourceWarning"),
    pytest.mark.filterwarnings("ignore:ssl.TLSVersion.TLSv1:DeprecationWarning"),  # which is what is served
]
MESSAGE = Message(vehicle="bus-1", what="raised", severity=700, subject="bus-1", text="text", time=0, document={})


def openssl(*words: object) -> None:
    subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Folder with an authority (ca.crt), and certificates of 127.0.0.1 by it, each bad in one way but `good`."""
    folder: Path = tmp_path_factory.mktemp("certificates")
    for name in ("ca", "other"):
        words = ("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", 9, "-subj", f"/CN={name}")
        openssl(*words, "-keyout", folder / f"{name}.key", "-out", folder / f"{name}.crt")
    for name, key, authority, host, days in (
        ("good", "rsa:2048", "ca", "IP:127.0.0.1", 9),
        ("expired", "rsa:2048", "ca", "IP:127.0.0.1", 0),
        ("foreign", "rsa:2048", "other", "IP:127.0.0.1", 9),
        ("elsewhere", "rsa:2048", "ca", "DNS:example.org", 9),
        ("weak", "rsa:1024", "ca", "IP:127.0.0.1", 9),
    ):
        request, extensions = folder / f"{name}.csr", folder / f"{name}.ext"
        extensions.write_text(f"subjectAltName={host}\n", encoding="utf-8")
        openssl("req", "-newkey", key, "-nodes", "-subj", "/CN=a", "-keyout", folder / f"{name}.key", "-out", request)
        signed = ("-CA", folder / f"{authority}.crt", "-CAkey", folder / f"{authority}.key", "-extfile", extensions)
        openssl("x509", "-req", "-in", request, *signed, "-days", days, "-out", folder / f"{name}.crt")
    time.sleep(1.1)  # the expired one was valid for its first second
    return folder


@contextmanager
def serving(folder: Path, name: str, *, begin: bytes = b"", oldest: bool = False):
    """Serve TLS, after a line of SMTP where `begin` is one, and yield the port and the bytes that came through."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.set_ciphers("DEFAULT:@SECLEVEL=0")
    if oldest:
        context.minimum_version, context.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
    context.load_cert_chain(folder / f"{name}.crt", folder / f"{name}.key")
    came: list[bytes] = []

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            plain: socket.socket = self.request
            plain.settimeout(5)
            try:
                if begin:
                    plain.sendall(begin)
                    plain.recv(1000)  # EHLO
                    plain.sendall(b"250-here\r\n250 STARTTLS\r\n")
                    plain.recv(1000)  # STARTTLS
                    plain.sendall(b"220 go\r\n")
                with context.wrap_socket(plain, server_side=True) as secure:
                    came.append(secure.recv(1000))
            except OSError:
                pass  # the client went away, as it should

    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server.server_address[1], came
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def deliver(kind: str, port: int, ca: Path) -> None:
    if kind == "broker":
        link = Link(Address.parse(f"mqtts://127.0.0.1:{port}?ca={ca}"), "a", topics=(), on_message=lambda *_: None)
        try:
            link.open(timeout=3.0)
        finally:
            link.close()
    elif kind == "webhook":
        WebhookSender(f"https://127.0.0.1:{port}/a", timeout=3.0).send(MESSAGE)
    else:
        MailSender("127.0.0.1", port, sender="a@example.org", recipients=["b@example.org"], timeout=3.0).send(MESSAGE)


@pytest.mark.parametrize("kind", ["broker", "webhook", "mail"])
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("good", "answer|closed|cannot be reached"),
        ("expired", "expired"),
        ("foreign", "self-signed|unable to get local issuer"),
        ("elsewhere", "IP address mismatch|not valid for '127.0.0.1'"),
        ("weak", "key too weak"),
        ("old TLS", "protocol|version|ALERT|alert"),
    ],
)
def test_clients_send_nothing_to_a_server_that_is_not_who_it_should_be(
    certificates, monkeypatch, kind, name, why
) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", str(certificates / "ca.crt"))
    begin = b"220 here\r\n" if kind == "mail" else b""
    certificate = "good" if name == "old TLS" else name
    with (
        serving(certificates, certificate, begin=begin, oldest=name == "old TLS") as (port, came),
        pytest.raises((LinkError, SendError), match=why),
    ):
        deliver(kind, port, certificates / "ca.crt")
    assert bool(b"".join(came)) == (name == "good")
