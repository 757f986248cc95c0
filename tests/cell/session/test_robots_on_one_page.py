"""Several robots on one page: each widget is its robot's, with its link, permission and control."""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.panel.file.load import load_panel
from app.system.errors import PanelError
from tests.support.parts import ROOT, Bridge, RosNode, Server, has_heard, http_client, live, until
from tests.support.servers import ready

BOOL, TEXT = "std_msgs/msg/Bool", "std_msgs/msg/String"
ROBOT = """
[[robot]]
id = "{name}"
name = "{title}"
namespace = "/{name}"
{connect}
[robot.overview]
topic = "/said"
type = "std_msgs/msg/String"
label = "says"
max_age_s = 600
"""
CELL = """
[[interlock]]
id = "operation"
topic = "/operation_enabled"

[[interlock]]
id = "area"
robot = "right"
topic = "/area_clear"

[[page]]
id = "cell"
title = "Cell"

[[page.widget]]
id = "weld"
kind = "publish"
label = "Weld"
robot = "left"
topic = "/weld"
type = "std_msgs/msg/String"
message = {{ data = "{{note}}" }}
interlock = "area"

[[page.widget]]
id = "note"
kind = "text"
label = "Note"
default = "seam"

[[page.widget]]
id = "frame"
kind = "select"
label = "Frame"
robot = "right"
options_from = {{ node = "/rail", parameter = "frames" }}

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
robot = "right"
topic = "/go"
type = "std_msgs/msg/String"
message = {{ data = "{{frame}}" }}

[[page.group]]
title = "Left"
robot = "left"
{left}
[[page.group]]
title = "Right"
robot = "right"
{right}
[[page]]
id = "side"
title = "Right side"
robot = "right"

[[page.widget]]
same = "start_right"

[[page]]
id = "robots"
title = "Robots"
overview = true

[[page]]
id = "any"
title = "Any"

[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
interlock = "operation"
"""
OF_ROBOT = """
[[page.group.widget]]
id = "start_{name}"
kind = "publish"
label = "Start {name}"
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
interlock = "operation"

[[page.group.widget]]
id = "said_{name}"
kind = "readout"
label = "Said {name}"
topic = "/said"
type = "std_msgs/msg/String"
max_age_s = 600
"""
NAMES = ("left", "right")


def panel_file(folder: Path, keys: str = "", connect: dict[str, str] | None = None) -> Path:
    text = f'title = "Welding cell"\n{keys}'
    for name in NAMES:
        where = f'connect = ["{connect[name]}"]' if connect else ""
        text += ROBOT.format(name=name, title=f"{name.capitalize()} arm", connect=where)
    parts = {name: OF_ROBOT.format(name=name) for name in NAMES}
    path = folder / "cell.toml"
    path.write_text(text + CELL.format(**parts))
    return path


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("cell")
    with ready(Server(ROOT, KIOSK_PANEL=str(panel_file(folder, 'mode = "demo"\n')))) as mine:
        yield mine


def enabled(server: Server, widget: str) -> bool:
    return bool(server.widget(widget)["enabled"])


def test_a_widget_of_one_robot_is_on_the_pages_of_each(simulated: Server) -> None:
    for name in NAMES:
        shown = simulated.robot(name).snapshot()["widgets"]
        assert {"start_left", "start_right", "said_left", "said_right", "weld", "start"} <= {*shown}
        page = simulated.http.get(f"/robots/{name}/pages/cell")
        assert page.status_code == 200
        assert f'formaction="/robots/{name}/widgets/start_left"' in page.text


def test_a_press_goes_to_the_widgets_own_robot(simulated: Server, way: str) -> None:
    left = simulated.robot("left").by(way)
    until(lambda: enabled(left, "start_right"), "permitted")
    seen = left.snapshot()["id"]
    receipt = left.press("start_right", inputs={}, seen=seen).json()
    assert receipt["outcome"] == "published"
    entries = simulated.http.get("/log.csv").text.splitlines()
    (line,) = (entry for entry in entries if receipt["id"] in entry)
    assert "Right arm" in line


