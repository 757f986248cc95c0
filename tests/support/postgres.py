"""A real PostgreSQL, of Debian: a cluster in a folder of its own, on a port of this machine."""

import os
import re
import shutil
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Final

import psycopg

from app.cell.forward.config import ConnectionConfig
from tests.support.parts import free_port, until

PROGRAMS: Final = Path("/usr/lib/postgresql")
ROOT_USES: Final = "postgres"  # PostgreSQL refuses to run as root
WRITER: Final = "operator_panel_writer"
READER: Final = "operator_panel_reader"
DATABASE: Final = "plant"
SCHEMA: Final = "plant_schema"
PASSWORD: Final = "s3cret-of-the-cell"


def programs() -> Path:
    """The folder with the programs of the newest version."""
    versions = (path for path in PROGRAMS.iterdir() if re.fullmatch("[0-9]+", path.name))
    return max(versions, key=lambda path: int(path.name)) / "bin"


def as_server(words: Sequence[str]) -> list[str]:
    """A command as a user who may run PostgreSQL."""
    return ["runuser", "-u", ROOT_USES, "--", *words] if os.geteuid() == 0 else list(words)


class Cluster:
    """A cluster, from `start` to `end`; `admin` is the connection of its superuser."""

    def __init__(self, is_elsewhere: bool = False) -> None:
        """`is_elsewhere`: it gets only the processor time that no one else wants, as if it were on
        another machine."""
        self._before = ["chrt", "--idle", "0"] if is_elsewhere else []
        # Not below the folder of pytest, which is root's alone.
        self.folder = Path(mkdtemp(prefix="operator-panel-pg-", dir="/tmp"))
        if os.geteuid() == 0:
            shutil.chown(self.folder, ROOT_USES)
        self.port = free_port()
        self._data = self.folder / "data"
        self._process: subprocess.Popen[bytes] | None = None
        words = [
            str(programs() / "initdb"),
            "-D",
            str(self._data),
            "-U",
            "admin",
            "-A",
            "scram-sha-256",
        ]
        secret = self.folder / "password"
        secret.write_text(PASSWORD)
        secret.chmod(0o644)
        words += ["--pwfile", str(secret), "--no-sync", "--locale=C.UTF-8", "-E", "UTF8"]
        subprocess.run(as_server(words), check=True, capture_output=True)

    def start(self, *options: str) -> None:
        settings = {
            "port": self.port,
            "listen_addresses": "127.0.0.1",
            "unix_socket_directories": self.folder,
            "fsync": "off",
            "max_connections": "150",
            "logging_collector": "off",
        }
        words = [str(programs() / "postgres"), "-D", str(self._data)]
        words += [word for name, value in settings.items() for word in ("-c", f"{name}={value}")]
        words += [word for option in options for word in ("-c", option)]
        with open(self.folder / "log", "ab") as log:
            words = [*self._before, *as_server(words)]
            self._process = subprocess.Popen(words, stdout=log, stderr=log)
        until(self.answers, "PostgreSQL takes connections", 30)

    def answers(self) -> bool:
        try:
            with self.connect("postgres"):
                return True
        except psycopg.OperationalError:
            return False

    def connect(
        self, database: str = DATABASE, user: str = "admin"
    ) -> "psycopg.Connection[tuple[Any, ...]]":
        return psycopg.connect(
            host="127.0.0.1", port=self.port, user=user, password=PASSWORD, dbname=database,
            sslmode="disable", autocommit=True, connect_timeout=5,
        )  # fmt: skip

    def config(self, user: str = "admin", port: int = 0, database: str = DATABASE) -> ConnectionConfig:
        keys = {
            "host": "127.0.0.1", "port": str(port or self.port), "user": user, "dbname": database,
            "sslmode": "disable",
        }  # fmt: skip
        return ConnectionConfig(keys=keys, password_file=self.folder / "cell-password")

    def string(self, user: str, port: int = 0, database: str = DATABASE) -> str:
        """The connection string of a settings' file."""
        keys = self.config(user, port, database).keys
        return " ".join(f"{name}={value}" for name, value in keys.items())

    @property
    def _pid(self) -> int:
        return int((self._data / "postmaster.pid").read_text().split()[0])

    def kill(self) -> None:
        """As a power failure of the server's machine would: at once, without a word."""
        for pid in self._tree():
            send_signal(pid, signal.SIGKILL)
        self._wait()

    def _tree(self) -> list[int]:
        first = self._pid
        children = subprocess.run(
            ["ps", "-o", "pid=", "--ppid", str(first)], capture_output=True, text=True, check=False
        ).stdout.split()
        return [first, *map(int, children)]

    def stop(self) -> None:
        """As its administrator does."""
        if self._process is not None and self._process.poll() is None:
            send_signal(self._pid, signal.SIGQUIT)
            self._wait()

    def _wait(self) -> None:
        if self._process is not None:
            self._process.wait(30)
            self._process = None

    def end(self) -> None:
        self.stop()
        shutil.rmtree(self.folder)


def send_signal(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


@contextmanager
def cluster(is_elsewhere: bool = False) -> Iterator[Cluster]:
    made = Cluster(is_elsewhere)
    (made.folder / "cell-password").write_text(f"{PASSWORD}\n")
    (made.folder / "cell-password").chmod(0o600)
    try:
        made.start()
        yield made
    finally:
        made.end()


def new_database(server: Cluster, name: str = DATABASE, template: str = "template1") -> None:
    """A copy of another database, of one without a schema, in place of one with this name."""
    with server.connect("postgres") as db:
        db.execute(f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")
        db.execute(f"CREATE DATABASE {name} TEMPLATE {template}")


def add_logins(server: Cluster, **roles: str) -> None:
    """Logins by their names, each in a role."""
    with server.connect("postgres") as db:
        for login, role in roles.items():
            if not db.execute("SELECT 1 FROM pg_roles WHERE rolname = %s", (login,)).fetchone():
                db.execute(f"CREATE ROLE {login} LOGIN PASSWORD '{PASSWORD}' IN ROLE {role}")


def query(server: Cluster, text: str, *values: Any, user: str = "admin") -> list[tuple[Any, ...]]:
    with server.connect(user=user) as db:
        return db.execute(text, values or None).fetchall()


def execute(server: Cluster, text: str) -> None:
    with server.connect() as db:
        db.execute(text)


class Wire:
    """A way to a port of this machine that can be cut: `is_cut` drops what comes, as a network does
    that says nothing."""

    def __init__(self, target: int) -> None:
        self.port = free_port()
        self.is_cut = False
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self._lock = threading.Lock()
        self._is_closed = False
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                try:
                    far = socket.create_connection(("127.0.0.1", self._target))
                except OSError:
                    near.close()
                    continue
                with self._lock:
                    self._sockets += [near, far]
                if self._is_closed:
                    self.reset()
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._copy, args=ends, daemon=True).start()

    def _copy(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(4096):
                if not self.is_cut:
                    sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)

    def reset(self) -> None:
        """Ends all connections."""
        with self._lock:
            ended, self._sockets = self._sockets, []
        for end in ended:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def close(self) -> None:
        self._is_closed = True
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.reset()


@contextmanager
def wire(target: int) -> Iterator[Wire]:
    made = Wire(target)
    try:
        yield made
    finally:
        made.close()
