"""Each reader has the language of their own, at every edge; English where there is no other."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.web.language import COOKIE, negotiated
from tests.support.parts import REFERENCE, ROOT, Server, events_in
from tests.support.servers import ready

AVAILABLE = ("de", "en", "pt-BR")
LANGUAGE = "qps"  # of tests/support/apps/translated.py
PSEUDO = {"accept-language": f"{LANGUAGE}, en;q=0.5"}
BRACKETED = re.compile("⟦.*⟧", re.DOTALL)


@pytest.mark.parametrize(
    ("chosen", "accepted", "language"),
    [
        ("", "de", "de"),
        ("", "DE-at, en;q=0.9", "de"),
        ("", "en;q=0.5, de;q=0.8", "de"),
        ("", "fr, de;q=0.1", "de"),
        ("", "pt-br", "pt-BR"),
        ("", "de;q=0, en;q=0.1", "en"),
        ("", "en-US,en;q=0.9", "en"),
        ("de", "en", "de"),
        ("fr", "en", "en"),
        ("../../etc", "de", "de"),
        ("", "fr", ""),
        ("", "*", ""),
        ("", "", ""),
        ("", ";q=x, , de;q=0.5;q=1, -", ""),
    ],
)
def test_the_language_is_the_best_that_has_a_catalogue(
    chosen: str, accepted: str, language: str
) -> None:
    assert negotiated(chosen, accepted, AVAILABLE) == language


def translated_panel(folder: Path) -> Path:
    """The shipped panel, for readers of English and of the other language."""
    panel = folder / "panel.toml"
    text = REFERENCE.read_text()
    panel.write_text(f'languages = ["en", "{LANGUAGE}"]\n{text}')
    return panel


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    panel = translated_panel(tmp_path_factory.mktemp("panel"))
    with ready(Server(ROOT, app="tests.support.apps.translated:app", KIOSK_PANEL=str(panel))) as mine:
        yield mine


def test_a_page_is_in_the_language_of_its_reader(server: Server) -> None:
    pseudo = server.http.get("/", headers=PSEUDO).text
    english = server.http.get("/").text
    assert '<html lang="qps" ' in pseudo
    assert '<html lang="en" ' in english
    assert '"lost":"⟦' in pseudo
    assert "⟦Server⟧" in pseudo
    assert "⟦" not in english
    assert re.sub("[⟦⟧]", "", pseudo).count("<") == english.count("<")


def test_the_cookie_counts_before_the_browsers_settings(server: Server) -> None:
    headers = {"cookie": f"{COOKIE}={LANGUAGE}", "accept-language": "en"}
    assert '<html lang="qps" ' in server.http.get("/", headers=headers).text


def test_events_are_in_the_language_of_their_reader(server: Server) -> None:
    def names(**headers: str) -> list[str]:
        text = server.http.get("/events?once=1", headers=headers).text
        link = json.loads(events_in(text)[0][1])["link"]
        return [lamp["name"] for lamp in link.values()]

    assert names(**PSEUDO) == [f"⟦{name}⟧" for name in names()]


def test_answers_are_in_the_language_of_their_reader(server: Server) -> None:
    press = {"inputs": {"message": "hello"}}
    pseudo = server.http.post("/widgets/operation", json=press, headers=PSEUDO).json()
    assert BRACKETED.fullmatch(pseudo["reason"])
    english = server.http.post("/widgets/operation", json=press).json()
    assert "⟦" not in english["reason"]
    with server.socket(**PSEUDO) as socket:
        said = socket.press(widget="operation", inputs={"message": "hello"}).json()
        assert BRACKETED.fullmatch(said["reason"])


def test_the_log_is_in_the_language_of_its_reader_and_written_in_english(server: Server) -> None:
    receipt = server.press("operation", "for the log").json()
    page = server.http.get("/log", headers=PSEUDO).text
    assert "⟦Operator" in page
    assert f"⟦{receipt['reason']}⟧" in page
    english = server.http.get("/log", params={"text": receipt["reason"]}).text
    assert receipt["reason"] in english
    assert "⟦" not in english


def test_an_error_is_in_the_language_of_its_reader(server: Server) -> None:
    wrong = server.http.get("/pages/none", headers=PSEUDO)
    assert (wrong.status_code, wrong.json()) == (404, {"error": '⟦This panel has no page "none".⟧'})
    wrong = server.http.put("/pages/none", headers=PSEUDO)
    assert (wrong.status_code, wrong.json()["error"][0]) == (405, "⟦")


def test_an_unlocked_page_of_a_robot_that_is_away_says_so_in_each_language(tmp_path: Path) -> None:
    panel = str(translated_panel(tmp_path))
    app = "tests.support.apps.translated:app"
    mine = Server(ROOT, app=app, KIOSK_MODE="live", KIOSK_PANEL=panel)
    try:
        answer = mine.http.get("/readyz", headers=PSEUDO)
        assert answer.status_code == 503
        assert BRACKETED.fullmatch(answer.json()["reason"])
        assert "⟦" not in mine.http.get("/readyz").json()["reason"]
    finally:
        mine.end()
