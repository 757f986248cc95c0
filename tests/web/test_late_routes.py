"""Routes whose modules are imported at their first use."""

import asyncio
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.routing import Route, WebSocketRoute

from app.web import routes
from app.web.route_tables import FIRST, LATE, Routes, all_modules, first_segment
from tests.support.servers import demo_server
from tests.web.test_first_page import THREE

MODULES = ("alarms", "help", "users")


def paths_of(module: str) -> Iterator[str]:
    for route in import_module(f"{routes.__name__}.{module}").router.routes:
        assert isinstance(route, Route | WebSocketRoute)
        yield route.path


@pytest.mark.parametrize("module", all_modules())
def test_the_first_segment_of_each_path_names_its_module(module: str) -> None:
    segments = {first_segment(path) for path in paths_of(module)}
    assert segments
    named = {segment for segment, modules in LATE.items() if module in modules}
    assert module in FIRST or segments == named


def test_a_path_below_a_robot_has_the_segment_of_its_own() -> None:
    paths = ("/", "/users", "/robots/a", "/robots/a/", "/robots/a/widgets/b", "//users", "x")
    assert [first_segment(path) for path in paths] == ["", "users", "", "", "widgets", "", ""]


def test_a_module_is_added_once() -> None:
    app = FastAPI()
    mine = Routes(app)
    before = len(app.routes)

    async def both() -> None:
        await asyncio.gather(*(mine.load("users") for _ in range(3)), mine.load("no_such_path"))

    asyncio.run(both())
    assert len(app.routes) == before + 1
    assert mine.methods.of_path("/users") == {"GET", "HEAD"}


def test_all_paths_are_described(tmp_path: Path) -> None:
    with demo_server(tmp_path, THREE) as server:
        paths = server.http.get("/openapi.json").json()["paths"]
    described = {path.replace(":path", "") for module in MODULES for path in paths_of(module)}
    assert described <= paths.keys()


def test_a_press_passes_by_the_solving_of_dependencies(tmp_path: Path) -> None:
    with demo_server(tmp_path, THREE) as server:
        pressed = server.http.post("/widgets/start", json={"inputs": {}})
        too_long = server.http.post(f"/widgets/start?robots={'r' * 4001}", json={"inputs": {}})
        others = [
            server.http.request(method, "/widgets/start").status_code for method in ("GET", "PUT")
        ]
    assert (pressed.status_code, pressed.json()["widget"]) == (200, "start")
    assert (too_long.status_code, "4000" in too_long.json()["error"]) == (422, True)
    assert others == [405, 405]


def test_the_routes_of_presses_stand_first() -> None:
    app = FastAPI()
    asyncio.run(Routes(app).load("presses"))
    first = app.routes[:2]
    assert {route.path for route in first if isinstance(route, Route)} == {
        "/widgets/{widget}",
        "/robots/{robot}/widgets/{widget}",
    }
