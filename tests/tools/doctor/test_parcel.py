"""The fault parcel: each part of it, of a running server and of the data folder of one that has ended;
stores that are damaged or not there; and no credential in it."""

import gzip
import io
import json
import re
import shutil
import zipfile
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest
from mcap.reader import make_reader

from app.cell.alarms.report import NAME as STATES
from app.cell.alarms.store import NAME as ALARMS
from app.cell.stops.shown import FOLDER as VIEWS
from app.records.copy import Comparison, read_copy
from app.records.database import NAME as LOG
from app.records.starts import sha256
from app.records.verify import verify
from app.system.public import LEFT_OUT
from app.tools.cli.command import main
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server, panel_file
from tests.support.users import add_user, token_of
from tests.tools.doctor.secrets import FORMS, NUMBER, SECRET, secrets_in
from tests.web.test_stops import PANEL, keys, story

NAMES: Final = {
    *("README.txt", "story.html", "story.json", "log.jsonl", "log.csv", "alarms.json", "alarms.csv"),
    *("panel.json", "versions.json", "layout.json"),
}
PAGE: Final = "pages/main.html"
RUNNING: Final = '<b data-text="text">Running</b>'
PATH: Final = "/state.data"
TREND: Final = """
[[page.widget]]
id = "curve"
kind = "trend"
label = "Belt"
window = "60s"
[[page.widget.pen]]
topic = "/speed"
type = "std_msgs/msg/Float64"
field = "data"
label = "Speed"
"""
RECORD: Final = "\n[record]\nbefore_s = 5\nafter_s = 0.5\n"
# Secrets in comments and texts of the panel file that the story does not need.
TEXTS: Final = "".join(
    f"# {form}\n[[page.widget]]\nid = 'text{n}'\nkind = 'label'\nlabel = {json.dumps(form)}\n"
    for n, form in enumerate(FORMS)
)
TABLES: Final = PANEL.replace("[[alarm]]", f"{TREND}{TEXTS}[[alarm]]", 1) + RECORD


class Cell(NamedTuple):
    """A server that has ended: its panel file and data folder, a stop with its time, and the parcel
    that it made."""

    panel: Path
    data: Path
    key: str
    at: datetime
    told: dict[str, Any]
    made: dict[str, bytes]
    name: str

    def command(self, file: Path, *more: str) -> list[str]:
        where = ["--data", str(self.data)]
        return ["parcel", str(self.panel), *where, "-o", str(file), *more]

    def copied(self, folder: Path) -> "Cell":
        return self._replace(data=Path(shutil.copytree(self.data, folder / "data")))


def parts_of(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        assert packed.testzip() is None
        return {name: packed.read(name) for name in packed.namelist()}


def readme(parts: dict[str, bytes]) -> str:
    return parts["README.txt"].decode()


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    folder = tmp_path_factory.mktemp("cell")
    data = folder / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "engineer", pin=NUMBER, password=SECRET, badge=f"{SECRET}04A2")
    token_of(data, "line", "engineer")
    zenoh = folder / "zenoh.json5"
    login = f'auth: {{ usrpwd: {{ user: "{SECRET}", password: "{SECRET}" }} }},'
    text = (ROOT / "zenoh.json5").read_text()
    zenoh.write_text(text.replace("transport: {", f"transport: {{\n{login}", 1))
    with demo_server(
        folder, TABLES, KIOSK_DATA=str(data), KIOSK_ZENOH=str(zenoh), DATABASE_PASSWORD=SECRET
    ) as server:
        server.http.post("/session", json={"user": "M. Sato", "pin": NUMBER}).raise_for_status()
        until(lambda: len(keys(server)) > 1, "the machine has stopped", within_s=40)
        key = keys(server)[0]
        at = datetime.fromisoformat(story(server, key)["stop"]["at"])
        record_at(server)
        until(lambda: RUNNING in server.http.get("/").text, "the machine runs again", within_s=40)
        answer = server.http.get(f"/stops/{key}/parcel.zip", timeout=120)
        assert answer.status_code == 200, answer.text
        told = story(server, key)
        log = server.http.get("/log", headers={"accept": "text/html"}).text
        assert "A fault parcel of the stop at" in log
        disposition = answer.headers["content-disposition"]
    name = re.fullmatch(r'attachment; filename="(fault-\d{8}-\d{6}\.zip)"', disposition)
    assert name is not None
    return Cell(folder / "cell.toml", data, key, at, told, parts_of(answer.content), name[1])


