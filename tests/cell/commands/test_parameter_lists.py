"""Parameters that are lists or one of some options: read, entered and set in a plain form, on the real
bridge with a robot on Cyclone DDS; and the silence of a node on Fast DDS."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest
from playwright.sync_api import Page, expect

from app.cell.commands.parameters import check_value
from app.cell.robot.parameter_state import ParameterState
from app.cell.view.parameter_values import parameter
from app.panel.numbers import Range
from app.panel.values import join_list, quote_element, split_list
from app.panel.widgets.parameter import Parameter
from app.system.errors import InputError
from app.system.texts import ENGLISH
from tests.panel.test_widgets import faults
from tests.support import cyclone
from tests.support.builders import panel_of, robot_there
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, live, until
from tests.support.servers import live_server
from tests.support.words import coded, english

cyclone_bridge = cyclone.cyclone_bridge
client = cyclone.client
cyclone_robots = cyclone.cyclone_robots
robot = cyclone.robot

GAINS: Final[dict[str, Any]] = {
    "id": "gains", "kind": "parameter", "label": "Gains", "node": "/arm", "parameter": "gains",
    "type": "double[]",
}  # fmt: skip
OPTIONS: Final = [{"value": 1, "label": "Slow"}, {"value": 2, "label": "Fast"}]
SEVERAL: Final = "separate several values with commas"
NUMBERS: Final = "separate several values like 1.5, 2.5"
TEXTS: Final = f"a text; {SEVERAL}"
VALUE: Final = "Gains, value"
FORM: Final = {"content-type": "application/x-www-form-urlencoded"}


def widget(**more: Any) -> Parameter:
    return Parameter.model_validate({**GAINS, **more})


# As it is entered.


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([], ""),
        (["1"], "1"),
        (["a b", "c"], "a b, c"),
        (["a,b", ' "', "", " c "], '"a,b", " """, "", " c "'),
        (["日本", "ü"], "日本, ü"),
    ],
)
def test_a_list_is_written_as_it_is_read(values: list[str], text: str) -> None:
    assert join_list(map(quote_element, values)) == text
    assert split_list(text) == values


@pytest.mark.parametrize("text", [",", "a,", ",a", "a,,b", '"a', 'a"b', '"a"b', '"a" "b"'])
def test_value_that_is_not_a_list_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="of them is none"):
        split_list(text)
    with pytest.raises(InputError) as refused:
        check_value(widget(type="string[]"), ParameterState("live"), text)
    assert coded(refused.value.text, "label", "limits") == ("parameter_not_a_list", "Gains", TEXTS)


@pytest.mark.parametrize("text", ['{}"a', 'a{}"', 'a,{}"', '"a{}', '"a"{}"'])
def test_spaces_that_end_in_a_mistake_take_no_time(text: str) -> None:
    began = time.process_time()
    with pytest.raises(InputError) as refused:
        check_value(widget(type="string[]"), ParameterState("live"), text.format(" " * 995))
    assert coded(refused.value.text) == ("parameter_not_a_list",)
    assert time.process_time() - began < 1  # it took 6 s, of the whole server


@pytest.mark.parametrize(
    ("kind", "entered", "value"),
    [
        ("double[]", "1, 2.5,-300", (1.0, 2.5, -300.0)),
        ("double[]", [1, 2.5], (1.0, 2.5)),
        ("double[]", " ", ()),
        ("integer[]", "1, 9007199254740993", (1, 2**53 + 1)),
        ("integer[]", [1, "9007199254740993"], (1, 2**53 + 1)),
        ("bool[]", "true, Off, on,FALSE", (True, False, True, False)),
        ("bool[]", [True], (True,)),
        ("string[]", 'a, "b, c", ""', ("a", "b, c", "")),
        ("string[]", ["a,b", ""], ("a,b", "")),
    ],
)
def test_a_list_is_typed_value_by_value(kind: str, entered: Any, value: tuple[Any, ...]) -> None:
    gains = widget(type=kind)
    checked = check_value(
        gains,
        ParameterState("live"),
        gains.parse_text(entered, ENGLISH) if isinstance(entered, str) else entered,
    )
    assert checked == value
    assert isinstance(checked, tuple)
    assert [type(element) for element in checked] == [type(element) for element in value]


