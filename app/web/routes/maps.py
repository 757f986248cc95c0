"""The pictures of a map: its tiles, and the whole map with the robot for a page without scripts. And
its route graph."""

import json
import time
from typing import Annotated, Final, Literal

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app.cell.permission.map_masks import Mask, mask_of
from app.cell.robot.maps import Grid, mask_tile, overview, reduced, tile
from app.cell.robot.transforms import Pose
from app.cell.session.session import RobotSession
from app.cell.view.map_layer_values import COSTMAP, mask_version
from app.cell.view.map_values import map_view
from app.panel.widgets.map_layers import MapLayer
from app.panel.widgets.map_view import MapView
from app.system.errors import NotFound
from app.system.texts import say
from app.web.app_state import CurrentSession, CurrentState
from app.web.large_answers import packed_answer
from app.web.requests import Described, errors

router = APIRouter()

Theme = Annotated[Literal["light", "dark", "contrast"], Query(description="whose colours it has")]
Place = Annotated[int, Path(ge=0)]
PNG: Final[Described] = {
    200: {"content": {"image/png": {"schema": {"type": "string", "format": "binary"}}}}
}
CENTIMETRES: Final = 100  # of a metre
KEPT: Final = "private, max-age=31536000, immutable"  # another map has another path


class RouteGraphAnswer(BaseModel):
    """A route graph, for drawing."""

    nodes: Annotated[list[int], Field(description="x, y, x, y … in centimetres of the map's frame")]
    edges: Annotated[
        list[int],
        Field(description="from, to, from, to …: numbers of nodes; a pair for each direction"),
    ]


@router.get(
    "/widgets/{widget}/map/{version}/{column}-{row}.png",
    response_class=Response,
    summary="A tile of a map, or of a costmap or mask over it: 512 cells a side, from the upper left",
    responses=errors(403, 404, 422, 429) | PNG,
)
async def map_tile(
    widget: str,
    version: str,
    column: Place,
    row: Place,
    session: CurrentSession,
    state: CurrentState,
    theme: Theme = "light",
) -> Response:
    if (mask := _mask_with(session, widget, version)) is not None:
        return await _mask_tile(*mask, version, column, row, theme, state)
    costs = version.startswith(COSTMAP)
    grid = _with_version(session, widget, version.removeprefix(COSTMAP))
    if grid is None or column >= grid.columns or row >= grid.rows:
        raise NotFound(say("map_changed"))
    picture = await state.fleet.map_pictures.picture(
        (version, column, row, theme), lambda: tile(grid, column, row, theme, costs=costs)
    )
    return _picture(picture, KEPT)


async def _mask_tile(
    layer: MapLayer, mask: Mask, version: str, column: int, row: int, theme: str, state: CurrentState
) -> Response:
    grid, marked = mask.grid, mask.marked
    if column >= grid.columns or row >= grid.rows:
        raise NotFound(say("map_changed"))
    picture = await state.fleet.map_pictures.picture(
        (version, column, row, theme),
        lambda: mask_tile(grid, column, row, theme, marked, is_hatched=layer.shows == "keep_out"),
    )
    return _picture(picture, KEPT)


def _mask_with(session: RobotSession, widget: str, version: str) -> tuple[MapLayer, Mask] | None:
    """The mask of a widget with this version, and its layer; None if there is none now."""
    view, robot, now = session.panel.widget(widget, MapView), session.robot, time.monotonic()
    for layer in view.layers:
        if not version.startswith(f"{layer.shows}-"):
            continue
        grid = robot.maps[robot.key(layer.topic)].grid
        if grid is None:
            continue
        mask = mask_of(layer, robot, grid.geometry, now).mask
        if mask is not None and mask_version(layer, mask) == version:
            return layer, mask
    return None


@router.get(
    "/widgets/{widget}/map.png",
    response_class=Response,
    summary="The whole map with the robot, at most 1000 pixels a side",
    responses=errors(403, 404, 422, 429) | PNG,
)
async def map_picture(
    widget: str, session: CurrentSession, state: CurrentState, theme: Theme = "light"
) -> Response:
    view = session.panel.widget(widget, MapView)
    shown, _ = map_view(view, session.robot, time.monotonic())
    grid = _with_version(session, widget, shown["grid"]["version"]) if shown["grid"] else None
    if grid is None:
        raise NotFound(shown["note"])
    pose = Pose(*shown["pose"]) if shown["state"] == "live" else None
    pixels = await state.fleet.map_pictures.picture((grid.version, "reduced"), lambda: reduced(grid))
    picture = await state.fleet.map_pictures.picture(
        (grid.version, theme, pose, view.radius),
        lambda: overview(pixels, grid, theme, pose, view.radius),
    )
    return _picture(picture, "no-store")


@router.get(
    "/widgets/{widget}/map/routes/{version}.json",
    response_model=RouteGraphAnswer,
    summary="The route graph of a map: its nodes and its edges",
    responses=errors(403, 404, 422),
)
async def map_routes(widget: str, version: str, request: Request, session: CurrentSession) -> Response:
    routes = session.panel.widget(widget, MapView).routes
    if routes is None or routes.graph.version != version:
        raise NotFound(say("map_changed"))
    nodes = [round(CENTIMETRES * part) for node in routes.graph.nodes for part in node]
    edges = [end for edge in routes.graph.edges for end in edge]
    text = json.dumps({"nodes": nodes, "edges": edges}, separators=(",", ":"))
    answer = await packed_answer(request, text.encode())
    answer.headers["cache-control"] = KEPT
    return answer


def _with_version(session: RobotSession, widget: str, version: str) -> Grid | None:
    """The map or costmap with this version that a widget shows; None if there is none now."""
    view, maps = session.panel.widget(widget, MapView), session.robot.maps
    grids = (maps[session.robot.key(topic)].grid for topic in view.grids)
    return next((grid for grid in grids if grid and grid.version == version), None)


def _picture(data: bytes, cache_control: str) -> Response:
    headers = {"cache-control": cache_control, "content-encoding": "identity"}  # it is packed already
    return Response(data, media_type="image/png", headers=headers)
