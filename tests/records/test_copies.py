"""Copies of the operator's log elsewhere: a file, a syslog server over TLS; away, back, and what they
show of a log that was cut off or replaced."""

import datetime
import os
import shutil
import socket
import sqlite3
import ssl
import stat
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from app.records.copy import (
    Comparison,
    CopyFile,
    LogCopier,
    Position,
    SyslogSink,
    as_line,
    parse_line,
    read_copy,
)
from app.records.database import NAME as DATABASE
from app.records.entry import Entry, Origin, new_entry
from app.records.store import Store
from app.records.verify import verify
from app.system.errors import SettingsError
from app.system.settings import Settings
from app.tools.cli.log import main
from tests.support.parts import until
from tests.support.servers import demo_server

FROM = Origin(address="10.0.0.7", browser="b1", who="Kim ö")
PANEL = """
title = "Cell 1"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
"""


class Log:
    """A log that a test writes; `synced` is what the copier may read."""

    def __init__(self, folder: Path, boot: str = "b1") -> None:
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self.store = Store(folder, boot)
        self.synced = self.store.head.seq

    def add(self, count: int) -> None:
        self.store.append([new_entry("refused", FROM, reason=f"no {n}") for n in range(count)])
        self.synced = self.store.head.seq

    def close(self) -> None:
        self.store.checkpoint()
        self.store.close()


@contextmanager
def copying(log: Log, copier: LogCopier) -> Iterator[None]:
    copier.start()
    try:
        yield
    finally:
        copier.stop()
        assert not any(thread.name == "operators-log-copy" for thread in threading.enumerate())


def to_file(log: Log, path: Path) -> LogCopier:
    return LogCopier(log.folder, CopyFile(path), lambda: log.synced)


def copied(path: Path) -> list[int]:
    return [entry.seq for entry in read_copy(path)] if path.exists() else []


def test_a_copy_has_every_entry_and_goes_on_after_a_restart(tmp_path: Path) -> None:
    log, path = Log(tmp_path / "data"), tmp_path / "copy"
    log.add(250)
    with copying(log, to_file(log, path)):
        until(lambda: len(copied(path)) == 250, "copied")
        log.add(3)
    with copying(log, to_file(log, path)):
        log.add(2)
    assert copied(path) == list(range(1, 256))
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    log.close()


def test_only_what_is_on_the_disk_is_copied(tmp_path: Path) -> None:
    """Else a power failure would leave a copy that is ahead of the log."""
    log, path = Log(tmp_path / "data"), tmp_path / "copy"
    log.add(5)
    log.synced = 3
    with copying(log, to_file(log, path)):
        until(lambda: len(copied(path)) >= 3, "copied")
    assert copied(path) == [1, 2, 3]
    log.close()


def test_a_place_that_is_away_gets_all_when_it_is_back(tmp_path: Path) -> None:
    log, disk = Log(tmp_path / "data"), tmp_path / "disk"
    log.add(4)
    with copying(log, to_file(log, disk / "copy")):
        log.add(4)
        disk.mkdir()
        until(lambda: len(copied(disk / "copy")) == 8, "copied")
    log.close()


def test_a_line_that_a_power_failure_cut_is_written_again(tmp_path: Path) -> None:
    log, path = Log(tmp_path / "data"), tmp_path / "copy"
    log.add(3)
    with copying(log, to_file(log, path)):
        pass
    path.write_bytes(path.read_bytes()[:-20])
    with copying(log, to_file(log, path)):
        pass
    assert copied(path) == [1, 2, 3]
    log.close()


def test_a_large_copy_is_rotated_once_and_read_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "copy"
    log = Log(tmp_path / "data")
    for _ in range(3):
        log.add(100)
        with copying(log, LogCopier(log.folder, CopyFile(path, 40_000), lambda: log.synced)):
            pass
    assert path.with_name("copy.1").exists()
    assert copied(path)[-1] == 300
    assert copied(path) == sorted(set(copied(path)))
    log.close()


def made_log(tmp_path: Path) -> tuple[Path, Path]:
    """A log of 20 entries that has ended, and its copy."""
    log, path = Log(tmp_path / "data"), tmp_path / "copy"
    log.add(20)
    with copying(log, to_file(log, path)):
        pass
    log.close()
    return log.folder, path


def status(data: Path, copy: Path) -> int:
    return main(["verify", "--data", str(data), "--against", str(copy)])


def test_a_log_with_its_copy_is_verified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, copy = made_log(tmp_path)
    assert status(data, copy) == 0
    assert "the log has each of the 20 entries of the copy" in capsys.readouterr().out
    assert status(data, tmp_path / "none") == 2


