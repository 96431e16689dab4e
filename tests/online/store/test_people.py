"""Accounts, sessions, tokens, verdicts, and the record of who did what, on both databases."""

from dataclasses import replace

from sprung.online.store import AccountRow, AuditRow, CommandRow, TokenRow, VerdictRow
from sprung.state import AlertState

ANNA = AccountRow("anna", "engineer", "hash-1", 5)
TOKEN = TokenRow("digest", "dashboard", "viewer", 5, "anna", expires=100)


def test_accounts(store) -> None:
    store.accounts.put(ANNA)
    store.accounts.put(AccountRow("bert", "viewer", "hash-2", 6))
    assert [row.name for row in store.accounts.all()] == ["anna", "bert"]
    assert store.accounts.find("anna") == ANNA
    assert store.accounts.find("carl") is None
    store.accounts.put(AccountRow("anna", "admin", "hash-3", 9))
    assert store.accounts.find("anna") == AccountRow("anna", "admin", "hash-3", 5)
    assert (store.accounts.remove("bert"), store.accounts.remove("bert"), store.accounts.n_accounts()) == (
        True,
        False,
        1,
    )
    assert "hash" not in repr(ANNA)


def test_sessions_end_with_their_time_and_with_a_new_password(store) -> None:
    store.accounts.put(ANNA)
    store.accounts.add_session("one", "anna", now=10, expires=20)
    store.accounts.add_session("two", "anna", now=10, expires=40)
    assert store.accounts.of_session("one", now=19) == ANNA
    assert store.accounts.of_session("one", now=20) is None
    assert store.accounts.of_session("three", now=19) is None
    store.accounts.end_session("one")
    assert store.accounts.of_session("one", now=19) is None
    store.accounts.put(replace(ANNA, password="new"))
    assert store.accounts.of_session("two", now=19) is None


def test_tokens_expire_and_are_revoked(store) -> None:
    number = store.accounts.add_token(TOKEN)
    endless = store.accounts.add_token(replace(TOKEN, digest="other", expires=None))
    assert store.accounts.of_token("digest", now=99) == replace(TOKEN, id=number)
    assert store.accounts.of_token("digest", now=100) is None
    assert store.accounts.of_token("other", now=10**18) is not None
    assert [row.id for row in store.accounts.tokens()] == [number, endless]
    assert (store.accounts.remove_token(endless), store.accounts.remove_token(endless)) == (True, False)
    assert store.accounts.of_token("other", now=0) is None


def test_verdicts(store) -> None:
    alert = store.alerts.put(AlertState("bus-1", "silent", 300, "text", 4), history=("raised", "", ""), now=4)
    row = VerdictRow(alert.number, 9, "anna", "another part", "bush", "bush renewed", raised=4, request=3)
    number = store.verdicts.add(row)
    assert store.verdicts.all() == store.verdicts.all(alerts=[alert.number]) == [replace(row, id=number)]
    assert store.verdicts.all(alerts=[alert.number + 1]) == []


def test_commands_are_on_the_record(store) -> None:
    store.requests.audit("eve", "log in", "service", now=1)
    number = store.requests.add_command("eve", "zafira", "learn again", {"reason": "new dampers"}, now=2)
    assert store.requests.open_commands() == [
        CommandRow(number, 2, "eve", "zafira", "learn again", {"reason": "new dampers"}, None)
    ]
    store.requests.command_done(number, 3)
    assert store.requests.open_commands() == []
    rows = store.requests.audited()
    assert rows == [
        AuditRow(rows[0].id, 1, "eve", "log in", "service", None),
        AuditRow(rows[1].id, 2, "eve", "learn again", "zafira", {"reason": "new dampers"}),
    ]
    assert store.requests.audited(limit=1) == rows[1:]