def test_a_form_leads_back_to_the_page_that_it_was_pressed_on(simulated: Server) -> None:
    until(lambda: enabled(simulated.robot("left"), "start_right"), "permitted")
    answer = simulated.http.post("/robots/left/widgets/start_right", data={"_page": "cell"})
    assert answer.status_code == 303
    assert answer.headers["location"].startswith("/robots/left/pages/cell?receipt=")
    assert "Sent" in simulated.http.get(answer.headers["location"]).text


def test_an_input_of_the_page_goes_to_any_robot(simulated: Server) -> None:
    right = simulated.robot("right")
    until(lambda: enabled(right, "weld"), "permitted")
    assert right.press("weld", inputs={"note": "long seam"}).json()["outcome"] == "published"


def test_the_options_of_a_select_are_those_of_its_own_robot(simulated: Server) -> None:
    left = simulated.robot("left")
    until(lambda: enabled(left, "go"), "the list of the right arm is known")
    shown = left.snapshot()["widgets"]
    assert shown["frame"]["options"] == ["demo 1", "demo 2", "demo 3"]
    seen = left.snapshot()["id"]
    receipt = left.press("go", inputs={"frame": "demo 2"}, seen=seen).json()
    assert receipt["outcome"] == "published"
    other = left.press("start_left", inputs={"frame": "demo 2"}, seen=seen).json()
    assert other["outcome"] == "published"  # a page sends all of its inputs
    gone = left.press("go", inputs={"frame": "demo 9"}, seen=seen).json()
    assert gone["code"] == "input_option_gone"


def test_a_choice_of_another_robots_list_is_a_fault(tmp_path: Path) -> None:
    text = panel_file(tmp_path).read_text()
    path = tmp_path / "mixed.toml"
    path.write_text(text.replace('robot = "right"\ntopic = "/go"', 'robot = "left"\ntopic = "/go"'))
    with pytest.raises(PanelError, match='sends "frame", which "right" lists'):
        load_panel(path)


def test_a_page_of_one_robot_is_only_its(simulated: Server) -> None:
    answer = simulated.http.get("/robots/left/pages/side?x=1")
    assert (answer.status_code, answer.headers["location"]) == (303, "/robots/right/pages/side?x=1")
    html = simulated.http.get("/robots/left/pages/cell").text
    assert 'href="/robots/right/pages/side"' in html
    assert 'href="/robots/left/pages/any"' in html
    side = simulated.http.get("/robots/right/pages/side").text
    assert 'href="/robots/left/pages/cell"' in side  # the tab of the other robot


def test_a_press_of_a_widget_of_every_robot_is_still_refused_from_anothers_page(
    simulated: Server, way: str
) -> None:
    seen = simulated.robot("left").snapshot()["id"]
    answer = simulated.robot("right").by(way).press("start", seen=seen)
    assert (answer.status_code, answer.json()["code"]) == (409, "press_seen_on_another_robot")


def test_control_of_each_robot_counts_for_its_own_widgets(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    path = panel_file(tmp_path, 'mode = "demo"\n[control]\nrequired = true\n')
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(path)))
    until(kiosk.ready, "ready")
    with http_client(kiosk.url) as client:
        client.get("/robots/left/pages/cell")

        def usable() -> list[str]:
            events = client.get("/robots/left/events?once=1&page=cell").text
            shown = json.loads(events.partition("data: ")[2].splitlines()[0])["widgets"]
            return [name for name in NAMES if shown[f"start_{name}"]["enabled"]]

        assert client.post("/robots/left/control/take", json={}).json()["done"]
        until(lambda: usable() == ["left"], "the left robot is controlled")
        press: dict[str, dict[str, str]] = {"inputs": {}}
        refused = client.post("/robots/left/widgets/start_right", json=press)
        assert (refused.status_code, refused.json()["code"]) == (409, "control_free")
        assert client.post("/robots/right/control/take", json={}).json()["done"]
        until(lambda: usable() == ["left", "right"], "both are controlled")
        assert client.post("/robots/left/widgets/start_right", json=press).status_code == 200
        client.post("/robots/right/control/release", json={})
        until(lambda: usable() == ["left"], "the right robot is free")


