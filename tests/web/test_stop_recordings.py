"""The recording that a stop begins: its link in the story, as a page and as JSON, and the file."""

import io
import re
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
from mcap.reader import make_reader

from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import add_user
from tests.web.test_stops import PANEL, keys, story

RECORD = "\n[record]\nbefore_s = 0\nafter_s = 0\n"
ALARM = PANEL.replace("priority = 3", "priority = 2").replace('stops = ["FAULT"]', "stops = []")


def recorded(server: Server) -> dict[str, Any]:
    """The story of a stop that has its recording."""

    def told() -> dict[str, Any] | None:
        stories = (story(server, key) for key in keys(server))
        return next((each for each in stories if each["recording"]), None)

    return dict(until(told, "a stop is recorded", within_s=60))


def test_the_story_leads_into_the_recording_at_its_moment(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL + RECORD) as server:
        told = recorded(server)
        recording, key = told["recording"], told["stop"]["key"]
        assert recording["path"].endswith("-stop.mcap")
        assert recording["since"] < told["stop"]["at"] < recording["until"]
        answer = server.http.get(recording["path"])
        assert answer.headers["content-type"] == "application/octet-stream"
        times = [
            message.log_time
            for _, _, message in make_reader(io.BytesIO(answer.content)).iter_messages()
        ]
        states = [
            message.log_time
            for _, _, message in make_reader(io.BytesIO(answer.content)).iter_messages(["/state"])
        ]
        at = min(times) / 1e9 + recording["offset_s"]
        assert min(abs(at - each / 1e9) for each in states) < 0.01  # the message of the stop itself
        page = server.http.get(f"/stops/{key}", headers={"accept": "text/html"}).text
        assert f'href="{recording["path"]}"' in page
        assert f"stop at {recording['offset_s']:.1f}" in page
        part = server.http.get(recording["path"], headers={"range": "bytes=0-7"})
        assert (part.status_code, part.content) == (206, b"\x89MCAP0\r\n")
        for file in (server.data / "recordings").glob("*.mcap"):
            file.unlink()
        gone = server.http.get(recording["path"], headers={"accept": "application/json"})
        assert (gone.status_code, "no longer kept" in gone.text) == (404, True)
        assert story(server, key)["recording"] is None
        assert server.http.get("/recordings/..%2F..%2Fpanel.mcap").status_code in (404, 422)
        assert server.http.get("/recordings/operators-log.mcap").status_code == 422


def test_it_is_shared_with_foxglove_which_begins_at_the_stop(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL + RECORD) as server:
        told = recorded(server)
        path = f"/stops/{told['stop']['key']}"
        receipt = server.http.post(f"{path}/foxglove", json={}).raise_for_status().json()
        assert (receipt["outcome"], receipt["done"]) == ("succeeded", True)
        shared = httpx.get(receipt["recording"], trust_env=False)  # without a cookie of the panel
        assert shared.content == server.http.get(told["recording"]["path"]).content
        answer = server.http.post(f"{path}/foxglove", data={"id": "0123456789abcdef"})
        assert (answer.status_code, answer.headers["location"]) == (303, path)
        page = server.http.get(path, headers={"accept": "text/html"}).text
        (browser, desktop) = re.findall(r'href="((?:https://app\.foxglove\.dev|foxglove:)[^"]+)"', page)
        for link in (browser, desktop):
            query = parse_qs(urlsplit(unescape(link)).query)
            assert query["time"] == [told["stop"]["at"]]
            assert query["ds.url"][0].startswith(f"{server.url}/recordings/shared/")
        log = server.http.get("/log", headers={"accept": "text/html"}).text
        assert log.count("was shared with Foxglove") == 2
        diagnostics = server.http.get("/diagnostics", headers={"accept": "text/html"}).text
        assert "app.foxglove.dev" not in diagnostics  # it has the last minute only
        for file in (server.data / "recordings").glob("*.mcap"):
            file.unlink()
        assert server.http.post(f"{path}/foxglove", json={}).status_code == 404


def test_an_alarm_of_priority_2_begins_one(tmp_path: Path) -> None:
    with demo_server(tmp_path, ALARM + RECORD) as server:
        assert recorded(server)["stop"]["sort"] == "alarm"


def test_a_recording_needs_maintenance(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "O. Tanaka", "operator", pin="2580")
    panel = f"{PANEL}{RECORD}[access]\nopen = false\n"
    with demo_server(tmp_path, panel, KIOSK_DATA=str(data)) as server:
        server.http.post("/session", json={"user": "O. Tanaka", "pin": "2580"}).raise_for_status()
        told = recorded(server)
        path = told["recording"]["path"]
        assert server.http.get(path).status_code == 403
        refused = server.http.post(f"/stops/{told['stop']['key']}/foxglove", json={})
        assert (refused.status_code, refused.json()["done"]) == (403, False)
        page = server.http.get(f"/stops/{told['stop']['key']}", headers={"accept": "text/html"}).text
        assert path not in page


def test_without_record_there_is_none(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL) as server:
        key = str(until(lambda: (keys(server) or [""])[0], "it has stopped", within_s=40))
        assert story(server, key)["recording"] is None
        assert not (server.data / "recordings").exists()