def record_at(server: Server) -> None:
    """A recording of the last seconds, by a press; it is finished."""
    server.press("start")
    folder = server.data / "recordings"
    until(lambda: any(folder.glob("*.mcap")), "the recording is finished")


def test_a_running_server_gives_each_part(cell: Cell) -> None:
    parts = cell.made
    assert NAMES | {PAGE} <= set(parts)
    told = json.loads(parts["story.json"])
    for name in ("key", "sort", "id", "at"):
        assert told["stop"][name] == cell.told["stop"][name]
    assert told["first_cause"] == cell.told["first_cause"]
    assert told["sentence"]
    html = parts["story.html"].decode()
    assert "Why did it stop?" in html
    assert "<script" not in html
    assert "http" not in html
    assert html.count("<tr") == len(told["lines"])
    page = parts[PAGE].decode()
    assert "when the machine stopped" in page
    assert "<style>" in page
    assert "<script" not in page
    assert 'data-widget="start"' in page
    assert '<b data-text="text">Fault</b>' in page  # the machine runs when the parcel is made
    assert RUNNING not in page
    for name, content in parts.items():
        if name != "README.txt":
            size = f"{len(content):,} bytes"
            assert re.search(rf"{re.escape(name)} +{size}", readme(parts)), name
    assert 'the page "main" as it was shown at the stop' in readme(parts)


def test_the_recording_has_the_messages_of_the_moment(cell: Cell) -> None:
    names = [name for name in cell.made if name.startswith("recordings/")]
    at = cell.at.timestamp() * 1e9
    covering = 0
    for name in names:
        messages = list(make_reader(io.BytesIO(cell.made[name])).iter_messages())
        times = [message.log_time for _, _, message in messages]
        covering += min(times) <= at <= max(times)
        assert {PATH.rpartition(".")[0], "/guard"} <= {channel.topic for _, channel, _ in messages}
    assert covering


