"""The support bundle: what it holds, what it never holds, and that it asks."""

import io
import json
import os
import sys
import time
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from app.system.public import LEFT_OUT
from app.system.settings import Settings
from app.tools.cli.command import main
from app.tools.doctor.bundle import CUT, Part, Sources, parts, text_part, write
from app.tools.doctor.doctor import Diagnosis, Options
from app.tools.doctor.findings import Report
from app.tools.doctor.journal import MOST_BYTES as JOURNAL_BYTES
from app.tools.doctor.journal import journal, journal_counts
from tests.support.parts import ROOT, Bridge, Server, until, zenoh_file
from tests.tools.doctor.secrets import FORMS, SECRET, secrets_in
from tests.tools.doctor.setups import Setup, button, call, panel_of

TEXT = '[[page.widget]]\nid = "words"\nkind = "text"\nlabel = "Words"\nmax_length = 200\n'
COUNT = '[[page.widget]]\nid = "amount"\nkind = "number"\nlabel = "Count"\nmin = 0\nmax = 9\n'
ENDPOINT = "tcp/127.0.0.1:7447"
NEEDED = {
    "doctor.json",
    "versions.json",
    "settings.json",
    "machine.json",
    "panel.json",
    "zenoh.json",
    "logs/journal.json",
    "logs/operators-log.jsonl",
    "state/readyz.json",
    "state/metrics.txt",
}


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    return Setup(tmp_path)


def panel_with_secrets() -> str:
    """A good panel file with a secret in each of its texts and comments."""
    say = button("/say").replace("message = {}", 'message = { data = "{words}" }')
    more = button("/count", "std_msgs/msg/Int32").replace(
        "message = {}", "message = { data = '{amount}' }"
    )
    texts = [
        f"[[page.widget]]\nid = 'text{n}'\nkind = 'label'\nlabel = {json.dumps(form)}\n# {form}\n"
        for n, form in enumerate(FORMS)
    ]
    return panel_of(TEXT, COUNT, say, more, *texts, more='mode = "demo"\n')


@pytest.fixture
def demo(setup: Setup) -> Iterator[Server]:
    """A running server, whose operator typed secrets in: accepted ones, and some that were refused."""
    setup.panel.write_text(panel_with_secrets())
    mine = Server(ROOT, KIOSK_PANEL=str(setup.panel))
    until(lambda: mine.widget("say")["enabled"], "open")
    for form in FORMS:
        for widget, entry in (("say", "words"), ("count", "amount"), ("say", form)):
            answer = mine.press(widget, inputs={entry: form})
            assert answer.status_code in (200, 422), answer.text
    yield mine
    mine.end()


def files_of(path: Path) -> dict[str, str]:
    with zipfile.ZipFile(path) as packed:
        assert packed.testzip() is None
        return {name: packed.read(name).decode() for name in packed.namelist()}


def command(setup: Setup, server: Server | None, *more: str) -> list[str]:
    port, data = (server.port, server.data) if server else (setup.port, setup.data)
    return ["support", str(setup.panel), "--port", str(port), "--data", str(data), *more]


def journal_of(folder: Path, lines: Sequence[str], unit: str = "operator-panel.service") -> None:
    """A program `journalctl` that prints lines as the real one does, the newest first."""
    fields = [
        {"__REALTIME_TIMESTAMP": f"{1795631090000000 + n}", "_SYSTEMD_UNIT": unit, "MESSAGE": line}
        for n, line in enumerate(lines)
    ]
    (folder / "journal").write_text("".join(f"{json.dumps(field)}\n" for field in reversed(fields)))
    program = folder / "journalctl"
    program.write_text(f'#!/bin/sh\ncat "{folder}/journal"\n')
    program.chmod(0o755)


