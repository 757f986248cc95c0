"""The methods of a path: those of its most specific template."""

import pytest
from fastapi import APIRouter

from app.web.path_methods import PathMethods


async def nothing() -> None:
    pass


@pytest.fixture(scope="module")
def methods() -> PathMethods:
    acts, alarms = APIRouter(), APIRouter()
    acts.add_api_route("/checks/{act}", nothing, methods=["POST"])
    acts.add_api_route("/checks/look", nothing, methods=["GET"])
    alarms.add_api_route("/alarms/{alarm:path}/{act}", nothing, methods=["POST"])
    alarms.add_api_route("/alarms/{alarm:path}/{act}/confirm", nothing, methods=["GET"])
    alarms.add_api_route("/alarms/report", nothing, methods=["GET"])
    alarms.add_api_route("/alarms/report", nothing, methods=["POST"])
    every = PathMethods()
    every.add(acts.routes)
    every.add(alarms.routes, "/robots/{robot}")
    return every


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/checks/look", {"GET", "HEAD"}),
        ("/checks/bundle", {"POST"}),
        ("/robots/left/alarms/report", {"GET", "HEAD", "POST"}),
        ("/robots/left/alarms/drive/hot/shelve", {"POST"}),
        ("/robots/left/alarms/drive/hot/shelve/confirm", {"GET", "HEAD"}),
        ("/alarms/report", set()),
    ],
)
def test_the_most_specific_template_has_the_methods(
    methods: PathMethods, path: str, expected: set[str]
) -> None:
    assert methods.of_path(path) == expected