@pytest.mark.parametrize(
    ("more", "entered", "label", "code", "about"),
    [
        ({}, "1, x", f"{VALUE} 2", "input_not_a_number", {"limits": "0 to 5", "given": '"x"'}),
        ({}, "1, 7", f"{VALUE} 2", "input_outside_limits", {"given": "7", "limits": "0 to 5"}),
        (
            {"min": 1, "unit": "N"},
            [0.5],
            f"{VALUE} 1",
            "input_outside_limits",
            {"given": "0.5 N", "limits": "1 to 5 N"},
        ),
        ({}, [1, None], f"{VALUE} 2", "input_number_empty", {"limits": "0 to 5"}),
        ({}, 5, "Gains", "parameter_not_a_list", {"limits": f"0 to 5; {NUMBERS}", "given": "5"}),
        ({}, [1.0] * 1001, "Gains", "parameter_list_too_long", {"count": 1001, "most": 1000}),
        (
            {"type": "bool[]"},
            "On, maybe",
            f"{VALUE} 2",
            "input_not_a_boolean",
            {"on": "On", "off": "Off", "given": '"maybe"'},
        ),
        (
            {"type": "integer[]"},
            "1, 1.5",
            f"{VALUE} 2",
            "input_not_a_number",
            {"limits": "a whole number"},
        ),
        ({"type": "string[]"}, [5], f"{VALUE} 1", "parameter_not_a_text", {"most": 1000, "given": "5"}),
    ],
)
def test_each_value_of_a_list_is_checked(
    more: dict[str, Any], entered: Any, label: str, code: str, about: dict[str, Any]
) -> None:
    limits = Range(0.0, 5.0) if more.get("type") is None else Range()
    with pytest.raises(InputError) as refused:
        check_value(widget(**more), ParameterState("live", range=limits), entered)
    assert coded(refused.value.text, "label", *about) == (code, label, *about.values())


@pytest.mark.parametrize(
    ("more", "entered", "value"),
    [
        ({"type": "integer"}, "2", 2),
        ({"type": "integer"}, 2, 2),
        ({"type": "double"}, "1", 1.0),
        ({"type": "double[]", "options": [{"value": [1, 2], "label": "A"}]}, "[1, 2]", (1.0, 2.0)),
        ({"type": "string", "options": [{"value": "a", "label": "A"}]}, "a", "a"),
    ],
)
def test_an_option_is_chosen_by_its_value_or_its_key(more: Any, entered: Any, value: Any) -> None:
    checked = check_value(widget(**{"options": OPTIONS, **more}), ParameterState("live"), entered)
    assert (checked, type(checked)) == (value, type(value))


@pytest.mark.parametrize("entered", ["", "3", 3, True, "Slow", [1]])
def test_unknown_option_is_refused(entered: Any) -> None:
    with pytest.raises(InputError) as refused:
        check_value(widget(type="integer", options=OPTIONS), ParameterState("live"), entered)
    assert coded(refused.value.text, "label", "options") == (
        "input_not_an_option",
        "Gains",
        ("Slow", "Fast"),
    )


def test_an_option_that_the_node_does_not_take_is_refused() -> None:
    gains = widget(type="integer", options=OPTIONS)
    with pytest.raises(InputError) as refused:
        check_value(gains, ParameterState("live", range=Range(0, 1)), "2")
    assert coded(refused.value.text, "given", "limits") == ("input_outside_limits", "Fast", "0 to 1")


@pytest.mark.parametrize(
    ("more", "value", "text", "entry", "limits"),
    [
        ({"unit": "N"}, (1.0, 2.5), "1, 2.5 N", "1, 2.5", f"a number; {NUMBERS}"),
        ({}, (), "(empty)", "", f"a number; {NUMBERS}"),
        ({}, (1.0, float("nan")), "1, NaN", "", f"a number; {NUMBERS}"),
        ({}, (0.0,) * 1001, None, "", f"a number; {NUMBERS}"),
        ({"type": "string[]"}, ("a, b", "c"), '"a, b", c', '"a, b", c', TEXTS),
        ({"type": "bool[]"}, (True, False), "On, Off", "On, Off", f"On or Off; {SEVERAL}"),
        ({"type": "integer", "options": OPTIONS}, 2, "Fast", "2", ""),
        ({"type": "integer", "options": OPTIONS}, 3, "3", "", ""),
    ],
)  # fmt: skip
def test_a_list_and_an_option_show_as_they_are_entered(
    more: dict[str, Any], value: Any, text: str | None, entry: str, limits: str
) -> None:
    panel = panel_of({**GAINS, **more})
    there = robot_there(panel)
    there.parameters["gains"] = ParameterState("live", value)
    (gains,) = panel.parameters()
    shown = english(parameter(gains, there))
    assert shown["text"] == text if text is not None else shown["text"].endswith("…")
    assert (shown["entry"], shown["limits"]) == (entry, limits)


