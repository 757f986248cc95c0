"""The panel file of this server, for engineers: read it, check another one, and take that."""

import asyncio
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, Field

from app.cell.commands.panel_acts import TAKE
from app.cell.session.sent_panels import PanelReceiver, outcome_text
from app.panel.roles import ENGINEER
from app.records.sent_panel import MOST_BYTES
from app.records.starts import HASH
from app.system.errors import InputError, NotFound, RoleNeeded
from app.system.texts import localized, say
from app.system.version import installed_version
from app.web.acts import ActBody, act_responses, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.requests import FormFields, body_of, described_body, errors, kind_of

router = APIRouter()

ZIP: Final = "application/zip"
NO_FORM: Final = FormFields({})
NOT_KEPT: Final = {"cache-control": "no-store"}
Hash = Annotated[str, Field(pattern=f"^{HASH.pattern}$")]


class Controller(BaseModel):
    """Who controls a robot; its name is "" on a panel with one robot."""

    robot: str
    name: str


class LastTake(BaseModel):
    """The last panel file that was taken, and the result. `trial`: the server runs with it, and
    takes it back if it ends within some seconds. Hashes are of the panel file with its files."""

    phase: Literal["writing", "trial", "kept", "restored"]
    old: str
    new: str
    who: str
    at: str
    since: Annotated[str, Field(description="when it was kept or restored, else empty")]
    text: Annotated[str, Field(description="the same as a sentence")]


class PanelAnswer(BaseModel):
    """`revision` is the beginning of the SHA-256 of the panel file that this server has loaded.
    `refusal` says why no other could be taken now, "" if one could."""

    title: str
    version: str
    revision: str
    control: list[Controller]
    refusal: str
    last: LastTake | None


class PanelFile(BaseModel):
    name: str
    sha256: str
    size: int


class PanelFileAnswer(BaseModel):
    """The text of the panel file in force, one hash for it with all its files, and these."""

    text: str
    hash: str
    files: list[PanelFile]


class PanelRemark(BaseModel):
    place: str
    id: str
    line: int
    message: str


class FileChange(BaseModel):
    name: str
    change: Literal["added", "changed", "removed"]


class PanelCheckAnswer(BaseModel):
    """What `check` says of a sent panel, by this server's version. `sent` is its hash, "" with faults;
    `compared` is that of the one in force, from which `diff` leads to it."""

    title: str
    faults: list[PanelRemark]
    notes: list[PanelRemark]
    sent: str
    compared: str
    diff: str
    files: list[FileChange]
    refusal: str
    version: str


class TakeBody(ActBody):
    """`sent` and `compared` are those of the check."""

    sent: Hash
    compared: Hash


@router.get(
    "/panel",
    response_model=PanelAnswer,
    summary="The panel that this server shows, and the last one that was sent to it",
    responses=errors(403, 404),
)
async def panel(request: Request, state: CurrentState) -> Response:
    receiver, fleet = _receiver(state), state.fleet
    take = await asyncio.to_thread(lambda: receiver.last)
    holders = [(each.robot.name, each.control.holder) for each in fleet.sessions]
    content: dict[str, Any] = {
        "title": fleet.panel.title,
        "version": installed_version(),
        "revision": fleet.panel.revision,
        "control": [{"robot": name, "name": who.name} for name, who in holders if who is not None],
        "refusal": receiver.obstacle(caller_of(request).principal) or "",
        "last": None,
    }
    if take is not None:
        shown = {name: getattr(take, name) for name in ("phase", "old", "new", "who", "at", "since")}
        content["last"] = {**shown, "text": outcome_text(take)}
    return _json(request, content)


@router.get(
    "/panel/file",
    response_model=PanelFileAnswer,
    summary="The panel file in force, with its hash",
    responses=errors(403, 404, 422),
)
async def panel_file(request: Request, state: CurrentState) -> Response:
    return _json(request, await _receiver(state).read())


@router.post(
    "/panel/check",
    response_model=PanelCheckAnswer,
    summary="Check a panel with its files, and compare it with the one in force",
    responses=errors(403, 404, 408, 413, 422),
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {ZIP: {"schema": {"type": "string", "format": "binary"}}},
        }
    },
    max_body_size=MOST_BYTES,
)
async def check(request: Request, state: CurrentState) -> Response:
    """Changes nothing. `panel.toml` in the zip file is the panel file, whatever its name is here."""
    receiver = _receiver(state)
    if kind_of(request) != ZIP:
        raise InputError(f'the body must be "{ZIP}"')
    answer = await receiver.check(await body_of(request))
    answer["refusal"] = receiver.obstacle(caller_of(request).principal) or ""
    answer["version"] = installed_version()
    return _json(request, answer)


@router.post(
    f"/panel/{TAKE}",
    response_model=ActAnswer,
    summary="Take a panel that was checked, and start again with it",
    responses=act_responses(ActAnswer),
    openapi_extra=described_body(TakeBody, None, required=True),
)
async def take(request: Request, state: CurrentState) -> Response:
    receiver = _receiver(state)
    sent = await sent_act(request, state, TakeBody, NO_FORM)
    values = {"sent": sent.body.sent, "compared": sent.body.compared}
    receipt = await sent.run(receiver.acts, sent.asked(TAKE, values=values), sent.act_id())
    receiver.restart_if_due()
    return sent.answer(receipt, "")


def _receiver(state: AppState) -> PanelReceiver:
    """NotFound where the settings do not permit it, RoleNeeded without users."""
    if state.receiver is None:
        raise NotFound(say("panel_take_off"))
    if not state.access.configured:
        raise RoleNeeded(say("panel_take_users"), ENGINEER)
    return state.receiver


def _json(request: Request, content: dict[str, Any]) -> Response:
    return JSONResponse(localized(content, caller_of(request).language), headers=NOT_KEPT)
