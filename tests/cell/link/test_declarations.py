"""All services that a panel calls are declared, are among those of its node, and are allowed by the
robot's configurations: one list has them."""

from collections.abc import Callable, Collection
from typing import Final

import pytest

from app.cell.link.declarations import declarations
from app.cell.link.rmw_zenoh import panel_endpoints
from app.panel.model import Panel
from app.tools.cell_config.bridge_config import allowed, timeouts
from tests.support.builders import INTERFACES, Table, panel_of, robot_there

CALL: Final[Table] = {
    "id": "home",
    "kind": "call",
    "label": "Home",
    "service": "/home",
    "type": "std_srvs/srv/Trigger",
}
LISTED: Final[Table] = {
    "id": "program",
    "kind": "select",
    "label": "Program",
    "options_from": {
        "service": "/list_programs",
        "type": "rcl_interfaces/srv/ListParameters",
        "field": "result.names",
    },
}
FRAME: Final[Table] = {
    "id": "frame",
    "kind": "select",
    "label": "Frame",
    "options_from": {"node": "/frames", "parameter": "names"},
}
SPEED: Final[Table] = {
    "id": "speed",
    "kind": "parameter",
    "label": "Speed",
    "node": "/drive",
    "parameter": "speed",
    "type": "double",
}
SIZE: Final[Table] = {"id": "size", "kind": "number", "label": "Size", "min": 0, "max": 9}
RECIPE: Final[Table] = {
    "id": "sizes",
    "label": "Sizes",
    "fields": ["size"],
    "service": "/load",
    "type": "rcl_interfaces/srv/SetParameters",
    "request": {},
}
# What a panel has → the services that it calls then.
CALLED: Final[dict[str, tuple[tuple[Table, ...], Collection[str]]]] = {
    "call": ((CALL,), {"/home"}),
    "options of a service": ((LISTED,), {"/list_programs"}),
    "options of a parameter": (
        (FRAME,),
        {"/frames/get_parameters", "/frames/describe_parameters", "/frames/set_parameters"},
    ),
    "parameter": (
        (SPEED,),
        {"/drive/get_parameters", "/drive/describe_parameters", "/drive/set_parameters"},
    ),
}


def declared(panel: Panel) -> Collection[str]:
    robot = robot_there(panel)
    return {f"/{key}" for key in declarations(panel, INTERFACES, robot).query}


def clients(panel: Panel) -> Collection[str]:
    ends = panel_endpoints(panel, lambda name: name)
    return {end.key for end in ends if end.role == "SC"}


def servers(panel: Panel) -> Collection[str]:
    return set(allowed(panel)["service_servers"])


@pytest.mark.parametrize("listed", [declared, clients, servers])
@pytest.mark.parametrize("kind", CALLED)
def test_each_service_that_a_panel_calls_is_listed(
    kind: str, listed: Callable[[Panel], Collection[str]]
) -> None:
    widgets, called = CALLED[kind]
    assert set(listed(panel_of(*widgets))) >= set(called)


def test_a_recipe_by_parameters_sets_all_or_none() -> None:
    table = {"id": "sizes", "label": "Sizes", "fields": ["size"], "parameters": {"size": "size"}}
    panel = panel_of(SIZE, recipe=[{**table, "node": "/arm", "timeout_s": 9.0}])
    service = "/arm/set_parameters_atomically"
    assert all(service in listed(panel) for listed in (declared, clients, servers))
    assert timeouts(panel)[0][service] == 9.0  # the bridge waits as long as the panel


def test_a_recipe_by_service_is_called() -> None:
    panel = panel_of(SIZE, recipe=[RECIPE])
    assert all("/load" in listed(panel) for listed in (declared, clients, servers))
