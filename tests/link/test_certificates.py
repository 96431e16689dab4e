"""The common name and the end of a certificate, against what openssl writes."""

import ssl
import subprocess
from pathlib import Path

import pytest

from sprung.errors import ParameterError
from sprung.link import common_name, valid_until

RSA = ("rsa:2048",)
CURVE = ("ec", "-pkeyopt", "ec_paramgen_curve:P-256")


@pytest.mark.parametrize(
    ("subject", "key", "options", "name"),
    [
        ("/CN=bus-17", CURVE, (), "bus-17"),
        ("/C=DE/O=Depot/CN=bus-17/emailAddress=a@example.org", RSA, (), "bus-17"),
        ("/O=Depot/CN=Straßenbahn 17", CURVE, ("-utf8",), "Straßenbahn 17"),
        ("/O=Depot", CURVE, (), ""),
    ],
)
def test_name_of_the_holder(tmp_path: Path, subject, key, options, name) -> None:
    words = ["openssl", "req", "-x509", "-newkey", *key, "-nodes", "-days", "1", "-subj", subject, *options]
    subprocess.run([*words, "-keyout", tmp_path / "a.key", "-out", tmp_path / "a.crt"], check=True, capture_output=True)
    assert common_name(tmp_path / "a.crt") == name


def test_holder_and_not_issuer(tmp_path: Path) -> None:
    script = Path(__file__).parents[2] / "scripts" / "make-test-ca"
    subprocess.run([script, tmp_path, "bus-17"], check=True, capture_output=True)
    assert common_name(tmp_path / "bus-17.crt") == "bus-17"


@pytest.mark.parametrize("content", [b"", b"x", b"-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n"])
def test_anything_else_has_none(tmp_path: Path, content) -> None:
    path = tmp_path / "a.crt"
    assert common_name(path) == ""
    path.write_bytes(content)
    assert common_name(path) == ""


@pytest.mark.parametrize("days", [1, 30, 20000])
def test_end_of_the_validity(tmp_path: Path, days) -> None:
    """Beyond 2049 certificates write years with four digits."""
    words = ["openssl", "req", "-x509", "-newkey", *RSA, "-nodes", "-days", str(days), "-subj", "/CN=a"]
    subprocess.run([*words, "-keyout", tmp_path / "a.key", "-out", tmp_path / "a.crt"], check=True, capture_output=True)
    shown = subprocess.run(
        ["openssl", "x509", "-in", tmp_path / "a.crt", "-noout", "-enddate"], check=True, capture_output=True, text=True
    ).stdout
    assert valid_until(tmp_path / "a.crt") == ssl.cert_time_to_seconds(shown.strip().removeprefix("notAfter=")) * 10**9


@pytest.mark.parametrize("content", [b"", b"x", b"-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n"])
def test_anything_else_has_no_end(tmp_path: Path, content) -> None:
    (tmp_path / "a.crt").write_bytes(content)
    with pytest.raises(ParameterError, match="holds no certificate that can be read"):
        valid_until(tmp_path / "a.crt")
    with pytest.raises(ParameterError, match="No such file"):
        valid_until(tmp_path / "b.crt")
