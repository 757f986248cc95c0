"""The gallery: in development, with every kind of widget; not there otherwise."""

import re
from collections.abc import Iterator
from typing import get_args

import pytest

from app.cell.view.displays import State
from app.panel.widgets.displays import Indicator
from app.panel.widgets.key_parts import KeyRole
from app.panel.widgets.kinds import KINDS
from app.system.texts import render, say, time_of_day
from tests.gallery import PARTS
from tests.support.parts import ROOT, Server

EXAMPLES = [example for part in PARTS for example in part.examples]


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    mine = Server(ROOT, KIOSK_MODE="demo", KIOSK_DEV="1")
    yield mine
    mine.end()


def test_every_widget_kind_is_in_the_gallery() -> None:
    assert {example.kind for example in EXAMPLES} == set(KINDS)


def test_gallery_has_all_roles_states_shapes_and_colours() -> None:
    """What a role, a lamp or a display may be has an example."""
    assert {example.table.get("role", "neutral") for example in EXAMPLES} | {"hold"} == {
        *get_args(KeyRole)
    }
    lamp = Indicator.model_fields["states"].annotation
    (state,) = {argument for argument in get_args(lamp) if argument is not Ellipsis}
    lamps = [example.shown for example in EXAMPLES if example.kind == "indicator"]
    for key in ("shape", "colour"):
        assert {*get_args(state.model_fields[key].annotation)} <= {lamp[key] for lamp in lamps}
    for kind in ("readout", "indicator"):
        assert {example.shown["state"] for example in EXAMPLES if example.kind == kind} == {
            *get_args(State)
        }


def test_gallery_is_a_page_in_each_theme_and_text_size(server: Server) -> None:
    plain = server.http.get("/gallery")
    assert plain.status_code == 200
    assert len(re.findall('data-widget="[^-]', plain.text)) == len(EXAMPLES)
    assert re.findall('data-widget="-tile-([^"]*)"', plain.text) == [
        f"example_cell_{place}" for place in range(1, 5)
    ]
    assert "data-failed" not in plain.text
    assert 'data-theme="light" data-text-size="normal"' in plain.text
    large = server.http.get("/gallery?theme=dark&text_size=large&hand=none").text
    assert 'data-theme="dark" data-text-size="large" data-hand="right"' in large
    assert 'href="?theme=contrast&amp;text_size=large&amp;hand=right&amp;sounds=off"' in large


def test_gallery_is_in_the_language_of_the_cookie(server: Server) -> None:
    """What an operator would read does; the names of the states are a developer's."""
    lock = {
        "en": "Close guard door 1",
        "ja": "安全扉 1 を閉じてください",
        "de": "Schutztür 1 schließen",
    }
    for language, reason in lock.items():
        page = server.http.get("/gallery", headers={"cookie": f"kiosk_language={language}"}).text
        assert f'<html lang="{language}"' in page
        assert reason in page
        for sentence in ("bridge", "parameter_read", "hold_since", "table_empty", "camera_encoding"):
            at = time_of_day("14:31:52" if sentence == "parameter_read" else "14:31:58")
            assert render(say(sentence, encoding="32FC1", time=at), language) in page, sentence
        assert '<p class="text-small" lang="en">locked by several</p>' in page


def test_there_is_none_without_development() -> None:
    server = Server(ROOT, KIOSK_MODE="demo")
    try:
        assert server.http.get("/gallery").status_code == 404
    finally:
        server.end()
