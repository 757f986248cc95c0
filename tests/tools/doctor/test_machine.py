"""What the doctor finds on this machine: port, data folder, disk, fonts, screens."""

import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from app.panel import load_panel
from app.system.time_source import TimeSource
from app.tools.cli.command import main
from app.tools.doctor import doctor, machine
from app.tools.doctor.findings import KINDS, Report
from app.tools.doctor.machine import (
    MB,
    check_data,
    check_fonts,
    check_port,
    check_screens,
    check_time,
    displays,
    has_font,
)
from tests.records.test_room import fill
from tests.support.browser.fonts import fonts_file
from tests.support.parts import ROOT, Server, free_port
from tests.tools.doctor.setups import Setup, named, panel_of, readout

NO_ROUTER = "tcp/127.0.0.1:9"  # the discard port: nothing listens


@pytest.fixture
def setup(tmp_path: Path) -> Setup:
    return Setup(tmp_path)


@pytest.fixture
def another_program(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """It has the panel's port, and says nothing."""
    monkeypatch.setattr("app.tools.doctor.machine.ANSWER_S", 0.1)
    with closing(socket.create_server(("127.0.0.1", setup.port))):
        yield


def edid(width: int, height: int, width_mm: int, height_mm: int) -> bytes:
    """What a screen of this size says of itself."""
    said = bytearray(128)
    said[:8] = bytes.fromhex("00ffffffffffff00")
    said[21:23] = width_mm // 10, height_mm // 10
    timing = bytearray(18)
    timing[2], timing[4] = width & 0xFF, width >> 4 & 0xF0
    timing[5], timing[7] = height & 0xFF, height >> 4 & 0xF0
    timing[12], timing[13] = width_mm & 0xFF, height_mm & 0xFF
    timing[14] = width_mm >> 4 & 0xF0 | height_mm >> 8 & 0x0F
    said[54:72] = timing
    return bytes(said)


def connect(root: Path, said: bytes, name: str = "card0-HDMI-A-1", status: str = "connected") -> None:
    folder = root / name
    folder.mkdir()
    (folder / "status").write_text(f"{status}\n")
    (folder / "edid").write_bytes(said)


def codes(setup: Setup, text: str = "") -> list[str]:
    """Without the one about the router that is not there."""
    reported = setup.diagnose(text or panel_of(), NO_ROUTER).report.codes()
    return [code for code in reported if code != "no_router"]


def test_a_free_port_a_writable_folder_fonts_and_no_screen_are_well(setup: Setup) -> None:
    assert codes(setup) == []
    assert not setup.data.exists()  # it only looks


@pytest.mark.usefixtures("another_program")
def test_a_port_of_another_program_is_named(setup: Setup) -> None:
    assert codes(setup) == ["port_in_use"]


def test_an_address_that_is_not_this_machines() -> None:
    report = Report()
    check_port(report, "192.0.2.99", free_port())
    (finding,) = report.findings
    assert finding.code == "address_unusable"
    assert "can't assign" in finding.sentence or "cannot assign" in finding.sentence


def test_a_list_of_options_that_a_running_server_lacks_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a server that reaches its robot: else that is the fault."""
    known = 'kiosk_options_known{robot="left",select="%s"} %s\n'
    answers: dict[str, object] = {
        "/healthz": {"status": "ok"},
        "/readyz": {"status": "ready"},
        "/metrics": known % ("frame", "1.0") + known % ("program", "0.0"),
    }
    monkeypatch.setattr(machine, "ask_server", lambda host, port, path: (200, answers[path]))
    report = Report()
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        check_port(report, "127.0.0.1", other.getsockname()[1])
    assert report.codes() == ["server_running", "options_unknown"]
    assert (report.findings[1].about, report.findings[1].robot) == ("program", "left")


@pytest.fixture
def server() -> Iterator[Server]:
    mine = Server(ROOT, KIOSK_MODE="live", KIOSK_ZENOH=str(ROOT / "zenoh.json5"))
    yield mine
    mine.end()


def test_a_server_of_ours_is_not_taken_for_another_program(setup: Setup, server: Server) -> None:
    setup.port, setup.data = server.port, server.data
    report = setup.diagnose(panel_of(), NO_ROUTER).report
    assert report.codes()[:2] == ["server_running", "server_not_ready"]
    assert "robot" in report.findings[1].sentence
    assert "data_in_use" not in report.codes()


def test_a_data_folder_that_another_server_has(setup: Setup, server: Server) -> None:
    setup.data = server.data
    assert codes(setup) == ["data_in_use"]


@pytest.mark.parametrize("place", ["file/data", "/proc/data"])
def test_a_folder_that_cannot_be_written(setup: Setup, place: str) -> None:
    (setup.folder / "file").write_text("")
    setup.data = setup.folder / place
    assert codes(setup) == ["data_unwritable"]


def test_a_full_disk(setup: Setup) -> None:
    setup.machine["free_bytes"] = lambda folder: 20 * MB
    findings = setup.diagnose(panel_of(), NO_ROUTER).report.findings
    (full,) = [finding for finding in findings if finding.code == "data_full"]
    assert full.details == {"free_mb": 20, "needed_mb": 562}  # the log's 512 and others


def test_size_of_the_existing_log_reduces_the_needed_disk_space(setup: Setup) -> None:
    setup.data.mkdir()
    with (setup.data / "operators-log.sqlite3").open("wb") as file:
        os.truncate(file.fileno(), 500 * MB)
    report = Report()
    setup.panel.write_text(panel_of())
    check_data(report, setup.data, load_panel(setup.panel), False, lambda folder: 70 * MB)
    assert report.is_well


@pytest.mark.parametrize(("fonts", "missing"), [("dejavu", ["ja"]), ("cjk", [])])
def test_japanese_needs_its_fonts(
    fonts: str, missing: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FONTCONFIG_FILE", str(fonts_file(fonts, tmp_path)))
    report = Report()
    check_fonts(report, ("en", "ja"), has_font, lambda: True)
    assert named(report.findings) == [("fonts_missing", tag) for tag in missing]
    assert all("fonts-noto-cjk" in finding.do for finding in report.findings)


def test_a_machine_without_a_browser_needs_no_fonts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    report = Report()
    check_fonts(report, ("en", "ja"), lambda language: False)
    assert report.is_well
    assert report.facts == ["no browser is installed here: no fonts are needed"]
    (tmp_path / "chromium").touch(mode=0o755)
    check_fonts(report, ("en", "ja"), lambda language: False)
    assert named(report.findings) == [("fonts_missing", "en"), ("fonts_missing", "ja")]


def test_without_fontconfig_the_files_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr("app.tools.doctor.machine.FOLDERS", (tmp_path,))
    assert not has_font("en")
    (tmp_path / "DejaVuSans.ttf").touch()
    assert has_font("en")
    assert not has_font("ja")
    (tmp_path / "NotoSansCJK-Regular.ttc").touch()
    assert has_font("ja")


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((1280, 800, 282, 176), []),  # 0.22 mm for a pixel, as the panel has it
        ((1280, 800, 150, 94), ["screen_small_targets"]),  # a 7-inch screen
        ((1280, 800, 518, 324), ["screen_scale"]),
        ((1280, 800, 0, 0), ["screen_unknown"]),
    ],
)
def test_a_screen_is_measured(
    setup: Setup, size: tuple[int, int, int, int], expected: list[str]
) -> None:
    connect(setup.screens, edid(*size))
    assert codes(setup) == expected


def test_the_key_that_comes_out_too_small_is_reported_in_mm(setup: Setup) -> None:
    connect(setup.screens, edid(1280, 800, 150, 94))
    finding = setup.diagnose(panel_of(), NO_ROUTER).report.findings[0]
    assert "a button of 20 mm is 11 mm wide" in finding.sentence
    assert "mm_per_px = 0.117" in finding.do


def test_a_page_that_does_not_fit_the_screen(setup: Setup) -> None:
    connect(setup.screens, edid(800, 480, 176, 106))
    many = [readout(f"/topic{number}") for number in range(40)]
    text = panel_of(*many).replace('title = "Main"\n', 'title = "Main"\nfit = true\n')
    assert codes(setup, text) == ["page_too_large"]


def test_connectors_without_a_screen_are_ignored(tmp_path: Path) -> None:
    connect(tmp_path, edid(1280, 800, 282, 176), "card0-DP-1", "disconnected")
    connect(tmp_path, b"", "card0-HDMI-A-1")
    connect(tmp_path, b"\xff" * 128, "card1-DP-1")
    (tmp_path / "card0-VGA-1").mkdir()
    assert list(displays(tmp_path)) == []
    report = Report()
    check_screens(report, load_panel(ROOT / "app/panel.toml"), tmp_path)
    assert report.facts == []
    assert report.findings == []


def test_a_type_without_definition_and_another_fault(setup: Setup) -> None:
    text = panel_of(readout("/door", "cell_msgs/msg/Door"))
    assert codes(setup, text) == ["type_unknown"]
    text += readout("/lamp").replace('label = "/lamp"', "")
    assert codes(setup, text) == ["type_unknown", "panel_fault"]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (TimeSource(True, "chrony"), []),
        (TimeSource(False, "chrony"), ["time_unsynchronised"]),
        (TimeSource(), ["time_unknown"]),
    ],
)
def test_the_clock_follows_a_time_source_or_that_is_a_note(
    setup: Setup, source: TimeSource, expected: list[str]
) -> None:
    setup.machine["read_time"] = lambda: source
    report = setup.diagnose(panel_of(more='mode = "demo"\n'), "tcp/127.0.0.1:1").report
    assert report.codes() == [*expected, "demo_mode"]
    assert report.is_well
    fact = "this machine's clock is synchronised by chrony"
    assert (fact in report.facts) is (source.synchronised is True)


@pytest.mark.parametrize(("days", "expected"), [(365, []), (36_500, ["log_room"])])
def test_a_log_that_needs_more_room_than_it_has_is_found_with_its_figures(
    setup: Setup, days: int, expected: list[str]
) -> None:
    setup.data.mkdir()
    fill(setup.data, time.time() - 8 * 86_400, 1600)
    rules = f'mode = "demo"\n[log]\ndays = {days}\nsize_mb = 64\n'
    report = setup.diagnose(panel_of(more=rules), NO_ROUTER).report
    assert [code for code in report.codes() if code != "demo_mode"] == expected
    facts = [fact for fact in report.facts if "at 200 entries a day" in fact]
    assert len(facts) == 1 - len(expected)
    for finding in report.findings[: len(expected)]:
        assert (finding.details["rate"], finding.details["room_mb"]) == ("200", "64")
        assert finding.severity == "warning"


def test_check_tells_it_of_the_log_of_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KIOSK_DATA", str(tmp_path / "data"))
    (tmp_path / "data").mkdir()
    file = tmp_path / "cell.toml"
    file.write_text(panel_of(more='mode = "demo"\n[log]\ndays = 36500\nsize_mb = 64\n'))
    assert main(["check", str(file)]) == 0
    assert "entries a day" not in capsys.readouterr().out
    fill(tmp_path / "data", time.time() - 8 * 86_400, 1600)
    assert main(["check", str(file)]) == 0
    assert "log: The operator's log has 64 MB for 36500 days" in capsys.readouterr().out


@pytest.fixture
def synchronised(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock of this machine, for commands."""
    read = partial(check_time, read=lambda: TimeSource(True))
    monkeypatch.setattr(doctor, "check_time", lambda report, _: read(report))


def command(setup: Setup, *more: str) -> list[str]:
    setup.panel.write_text(panel_of(more='mode = "demo"\n'))
    where = ["--port", str(setup.port), "--data", str(setup.data)]
    return ["doctor", str(setup.panel), *where, *more]


@pytest.mark.usefixtures("synchronised")
def test_the_command_ends_with_0_where_all_is_well(
    setup: Setup, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(setup, "--verbose")) == 0
    said = capsys.readouterr().out
    assert f"ok       127.0.0.1 port {setup.port} is free" in said
    assert "note     demo_mode: " in said
    assert "\nAll is well: 1 note, " in said


@pytest.mark.usefixtures("another_program", "synchronised")
def test_the_command_ends_with_1_where_something_is_wrong(
    setup: Setup, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(setup)) == 1
    said = capsys.readouterr().out
    assert said.startswith("error    port_in_use: Another program listens on 127.0.0.1 port ")
    assert "\nSomething is wrong: 1 error, 1 note, " in said


@pytest.mark.usefixtures("another_program", "synchronised")
def test_the_command_speaks_json_to_programs(setup: Setup, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(command(setup, "--json")) == 1
    diagnosis = json.loads(capsys.readouterr().out)
    assert diagnosis["well"] is False
    assert set(diagnosis) == {"version", "panel", "well", "findings", "facts", "more"}
    first, second = diagnosis["findings"]
    at = f"127.0.0.1 port {setup.port}"
    assert second["code"] == "demo_mode"
    assert first == {
        "severity": "error",
        "code": "port_in_use",
        "about": at,
        "robot": "",
        "what": f"Another program listens on {at}, and it is not a panel server.",
        "do": KINDS["port_in_use"].do,
        "details": {},
    }


def test_doctor_ends_with_2_if_checks_are_impossible(
    setup: Setup, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = command(setup)
    setup.panel.unlink()
    assert main(arguments) == 2
    assert str(setup.panel) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "words"),
    [("--port=0", "is not a port: 1 to 65535"), ("--listen=no", "is not a time: up to 600 seconds")],
)
def test_a_mistake_on_the_command_line(
    option: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["doctor", option])
    assert words in capsys.readouterr().err


def test_a_zenoh_file_that_cannot_be_used(setup: Setup, capsys: pytest.CaptureFixture[str]) -> None:
    setup.panel.write_text(panel_of())
    file = setup.folder / "mine.json5"
    file.write_text("{ mode: 3 }")
    where = ["--zenoh", str(file), "--data", str(setup.data), "--port", str(setup.port)]
    assert main(["doctor", str(setup.panel), *where]) == 1
    assert "zenoh_config" in capsys.readouterr().out
