"""Certificates that expire: a sentence, and an alert that clears when they are renewed."""

import subprocess
from pathlib import Path

import pytest

from sprung.online.monitor import Site
from sprung.online.monitor.housekeeping import CERTIFICATE, Certificate, certificates_of

DAY = 86400 * 10**9
NOW = 1_795_219_200_000_000_000


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (30 * DAY, ""),
        (30 * DAY - 1, "the certificate of the pages a.crt expires at 2026-12-21 "),
        (1, "the certificate of the pages a.crt expires at "),
        (0, "the certificate of the pages a.crt has expired at 2026-11-21 00:00 UTC: renew it, then restart"),
    ],
)
def test_problem_by_the_time_left(left, words) -> None:
    problem = Certificate("certificate of the pages", "a.crt", NOW + left).problem_at(NOW)
    assert (problem or "").startswith(words)
    assert (problem is None) == (not words)


def test_files_of_a_site() -> None:
    site = Site.model_validate(
        {"broker": "mqtts://host?ca=ca.crt&cert=m.crt&key=m.key", "web": {"certificate": "w.crt", "key": "w.key"}}
    )
    assert [each.path for each in certificates_of(site)] == ["w.crt", "m.crt", "ca.crt"]
    problem = certificates_of(site)[0].problem_at(NOW)
    assert problem is not None
    assert "w.crt cannot be read (No such file or directory)" in problem
    assert certificates_of(Site()) == []
    assert certificates_of(Site(broker="mqtt://host")) == []


@pytest.mark.slow
def test_the_alert_stands_until_the_certificate_is_renewed(bench, tmp_path: Path) -> None:
    path = tmp_path / "web.crt"

    def renew(days):
        words = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", str(days), "-subj", "/CN=a"]
        subprocess.run([*words, "-keyout", tmp_path / "web.key", "-out", path], check=True, capture_output=True)

    def active():
        one.seconds += 61.0
        one.station.step()
        return [row.text for row in one.store.alerts.find(is_active=True) if row.cause == CERTIFICATE]

    renew(20000)
    one = bench(web={"certificate": str(path), "key": str(tmp_path / "web.key")})
    assert active() == []
    path.unlink()
    assert ["cannot be read" in text for text in active()] == [True]
    renew(20000)
    assert active() == []