@pytest.mark.parametrize(
    ("value", "entered"),
    [
        (("a" * 500, "b" * 498), True),
        (("a" * 500, "b" * 499), False),
        (("a" * 10_000_000,), False),
        (("a" * 5_000,) * 1001, False),
    ],
)  # fmt: skip
def test_a_list_shows_its_beginning_however_long_its_texts_are(
    value: tuple[str, ...], entered: bool
) -> None:
    panel = panel_of({**GAINS, "type": "string[]"})
    there = robot_there(panel)
    there.parameters["gains"] = ParameterState("live", value)
    (gains,) = panel.parameters()
    began = time.process_time()
    for _ in range(50):  # with every change of anything on the page
        shown = parameter(gains, there)
    assert time.process_time() - began < 1  # it took 5 s, of the whole server
    assert shown["text"] == "a" * 199 + "…"
    assert shown["entry"] == (", ".join(value) if entered else "")


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ({"type": "bool[]", "min": 0}, '.min: is for numbers; the type is "bool[]"'),
        ({"type": "integer[]", "step": 0.5}, ".step: 0.5 must be whole: the type is integer[]"),
        ({"min": 2, "max": 1}, ".max: 1 must be more than min (2)"),
        ({"type": "bool", "options": OPTIONS}, ".options: a bool has none: its switch has the words"),
        (
            {"type": "integer", "options": OPTIONS, "min": 0},
            ".min: is for what is entered: with options",
        ),
        (
            {"type": "integer", "options": [{"value": 1.5, "label": "A"}]},
            ".options[0].value: must be a whole number (int64), not 1.5",
        ),
        (
            {"type": "double[]", "options": [{"value": 1.5, "label": "A"}]},
            ".options[0].value: a list: each must be a number, not 1.5",
        ),
        (
            {"type": "integer", "options": [OPTIONS[0], OPTIONS[0]]},
            ".options[1].value: 1 is already options[0]",
        ),
    ],
)
def test_faulty_list_or_option_in_the_panel_file_is_reported(more: dict[str, Any], fault: str) -> None:
    assert any(message.startswith(f"page[0].widget[0]{fault}") for message in faults({**GAINS, **more}))


# On the real bridge.

PANEL: Final = """
title = "Cyclone cell"
[[page]]
id = "setup"
title = "Setup"
""" + "".join(
    f"""
[[page.widget]]
kind = "parameter"
node = "/cyclone_robot"
id = "{name}"
label = "{label}"
parameter = "{name}"
type = "{kind}"
{more}
"""
    for name, label, kind, more in (
        ("gains", "Gains", "double[]", 'unit = "N"'),
        ("axes", "Axes", "bool[]", 'on = "used"\noff = "free"'),
        ("frames", "Frames", "string[]", ""),
        ("slots", "Slots", "integer[]", ""),
        ("mode", "Mode", "integer",
         'options = [{ value = 1, label = "Slow" }, { value = 2, label = "Fast" }]'),
    )
)  # fmt: skip


@pytest.fixture
def kiosk(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("gains")["enabled"], "the parameters are read")
        until(lambda: robot.subscribers(topic="/parameter_events"), "events are heard")
        yield mine


def press(kiosk: Server, name: str, value: Any) -> httpx.Response:
    return kiosk.http.post(f"/widgets/{name}", json={"inputs": {name: value}})


def test_lists_and_options_are_read_and_set(kiosk: Server, robot: CycloneRobot) -> None:
    shown = kiosk.snapshot()["widgets"]
    assert {name: shown_parameter["text"] for name, shown_parameter in shown.items()} == {
        "gains": "1, 2.5 N",
        "axes": "used, free",
        "frames": 'base, "tool, left"',
        "slots": "1, 9007199254740993",
        "mode": "Slow",
    }
    assert shown["gains"]["limits"] == "0 to 5 N; separate several values like 1.5, 2.5"
    values = {
        "gains": ("0.5, 5", [0.5, 5.0]),
        "axes": ("free, free, used", [False, False, True]),
        "frames": ('"a, b", c', ["a, b", "c"]),
        "slots": ("7", [7]),
        "mode": ("2", 2),
    }
    for name, (entered, value) in values.items():
        receipt = press(kiosk, name, entered)
        assert (receipt.status_code, receipt.json()["outcome"]) == (200, "succeeded"), receipt.text
        assert robot.parameters()[name] == value
    until(lambda: kiosk.widget("mode")["text"] == "Fast", "it shows")
    assert "Set to 0.5, 5 N at" in kiosk.widget("gains")["result"]
    assert press(kiosk, "gains", [1, 2]).json()["outcome"] == "succeeded"
    assert robot.parameters()["gains"] == [1.0, 2.0]
    refused = press(kiosk, "gains", "1, 6")
    assert (refused.status_code, refused.json()["code"]) == (422, "input_outside_limits")
    robot.set_parameter(name="frames", value=["x"])
    until(lambda: kiosk.widget("frames")["text"] == "x", "what the robot sets shows")