def test_attack_the_tail_is_cut_off(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, copy = made_log(tmp_path)
    with closing(sqlite3.connect(data / DATABASE)) as db, db:
        db.execute("DELETE FROM entry WHERE seq > 15")
    assert verify(data).fault == ""
    assert status(data, copy) == 1
    assert "the copy has entries up to 20, the log only up to 15" in capsys.readouterr().out


def test_attack_the_tail_is_cut_off_and_the_server_writes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    data, copy = made_log(tmp_path)
    with closing(sqlite3.connect(data / DATABASE)) as db, db:
        db.execute("DELETE FROM entry WHERE seq > 15")
    log = Log(data, "b2")
    log.add(2)
    with copying(log, to_file(log, copy)):
        pass
    log.close()
    assert "is not the one that was copied" in caplog.text
    assert status(data, copy) == 1
    assert "entry 16 is another than in the copy" in capsys.readouterr().out


def test_attack_an_older_copy_is_put_in_the_place_of_the_log(tmp_path: Path) -> None:
    log, path = Log(tmp_path / "data"), tmp_path / "copy"
    log.add(10)
    log.close()
    shutil.copy(tmp_path / "data" / DATABASE, tmp_path / "older")
    log = Log(tmp_path / "data", "b2")
    log.add(10)
    with copying(log, to_file(log, path)):
        pass
    log.close()
    for file in (tmp_path / "data").iterdir():
        file.unlink()
    shutil.copy(tmp_path / "older", tmp_path / "data" / DATABASE)
    assert verify(tmp_path / "data").fault == ""
    assert status(tmp_path / "data", path) == 1


def test_attack_an_entry_is_changed_and_sealed_again(tmp_path: Path) -> None:
    _, copy = made_log(tmp_path)
    entries = list(read_copy(copy))
    changed = [e._replace(reason="yes") if e.seq == 9 else e for e in entries]
    (tmp_path / "other").mkdir()
    store = Store(tmp_path / "other", "b1")
    store.append(changed)
    store.close()
    comparison = Comparison(read_copy(copy))
    assert (
        "entry 1 is another than in the copy"
        in verify(tmp_path / "other", against=comparison.fault).fault
    )


def test_an_entry_is_read_back_from_a_line_of_any_syslog_server() -> None:
    entry = new_entry("refused", FROM, reason='a "b"\n').sealed(7, "b1", "0" * 64)
    assert parse_line(f"2027-01-20T10:00:00Z panel operator-panel: \ufeff{as_line(entry)}\n") == entry
    assert parse_line("Jan 20 10:00:00 panel sshd: {}") is None
    assert parse_line('x {"seq":1}') is None
    assert parse_line('x {"seq":') is None


class Collector:
    """A syslog server: TLS, messages with their lengths before them (RFC 5425)."""

    def __init__(self, folder: Path) -> None:
        key = ec.generate_private_key(ec.SECP256R1())
        name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "collector")])
        now = datetime.datetime.now(datetime.UTC)
        day = datetime.timedelta(days=1)
        address = x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))])
        certificate = (
            x509.CertificateBuilder(name, name, key.public_key(), 1, now - day, now + day)
            .add_extension(address, False)
            .add_extension(x509.BasicConstraints(True, None), True)
            .sign(key, hashes.SHA256())
        )
        self.ca = folder / "ca.pem"
        self.ca.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        key_file = folder / "key.pem"
        key_file.write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
        )
        self._context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self._context.load_cert_chain(self.ca, key_file)
        self.messages: list[bytes] = []
        self.port = 0
        self._connections: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._listener: socket.socket | None = None

    def listen(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listener.getsockname()[1]
        self._start(self._accept, self._listener)

    def go_away(self) -> None:
        assert self._listener is not None
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in self._connections:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                continue  # it has ended already
        for thread in self._threads:
            thread.join(10)

    def _start(self, work: object, *arguments: object) -> None:
        thread = threading.Thread(target=work, args=arguments)  # type: ignore[arg-type]
        self._threads.append(thread)
        thread.start()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                raw, _ = listener.accept()
            except OSError:
                return
            self._connections.append(raw)
            self._start(self._read, raw)

    def _read(self, raw: socket.socket) -> None:
        try:
            with self._context.wrap_socket(raw, server_side=True) as connection:
                self._connections.append(connection)
                stream = connection.makefile("rb")
                while length := self._length(stream):
                    self.messages.append(stream.read(length))
        except (OSError, ValueError):
            return  # the sender, or the test, has ended the connection

    @staticmethod
    def _length(stream: object) -> int:
        digits = b""
        while (byte := stream.read(1)) not in (b" ", b""):  # type: ignore[attr-defined]
            digits += byte
        return int(digits or b"0")

    def numbers(self) -> set[int]:
        entries = (parse_line(message.decode()) for message in tuple(self.messages))
        return {entry.seq for entry in entries if entry}


@pytest.fixture
def collector(tmp_path: Path) -> Iterator[Collector]:
    mine = Collector(tmp_path)
    mine.listen()
    yield mine
    mine.go_away()


def to_syslog(log: Log, collector: Collector, ca: Path | None = None) -> LogCopier:
    sink = SyslogSink("127.0.0.1", collector.port, ca or collector.ca)
    return LogCopier(log.folder, sink, lambda: log.synced, Position(log.folder / "log-sent.json"))


def test_syslog_messages_have_the_form_of_rfc_5424(tmp_path: Path, collector: Collector) -> None:
    log = Log(tmp_path / "data")
    log.add(2)
    with copying(log, to_syslog(log, collector)):
        until(lambda: collector.numbers() == {1, 2}, "received")
    head, _, text = collector.messages[0].partition(b" - ")
    version, at, host, app, pid, kind = head.decode().split(" ")
    assert (version, host, app, pid, kind) == (
        "<110>1", socket.gethostname(), "operator-panel", str(os.getpid()), "refused",
    )  # fmt: skip
    assert datetime.datetime.fromisoformat(at).tzinfo is not None
    assert text.startswith(b"\xef\xbb\xbf{")
    log.close()


def test_what_a_syslog_server_has_written_is_a_copy_to_verify_against(
    tmp_path: Path, collector: Collector
) -> None:
    log = Log(tmp_path / "data")
    log.add(20)
    with copying(log, to_syslog(log, collector)):
        until(lambda: len(collector.numbers()) == 20, "received")
    log.close()
    written = tmp_path / "messages"
    written.write_bytes(b"\n".join(collector.messages))
    assert status(log.folder, written) == 0
    with closing(sqlite3.connect(log.folder / DATABASE)) as db, db:
        db.execute("DELETE FROM entry WHERE seq > 19")
    assert status(log.folder, written) == 1


def test_a_syslog_server_that_was_away_has_no_gap(tmp_path: Path, collector: Collector) -> None:
    log = Log(tmp_path / "data")
    log.add(3)
    with copying(log, to_syslog(log, collector)):
        until(lambda: len(collector.numbers()) == 3, "received")
        collector.go_away()
        log.add(250)
        collector.listen()
        until(lambda: len(collector.numbers()) == 253, "received", within_s=30)
    log.add(1)
    collector.messages.clear()
    with copying(log, to_syslog(log, collector)):  # a restart: it goes on where it was
        until(lambda: 254 in collector.numbers(), "received")
    assert min(collector.numbers()) == 254
    log.close()


def test_attack_a_syslog_server_with_another_certificate_gets_nothing(
    tmp_path: Path, collector: Collector, caplog: pytest.LogCaptureFixture
) -> None:
    log = Log(tmp_path / "data")
    log.add(3)
    (tmp_path / "other").mkdir()
    other = Collector(tmp_path / "other")
    with copying(log, to_syslog(log, collector, other.ca)):
        until(lambda: "is not copied to" in caplog.text, "refused")
    assert "certificate verify failed" in caplog.text
    assert collector.messages == []
    log.close()


@pytest.mark.parametrize("text", ["log plant:1", "log:0", "log:65536", ":6514", "udp://log:514"])
def test_a_wrong_address_of_a_syslog_server_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="KIOSK_SYSLOG is"):
        Settings.from_environment({"KIOSK_SYSLOG": text})


