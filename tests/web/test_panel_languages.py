"""A panel with texts in three languages: each reader has one, at every edge."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.parts import ROOT, Server, events_in, until
from tests.support.servers import ready

APP = "tests.support.apps.three_languages:app"
PANEL = ROOT / "tests/three_languages.toml"
LABELS = {"en": "Speed", "ja": "速度", "de": "Geschwindigkeit"}


@pytest.fixture(scope="module")
def kiosk() -> Iterator[Server]:
    with ready(Server(ROOT, app=APP, KIOSK_PANEL=str(PANEL))) as mine:
        until(lambda: text_of(mine, "speed", "en") == "−1,234.5 mm/s", "a value is shown")
        until(lambda: widget(mine, "set_limit", "en")["enabled"], "a press is permitted")
        yield mine


def read_by(language: str) -> dict[str, str]:
    return {"accept-language": language}


def widget(kiosk: Server, name: str, language: str) -> dict[str, Any]:
    text = kiosk.http.get("/events?once=1", headers=read_by(language)).text
    shown: dict[str, Any] = json.loads(events_in(text)[0][1])["widgets"][name]
    return shown


def text_of(kiosk: Server, name: str, language: str) -> Any:
    return widget(kiosk, name, language)["text"]


def press(kiosk: Server, language: str, name: str = "set_limit", **inputs: Any) -> str:
    answer = kiosk.http.post(
        f"/widgets/{name}", json={"inputs": inputs}, headers=read_by(language)
    ).json()
    return str(answer["reason"])


@pytest.mark.parametrize(("language", "label"), LABELS.items())
def test_a_page_has_the_texts_of_its_readers_language(kiosk: Server, language: str, label: str) -> None:
    answer = kiosk.http.get("/", headers=read_by(language))
    html = answer.text
    assert f'<html lang="{language}"' in html
    assert f'<h3 id="label-speed">{label}</h3>' in html
    assert not any(f">{other}<" in html for other in LABELS.values() if other != label)
    assert re.search(r"<title>(Main – Cell 1|メイン – セル1|Übersicht – Zelle 1)</title>", html)
    assert ">Door 1</h3>" in html
    assert "{&#39;" not in html
    assert "Text(" not in html
    assert answer.headers["content-language"] == language
    varies = answer.headers["vary"].lower()
    assert "accept-language" in varies
    assert "cookie" in varies


def test_values_units_and_states_are_in_the_language_of_their_reader(kiosk: Server) -> None:
    read = {language: text_of(kiosk, "speed", language) for language in LABELS}
    assert read == {"en": "−1,234.5 mm/s", "ja": "−1,234.5 mm/s", "de": "−1.234,5 mm/s"}
    read = {language: text_of(kiosk, "count", language) for language in LABELS}
    assert read == {"en": "−1234 pcs", "ja": "−1234 個", "de": "−1234 Stück"}
    read = {language: text_of(kiosk, "door_lamp", language) for language in LABELS}
    assert read == {"en": "Open", "ja": "開", "de": "Offen"}
    read = {language: widget(kiosk, "limit", language)["limits"] for language in LABELS}
    assert read == {"en": "0 to 2.5 m/s", "ja": "0～2.5 m/s", "de": "0 bis 2,5 m/s"}
    html = kiosk.http.get("/", headers=read_by("de")).text
    assert "<b>−1234</b><small> Stück</small>" in html
    assert 'data-decimal=","' in html


def test_reasons_of_locks_are_in_the_language_of_their_reader(kiosk: Server) -> None:
    read = {language: widget(kiosk, "locked", language)["reason"] for language in LABELS}
    assert read == {
        "en": "The robot does not permit the door.",
        "ja": "ロボットが「扉」を許可していません。",
        "de": "Der Roboter erlaubt die Tür nicht.",
    }


def test_receipts_and_refusals_are_in_the_language_of_their_reader(kiosk: Server) -> None:
    assert press(kiosk, "de", limit=1.5).startswith("Gesendet auf /limit um ")
    assert press(kiosk, "en", limit=1.5).startswith("Sent at ")
    assert "Grenze ist 7,5: erlaubt ist 0 bis 2,5 m/s" in press(kiosk, "de", limit=7.5)
    assert "上限は7.5です。0～2.5 m/sでなければなりません" in press(kiosk, "ja", limit=7.5)
    assert "Limit is 7.5: it must be 0 to 2.5 m/s" in press(kiosk, "en", limit=7.5)


def test_a_form_takes_the_decimal_comma_of_its_language_and_of_no_other(kiosk: Server) -> None:
    def sent(language: str, text: str) -> str:
        answer = kiosk.http.post(
            "/widgets/set_limit",
            data={"limit": text},
            headers=read_by(language),
            follow_redirects=True,
        )
        match = re.search(r'id="receipt-set_limit"[^>]*>([^<]*)<', answer.text)
        assert match is not None
        return match[1]

    assert sent("de", "0,5").startswith("Gesendet auf /limit")
    assert sent("de", "－０，５").endswith("Grenze ist −0,5: erlaubt ist 0 bis 2,5 m/s.")
    for typed in ("0.5", "1.5", "0,5 m/s", "1,2,3"):
        assert sent("de", typed).endswith(f"wie 1.234,5, nicht &#34;{typed}&#34;.")
    assert sent("de", "7,5").endswith("Grenze ist 7,5: erlaubt ist 0 bis 2,5 m/s.")
    assert "must be a number, 0 to 2.5 m/s, written like 1,234.5, not" in sent("en", "0,5")
    assert sent("en", "1,000").endswith("Limit is 1000: it must be 0 to 2.5 m/s.")


def test_a_form_is_read_in_the_language_of_its_page(kiosk: Server) -> None:
    """Another page of the browser may have changed its language since."""
    page = kiosk.http.get("/", headers=read_by("de")).text
    assert '<input type="hidden" name="_language" value="de">' in page
    answer = kiosk.http.post(
        "/widgets/set_limit",
        data={"limit": "1,500", "_language": "de"},
        headers=read_by("en"),
        follow_redirects=True,
    )
    assert "Sent at" in answer.text
    assert 'value="1.5"' in answer.text  # as this page writes it
    refused = kiosk.http.post("/widgets/set_limit", data={"limit": "1", "_language": "xx"})
    assert refused.status_code == 422


def test_confirmation_without_scripts_has_the_readers_decimal_sign(kiosk: Server) -> None:
    html = kiosk.http.post("/widgets/asked", data={"limit": "0,5"}, headers=read_by("de")).text
    assert "<dt>Grenze</dt><dd>0,5</dd>" in html
    assert '<button class="yes">Erst fragen</button>' in html


def test_log_page_has_each_entry_in_the_readers_language(kiosk: Server) -> None:
    press(kiosk, "ja", limit=9.5)
    for language, sentence, title, day in (
        (
            "en",
            "Limit is 9.5: it must be 0 to 2.5 m/s",
            "Set the limit",
            r"Today, \w+day \d+ \w+ \d{4}",
        ),
        (
            "ja",
            "上限は9.5です。0～2.5 m/sでなければなりません",
            "上限を設定",
            r".*\d{4}年\d+月\d+日.曜日",
        ),
        (
            "de",
            "Grenze ist 9,5: erlaubt ist 0 bis 2,5 m/s",
            "Grenze setzen",
            r".*, \w+tag, \d+\. \w+ \d{4}",
        ),
    ):
        html = kiosk.http.get("/log", headers=read_by(language)).text
        row = next(row for row in html.split("<tr ") if sentence in row)
        assert f"<b>{title}</b>" in row
        assert re.search(r"<time [^>]*>\d\d:\d\d:\d\d</time>", row)
        heading = re.search('<th colspan="4" scope="rowgroup">(.*?)</th>', html)
        assert heading
        assert re.fullmatch(day, heading[1])
        if language == "de":
            assert '<p class="outcome">abgelehnt</p>' in row
            who = "ein Programm|das Panel an der Zelle|Browser [0-9]+ an der Zelle"
            assert re.search(rf"<td>({who})</td>", row)
            assert "<small>Grenze</small> 9,5" in html
        csv = kiosk.http.get("/log.csv", headers=read_by(language))
        assert csv.headers["content-language"] == language


def test_a_choice_in_the_menu_is_kept(kiosk: Server) -> None:
    html = kiosk.http.get("/").text
    names = re.findall(
        r'<button name="language" value="(\w+)" lang="\1" aria-pressed="(\w+)">(.*?)<', html
    )
    assert names == [
        ("de", "false", "Deutsch"),
        ("en", "true", "English"),
        ("ja", "false", "日本語"),
    ]
    answer = kiosk.http.post("/display", data={"language": "ja", "page": "/pages/main"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/pages/main")
    assert answer.headers["set-cookie"].startswith("kiosk_language=ja;")
    unknown = kiosk.http.post("/display", data={"language": "fr"})
    assert "set-cookie" not in unknown.headers


def test_machine_readable_texts_are_in_the_panels_language(kiosk: Server) -> None:
    german = {"accept-language": "de"}
    assert "Zelle" not in kiosk.http.get("/metrics", headers=german).text
    assert "Zelle" not in kiosk.http.get("/openapi.json", headers=german).text
    assert kiosk.process.count('panel "Cell 1"') == 1
