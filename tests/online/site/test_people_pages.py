"""Accounts, tokens and the audit trail by forms, as a browser without scripts sends them."""

import re

import pytest
from tests.online.site.conftest import NOW, PASSWORD


@pytest.fixture
def admin(log_in):
    """A client of an administrator, and the headers of its acts."""
    return log_in("admin")


@pytest.fixture
def send(admin):
    """Function of a path and fields that sends a form as an administrator, and returns the page that follows."""
    client, headers = admin

    def sent(path, **fields):
        token = {"csrf_token": headers["X-CSRF-Token"]}
        return client.post(path, data=fields | token, headers={"Accept": "text/html"})

    return sent


@pytest.mark.slow
def test_an_account_is_added_changed_and_removed(send, store) -> None:
    text = send("/people/accounts", name="carl", role="viewer", password=PASSWORD).text
    assert "The account is saved" in text
    assert '<th scope="row">carl</th>' in text
    password = store.accounts.find("carl").password
    assert "The role is changed" in send("/people/accounts/role", name="carl", role="engineer").text
    assert (store.accounts.find("carl").role, store.accounts.find("carl").password) == ("engineer", password)
    assert "The account is removed" in send("/people/accounts/remove", name="carl").text
    assert store.accounts.find("carl") is None
    acts = [(row.who, row.act, row.subject) for row in store.requests.audited(limit=3)]
    assert acts == [("ada", "account", "carl"), ("ada", "role", "carl"), ("ada", "account removed", "carl")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "fields", "words"),
    [
        ("accounts", {"name": "carl", "role": "viewer", "password": "short"}, "10 to 200 characters"),
        ("accounts", {"name": "carl", "role": "viewer", "password": "x" * 201}, "10 to 200 characters"),
        ("accounts", {"name": "", "role": "viewer", "password": PASSWORD}, "1 to 64 printable"),
        ("accounts", {"name": "e\nve", "role": "viewer", "password": PASSWORD}, "1 to 64 printable"),
        ("accounts", {"name": "carl", "role": "root", "password": PASSWORD}, "is unknown: give viewer"),
        ("accounts", {"name": "ada", "role": "engineer", "password": PASSWORD}, "ada is the last administrator"),
        ("accounts/role", {"name": "ada", "role": "viewer"}, "ada is the last administrator"),
        ("accounts/remove", {"name": "ada"}, "ada is the last administrator"),
        ("accounts/role", {"name": "carl", "role": "viewer"}, "unknown account"),
        ("accounts/role", {"name": "eve", "role": "root"}, "is unknown: give viewer"),
        ("accounts/remove", {"name": "carl"}, "unknown account"),
        ("tokens", {"name": "", "role": "viewer"}, "1 to 64 printable"),
        ("tokens", {"name": "a", "role": "viewer", "days": "soon"}, "must be a number"),
        ("tokens", {"name": "a", "role": "viewer", "days": "nan"}, "must be above 0"),
        ("tokens/77/revoke", {}, "unknown token 77"),
    ],
)
def test_what_cannot_be_is_said(send, store, path, fields, words) -> None:
    before = len(store.requests.audited())
    answer = send(f"/people/{path}", **fields)
    assert answer.status_code in {404, 409}
    assert words in answer.text
    assert len(store.requests.audited()) == before


@pytest.mark.slow
def test_a_token_is_shown_once_and_works_until_it_is_revoked(admin, send, store) -> None:
    client, _ = admin
    text = send("/people/tokens", name="dashboard", role="viewer", days="30").text
    (secret,) = re.findall(r"<pre class=\"secret\" tabindex=\"0\">(sprung_[\w-]{43})</pre>", text)
    assert secret not in client.get("/people").text
    headers = {"Authorization": f"Bearer {secret}"}
    assert client.get("/api/v1/session", headers=headers).json()["name"] == "token dashboard"
    (row,) = store.accounts.tokens()
    assert row.expires == NOW + 30 * 86400 * 10**9
    assert "The token is revoked" in send(f"/people/tokens/{row.id}/revoke").text
    assert client.get("/api/v1/session", headers=headers).status_code == 401


def test_the_audit_trail_has_pages(log_in, store) -> None:
    client, _ = log_in("engineer")
    for number in range(250):
        store.requests.audit("eve", "ack", f"alert-{number:03d}", {"why": ["x"]}, now=NOW)
    seen, path = [], ["/audit"]
    while path:
        text = client.get(path[0]).text
        seen += re.findall(r"alert-\d{3}", text)
        path = re.findall(r'rel="next" href="([^"]+)"', text)
    assert seen == [f"alert-{number:03d}" for number in reversed(range(250))]


def test_roles_change_through_the_interface(log_in, store) -> None:
    client, headers = log_in("admin")
    done = client.patch("/api/v1/accounts/eve", json={"role": "viewer"}, headers=headers)
    assert (done.status_code, store.accounts.find("eve").role) == (200, "viewer")
    assert client.patch("/api/v1/accounts/ada", json={"role": "viewer"}, headers=headers).status_code == 409
    assert client.patch("/api/v1/accounts/carl", json={"role": "viewer"}, headers=headers).status_code == 404