def test_an_address_of_a_syslog_server() -> None:
    for text, address in (("log.plant", ("log.plant", 6514)), ("[::1]:99", ("::1", 99))):
        assert Settings.from_environment({"KIOSK_SYSLOG": text}).syslog == address


def test_a_server_signs_copies_and_ends_with_a_signature(tmp_path: Path, collector: Collector) -> None:
    data, copy = tmp_path / "data", tmp_path / "copy"
    syslog = f"127.0.0.1:{collector.port}"
    with demo_server(
        tmp_path,
        PANEL,
        KIOSK_DATA=str(data),
        KIOSK_LOG_COPY=str(copy),
        KIOSK_SYSLOG=syslog,
        KIOSK_SYSLOG_CA=str(collector.ca),
    ) as server:
        assert server.press("start", inputs={}).json()["outcome"] == "published"
        until(lambda: 'log_uncopied{copy="file"} 0.0' in server.http.get("/metrics").text, "copied")
        assert 'log_uncopied{copy="syslog"}' in server.http.get("/metrics").text
        assert "log is signed with the key" in server.http.get("/help").text
    copied_entries: list[Entry] = list(read_copy(copy))
    assert {"began", "pressed", "closed", "signed"} <= {entry.kind for entry in copied_entries}
    assert copied_entries[-1].kind == "signed"
    assert '"why": "end"' in copied_entries[-1].values
    verified = verify(data)
    assert (verified.fault, verified.signed.unsigned) == ("", 0)
    assert verified.count == len(copied_entries)
    assert status(data, copy) == 0
    until(lambda: max(collector.numbers()) == verified.count, "received")
