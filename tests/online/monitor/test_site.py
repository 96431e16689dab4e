"""The site file: every mistake in it is one sentence with file, place, rule and remedy."""

import json
import re
import tomllib
from pathlib import Path
from types import NoneType
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sprung.errors import FormatError, ParameterError, SprungError
from sprung.online.alerts import AlertSettings
from sprung.online.monitor import MonitorSettings, Site, read_site
from sprung.toml import checked

MANUAL = Path(__file__).parents[3] / "docs" / "monitor.md"


def example():
    """The text of the manual's site file."""
    (block,) = re.findall(r"```toml\n(.*?)```", MANUAL.read_text(encoding="utf-8"), flags=re.DOTALL)
    return block


def test_site_file_of_the_manual(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text(example(), encoding="utf-8")
    site = read_site(path)
    assert (site.broker, site.http_address) == ("embedded", ("127.0.0.1", 8737))
    assert site.archive == Path("sprung-data/raw")
    assert site.alerts.settings.renotify_after == 24 * 3600 * 10**9
    assert [hook.as_sender("a").name for hook in site.send.webhook] == ["a"]
    assert [mail.as_sender("a").name for mail in site.send.mail] == ["a"]
    assert Site() == checked(Site, {})


def documented():
    """Default and meaning of each key in the tables of the manual, by table and key."""
    rows = re.findall(r"^\| `([\w.]+)` \| (.*?) \| (.*?) \|$", MANUAL.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {key: (default, meaning) for key, default, meaning in rows}


def shown_default(field):
    """A default as the manual writes it."""
    if field.is_required():
        return "required"
    default = field.get_default()
    if default is None or default == {}:
        return "-"
    return f"`{json.dumps(default)}`"


def fields(model, table=""):
    """Keys of a table and of those in it, with their fields."""
    for name, field in model.model_fields.items():
        (kind, *_) = [inner for inner in (field.annotation, *get_args(field.annotation)) if inner is not NoneType]
        inner = next((each for each in get_args(field.annotation) if hasattr(each, "model_fields")), kind)
        if hasattr(inner, "model_fields"):
            yield from fields(inner, f"{table}{name}.")
        else:
            yield f"{table}{field.alias or name}", field


def test_every_setting_is_in_the_manual_with_its_default() -> None:
    expected = {key: (shown_default(field), field.description) for key, field in fields(Site)}
    assert len(expected) == 51
    assert documented() == expected


def test_defaults_are_those_of_the_parts() -> None:
    assert Site().watch.settings == MonitorSettings()
    assert Site().alerts.settings == AlertSettings()


def test_the_address_of_an_alert_is_below_that_of_the_site() -> None:
    assert Site().alert_url(7) == ""
    assert Site(url="https://sprung.example.org/").alert_url(7) == "https://sprung.example.org/alerts/7"


def changed(path, value):
    """The example's fields with one of them changed."""
    fields = tomllib.loads(example())
    place = fields
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    return fields


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("wacht",), {}, "wacht is not known here: did you mean watch?"),
        (("watch", "method"), "ssi", "watch, method='ssi' must be 'cov', 'acs' or 'coss': correct it"),
        (("keep", "results_days"), 1e300, "keep, results_days=1e+300 must be at most 36525: correct it"),
        (
            ("broker",),
            "http://x",
            "broker: 'http://x' is not the address of a broker: write mqtt://host:1883 or mqtts://",
        ),
        (("broker",), "mqtt://a:b@x:99999", "broker: 'mqtt://...@x:99999' is not the address of a broker: Port out of"),
        (("broker",), "embedded:x", "broker: 'embedded:x' is not the address of a broker: write embedded or embedded"),
        (
            ("store",),
            "results.sqlite",
            "store: 'results.sqlite' is not the address of a store: write sqlite:///folder/",
        ),
        (("http",), "8737", "http: '8737' is not an address: write HOST:PORT, such as 127.0.0.1:8737"),
        (("url",), "sprung.example.org", "url: 'sprung.example.org' is not the address of a page: write it like https"),
        (
            ("alerts", "limits"),
            {"dampr": [0.1, 0.2]},
            "alerts, limits: 'dampr' is no part: limit one of spring, damper, primary_spring",
        ),
        (
            ("alerts", "limits"),
            {"damper": [0.3, 0.2]},
            "alerts, limits: damper = [0.3, 0.2] must be a soft limit above 0 and a hard one",
        ),
        (
            ("alerts", "vehicle_limits"),
            {"bus-0*": {"dampr": [0.1, 0.2]}},
            "alerts, vehicle_limits, bus-0*: 'dampr' is no part: limit one of spring, damper, primary_spring",
        ),
        (("send", "webhook"), {"url": "http://secret"}, "send, webhook must be a list: write texts in brackets"),
        (("send", "webhook", 0), {}, "[[send.webhook]] 1, url is missing: add it"),
        (("send", "webhook", 0, "url"), "x/secret", "[[send.webhook]] 1: url of the webhook must begin with http://"),
        (("send", "webhook", 0, "headers"), {"Key": 1}, "[[send.webhook]] 1, headers, Key must be text: write it in"),
        (("send", "mail", 0, "recipients"), [], "[[send.mail]] 1, recipients has 0 entries, but must have at least 1"),
        (("send", "mail", 0, "recipients"), ["anna"], "[[send.mail]] 1: 'anna' is not a mail address: write it like"),
        (("send", "mail", 0, "port"), 0, "[[send.mail]] 1: port=0 must be at least 1 and at most 65535"),
        (("send", "mail", 0, "password"), 1234, "[[send.mail]] 1, password must be text: write it in quotes"),
        (("send", "mail", 0, "password"), "1234", "[[send.mail]] 1: username and password of the mail server go tog"),
    ],
)
def test_refusals_name_the_field_the_rule_and_the_remedy(path, value, message) -> None:
    with pytest.raises(ParameterError) as refusal:
        checked(Site, changed(path, value))
    assert str(refusal.value).startswith(message)
    assert "\n" not in str(refusal.value)
    assert "secret" not in str(refusal.value)
    assert "1234" not in str(refusal.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"broker = \n", r"site\.toml is not a TOML file: Invalid value \(at line 1, column 10\): correct it"),
        (b"\xff\xfe", r"site\.toml is not a TOML file: 'utf-8' codec can't decode"),
        (b"x = " + b"[" * 100_000, r"site\.toml is not a TOML file: nested too deeply"),
        (b"[keep]\nraw_days = -1\nmore = 2", r"site\.toml: keep, raw_days=-1 must be .* \(and 1 more\) \(see docs/mon"),
    ],
)
def test_bad_files_are_refused_with_their_name(tmp_path: Path, content, message) -> None:
    path = tmp_path / "site.toml"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=message):
        read_site(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    for path in (tmp_path / "site.toml", tmp_path):
        with pytest.raises(ParameterError, match=r"cannot be read \((No such file|Is a dir).*\): give the site"):
            read_site(path)


PLACES = [
    ("broker",),
    ("store",),
    ("http",),
    ("watch",),
    ("watch", "workers"),
    ("watch", "method"),
    ("keep", "results_days"),
    ("alerts", "remind_after_hours"),
    ("send",),
    ("send", "mail"),
    ("send", "mail", 0),
    ("send", "mail", 0, "port"),
    ("send", "mail", 0, "recipients"),
    ("send", "webhook", 0, "url"),
    ("send", "webhook", 0, "headers"),
]
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.slow
@given(place=st.sampled_from(PLACES), value=values)
def test_any_value_anywhere_is_read_or_refused_in_one_sentence(place, value) -> None:
    message = ""
    try:
        site = checked(Site, changed(place, value))
        now = 1_795_219_200_000_000_000
        assert abs(site.keep.before(site.keep.results_days, now)) < 2**63
        assert site.watch.settings.learning_windows >= 2
        assert site.alerts.settings.raise_after >= 1
    except SprungError as refusal:
        message = str(refusal)
    assert "\n" not in message
