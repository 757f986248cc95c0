"""Texts of a panel file in several languages."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.panel import Panel, check_panel, load_panel
from app.panel.texts import panel_texts
from app.system.errors import PanelError
from app.system.texts import PanelText, render, say, text_in
from app.system.texts.catalogue import catalogues_in
from tests.support.parts import ROOT

FILE = ROOT / "tests/three_languages.toml"
TEXT = FILE.read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def catalogues(tmp_path: Path) -> Iterator[None]:
    folder = tmp_path / "catalogues"
    folder.mkdir()
    for language in ("de", "ja"):
        (folder / f"{language}.po").write_text('msgid "ready"\nmsgstr "ready"\n')
    with catalogues_in(folder):
        yield


def load(folder: Path, old: str = "", new: str = "") -> Panel:
    assert old in TEXT
    file = folder / "panel.toml"
    file.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    return load_panel(file)


def faults(folder: Path, old: str, new: str) -> list[str]:
    with pytest.raises(PanelError) as caught:
        load(folder, old, new)
    return [f"{fault.place}: {fault.message}" for fault in caught.value.faults]


def notes(folder: Path, old: str, new: str) -> list[str]:
    load(folder, old, new)
    return [f"{note.place}: {note.message}" for note in check_panel(folder / "panel.toml").notes]


def test_text_may_be_a_table_of_languages_or_plain(tmp_path: Path) -> None:
    panel = load(tmp_path)
    lamp = panel.pages[0].widgets[-1]
    assert (type(lamp.label), lamp.label) == (str, "Door 1")
    assert isinstance(panel.title, PanelText)
    read = [render(panel.title, language) for language in ("en", "ja", "de", "fr")]
    assert read == ["Cell 1", "セル1", "Zelle 1", "Cell 1"]
    assert f"{panel.title}" == "Cell 1"


def test_every_text_is_found_with_its_place(tmp_path: Path) -> None:
    places = [place for place, _ in panel_texts(load(tmp_path))]
    assert places[:3] == ["title", "interlock[0].label", "interlock[1].label"]
    assert "page[0].group[0].widget[3].options[1].label" in places
    assert "page[0].group[0].widget[1].unit" in places
    assert len(places) == TEXT.count("ja = ")


def test_reader_of_another_language_gets_the_panels_language(tmp_path: Path) -> None:
    panel = load(tmp_path, 'mode = "demo"', 'mode = "demo"\nlanguage = "ja"')
    assert [render(panel.title, language) for language in ("fr", "en")] == ["セル1", "Cell 1"]
    assert str(panel.title) == "セル1"


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('ja = "動作"', 'ja = ""', "page[0].group[0].title.ja: must not be empty"),
        ('ja = "動作"', "ja = 1", "page[0].group[0].title.ja: must be text, not 1"),
        (
            'ja = "確認あり"',
            f'ja = "{"あ" * 41}"',
            "page[0].group[0].widget[5].note.ja: must be 40 characters at most; it has 41",
        ),
        (
            '{ en = "Speed", ja = "速度", de = "Geschwindigkeit" }',
            "{}",
            "page[0].group[0].widget[0].label: must not be empty",
        ),
        (
            'ja = "動作"',
            'jp = "動作"',
            "page[0].group[0].title.jp: is no language with a catalogue; there is de, en, ja",
        ),
        (
            'en = "Motion", ',
            "",
            "page[0].group[0].title: has no text in the panel's language: "
            'add en = "…", or set `language` of the panel to another one',
        ),
        (
            'de = "Groß"',
            'de = "Klein"',
            'page[0].group[0].widget[3].options[1].label: "Large" is already the label of options[0]',
        ),
        (
            'shape = "square", text = { en = "Open", ja = "開", de = "Offen" }',
            'shape = "circle", text = { en = "Open", ja = "閉", de = "Offen" }',
            "page[0].group[0].widget[7].states[1]: has the shape and text of states[0]: "
            "only the colour would tell them apart",
        ),
        (
            'mode = "demo"',
            'mode = "demo"\nlanguage = "tlh"',
            'language: must be "de", "en" or "ja", not "tlh"',
        ),
        (
            'mode = "demo"',
            'mode = "demo"\nlanguages = ["ja"]',
            'languages: lacks the panel\'s own language, "en"',
        ),
        (
            'mode = "demo"',
            'mode = "demo"\nlanguages = ["en", "en"]',
            'languages: names "en" twice',
        ),
    ],
)
def test_a_fault_has_the_language_in_its_place(tmp_path: Path, old: str, new: str, fault: str) -> None:
    assert faults(tmp_path, old, new) == [fault]


def test_a_text_that_lacks_a_language_of_others_is_a_note(tmp_path: Path) -> None:
    reported = notes(tmp_path, ', ja = "速度", de = "Geschwindigkeit"', "")
    assert 'page[0].group[0].widget[0].label: has no de and no ja; it is shown in "en"' in reported
    assert not any("has no" in note for note in notes(tmp_path, "", ""))


def test_a_language_that_the_panel_leaves_out_needs_no_texts(tmp_path: Path) -> None:
    new = 'mode = "demo"\nlanguages = ["en", "de"]'
    assert not any("has no" in note for note in notes(tmp_path, 'mode = "demo"', new))


def test_readers_choose_among_the_languages_of_the_panel(tmp_path: Path) -> None:
    assert load(tmp_path).readers_languages == ("de", "en", "ja")
    two = load(tmp_path, 'mode = "demo"', 'mode = "demo"\nlanguages = ["ja", "en"]')
    assert two.readers_languages == ("ja", "en")
    plain = tmp_path / "plain.toml"
    plain.write_text('title = "x"\n[[page]]\nid = "one"\ntitle = { en = "One", de = "Eins" }\n')
    assert load_panel(plain).readers_languages == ("de", "en")
    plain.write_text('title = "x"\n[[page]]\nid = "one"\ntitle = "One"\n')
    assert load_panel(plain).readers_languages == ("de", "en", "ja")


def test_a_text_in_a_sentence_survives_json() -> None:
    label = PanelText({"en": "Start", "ja": "始動"}, "en")
    text = say("input_outside_limits", label=label, given="1", limits=say("ready"))
    assert text_in(json.dumps(text.as_json())) == text
    assert hash(label) == hash(PanelText({"ja": "始動", "en": "Start"}, "en"))
    assert render(text_in(json.dumps(text.as_json())), "ja").startswith("始動")
