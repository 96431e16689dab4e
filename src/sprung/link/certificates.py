"""The name that a certificate gives its holder."""

import ssl
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

#: Object identifier of the common name, encoded (ITU-T X.520, id-at-commonName 2.5.4.3), and tags of ASN.1 (X.690).
_COMMON_NAME = bytes((0x55, 0x04, 0x03))
_VERSION, _BMP_STRING = 0xA0, 0x1E
_FOOT = "-----END CERTIFICATE-----"


def common_name(path: str | Path) -> str:
    """Return the common name of the holder of a certificate, which is the user name at a broker as shipped.

    Parameters
    ----------
    path
        File with the certificate (PEM); of several the first counts.

    Returns
    -------
    str
        The name; empty where the file holds no certificate that can be read, or one without such a name.

    Notes
    -----
    The fields of a certificate are version (optional), serial number, algorithm, issuer, validity, subject (RFC 5280,
    4.1).
    """
    with suppress(OSError, ValueError, IndexError):
        text = Path(path).read_text(encoding="ascii")
        first = text[text.index("-----BEGIN CERTIFICATE-----") : text.index(_FOOT) + len(_FOOT)]
        ((_, certificate),) = _fields(ssl.PEM_cert_to_DER_cert(first))
        (_, signed), *_ = _fields(certificate)
        fields = [content for tag, content in _fields(signed) if tag != _VERSION]
        for _, attributes in _fields(fields[4]):
            for _, attribute in _fields(attributes):
                (_, name), (tag, value) = _fields(attribute)
                if name == _COMMON_NAME:
                    return value.decode("utf-16-be" if tag == _BMP_STRING else "utf-8")
    return ""


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
