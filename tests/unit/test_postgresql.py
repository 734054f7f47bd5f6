"""Export to a real PostgreSQL server, which the test starts; skipped where none is installed."""

from __future__ import annotations

import getpass
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from stored_parts import filled_store, part

psycopg = pytest.importorskip("psycopg", reason="the driver psycopg is not installed")
sqlalchemy = pytest.importorskip("sqlalchemy", reason="SQLAlchemy is not installed")


def binary(name: str) -> str:
    found = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    if found:
        return str(found[-1])
    on_path = shutil.which(name)
    if on_path is None:
        pytest.skip(f"{name} is not installed (apt install postgresql)")
    return on_path


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """The URL of a database in a server of its own."""
    initdb, postgres = binary("initdb"), binary("postgres")
    as_other: list[str] = []
    if os.getuid() == 0:  # PostgreSQL refuses to run as root
        if shutil.which("runuser") is None:
            pytest.skip("PostgreSQL refuses to run as root, and there is no runuser")
        as_other = ["runuser", "-u", "nobody", "--"]
    user = "nobody" if as_other else getpass.getuser()
    with tempfile.TemporaryDirectory(prefix="bgars-pg-", dir="/tmp") as place:
        folder = Path(place)
        if as_other:
            shutil.chown(folder, "nobody")
        data = folder / "data"
        made = subprocess.run(
            [*as_other, initdb, "-D", data, "-A", "trust", "-U", user, "-N"],
            capture_output=True,
            text=True,
            check=False,
        )
        if made.returncode:
            pytest.skip(f"initdb: {made.stderr.strip().splitlines()[-1]}")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        command = [*as_other, postgres, "-D", data, "-p", str(port), "-k", place, "-c", "listen_addresses=127.0.0.1"]
        with (folder / "log").open("wb") as log:
            running = subprocess.Popen(command, stdout=log, stderr=log, cwd="/")
        try:
            wait_for(port, running)
            yield f"postgresql+psycopg://{user}@127.0.0.1:{port}/postgres"
        finally:
            running.terminate()
            running.wait(30)


def wait_for(port: int, running: subprocess.Popen[bytes]) -> None:
    for _ in range(300):
        assert running.poll() is None, "the server ended"
        try:
            psycopg.connect(f"host=127.0.0.1 port={port} dbname=postgres connect_timeout=2", user="nobody").close()
        except psycopg.OperationalError as error:
            if "role" in str(error):
                return
            time.sleep(0.1)
        else:
            return
    pytest.fail("the server does not answer")


def test_postgresql_gets_every_new_part_once(server: str, tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 4)
    assert store.export(server)["bgars_parts"] == 4
    store.append(part(5))
    store.append_failure("/c/x", "cut off", serial="SN9")
    assert store.export(server) == {
        "bgars_parts": 1,
        "bgars_balls": 6,
        "bgars_checks": 4,
        "bgars_budgets": 2,
        "bgars_failures": 1,
    }
    engine = sqlalchemy.create_engine(server)
    with engine.connect() as connection:
        rows = connection.execute(
            sqlalchemy.text("select serial, verdict, defects from bgars_parts where verdict = 'fail' order by serial")
        ).all()
        tops = connection.execute(sqlalchemy.text("select count(top_um) from bgars_balls")).scalar_one()
    engine.dispose()
    assert [tuple(row) for row in rows] == [("SN0003", "fail", "missing"), ("SN0005", "fail", "missing")]
    assert tops == 28


def test_postgresql_gets_any_text_and_two_exports_at_once_add_no_part_twice(server: str, tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    serial = "SN-\u00e9\u4e2d\U0001f600-'q\""
    store.append(replace(part(6), serial=serial))
    store.append_failure("/c/y", "a library said \0 and 'so'", serial="SN8")
    assert store.export(server)["bgars_parts"] == 1
    engine = sqlalchemy.create_engine(server)
    with engine.connect() as connection:
        every = connection.execute(sqlalchemy.text("select serial from bgars_parts")).scalars().all()
        reason = connection.execute(sqlalchemy.text("select reason from bgars_failures where serial = 'SN8'")).scalar()
    assert serial in every
    assert reason == "a library said \ufffd and 'so'"
    # What another export added since this one looked: here a ball of a part that is not there yet.
    store.append(part(7))
    key = store.query("select part_key from parts where serial = 'SN0007'")["part_key"][0].as_py()
    with engine.begin() as connection:
        connection.execute(sqlalchemy.text(f"insert into bgars_balls (part_key, name) values ('{key}', 'A1')"))
    with pytest.raises(bgars.FileFormatError, match="another export writes at the same time"):
        store.export(server)
    with engine.begin() as connection:
        assert connection.execute(sqlalchemy.text("select count(*) from bgars_parts")).scalar() == len(every)
        connection.execute(sqlalchemy.text(f"delete from bgars_balls where part_key = '{key}'"))
    engine.dispose()
    assert store.export(server)["bgars_parts"] == 1
