"""The scripts that back up and restore a monitor, on both databases."""

import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import psycopg
import pytest

from sprung.online.store import Progress, StoredFrame, open_store

DEPLOY = Path(__file__).parents[3] / "deploy"


def run(script, *words):
    """Run a script, and return its exit code, output and errors."""
    command = [sys.executable, DEPLOY / script, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout.strip(), done.stderr.strip()


def fill(store, number):
    """Let a vehicle be monitored."""
    store.inbox.put_vehicle(f"car-{number}", configuration="c", description="", channels=[], now=number)
    store.inbox.add_frames([StoredFrame(f"car-{number}", 1, seq, 0, b"x" * 100) for seq in range(100)], now=number)
    progress = Progress(f"car-{number}", 1, done_seq=9, delete_through_seq=9, observations=((0, 0, {"n": number}),))
    store.results.commit(progress)


def contents(store):
    """What a monitor continues from."""
    names = [row.vehicle for row in store.inbox.vehicles()]
    return store.inbox.cursors(), [(store.results.observations(name), store.inbox.boots(name)) for name in names]


@pytest.fixture
def site(url, tmp_path: Path):
    """The site file of a monitor, with certificates next to it."""
    folder = tmp_path / "etc" / "sprung"
    folder.mkdir(parents=True)
    (folder / "monitor.key").write_text("key", encoding="ascii")
    (folder / "monitor.key").chmod(0o600)
    (folder / "site.toml").write_text(f'schema = "sprung.site/1"\nstore = "{url}"\n', encoding="ascii")
    if url.startswith("postgresql") and not (shutil.which("pg_dump") and shutil.which("pg_restore")):
        pytest.skip("no pg_dump and pg_restore: install postgresql-client")
    return folder / "site.toml"


@pytest.mark.slow
def test_a_backup_of_a_running_monitor_is_restored_as_it_was(url, site, tmp_path: Path) -> None:
    with open_store(url) as store:
        fill(store, 1)
        saved = contents(store)
        code, backup, errors = run("backup", site, tmp_path / "backups")
        assert (code, errors) == (0, "")
        fill(store, 2)
    assert Path(backup).stat().st_mode & 0o777 == 0o700
    shutil.rmtree(site.parent)
    code, said, errors = run("restore", backup, site)
    assert (code, said, errors) == (0, f"restored from {backup}: start the monitor", "")
    assert (site.parent / "monitor.key").read_text(encoding="ascii") == "key"
    assert (site.parent / "monitor.key").stat().st_mode & 0o777 == 0o600
    with open_store(url) as store:
        assert contents(store) == saved
        fill(store, 3)


def test_the_newest_backups_are_kept(url, site, tmp_path: Path) -> None:
    open_store(url).close()
    made = [run("backup", site, tmp_path / "backups", "--keep", "2")[1] for _ in range(4)]
    assert sorted(map(str, (tmp_path / "backups").iterdir())) == made[2:]


def test_a_damaged_backup_is_refused(url, site, tmp_path: Path) -> None:
    with open_store(url) as store:
        fill(store, 1)
        saved = contents(store)
    _, backup, _ = run("backup", site, tmp_path / "backups")
    (path,) = Path(backup).glob("store.*")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    code, _, errors = run("restore", backup, site)
    assert (code, errors) == (1, f"nothing restored: {path} is damaged: use another backup")
    path.unlink()
    assert "contains other files than SHA256SUMS lists" in run("restore", backup, site)[2]
    with open_store(url) as store:
        assert contents(store) == saved


def test_a_store_in_use_is_not_replaced(sqlite_file, tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(f'store = "sqlite:///{sqlite_file}"\n', encoding="ascii")
    with open_store(f"sqlite:///{sqlite_file}") as store:
        fill(store, 1)
        _, backup, _ = run("backup", site, tmp_path / "backups")
        fill(store, 2)
        code, _, errors = run("restore", backup, site)
        assert code == 1
        assert "is in use (database is locked): stop the monitor" in errors
        assert len(store.inbox.vehicles()) == 2
    assert run("restore", backup, site)[0] == 0
    (before,) = sqlite_file.parent.glob("store.sqlite.before-*")
    with open_store(f"sqlite:///{before}") as store:
        assert len(store.inbox.vehicles()) == 2, "what was replaced is kept"


def test_a_database_in_use_is_not_replaced(postgresql_url, tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(f'store = "{postgresql_url}"\n', encoding="ascii")
    with open_store(postgresql_url) as store:
        fill(store, 1)
        _, backup, _ = run("backup", site, tmp_path / "backups")
        fill(store, 2)
        code, _, errors = run("restore", backup, site)
        assert (code, errors) == (1, "nothing restored: the store has 1 open connection: stop the monitors")
        assert len(store.inbox.vehicles()) == 2


def test_nothing_of_a_newer_store_is_left(postgresql_url, tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(f'store = "{postgresql_url}"\n', encoding="ascii")
    with open_store(postgresql_url) as store:
        fill(store, 1)
        saved = contents(store)
    _, backup, _ = run("backup", site, tmp_path / "backups")
    with psycopg.connect(postgresql_url) as connection:
        connection.execute("CREATE TABLE of_a_later_version (boot bigint)")
        connection.execute("CREATE VIEW on_it AS SELECT * FROM of_a_later_version")
    assert run("restore", backup, site)[::2] == (0, "")
    with psycopg.connect(postgresql_url) as connection:
        (count,) = connection.execute("SELECT count(*) FROM pg_class WHERE relname IN ('of_a_later_version', 'on_it')")
        assert count == (0,)
    with open_store(postgresql_url) as store:
        assert contents(store) == saved


def test_a_dump_that_cannot_be_read_replaces_nothing(postgresql_url, tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text(f'store = "{postgresql_url}"\n', encoding="ascii")
    with open_store(postgresql_url) as store:
        fill(store, 1)
        saved = contents(store)
    _, backup, _ = run("backup", site, tmp_path / "backups")
    path = Path(backup) / "store.dump"
    path.write_bytes(path.read_bytes()[:-100])  # the checksum is that of what was written
    sums = Path(backup) / "SHA256SUMS"
    digests = [
        f"{sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in (Path(backup) / "settings.tar", path)
    ]
    sums.write_text("".join(digests), encoding="ascii")
    code, _, errors = run("restore", backup, site)
    assert (code, "nothing restored: pg_restore" in errors) == (1, True)
    with open_store(postgresql_url) as store:
        assert contents(store) == saved


def test_a_backup_of_nothing_is_an_error(tmp_path: Path) -> None:
    code, _, errors = run("backup", tmp_path / "site.toml", tmp_path / "backups")
    assert (code, errors.startswith("no backup: ")) == (1, True)