def test_lists_and_options_work_by_forms(kiosk: Server, robot: CycloneRobot) -> None:
    form = "_id=f1&gains=4%2C+3&axes=&frames=&slots=&mode=2"
    for name in ("gains", "mode"):
        answer = kiosk.http.post(f"/widgets/{name}", content=form, headers=FORM)
        assert answer.status_code == 303
    assert (robot.parameters()["gains"], robot.parameters()["mode"]) == ([4.0, 3.0], 2)


def test_lists_and_options_are_set_with_a_browser(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    page.goto(kiosk.url)
    gains, mode = (page.locator(f'[data-widget="{name}"]') for name in ("gains", "mode"))
    expect(gains.get_by_role("textbox")).to_have_value("1, 2.5")
    gains.get_by_role("textbox").fill("0.25, 1")
    page.get_by_role("button", name="Set Gains", exact=True).click()
    expect(gains.locator(".value")).to_have_text("0.25, 1 N")
    select = mode.get_by_role("combobox")
    expect(select).to_have_value("1")
    select.select_option("2")
    page.get_by_role("button", name="Set Mode", exact=True).click()
    expect(mode.locator(".value")).to_have_text("Fast")
    assert (robot.parameters()["gains"], robot.parameters()["mode"]) == ([0.25, 1.0], 2)
    robot.set_parameter(name="mode", value=7)
    expect(mode.locator(".value")).to_have_text("7")
    expect(select).to_have_value("")  # it is none of the options


def test_a_list_with_decimal_commas_is_set_as_it_is_shown(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    """1,5 is one number, or the press is refused; it was taken for 1 and 5."""
    page.context.add_cookies([{"name": "kiosk_language", "value": "de", "url": kiosk.url}])
    page.goto(kiosk.url)
    gains = page.locator('[data-widget="gains"]')
    entry, button = gains.get_by_role("textbox"), gains.locator(".set")
    expect(entry).to_have_value("1; 2,5")
    expect(gains.locator(".limits")).to_contain_text("0 bis 5 N; mehrere Werte so trennen: 1,5; 2,5")
    entry.fill("1,5, 2,5")
    button.click()
    expect(gains.locator(".receipt")).to_contain_text("1.234,5")
    assert robot.parameters()["gains"] == [1.0, 2.5]
    entry.fill("1,5; 3")
    expect(button).not_to_have_attribute("aria-busy", "true")
    button.click()
    expect(gains.locator(".value")).to_have_text("1,5; 3 N")
    assert robot.parameters()["gains"] == [1.5, 3.0]
    for language, text, value in (("de", "0,5; 1", [0.5, 1.0]), ("en", "0.25, 2", [0.25, 2.0])):
        form = {"gains": text, "_language": language}
        assert kiosk.http.post("/widgets/gains", data=form).status_code == 303
        assert robot.parameters()["gains"] == value
    kiosk.http.post("/widgets/gains", data={"gains": "1,5, 2,5", "_language": "de"})
    assert robot.parameters()["gains"] == [0.25, 2.0]


# A node on Fast DDS never answers, and prints an error at each question: it is not asked.

PRINTED: Final = "failed to create array for field 'names'"


@pytest.fixture
def errors(tmp_path: Path) -> Path:
    return tmp_path / "errors"


@pytest.fixture
def fast(own_bridge: Bridge, errors: Path) -> Iterator[RosNode]:
    with errors.open("w") as file:
        mine = RosNode(own_bridge.domain, stderr=file)
        yield mine
        mine.end()


def test_a_node_on_fast_dds_is_not_asked_and_says_why(
    own_bridge: Bridge,
    fast: RosNode,
    errors: Path,
    page: Page,
    tmp_path: Path,
    servers: Callable[[Server], Server],
) -> None:
    path = tmp_path / "fast.toml"
    path.write_text(
        PANEL.replace("/cyclone_robot", "/system_controller")
        + """
[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/heard"
type = "std_msgs/msg/String"
"""
    )
    mine = servers(live(own_bridge.endpoint, tmp_path, KIOSK_PANEL=str(path)))

    def printed() -> int:
        return errors.read_text(errors="replace").count(PRINTED)

    fast.advertise("/heard", "std_msgs/msg/String")
    page.goto(mine.url)
    gains = page.locator('[data-widget="gains"]')
    again = gains.get_by_role("button", name="Read Gains again")
    for place in (".note", ".why"):
        expect(gains.locator(place)).to_contain_text("runs on Fast DDS")
    expect(again).to_be_disabled()
    notes: set[str] = set()  # the seconds at which it spoke

    def goes_on() -> bool:
        notes.add(mine.widget("heard")["note"])
        return len(notes) > 6

    fast.every("/heard", {"data": "alive"}, 0.5)
    until(goes_on, "the node goes on speaking", within_s=60, every_s=0.2)
    assert printed() == 0