@pytest.fixture
def two(
    domain: int, tmp_path: Path, servers: Callable[[Server], Server]
) -> Iterator[tuple[Server, list[Bridge], list[RosNode]]]:
    """Two robots, each on a domain of its own behind a bridge of its own."""
    bridges = [Bridge(domain + 4 + n, f"/{name}") for n, name in enumerate(NAMES)]
    nodes = []
    try:
        for bridge in bridges:
            bridge.start()
            nodes.append(RosNode(bridge.domain))
            for topic in ("/start", "/weld"):
                nodes[-1].subscribe(topic, BOOL if topic == "/start" else TEXT)
            nodes[-1].advertise("/said", TEXT, durability="transient_local", depth=1)
            for topic in ("/operation_enabled", "/area_clear"):
                nodes[-1].advertise(topic, BOOL, durability="transient_local", depth=1)
        connect = {name: bridge.endpoint for name, bridge in zip(NAMES, bridges, strict=True)}
        path = panel_file(tmp_path, connect=connect)
        kiosk = servers(live("tcp/127.0.0.1:1", tmp_path, KIOSK_PANEL=str(path)))
        until(kiosk.ready, "both robots are ready")
        for node in nodes:
            until(partial(node.endpoints, "/start"), "the robot sees who publishes")
        until(partial(nodes[0].endpoints, "/weld"), "the left robot sees who welds")
        yield kiosk, bridges, nodes
    finally:
        for node in nodes:
            node.end()
        for bridge in bridges:
            bridge.end()


def test_a_lost_robot_locks_its_own_widgets_only(
    two: tuple[Server, list[Bridge], list[RosNode]], page: Page
) -> None:
    kiosk, bridges, nodes = two
    for node, name in zip(nodes, NAMES, strict=True):
        node.publish("/operation_enabled", {"data": True})
        node.publish("/said", {"data": f"{name} is here"})
    page.goto(f"{kiosk.url}/robots/left/pages/cell")
    left, right = (page.locator(f"[data-widget=start_{name}] > button:not(.more)") for name in NAMES)
    for name, button in zip(NAMES, (left, right), strict=True):
        expect(button).to_be_enabled()
        expect(page.locator(f"[data-widget=said_{name}]")).to_contain_text(f"{name} is here")
    right.click()
    until(partial(has_heard, nodes[1], "/start", 1), "the right robot heard it")
    assert not has_heard(nodes[0], "/start", 1)

    bridges[1].kill()
    expect(right).to_be_disabled()
    expect(left).to_be_enabled()
    nodes[0].publish("/said", {"data": "left still works"})
    expect(page.locator("[data-widget=said_left]")).to_contain_text("left still works")
    left.click()
    until(partial(has_heard, nodes[0], "/start", 1), "the left robot heard it")
    assert kiosk.robot("left").press("start_right", inputs={}).status_code == 503

    bridges[1].start()
    expect(right).to_be_enabled()


def test_an_interlock_of_another_robot_locks_and_permits(
    two: tuple[Server, list[Bridge], list[RosNode]],
) -> None:
    kiosk, bridges, nodes = two
    left = kiosk.robot("left")
    assert not enabled(left, "weld")
    nodes[0].publish("/area_clear", {"data": True})  # the left robot's own does not count
    nodes[1].publish("/area_clear", {"data": True})
    until(lambda: enabled(left, "weld"), "the right robot permits")

    def welded() -> bool:
        left.press("weld", inputs={"note": "a"})  # again until the robot's subscriber is known
        return has_heard(nodes[0], "/weld", 1)

    until(welded, "the left robot heard it")
    nodes[1].publish("/area_clear", {"data": False})
    until(lambda: not enabled(left, "weld"), "locked")
    assert left.press("weld", inputs={"note": "b"}).json()["code"] == "interlock_not_permitted"
    nodes[1].publish("/area_clear", {"data": True})
    until(lambda: enabled(left, "weld"), "permitted again")
    bridges[1].kill()
    until(lambda: not enabled(left, "weld"), "locked: the right robot is gone")
    assert str(left.widget("weld")["reason"]).startswith("Right arm: ")
    assert {*nodes[0].heard_data("/weld")} == {"a"}


