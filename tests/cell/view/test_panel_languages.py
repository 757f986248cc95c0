"""Texts of the panel in several languages, where code joins, measures or fills them."""

from pathlib import Path
from typing import Any

import pytest
from markupsafe import Markup

from app.cell.commands.parameters import check_value
from app.cell.commands.receipts import reason_code
from app.cell.commands.services import with_fields, with_reply
from app.cell.robot.parameter_state import ParameterState
from app.cell.robot.state import RobotState
from app.cell.view.link_status import LONGEST_LIST, locks
from app.cell.view.view import build_view
from app.panel.page_template import PageParts, run_template
from app.panel.widgets.parameter import Parameter
from app.system.errors import InputError
from app.system.texts import PanelText, Text, localized, render, say
from app.system.texts.catalogue import catalogues_in
from tests.support.builders import DIALECT, FREE, INTERFACES, KIOSK, NOW, TRAITS, panel_of
from tests.support.catalogues import write_catalogue


@pytest.fixture(autouse=True)
def _catalogues(tmp_path: Path) -> Any:
    german = {"limits_both": "{low} bis {high}{unit}", "with_reply": "{said}: {reply}"}
    write_catalogue(tmp_path, "de", german)
    write_catalogue(tmp_path, "ja", {"link_unreachable": "接続なし。"})
    with catalogues_in(tmp_path):
        yield


def text(en: str, de: str) -> PanelText:
    return PanelText({"en": en, "de": de}, "en")


def test_a_list_of_labels_is_cut_where_the_longest_language_is_too_long() -> None:
    short, long = [f"Key {n}" for n in range(4)], ["x" * (LONGEST_LIST // 3)] * 4
    named = locks([text(*pair) for pair in zip(short, long, strict=True)])
    assert named.code == "locks_more"
    assert dict(named.params)["number"] == 2
    assert locks(short).code == "locks"


def test_a_response_is_filled_into_each_language_with_its_own_signs() -> None:
    template = text("{count} boxes, {mass} kg", "{count} Kartons, {mass} kg")
    fields: Any = {"count": 3, "mass": 12.5}
    filled = with_fields(template, fields)
    assert render(filled) == "3 boxes, 12.5 kg"
    assert render(filled, "de") == "3 Kartons, 12,5 kg"
    assert render(with_fields("{mass} kg", fields), "de") == "12,5 kg"
    assert with_fields("{count} boxes", fields) == "3 boxes"
    said = with_reply(say("call_succeeded", time="11:00"), filled)
    assert render(said, "de").endswith(": 3 Kartons, 12,5 kg")
    assert reason_code(said) == "call_succeeded"
    assert reason_code(filled) is None


ENTRY = {
    "kind": "parameter",
    "id": "gain",
    "label": {"en": "Gain", "de": "Verstärkung"},
    "node": "/arm",
    "parameter": "gain",
}


def test_a_value_of_a_parameter_is_shown_with_the_sign_and_unit_of_its_reader() -> None:
    unit = {"en": "pcs", "de": "Stück"}
    gain = Parameter.model_validate({**ENTRY, "type": "double", "unit": unit, "min": 0.0, "max": 1.5})
    assert render(gain.value_text(1.25), "de") == "1,25 Stück"
    assert render(gain.entry_text(1.25), "de") == "1,25"
    known = ParameterState("live", 1.0)
    with pytest.raises(InputError) as caught:
        check_value(gain, known, 7.5)
    assert render(caught.value.text, "de").startswith("Verstärkung")
    assert "0 bis 1,5 Stück" in render(caught.value.text, "de")
    several = Parameter.model_validate({**ENTRY, "type": "double[]"})
    assert render(several.value_text((1.5, 2.5)), "de") == "1,5; 2,5"  # as it is entered


def test_the_words_of_a_list_of_bools_are_those_of_any_language() -> None:
    words = {"on": {"en": "open", "de": "auf"}, "off": {"en": "shut", "de": "zu"}}
    doors = Parameter.model_validate({**ENTRY, "type": "bool[]", **words})
    known = ParameterState("live", (True,))
    for text in ("open, shut", "auf, zu", "true, false"):
        assert check_value(doors, known, text) == (True, False)


def test_robots_name_is_in_the_readers_language() -> None:
    panel = panel_of(
        FREE,
        robot=[{"id": "left", "name": {"en": "Left arm", "de": "Linker Arm"}, "namespace": "/left"}],
    )
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK, panel.robots[0])
    assert robot.name == "Left arm"
    built = build_view(panel, robot, NOW)
    assert isinstance(built.robot["name"], Text)
    assert localized(built.robot, "de")["name"] == "Linker Arm"


def test_a_template_of_a_page_knows_the_language_of_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "plan.html"
    path.write_text('{{ title }}: {{ "Plan" if language == "de" else "Map" }} {{ widget("free") }}')
    page = panel_of(FREE).pages[0].model_copy(update={"title": text("Cell", "Zelle")})

    def parts() -> PageParts:
        made = run_template(path, page, (), ("en", "de"))
        assert isinstance(made, PageParts)
        return made

    shown = [str(parts().inside(language, Markup, "")) for language in ("en", "de")]
    assert shown == ["Cell: Map free", "Zelle: Plan free"]
    assert parts().placed("free")
    path.write_text('{% if language != "de" %}{{ widget("free") }}{% endif %}')
    assert not parts().placed("free")
