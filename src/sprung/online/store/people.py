"""People and programs that may use the interface, what they request, and what the workshop found."""

from collections.abc import Collection
from dataclasses import asdict
from typing import Any

from sqlalchemy import delete, func, or_, select, update

from sprung.online.store.database import Tables
from sprung.online.store.schema import (
    ACCOUNTS,
    ALERTS,
    AUDIT,
    COMMANDS,
    SESSIONS,
    TOKENS,
    VERDICTS,
    AccountRow,
    AuditRow,
    CommandRow,
    TokenRow,
    VerdictRow,
)


class Accounts(Tables):
    """Accounts with their sessions, and tokens. Secrets are stored as hashes only."""

    def all(self) -> list[AccountRow]:
        """Return the accounts by name."""
        return self._database.rows(AccountRow, select(ACCOUNTS).order_by(ACCOUNTS.c.name))

    def find(self, name: str) -> AccountRow | None:
        """Return an account; None if the name is unknown."""
        return self._database.row(AccountRow, select(ACCOUNTS).where(ACCOUNTS.c.name == name))

    def n_accounts(self) -> int:
        """Return the number of accounts."""
        return self._database.scalar(select(func.count()).select_from(ACCOUNTS)) or 0

    def put(self, row: AccountRow) -> None:
        """Store an account, replacing role and password of one of that name, whose sessions end."""
        values = asdict(row)
        new = {name: values[name] for name in ("role", "password")}
        put = self._database.insert(ACCOUNTS).values(values)
        with self._database.writing() as connection:
            connection.execute(put.on_conflict_do_update(index_elements=["name"], set_=new))
            connection.execute(delete(SESSIONS).where(SESSIONS.c.account == row.name))

    def remove(self, name: str) -> bool:
        """Remove an account with its sessions, and return whether there was one."""
        return self._database.remove(ACCOUNTS, ACCOUNTS.c.name == name)

    def add_session(self, digest: str, account: str, *, now: int, expires: int) -> None:
        """Store a session by the hash of its secret, and remove those that ended."""
        with self._database.writing() as connection:
            connection.execute(delete(SESSIONS).where(SESSIONS.c.expires <= now))
            row = {"digest": digest, "account": account, "created": now, "expires": expires}
            connection.execute(SESSIONS.insert(), row)

    def of_session(self, digest: str, *, now: int) -> AccountRow | None:
        """Return the account of a session; None if there is none, or it has ended."""
        query = select(ACCOUNTS).join(SESSIONS, SESSIONS.c.account == ACCOUNTS.c.name)
        query = query.where(SESSIONS.c.digest == digest, SESSIONS.c.expires > now)
        return self._database.row(AccountRow, query)

    def end_session(self, digest: str) -> None:
        """End a session."""
        self._database.remove(SESSIONS, SESSIONS.c.digest == digest)

    def tokens(self) -> list[TokenRow]:
        """Return the tokens, the oldest first."""
        return self._database.rows(TokenRow, select(TOKENS).order_by(TOKENS.c.id))

    def add_token(self, row: TokenRow) -> int:
        """Store a token, and return its number."""
        return self._database.add(TOKENS, asdict(row))

    def of_token(self, digest: str, *, now: int) -> TokenRow | None:
        """Return a token; None if it is unknown or has expired."""
        is_valid = or_(TOKENS.c.expires.is_(None), TOKENS.c.expires > now)
        return self._database.row(TokenRow, select(TOKENS).where(TOKENS.c.digest == digest, is_valid))

    def remove_token(self, number: int) -> bool:
        """Remove a token, and return whether there was one of that number."""
        return self._database.remove(TOKENS, TOKENS.c.id == number)


class Verdicts(Tables):
    """Verdicts of the workshop on alerts."""

    def add(self, row: VerdictRow) -> int:
        """Store a verdict, and return its number."""
        return self._database.add(VERDICTS, asdict(row))

    def all(self, *, alerts: Collection[int] | None = None) -> list[VerdictRow]:
        """Return verdicts in order, all or those on some alerts."""
        query = select(VERDICTS).order_by(VERDICTS.c.id)
        if alerts is not None:
            query = query.where(VERDICTS.c.alert.in_(alerts))
        return self._database.rows(VerdictRow, query)

    def judged(self, *, since: int = 0) -> list[tuple[VerdictRow, str]]:
        """Return the last verdict on each alert for each time that it was raised since a time, with its cause."""
        query = select(VERDICTS, ALERTS.c.cause).join(ALERTS, ALERTS.c.number == VERDICTS.c.alert)
        query = query.where(VERDICTS.c.raised >= since).order_by(VERDICTS.c.id)
        last: dict[tuple[int, int], tuple[VerdictRow, str]] = {}
        for values in self._database.rows(dict[str, Any], query):
            cause = values.pop("cause")
            last[values["alert"], values["raised"]] = (VerdictRow(**values), cause)
        return list(last.values())


class Requests(Tables):
    """Requests and the audit trail, which keeps everything for as long as the site file states."""

    def audit(self, who: str, act: str, subject: str, detail: Any = None, *, now: int) -> None:
        """Record who did what to what; `detail` is anything that JSON can hold."""
        self._database.add(AUDIT, {"time": now, "who": who, "act": act, "subject": subject, "detail": detail})

    def audited(self, *, act: str | None = None, before: int | None = None, limit: int | None = None) -> list[AuditRow]:
        """Return the record in order.

        Parameters
        ----------
        act
            Name of an action; None: all actions.
        before
            Number of an entry, which is left out with all later ones; None: no entry is.
        limit
            Largest number of entries, of which the last are returned; None: no limit.
        """
        query = select(AUDIT).order_by(AUDIT.c.id.desc()).limit(limit)
        if act is not None:
            query = query.where(AUDIT.c.act == act)
        if before is not None:
            query = query.where(AUDIT.c.id < before)
        return self._database.rows(AuditRow, query)[::-1]

    def add_command(self, who: str, vehicle: str, act: str, detail: Any = None, *, now: int) -> int:
        """Store a request to the running monitor, with an entry in the audit trail, and return its number."""
        row = {"created": now, "who": who, "vehicle": vehicle, "act": act, "detail": detail}
        with self._database.together():
            self.audit(who, act, vehicle, detail, now=now)
            return self._database.add(COMMANDS, row)

    def open_commands(self) -> list[CommandRow]:
        """Return open requests, the oldest first."""
        query = select(COMMANDS).where(COMMANDS.c.done.is_(None)).order_by(COMMANDS.c.id)
        return self._database.rows(CommandRow, query)

    def commands_of(self, vehicle: str) -> list[CommandRow]:
        """Return the requests about a vehicle, open and done, the oldest first."""
        query = select(COMMANDS).where(COMMANDS.c.vehicle == vehicle).order_by(COMMANDS.c.id)
        return self._database.rows(CommandRow, query)

    def command(self, command_id: int) -> CommandRow | None:
        """Return a request, open or done; None if the number is unknown."""
        return self._database.row(CommandRow, select(COMMANDS).where(COMMANDS.c.id == command_id))

    def command_done(self, command_id: int, now: int, *, detail: Any = None) -> None:
        """Store that a request was completed; `detail` replaces that of the request, if given."""
        statement = update(COMMANDS).where(COMMANDS.c.id == command_id, COMMANDS.c.done.is_(None))
        with self._database.writing() as connection:
            connection.execute(statement.values(done=now, **({} if detail is None else {"detail": detail})))