def test_the_overview_shows_each_robot_and_leads_to_its_pages(
    two: tuple[Server, list[Bridge], list[RosNode]], page: Page
) -> None:
    kiosk, bridges, nodes = two
    for node, name in zip(nodes, NAMES, strict=True):
        node.publish("/said", {"data": f"{name} is here"})
    page.goto(f"{kiosk.url}/robots/right/pages/robots")
    expect(page.locator(".robot-tile .name")).to_have_text(["Left arm", "Right arm"])
    left, right = (page.locator(f"[data-widget=-tile-{name}]") for name in NAMES)
    for name, tile in zip(NAMES, (left, right), strict=True):
        expect(tile.locator(".figure")).to_contain_text(f"{name} is here")
        expect(tile).to_have_attribute("data-link_state", "ok")
        expect(tile).to_have_attribute("data-priority", "")
    sums = page.locator(".robot-sums li:visible")
    expect(sums).to_have_text(["2 ONLINE"])
    expect(page.locator(".robot-sums .total")).to_have_text("2 robots")
    bridges[1].kill()
    expect(sums).to_have_text(["1 ONLINE", "1 NO LINK"])
    expect(right).to_have_attribute("data-link_state", "bad")
    expect(right).to_have_attribute("data-state", "old")
    nodes[0].publish("/said", {"data": "left still works"})
    expect(left.locator(".figure")).to_contain_text("left still works")
    expect(left).to_have_attribute("data-state", "live")
    right.click()
    expect(page).to_have_url(f"{kiosk.url}/robots/right/pages/side")
    page.goto(f"{kiosk.url}/robots/right/pages/robots")
    left.click()
    expect(page).to_have_url(f"{kiosk.url}/robots/left/pages/cell")


def test_without_its_server_an_overview_says_that_nothing_is_known(
    tmp_path: Path, servers: Callable[[Server], Server], page: Page
) -> None:
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(panel_file(tmp_path, 'mode = "demo"\n'))))
    until(kiosk.ready, "ready")
    page.goto(f"{kiosk.url}/robots/left/pages/robots")
    tile = page.locator("[data-widget=-tile-left]")
    expect(tile).to_have_attribute("data-link_state", "ok")
    kiosk.end()
    expect(tile).to_have_attribute("data-link_state", "wait")
    expect(tile).to_have_attribute("data-state", "old")
    expect(tile.locator("[data-text=alarm]")).to_have_text("unknown")
    expect(page.locator(".robot-sums")).to_have_attribute("data-state", "old")


def test_only_the_overview_gets_the_tiles(simulated: Server) -> None:
    def sent(page: str) -> str:
        return simulated.http.get(f"/robots/left/events?once=1&page={page}").text

    assert "-tile-right" in sent("robots")
    assert "-tile-right" not in sent("cell")
    html = simulated.http.get("/robots/left/pages/robots").text
    assert "<h1><span>Welding cell</span></h1>" in html  # of no robot: the panel's title


def test_an_overview_adds_the_figures_of_its_robots(
    tmp_path: Path, servers: Callable[[Server], Server], page: Page
) -> None:
    text = panel_file(tmp_path, 'mode = "demo"\n').read_text()
    figure = 'type = "std_msgs/msg/Float32"\nunit = "boxes"\nformat = ".0f"\n'
    text = text.replace(
        f'topic = "/said"\ntype = "{TEXT}"\nlabel = "says"', f'topic = "/made"\n{figure}'
    )
    text = text.replace("overview = true", 'overview = true\ntotal = "Both arms"')
    path = tmp_path / "hall.toml"
    path.write_text(f'{text}\n[demo."/made"]\nmessage = {{ data = 21.0 }}\n')
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(path)))
    until(kiosk.ready, "ready")
    page.goto(f"{kiosk.url}/robots/left/pages/robots")
    expect(page.locator(".robot-sums .total")).to_have_text("Both arms 42 boxes")
    expect(page.locator(".robot-sums")).to_have_attribute("data-total_state", "live")