def test_the_log_is_a_part_of_the_chain_that_can_be_verified(cell: Cell, tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    file.write_bytes(cell.made["log.jsonl"])
    comparison = Comparison(read_copy(file))
    assert comparison.count >= 2
    assert not verify(cell.data, against=comparison.fault).fault
    assert not comparison.end_fault()
    assert "each follows the one before it" in readme(cell.made)
    csv = cell.made["log.csv"].decode("utf-8-sig").splitlines()
    assert csv[0].startswith("seq,at,boot,")
    assert len(csv) == comparison.count + 1
    file.write_bytes(cell.made["log.jsonl"].replace(b'"kind":"pressed"', b'"kind":"refused"'))
    changed = [entry for entry in read_copy(file) if entry.hash != entry.computed_hash()]
    assert [entry.kind for entry in changed] == ["refused"]


def test_alarms_versions_and_the_panel_file(cell: Cell) -> None:
    alarms = json.loads(cell.made["alarms.json"])
    assert {row["id"] for row in alarms} == {"speed_low"}
    assert alarms[0]["record"]["about"]["text"] == "Belt is slow"
    assert cell.made["alarms.csv"].decode("utf-8-sig").count("speed_low") == len(alarms)
    about = json.loads(cell.made["versions.json"])
    digest = sha256(cell.panel.read_bytes())
    assert about["panel_sha256"] == digest == about["at_the_stop"]["sha256"]["panel"]
    assert about["program_sha256"] == about["at_the_stop"]["sha256"]["program"]
    assert re.fullmatch("[0-9a-f]{64}", about["dependencies"]["fastapi"]["record_sha256"])
    assert about["versions"]["operator-panel"] == about["at_the_stop"]["version"]
    panel = json.loads(cell.made["panel.json"])
    assert panel["title"] == LEFT_OUT
    assert panel["interlocks"][0]["id"] == "guard"


def test_the_layout_has_the_topics_of_the_panel_file(cell: Cell) -> None:
    layout = json.loads(cell.made["layout.json"])
    panels = layout["configById"]
    bands = [path["value"] for path in panels["StateTransitions!states"]["paths"]]
    assert bands == [PATH, "/guard.data", "/no_fault.data"]
    assert [path["value"] for path in panels["Plot!curves"]["paths"]] == ["/speed.data"]
    assert panels["RawMessages!presses"]["topicPath"] == "/web_ui/presses"
    assert set(re.findall(r"\w+!\w+", json.dumps(layout["layout"]))) == set(panels)
    name = next(name for name in cell.made if name.startswith("recordings/"))
    summary = make_reader(io.BytesIO(cell.made[name])).get_summary()
    assert summary is not None
    recorded = {channel.topic for channel in summary.channels.values()}
    assert {path.rpartition(".")[0] for path in bands} <= recorded


def test_no_credential_is_in_it(cell: Cell) -> None:
    texts = {name: content.decode("latin-1") for name, content in cell.made.items()}
    # The page as everyone sees it has the texts of the panel file, and nothing else of them.
    page = texts.pop(PAGE)
    assert page.count(SECRET) == sum(form.count(SECRET) for form in FORMS)
    assert secrets_in(texts) == []
    views = list((cell.data / VIEWS).iterdir())
    assert views
    kept = {file.name: gzip.decompress(file.read_bytes()).decode() for file in views}
    assert secrets_in(kept) == []


def test_the_command_reads_the_folder_of_a_server_that_has_ended(
    cell: Cell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "fault.zip"
    near = (cell.at + timedelta(seconds=1)).isoformat()
    assert main(cell.command(file, "--at", near, "--language", "ja")) == 0
    assert file.stat().st_mode & 0o777 == 0o600
    parts = parts_of(file.read_bytes())
    assert set(parts) >= NAMES
    told = json.loads(parts["story.json"])
    assert told["stop"]["key"] == cell.key
    assert "安全扉" in told["sentence"]
    assert any(name.startswith("recordings/") for name in parts)
    page = parts[PAGE].decode()
    assert "機械が停止したときの表示" in page
    assert '<b data-text="text">異常</b>' in page
    assert main(cell.command(file)) == 1
    assert f"{file} exists" in capsys.readouterr().err
    assert main(cell.command(file, "--force")) == 0
    assert json.loads(parts_of(file.read_bytes())["story.json"])["stop"]["sort"] == "state"


def test_a_time_without_a_stop_has_what_there_is(cell: Cell, tmp_path: Path) -> None:
    file = tmp_path / "fault.zip"
    assert main(cell.command(file, "--at", "2020-01-01T00:00:00")) == 0
    parts = parts_of(file.read_bytes())
    assert "story.html: no stop is recorded within ten minutes of this time" in readme(parts)
    assert "recordings/: no finished recording has this moment" in readme(parts)
    assert "versions at the stop: the log begins later" in readme(parts)
    assert parts["log.jsonl"] == b""
    assert json.loads(parts["alarms.json"]) == []


@pytest.mark.parametrize("name", [STATES, ALARMS, LOG])
def test_of_a_damaged_store_the_rest_is_there(cell: Cell, tmp_path: Path, name: str) -> None:
    """A story without one of its stores might name a wrong cause: it is left out."""
    damaged = cell.copied(tmp_path)
    for file in damaged.data.glob(f"{name}*"):
        file.unlink()
    (damaged.data / name).write_bytes(b"\0hostile" * 4096)
    file = tmp_path / "fault.zip"
    assert main(damaged.command(file, "--at", cell.at.isoformat())) == 0
    parts = parts_of(file.read_bytes())
    assert "story.json" not in parts
    assert re.search(r"story\.json: the stops can't be read: .*the file is damaged", readme(parts))
    missing = {STATES: set[str](), ALARMS: {"alarms.json", "alarms.csv"}, LOG: {"log.jsonl", "log.csv"}}
    assert NAMES - set(parts) == {"story.html", "story.json", *missing[name]}
    for left_out in missing[name]:
        assert f"{left_out}: the file is damaged" in readme(parts)


def test_an_empty_folder_has_no_stop(
    cell: Cell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = cell._replace(data=tmp_path / "nothing")
    file = tmp_path / "fault.zip"
    assert main(empty.command(file)) == 1
    assert "name a time with --at" in capsys.readouterr().err
    assert main(empty.command(file, "--at", "2020-01-01T00:00:00")) == 0
    parts = parts_of(file.read_bytes())
    assert "log.jsonl: there is no operator's log" in readme(parts)
    assert "alarms.json: no alarm was recorded" in readme(parts)


def test_hostile_recordings_are_left_out(cell: Cell, tmp_path: Path) -> None:
    hostile = cell.copied(tmp_path)
    folder = hostile.data / "recordings"
    kept = sorted(file.name for file in folder.glob("*.mcap"))
    own = folder / kept[0]
    stem = own.name.rpartition("-")[0] + "-"
    (folder / f"{stem}cut.mcap").write_bytes(own.read_bytes()[:-40])
    (folder / f"{stem}noise.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(1000))
    (folder / f"{stem}link.mcap").symlink_to(cell.panel)
    (folder / f"{stem}going.mcap.unfinished").write_bytes(b"")
    (folder / f"{stem}folder.mcap").mkdir()
    file = tmp_path / "fault.zip"
    assert main(hostile.command(file, "--at", cell.at.isoformat())) == 0
    parts = parts_of(file.read_bytes())
    packed = {name.removeprefix("recordings/") for name in parts if "mcap" in name}
    assert packed
    assert packed <= set(kept)
    assert "A recording was still being written" in readme(parts)


def test_of_a_long_log_and_many_alarms_the_newest_are_kept(
    cell: Cell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made() -> dict[str, bytes]:
        file = tmp_path / "fault.zip"
        assert main(cell.command(file, "--at", cell.at.isoformat(), "--force")) == 0
        return parts_of(file.read_bytes())

    whole = made()
    lines = whole["log.jsonl"].splitlines()
    monkeypatch.setattr("app.tools.doctor.parcel.MOST_TEXT", len(whole["log.jsonl"]) - 100)
    cut = made()
    assert cut["log.jsonl"].splitlines() == lines[1:]
    assert f"The log had more entries: it has the newest {len(lines) - 1}." in readme(cut)
    monkeypatch.setattr("app.tools.doctor.parcel.MOST_TEXT", len(whole["alarms.json"]) - 100)
    alarms, fewer = json.loads(whole["alarms.json"]), json.loads(made()["alarms.json"])
    assert fewer == alarms[-len(fewer) :]
    assert len(fewer) < len(alarms)


def test_too_many_recordings_are_named(
    cell: Cell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.tools.doctor.parcel.MOST_RECORDED", 100)
    file = tmp_path / "fault.zip"
    assert main(cell.command(file, "--at", cell.at.isoformat())) == 0
    parts = parts_of(file.read_bytes())
    assert not any(name.startswith("recordings/") for name in parts)
    assert re.search(r"recordings/\S+\.mcap: 0 MB, with which all are more than", readme(parts))


def test_a_panel_that_records_nothing_says_so(cell: Cell, tmp_path: Path) -> None:
    panel = panel_file(tmp_path, TABLES.replace(RECORD, ""))
    file = tmp_path / "fault.zip"
    plain = cell._replace(panel=panel)
    assert main(plain.command(file, "--at", cell.at.isoformat())) == 0
    parts = parts_of(file.read_bytes())
    assert "recordings/: the panel records nothing" in readme(parts)
    assert PAGE not in parts
    assert re.search(r"pages/: .*can't be drawn: the panel file has been changed since", readme(parts))
    assert "The panel file has been changed since" in readme(parts)


def test_mistakes_on_the_command_line_are_named(
    cell: Cell, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "fault.zip"
    assert main(cell.command(file, "--language", "fr")) == 2
    assert 'not in the language "fr": it has en, ja' in capsys.readouterr().err
    assert main(cell.command(file, "--robot", "r1")) == 2
    assert 'there is no robot "r1"' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(cell.command(file, "--at", "yesterday"))
    assert '"yesterday" is not a time' in capsys.readouterr().err
    assert not file.exists()


def test_who_may_take_it(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "O. Tanaka", "operator", pin="2580")
    add_user(data, "M. Sato", "maintenance", pin="1470")
    deep = '[[page]]\nid = "deep"\ntitle = "Deep"\nneeds = "engineer"\n[[alarm]]'
    panel = PANEL.replace("[[alarm]]", deep, 1) + "\n[access]\nopen = false\n"
    with demo_server(tmp_path, panel, KIOSK_DATA=str(data)) as server:
        for user, pin, status in (("O. Tanaka", "2580", 403), ("M. Sato", "1470", 200)):
            server.http.post("/session", json={"user": user, "pin": pin}).raise_for_status()
            key = str(until(lambda: (keys(server) or [""])[0], "it has stopped", within_s=40))
            page = server.http.get(f"/stops/{key}").text
            assert (f"/stops/{key}/parcel.zip" in page) == (status == 200)
            answer = server.http.get(f"/stops/{key}/parcel.zip", timeout=120)
            assert answer.status_code == status
        parts = parts_of(answer.content)
        assert PAGE in parts
        assert "pages/deep.html: it needs the role or group engineer" in readme(parts)
        assert server.http.get("/stops/state-99999/parcel.zip").status_code == 404


@pytest.mark.parametrize("is_damaged", [False, True])
def test_without_what_was_kept_the_pages_are_those_of_now(tmp_path: Path, is_damaged: bool) -> None:
    with demo_server(tmp_path, PANEL) as server:
        folder = server.data / VIEWS
        until(lambda: keys(server) and list(folder.glob("*.gz")), "it has stopped", within_s=40)
        for file in folder.iterdir():
            if is_damaged:
                file.write_bytes(file.read_bytes()[:-20])
            else:
                file.unlink()
        answer = server.http.get(f"/stops/{keys(server)[-1]}/parcel.zip", timeout=120)
        parts = parts_of(answer.content)
        assert "not at the stop" in parts[PAGE].decode()
        assert "The pages are not those of the stop: what the pages showed" in readme(parts)
        damaged = re.search(rf"{VIEWS}/[0-9]+\.json\.gz: it is not whole", readme(parts))
        assert (damaged is not None) == is_damaged


def test_a_stop_of_one_of_several_robots_has_its_pages(tmp_path: Path) -> None:
    robots = "".join(
        f'[[robot]]\nid = "{name}"\nname = "{name.title()}"\nnamespace = "/{name}"\n'
        for name in ("left", "right")
    )
    with demo_server(tmp_path, PANEL.replace("[state]", f"{robots}[state]", 1)) as server:
        folder = server.data / VIEWS
        until(lambda: len(keys(server)) > 1, "both have stopped", within_s=40)
        until(lambda: {*folder.glob("*-left.*")} and {*folder.glob("*-right.*")}, "both are kept")
        seen = set()
        for key in keys(server)[-2:]:
            robot = story(server, key)["stop"]["robot"]
            answer = server.http.get(f"/stops/{key}/parcel.zip", timeout=120)
            parts = parts_of(answer.content)
            page = parts[PAGE].decode()
            assert f"<title>Main – {robot.title()} – Cell</title>" in page
            assert "when the machine stopped" in page
            assert '<b data-text="text">Fault</b>' in page
            seen.add(robot)
        assert seen == {"left", "right"}
