"""Sentences for the operator when the monitor starts: where it listens, where results are, and what to do next."""

from pathlib import Path

from sprung._display import counted
from sprung.link import Address
from sprung.online.monitor.site import Site, embedded_port
from sprung.online.store import check_address


def start_in_words(
    site: Site, broker: Address, *, http: tuple[str, int], n_vehicles: int, has_accounts: bool = False
) -> list[str]:
    """Return sentences about a monitor that has just started.

    Parameters
    ----------
    site
        Settings of the monitor.
    broker
        Address of its broker.
    http
        Host and port of its pages.
    n_vehicles
        Number of vehicles in the store.
    has_accounts
        Whether people log in.
    """
    is_embedded = embedded_port(site.broker) is not None
    store = check_address(site.store).render_as_string(hide_password=True).replace("+psycopg", "")
    scheme = "http" if site.web.certificate is None else "https"
    page = f"{scheme}://{f'[{http[0]}]' if ':' in http[0] else http[0]}:{http[1]}"
    log_in = (
        "" if has_accounts else "; no log-in is needed on this machine until there is an account (sprung accounts add)"
    )
    where = f" --store {store}" if site.store != Site().store else ""
    return [
        f"boxes reach this monitor at {broker}{' (embedded, for programs of this user only)' if is_embedded else ''}",
        f"pages: {page}/{log_in}",
        f"interface: {page}/api, health: {page}/health, figures for Prometheus: {page}/metrics",
        f"store: {store}; {_samples(site)}",
        *_exposed(site),
        _recipients(site),
        f"next: sprung vehicles{where} shows the progress of {n_vehicles} known vehicle{'s'[: n_vehicles != 1]}"
        if n_vehicles
        else "next: connect a box (sprung box --help), or replay a recording: sprung replay FILE --vehicle-id ID "
        f"--vehicle V.toml --broker {broker}; then sprung vehicles{where} shows the progress",
    ]


def _samples(site: Site) -> str:
    """Return where samples are kept, and how long."""
    if site.archive is None:
        return "samples are not kept"
    return f"samples of the last {site.keep.raw_days:g} days in {site.archive}"


def _exposed(site: Site) -> list[str]:
    """Return a sentence if other users of this machine can read the file of the store, as an older program made it."""
    path = Path(site.store.removeprefix("sqlite:///"))
    try:
        is_exposed = site.store.startswith("sqlite:///") and path.stat().st_mode & 0o077
    except OSError:
        return []
    sentence = f"other users of this machine can read or write {path}: make it private with chmod -R go= {path.parent}"
    return [sentence] if is_exposed else []


def _recipients(site: Site) -> str:
    """Return who is notified of alerts."""
    mails = [address for mail in site.send.mail for address in mail.recipients]
    numbers = (("webhook", len(site.send.webhook)), ("apprise service", len(site.send.apprise)))
    if not mails and not any(number for _, number in numbers):
        return "alerts go to this log and to MQTT only: add [[send.mail]] or [[send.webhook]] to the site file"
    parts = [f"mail to {', '.join(mails)}"] if mails else []
    parts += [counted(number, name) for name, number in numbers if number]
    return f"alerts go to this log, to MQTT, and by {' and '.join(parts)}: test it with sprung monitor --test-senders"