def test_support_bundle_has_no_secret_in_any_form(
    setup: Setup, demo: Server, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KIOSK_HOSTS", "panel1.local")
    monkeypatch.setenv("PATH", f"{setup.folder}:{os.environ['PATH']}")
    for name in ("DATABASE_PASSWORD", "PGPASSWORD", "TOKEN", "apiKey"):
        monkeypatch.setenv(name, SECRET)
    shipped = (ROOT / "zenoh.json5").read_text()
    login = f'auth: {{ usrpwd: {{ user: "{SECRET}", password: "{SECRET}" }} }},'
    settings = (f"tls/robot:7447#password={SECRET}", f"tcp/robot:7447?token={SECRET}")
    listed = "".join(f'"{endpoint}", ' for endpoint in settings)
    comments = "".join(f"// {form}\n" for form in FORMS)
    zenoh = setup.folder / "zenoh.json5"
    zenoh.write_text(
        comments
        + shipped.replace("transport: {", f"transport: {{\n{login}", 1)
        .replace("endpoints: [", f"endpoints: [{listed}", 1)
        .replace("scouting: {", f'metadata: {{ name: "{SECRET}" }}, scouting: {{', 1)
    )
    path = setup.folder / "bundle.zip"
    logged = demo.process.text.splitlines()
    assert any(SECRET in line for line in logged)
    journal_of(setup.folder, [*logged, *FORMS, *(f"[WARN] [1.5] [web_ui]: {form}" for form in FORMS)])
    demo.http.get("/", params={"token": SECRET}, headers={"Referer": f"http://x/?password={SECRET}"})
    assert main(command(setup, demo, "--zenoh", str(zenoh), "-o", str(path), "--yes")) == 0
    output = capsys.readouterr().out
    files = files_of(path)
    assert secrets_in(files | {"output": output}) == []
    assert {line.split()[0] for line in output.splitlines() if line.startswith("  ")} == set(files)
    assert set(files) == NEEDED
    assert path.stat().st_mode & 0o777 == 0o600

    # What helps is there.
    settings = json.loads(files["settings.json"])
    assert "KIOSK_HOSTS" in settings["set"]
    assert "panel1.local" in settings["in use"]["hosts"]
    assert json.loads(files["versions.json"])["eclipse-zenoh"].startswith("1.")
    doctor = json.loads(files["doctor.json"])
    assert doctor["findings"][0]["code"] == "server_running"
    assert doctor["findings"][0]["about"] == f"127.0.0.1 port {demo.port}"
    entries = [json.loads(line) for line in files["logs/operators-log.jsonl"].splitlines()]
    outcomes = {(entry.get("widget"), entry.get("outcome")) for entry in entries}
    assert {("say", "published"), ("count", "refused")} <= outcomes
    sent = next(entry for entry in entries if entry.get("outcome") == "published")
    assert sent["codes"] == ["published"]
    refused = next(entry for entry in entries if entry.get("outcome") == "refused")
    assert "input_not_a_number" in refused["codes"]
    assert json.loads(files["state/readyz.json"]) == {"ready": True, "code": ""}
    assert 'kiosk_presses_total{outcome="published"}' in files["state/metrics.txt"]
    counts = json.loads(files["logs/journal.json"])["operator-panel.service"]
    assert sum(counts.values()) == len(logged) + 2 * len(FORMS)
    assert counts["WARN"] >= len(FORMS)
    widgets = json.loads(files["panel.json"])["pages"][0]["own"]
    said = next(widget for widget in widgets if widget["id"] == "say")
    assert (said["topic"], said["label"]) == ("/say", LEFT_OUT)
    assert json.loads(files["zenoh.json"])["connect"] == [LEFT_OUT, LEFT_OUT, ENDPOINT]


@pytest.mark.parametrize("form", FORMS)
def test_support_bundle_has_no_secret_of_a_broken_file(
    setup: Setup, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor in the errors that tell what is wrong with it."""
    zenoh = setup.folder / "zenoh.json5"
    settings = Settings(panel=setup.panel, zenoh=zenoh, mode="live", data=setup.data)
    options = Options(port=setup.port)
    for panel in (f"{form}\n", f'title = "Cell"\n{form}\n', f'[[page]]\nid = "a"\n{form} = 1\n'):
        settings.panel.write_text(panel_of(button("/say")) + panel)
        settings.zenoh.write_text(f"{{ mode: 'peer', connect: {{ endpoints: [{form}] }}, {form} }}")
        diagnosis = Diagnosis(report=Report())
        diagnosis.report.find("zenoh_config", str(settings.zenoh), detail=form)
        diagnosis.report.find("panel_fault", f"{form} (line 3)", detail=form)
        diagnosis.report.find("panel_fault", f"page[0].{form}", detail=form)
        sources = Sources(environment={"KIOSK_PANEL": form, "X": form}, journal=bytes)
        made = parts(settings, options, diagnosis, sources)
        assert secrets_in({part.name: part.text for part in made}) == []


def test_support_bundle_has_the_graph(
    setup: Setup, domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    setup.panel.write_text(panel_of(call("/reset", "std_srvs/srv/Trigger")))
    bridge, path = Bridge(domain + 5), setup.folder / "bundle.zip"
    bridge.start()
    try:
        zenoh = zenoh_file(setup.folder, bridge.endpoint)
        options = ["--zenoh", str(zenoh), "--listen", "0.1", "-o", str(path), "--yes"]
        assert main(command(setup, None, *options)) == 0
    finally:
        bridge.end()
    graph = json.loads(files_of(path)["graph.json"])
    assert graph["robots"][0]["bridges"][0]["version"] == "v1.10.2"
    assert "graph.json" in capsys.readouterr().out


@pytest.fixture
def quick(setup: Setup) -> Setup:
    """Nothing that has to be waited for."""
    setup.panel.write_text(panel_of(more='mode = "demo"\n'))
    return setup


def test_a_list_writes_nothing(
    quick: Setup, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(quick.folder)
    assert main(command(quick, None, "--list")) == 0
    assert "doctor.json" in capsys.readouterr().out
    assert list(quick.folder.glob("*.zip")) == []


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("answer", "status"), [("y\n", 0), ("\n", 2), ("no\n", 2)])
def test_support_asks_before_writing(
    quick: Setup, answer: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(quick.folder)
    monkeypatch.setattr(sys, "stdin", Terminal(answer))
    assert main(command(quick, None)) == status
    assert len(list(quick.folder.glob("operator-panel-support-*.zip"))) == (status == 0)


def test_support_without_a_terminal_asks_for_an_option(
    quick: Setup, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("y\n"))
    assert main(command(quick, None)) == 2
    assert "--yes" in capsys.readouterr().err


def test_a_file_that_is_there_is_kept(quick: Setup, capsys: pytest.CaptureFixture[str]) -> None:
    path = quick.folder / "bundle.zip"
    path.write_text("mine")
    assert main(command(quick, None, "--yes", "-o", str(path))) == 1
    assert "exists: give another name with -o" in capsys.readouterr().err
    assert path.read_text() == "mine"
    assert main(command(quick, None, "--yes", "-o", str(quick.folder / "no/bundle.zip"))) == 1


def test_the_journal_is_asked_for_the_last_hour_of_our_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "journalctl"
    program.write_text('#!/bin/sh\necho "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    words = journal().decode().split()
    assert {"--unit=operator-panel*", "--unit=zenoh-bridge*", "--since=-3600s"} <= set(words)


def test_a_journal_without_end_is_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "journalctl"
    program.write_text("#!/bin/sh\nexec yes\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert len(journal()) == JOURNAL_BYTES
    assert journal_counts(journal()) == {}


def test_of_a_long_log_the_end_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    most, line = 4_000, "x" * 99 + "\n"
    monkeypatch.setattr("app.tools.doctor.bundle.MOST_BYTES", most)
    part = text_part("logs/operators-log.jsonl", "", line * (2 * most // len(line)))
    assert part.text.startswith(CUT + line)
    assert part.text.endswith(line)
    assert most - len(line) <= part.size - len(CUT) <= most


def test_without_a_journal_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert journal() == b""


def test_a_bundle_is_a_zip(tmp_path: Path) -> None:
    path = tmp_path / "bundle.zip"
    began = time.time()
    assert write(path, [Part("a/b.txt", "", "äöü")]) == path.stat().st_size
    assert files_of(path) == {"a/b.txt": "äöü"}
    assert path.stat().st_mtime >= began - 1
