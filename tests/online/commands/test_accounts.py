"""`sprung accounts` and `sprung tokens`: who may use the pages and the interface."""

import json

import pytest

PASSWORD = "correct horse battery"


@pytest.fixture
def accounts(sprung, tmp_path):
    """Function of words that runs `sprung accounts` or `sprung tokens` on a store that does not exist at first."""
    file = tmp_path / "password"
    file.write_text(f"{PASSWORD}\nnot this\n")
    store = ("--store", f"sqlite:///{tmp_path}/store.sqlite")

    def run(*words):
        more = ("--password-file", file) if words[:2] == ("accounts", "add") else ()
        return sprung(*words, *more, *store)

    return run


@pytest.mark.slow
def test_accounts_are_added_and_removed(accounts) -> None:
    assert accounts("accounts", "list").code == 2
    added = accounts("accounts", "add", "ada", "--role", "admin")
    assert (added.code, PASSWORD in added.out) == (0, False)
    accounts("accounts", "add", "eve")
    document = json.loads(accounts("accounts", "list", "--json", "-").out)
    assert [(entry["name"], entry["role"]) for entry in document["accounts"]] == [("ada", "admin"), ("eve", "viewer")]
    refused = accounts("accounts", "remove", "ada")
    assert (refused.code, "last administrator" in refused.err) == (2, True)
    assert accounts("accounts", "remove", "eve").code == 0
    assert "no accounts" in accounts("accounts", "remove", "ada").out


def test_a_token_is_shown_once(accounts) -> None:
    accounts("accounts", "add", "ada", "--role", "admin")
    document = json.loads(accounts("tokens", "add", "dashboard", "--days", "30", "--json", "-").out)
    (entry,) = document["tokens"]
    assert entry["secret"].startswith("sprung_")
    listed = accounts("tokens")
    assert (listed.code, "dashboard" in listed.out, entry["secret"] in listed.out) == (0, True, False)
    assert "no tokens" in accounts("tokens", "remove", "1").out
    assert accounts("tokens", "remove", "1").code == 2


def test_without_a_terminal_a_password_comes_from_a_file(sprung, tmp_path) -> None:
    store = ("--store", f"sqlite:///{tmp_path}/store.sqlite")
    asked = sprung("accounts", "add", "ada", *store)
    assert (asked.code, "--password-file" in asked.err) == (2, True)
    missing = sprung("accounts", "add", "ada", "--password-file", tmp_path / "missing", *store)
    assert (missing.code, "cannot be read" in missing.err) == (2, True)
    short = tmp_path / "short"
    short.write_text("short\n")
    assert "10 to 200" in sprung("accounts", "add", "ada", "--password-file", short, *store).err
