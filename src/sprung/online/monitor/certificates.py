"""Certificates of a monitor, and when they expire."""

from dataclasses import dataclass

from sprung.errors import ParameterError
from sprung.link import Address, valid_until
from sprung.online.monitor.site import Site, embedded_port
from sprung.results.tables.wording import format_time

#: Time before the expiry of a certificate from which on it is reported [ns].
_WARN = 30 * 86400 * 10**9


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate in a file.

    Parameters
    ----------
    purpose
        Purpose of the certificate.
    path
        File that contains it.
    expires
        Time until which it is valid, UTC ns; None if the file cannot be read.
    problem
        Reason why the file cannot be read; None if it can.
    """

    purpose: str
    path: str
    expires: int | None
    problem: str | None = None

    def problem_at(self, now: int) -> str | None:
        """Return what is wrong with it at a time (UTC ns) and what to do; None if nothing is."""
        if self.expires is None:
            return f"{self.purpose}: {self.problem}"
        if self.expires - now >= _WARN:
            return None
        verb = "has expired" if self.expires <= now else "expires"
        end = format_time(self.expires)
        return f"the {self.purpose} {self.path} {verb} at {end} UTC: renew it, then restart the monitor"


def certificates_of(site: Site) -> list[Certificate]:
    """Return the certificates that a site file names: of the pages, and of the connection to the broker."""
    files = {"certificate of the pages": site.web.certificate or ""}
    if embedded_port(site.broker) is None:
        address = Address.parse(site.broker)
        files |= {"certificate at the broker": address.cert, "certificate of the broker's authority": address.ca}
    return [_read(path, purpose) for purpose, path in files.items() if path]


def _read(path: str, purpose: str) -> Certificate:
    """Return the certificate in a file."""
    try:
        return Certificate(purpose, path, valid_until(path))
    except ParameterError as error:
        return Certificate(purpose, path, None, str(error))
