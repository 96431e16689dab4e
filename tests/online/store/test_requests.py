"""Requests of people, and the record of who did what."""

from sprung.online.store import AuditRow, CommandRow


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
