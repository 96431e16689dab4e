"""People and programs that may use the interface, and what the workshop found."""

from collections.abc import Collection
from dataclasses import asdict, dataclass, field

from sqlalchemy import delete, func, select

from sprung.online.store.database import Database
from sprung.online.store.schema import ACCOUNTS, ALERTS, SESSIONS, TOKENS, VERDICTS


@dataclass(frozen=True, slots=True)
class AccountRow:
    """A person: name, role and salted hash of the password."""

    name: str
    role: str
    password: str = field(repr=False)
    created: int


@dataclass(frozen=True, slots=True)
class TokenRow:
    """A program that may use the interface until `expires`; `digest` is the hash of its secret."""

    digest: str = field(repr=False)
    name: str
    role: str
    created: int
    created_by: str
    expires: int | None = None
    id: int | None = None


@dataclass(frozen=True, slots=True)
class VerdictRow:
    """Verdict of the workshop on an alert.

    Parameters
    ----------
    alert
        Number of the alert.
    time, who
        Time of the verdict [UTC ns], and person who stated it.
    verdict
        "confirmed", "another part", "nothing found" or "not looked at".
    part
        Part that was found instead; empty for none.
    action
        Work that was done; empty: none.
    raised
        Time when the alert was raised.
    request
        Number of the request for a new baseline; None: none.
    id
        Number of the row; None before it is stored.
    """

    alert: int
    time: int
    who: str
    verdict: str
    part: str
    action: str
    raised: int
    request: int | None = None
    id: int | None = None


class Accounts:
    """Accounts with their sessions, and tokens. Secrets are stored as hashes only.

    Parameters
    ----------
    database
        Database of the store.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def all(self) -> list[AccountRow]:
        """Return the accounts by name."""
        with self._database.reading() as connection:
            rows = connection.execute(select(ACCOUNTS).order_by(ACCOUNTS.c.name)).mappings()
            return [AccountRow(**row) for row in rows]

    def find(self, name: str) -> AccountRow | None:
        """Return an account; None if the name is unknown."""
        with self._database.reading() as connection:
            row = connection.execute(select(ACCOUNTS).where(ACCOUNTS.c.name == name)).mappings().first()
            return None if row is None else AccountRow(**row)

    def n_accounts(self) -> int:
        """Return the number of accounts."""
        with self._database.reading() as connection:
            return connection.scalar(select(func.count()).select_from(ACCOUNTS)) or 0

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
        with self._database.writing() as connection:
            connection.execute(delete(SESSIONS).where(SESSIONS.c.account == name))
            return connection.execute(delete(ACCOUNTS).where(ACCOUNTS.c.name == name)).rowcount > 0

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
        with self._database.reading() as connection:
            row = connection.execute(query).mappings().first()
            return None if row is None else AccountRow(**row)

    def end_session(self, digest: str) -> None:
        """End a session."""
        with self._database.writing() as connection:
            connection.execute(delete(SESSIONS).where(SESSIONS.c.digest == digest))

    def tokens(self) -> list[TokenRow]:
        """Return the tokens, the oldest first."""
        with self._database.reading() as connection:
            return [TokenRow(**row) for row in connection.execute(select(TOKENS).order_by(TOKENS.c.id)).mappings()]

    def add_token(self, row: TokenRow) -> int:
        """Store a token, and return its number."""
        values = {name: value for name, value in asdict(row).items() if name != "id"}
        with self._database.writing() as connection:
            return int(connection.execute(TOKENS.insert().values(values).returning(TOKENS.c.id)).scalar_one())

    def of_token(self, digest: str, *, now: int) -> TokenRow | None:
        """Return a token; None if it is unknown or has expired."""
        with self._database.reading() as connection:
            row = connection.execute(select(TOKENS).where(TOKENS.c.digest == digest)).mappings().first()
        found = None if row is None else TokenRow(**row)
        return None if found is None or (found.expires is not None and found.expires <= now) else found

    def remove_token(self, number: int) -> bool:
        """Remove a token, and return whether there was one of that number."""
        with self._database.writing() as connection:
            return connection.execute(delete(TOKENS).where(TOKENS.c.id == number)).rowcount > 0


class Verdicts:
    """Verdicts of the workshop on alerts.

    Parameters
    ----------
    database
        Database of the store.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, row: VerdictRow) -> int:
        """Store a verdict, and return its number."""
        values = {name: value for name, value in asdict(row).items() if name != "id"}
        with self._database.writing() as connection:
            return int(connection.execute(VERDICTS.insert().values(values).returning(VERDICTS.c.id)).scalar_one())

    def all(self, *, alerts: Collection[int] | None = None) -> list[VerdictRow]:
        """Return verdicts in order, all or those on some alerts."""
        query = select(VERDICTS).order_by(VERDICTS.c.id)
        if alerts is not None:
            query = query.where(VERDICTS.c.alert.in_(alerts))
        with self._database.reading() as connection:
            return [VerdictRow(**row) for row in connection.execute(query).mappings()]

    def judged(self, *, since: int = 0) -> list[tuple[VerdictRow, str]]:
        """Return the last verdict on each alert for each time that it was raised since a time, with its cause."""
        query = select(VERDICTS, ALERTS.c.cause).join(ALERTS, ALERTS.c.id == VERDICTS.c.alert)
        query = query.where(VERDICTS.c.raised >= since).order_by(VERDICTS.c.id)
        last: dict[tuple[int, int], tuple[VerdictRow, str]] = {}
        with self._database.reading() as connection:
            for row in connection.execute(query).mappings():
                values = dict(row)
                cause = values.pop("cause")
                last[values["alert"], values["raised"]] = (VerdictRow(**values), cause)
        return list(last.values())
