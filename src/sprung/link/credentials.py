"""Credentials at a broker: what a certificate says of its holder, and the password inside a monitor.

The password is in a file that only programs of the same user can read.
"""

import fcntl
import os
import secrets
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from sprung.errors import ParameterError, SprungError

#: User name under which programs of this machine reach the broker.
LOCAL_USER = "local"
_HERE = {"127.0.0.1", "localhost", "::1"}
#: Object identifier of the common name, encoded (ITU-T X.520, id-at-commonName 2.5.4.3), and tags of ASN.1 (X.690).
_COMMON_NAME = bytes((0x55, 0x04, 0x03))
_VERSION = 0xA0
_BMP_STRING = 0x1E
_UTC_TIME = 0x17
_FOOT = "-----END CERTIFICATE-----"


def common_name(path: str | Path) -> str:
    r"""Return the common name of the holder of a certificate, which is the user name at a broker as shipped.

    Parameters
    ----------
    path
        File with the certificate (PEM); of several the first counts.

    Returns
    -------
    str
        The name; empty if the file holds no certificate that can be read, or one without such a name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> lines = (
    ...     "-----BEGIN CERTIFICATE-----",
    ...     "MIHIMHwCAQEwBQYDK2VwMBExDzANBgNVBAMMBmJ1cy0xNzAeFw0yNjExMjMwMjQxMDRaFw0zNjExMjAwMjQxMDRa",
    ...     "MBExDzANBgNVBAMMBmJ1cy0xNzAqMAUGAytlcAMhAPHazIsP7jGA6YNMn50igP2g4+gjxebhnU0+fUNCwwaWMAUG",
    ...     "AytlcANBAE5yjYPO9H9vG52C5Nl7nL99QRDLX6iF3R5bov1O386o1Iyx6tuFFukZGpaJtS2th8FslkCKcZunqMES",
    ...     "YegK5Ac=",
    ...     "-----END CERTIFICATE-----",
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "box.crt")
    ...     _ = path.write_text("\n".join(lines), encoding="utf-8")
    ...     common_name(path)
    'bus-17'
    """
    with suppress(OSError, ValueError, IndexError):
        for _, attributes in _fields(_contents(path)[4]):
            for _, attribute in _fields(attributes):
                (_, name), (tag, value) = _fields(attribute)
                if name == _COMMON_NAME:
                    return value.decode("utf-16-be" if tag == _BMP_STRING else "utf-8")
    return ""


def valid_until(path: str | Path) -> int:
    r"""Return the time until which a certificate is valid, UTC ns.

    Parameters
    ----------
    path
        File with the certificate (PEM); of several the first counts.

    Raises
    ------
    ParameterError
        If the file cannot be read, or holds no certificate.

    Notes
    -----
    The validity has two times, of two kinds (RFC 5280, 4.1.2.5): with two digits for years from 1950 to 2049, else with
    four.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> lines = (
    ...     "-----BEGIN CERTIFICATE-----",
    ...     "MIHIMHwCAQEwBQYDK2VwMBExDzANBgNVBAMMBmJ1cy0xNzAeFw0yNjExMjMwMjQxMDRaFw0zNjExMjAwMjQxMDRa",
    ...     "MBExDzANBgNVBAMMBmJ1cy0xNzAqMAUGAytlcAMhAPHazIsP7jGA6YNMn50igP2g4+gjxebhnU0+fUNCwwaWMAUG",
    ...     "AytlcANBAE5yjYPO9H9vG52C5Nl7nL99QRDLX6iF3R5bov1O386o1Iyx6tuFFukZGpaJtS2th8FslkCKcZunqMES",
    ...     "YegK5Ac=",
    ...     "-----END CERTIFICATE-----",
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "box.crt")
    ...     _ = path.write_text("\n".join(lines), encoding="utf-8")
    ...     valid_until(path)
    2110761664000000000
    """
    try:
        _, (tag, end) = _fields(_contents(path)[3])
        text = end.decode("ascii")
        if tag == _UTC_TIME:
            text = ("19" if text >= "50" else "20") + text
        return int(datetime.strptime(text, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC).timestamp()) * 10**9
    except OSError as error:
        raise ParameterError(f"{path} cannot be read ({error.strerror}): give a file with a certificate") from None
    except (ValueError, IndexError):
        raise ParameterError(f"{path} holds no certificate that can be read: give one in PEM") from None


def _contents(path: str | Path) -> list[bytes]:
    """Return the fields of a certificate.

    They are serial number, algorithm, issuer, validity, subject (RFC 5280, 4.1); the optional version is left out.
    """
    text = Path(path).read_text(encoding="ascii")
    first = text[text.index("-----BEGIN CERTIFICATE-----") : text.index(_FOOT) + len(_FOOT)]
    ((_, certificate),) = _fields(ssl.PEM_cert_to_DER_cert(first))
    (_, signed), *_ = _fields(certificate)
    return [content for tag, content in _fields(signed) if tag != _VERSION]


def _fields(encoded: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield tag and content of each field of a sequence in the distinguished encoding (X.690, 8.1)."""
    place = 0
    while place < len(encoded):
        tag, length = encoded[place], encoded[place + 1]
        place += 2
        if length >= 0x80:
            n_bytes = length - 0x80
            length = int.from_bytes(encoded[place : place + n_bytes], "big")
            place += n_bytes
        yield tag, encoded[place : place + length]
        place += length


class SecretError(SprungError):
    """A password that cannot be kept."""


@contextmanager
def keep_secret(port: int) -> Iterator[str]:
    """Yield a new random password for the broker at a port, kept in a file until the end of the context.

    Raises
    ------
    SecretError
        If the file cannot be written.

    Notes
    -----
    The file is in the folder ``$XDG_STATE_HOME/sprung``, by default ``~/.local/state/sprung`` (mode 700), has mode 600,
    and is locked: so one that a killed program left differs from one in use.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         is_found = find_secret("localhost", 1883) == secret
    ...     is_found, find_secret("localhost", 1883)
    (True, '')
    """
    secret = secrets.token_urlsafe(32)
    try:
        path = _path(port)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)  # it may have another mode, or be that of a program that was killed
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.write(handle, secret.encode())
    except (OSError, RuntimeError) as error:
        raise SecretError(
            f"the password of the embedded broker cannot be kept ({error}): set XDG_STATE_HOME to a folder that this "
            "user can write, or give --broker"
        ) from None
    try:
        yield secret
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def find_secret(host: str, port: int) -> str:
    """Return the password of the broker of a monitor that runs on this machine as the same user; empty: none.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryDirectory
    >>> from unittest.mock import patch
    >>> with TemporaryDirectory() as folder, patch.dict(os.environ, XDG_STATE_HOME=folder):
    ...     with keep_secret(1883) as secret:
    ...         find_secret("localhost", 1883) == secret, find_secret("broker.example.org", 1883)
    (True, '')
    """
    if host not in _HERE:
        return ""
    try:
        handle = os.open(_path(port), os.O_RDONLY)
    except (OSError, RuntimeError):
        return ""
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return os.read(handle, 100).decode("ascii", errors="replace")
    finally:
        os.close(handle)
    return ""  # nobody holds the lock: the program that wrote it has ended


def _path(port: int) -> Path:
    """Return the file of the broker at a port of this machine."""
    state = os.environ.get("XDG_STATE_HOME", "")
    return (Path(state) if state else Path.home() / ".local" / "state") / "sprung" / f"broker-{port}"
