"""The editor's server: one panel file, its page in any number of browsers, and the preview."""

import asyncio
import hashlib
import json
import logging
import secrets
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path as FilePath
from typing import Annotated, Any, Final

from fastapi import Depends, FastAPI, Request
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from pydantic import BaseModel
from starlette.requests import cookie_parser
from starlette.routing import Mount
from starlette.types import ASGIApp, Receive, Scope, Send

from app.system.concurrency import keep_running
from app.system.errors import KioskError, NotFound
from app.system.settings import Settings, shipped_path
from app.system.texts import localized, say
from app.tools.editor import uploads
from app.tools.editor.adding import Addition, add
from app.tools.editor.checked import DocumentChecker
from app.tools.editor.document import Change, EditError, edit_from, path_from
from app.tools.editor.editor import Browser, Editor, PartRequest
from app.tools.editor.filling import filled
from app.tools.editor.merge import Side
from app.tools.editor.pages import PARTS, interfaces_of, page_context, place_list
from app.tools.editor.pasting import paste
from app.tools.editor.paths import path_of
from app.tools.editor.preview import ROOT as PREVIEW
from app.tools.editor.preview import Preview
from app.tools.editor.sending import Destination
from app.tools.editor.session import EditSession
from app.tools.editor.signin import PERSON, SignIn, SignInGuard, add_sign_in
from app.tools.editor.start import Start, started
from app.tools.robot.link import Place
from app.web.asgi import Application
from app.web.assets import FONTS, Asset, asset
from app.web.language import MOST_ACCEPTED, negotiated
from app.web.pages.page_templates import PageTemplates
from app.web.security import POLICY, RequestGuard, content_security_policy, refuse

log = logging.getLogger("kiosk.editor")

COOKIE: Final = "panel_editor"
CONFLICT: Final = 409
TOKEN: Final = "token"  # in the query of the printed address
LANGUAGES: Final = ("en", "ja", "de")
BEAT_S: Final = 15.0
MOST_BROWSERS: Final = 20
LONGEST_BODY: Final = 4_000_000  # bytes: a whole file is one edit
NOT_KEPT: Final = {"cache-control": "no-store"}
SHEET: Final = "editor.css"
# Before the editor's own style.
LAYERS: Final = ("tokens", "priorities", "alarm-line")
SHARED_SCRIPTS: Final = ("in-place.js",)


class Edits(BaseModel):
    """`revision` is that of the document which the browser has seen. `label` says what was done."""

    revision: int
    edits: list[dict[str, Any]]
    label: str = ""


class Pasted(BaseModel):
    """The text of a table; `path` is that of the selected one."""

    path: list[str | int]
    text: str
    label: str = ""


class Choice(BaseModel):
    """What a conflict with the file on the disk becomes: a side, or a `text`."""

    name: str
    side: Side = "ours"
    text: str | None = None


class Recovery(BaseModel):
    """Whether to go on with what was not saved."""

    take: bool


class Saving(BaseModel):
    """`recreate`: also if the file was removed."""

    recreate: bool = False


class Selected(BaseModel):
    browser: str
    path: list[str | int] | None = None


def _editor_of(request: Request) -> Editor:
    editor: Editor = request.app.state.editor
    return editor


CurrentEditor = Annotated[Editor, Depends(_editor_of)]


def editor_app(
    path: FilePath,
    settings: Settings,
    *,
    token: str,
    port: int = 0,
    is_live: bool = False,
    language: str = "",
    users: FilePath | None = None,
) -> FastAPI:
    """The application of the editor of one file. Only browsers with the token, which the address has
    once, are let in, and with `users`, the folder of a users' file, only its engineers."""
    preview = Preview(path, settings, is_live)
    session = EditSession(path)
    editor = Editor(session, preview, DocumentChecker(path), language)
    sign_in = SignIn(users, session.folder, port) if users is not None else None

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await preview.start()
        editor.begin()
        tasks = [
            keep_running(editor.watch, log, "watching the file failed"),
            keep_running(editor.robots.run, log, "reading the robot failed"),
        ]
        if sign_in is not None:
            tasks.append(await sign_in.start())
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            editor.close()
            session.close()
            if sign_in is not None:
                sign_in.close()
            await preview.stop()

    app = Application(
        title="Operator panel editor",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.state.editor = editor
    app.state.files, app.state.revision = _files()
    app.state.templates = PageTemplates(shipped_path("templates"))
    _add_routes(app, settings, sign_in)
    app.router.routes.append(Mount(PREVIEW, app=preview))
    app.add_exception_handler(KioskError, _on_error)
    if sign_in is not None:
        editor.on_save = sign_in.log.saved
        add_sign_in(app, sign_in, _sign_in_page)
        app.add_middleware(SignInGuard, sign_in=sign_in, language=language_of)
    app.add_middleware(TokenGuard, token=token, cookie=f"{COOKIE}_{port}")
    app.add_middleware(RequestGuard, hosts=settings.hosts)
    return app


class TokenGuard:
    """Lets in who has the token: in the address once, then in a cookie."""

    def __init__(self, app: ASGIApp, token: str, cookie: str) -> None:
        self._app = app
        self._token = token
        self._cookie = cookie

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        request = Request(scope) if scope["type"] == "http" else None
        if request is not None and request.method == "GET" and request.url.path == "/":
            offered = request.query_params.get(TOKEN, "")
            if offered and self._is_right(offered):
                answer = RedirectResponse("/", status_code=303, headers=NOT_KEPT)
                answer.set_cookie(
                    self._cookie,
                    self._token,
                    httponly=True,
                    samesite="strict",
                    secure=scope["scheme"] == "https",
                )
                await answer(scope, receive, send)
                return
        headers = dict(scope["headers"])
        cookies = cookie_parser(headers.get(b"cookie", b"").decode("latin-1"))
        if self._is_right(cookies.get(self._cookie, "")):
            await self._app(scope, receive, send)
            return
        answer_text = say("editor_no_token")
        language = _negotiated(headers.get(b"accept-language", b"").decode("latin-1"))
        await refuse(
            PlainTextResponse(str(localized(answer_text, language)), 403, NOT_KEPT),
            scope,
            receive,
            send,
        )

    def _is_right(self, offered: str) -> bool:
        return secrets.compare_digest(offered.encode(), self._token.encode())


def _negotiated(accepted: str) -> str:
    return negotiated("", accepted[:MOST_ACCEPTED], LANGUAGES) or LANGUAGES[0]


def language_of(request: Request) -> str:
    """The language of the editor's own sentences."""
    editor: Editor = request.app.state.editor
    return editor.language or _negotiated(request.headers.get("accept-language", ""))


def person_of(request: Request) -> str:
    """Who is signed in; "" on this machine, where no one needs to be."""
    return str(request.scope.get(PERSON, ""))


async def _on_error(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, KioskError) else 500
    message = error.text if isinstance(error, KioskError) else str(error)
    answer: dict[str, Any] = {"message": message}
    if status == CONFLICT:
        answer |= _editor_of(request).state("")
    if isinstance(error, EditError):
        answer["path"] = error.path
    return _json(request, answer, status)


def _json(request: Request, content: Any, status: int = 200) -> Response:
    return JSONResponse(localized(content, language_of(request)), status, NOT_KEPT)


def _files() -> tuple[Mapping[str, Asset], str]:
    """The scripts, the style and the fonts of the editor's page, with their revision."""
    static = shipped_path("static")
    sheets = [static / "css" / f"{name}.css" for name in LAYERS]
    sheets += sorted((static / "css/editor").glob("*.css"))
    files = {SHEET: asset(b"\n".join(sheet.read_bytes() for sheet in sheets), ".css")}
    for script in sorted((static / "js/editor").glob("*.js")):
        files[f"editor/{script.name}"] = asset(script.read_bytes(), ".js")
    for name in SHARED_SCRIPTS:
        files[name] = asset((static / "js" / name).read_bytes(), ".js")
    for font in sorted((static / FONTS).glob("*.woff2")):
        files[f"{FONTS}/{font.name}"] = Asset(font.read_bytes(), "font/woff2", False)
    digest = hashlib.sha256()
    for name, sent in sorted(files.items()):
        digest.update(name.encode() + b"\0" + sent.source + b"\0")
    return files, digest.hexdigest()[:12]


def _sign_in_page(request: Request, variables: Mapping[str, Any]) -> str:
    state = request.app.state
    about = {"file": state.editor.session.path.name, "revision": state.revision}
    html: str = state.templates.render(
        "editor/sign_in.html", language_of(request), **about, **variables
    )
    return html


def _add_routes(app: FastAPI, settings: Settings, sign_in: SignIn | None) -> None:
    @app.get("/", response_class=HTMLResponse)
    async def page(request: Request, editor: CurrentEditor) -> Response:
        language = language_of(request)
        context = page_context(editor, language, request.app.state.revision, person_of(request))
        html = request.app.state.templates.render("editor/edit.html", language, **context)
        policy = f"{content_security_policy()}; frame-src 'self'"
        return HTMLResponse(html, headers=NOT_KEPT | {POLICY: policy})

    @app.get("/static/{revision}/{name:path}")
    async def static(revision: str, name: str, request: Request) -> Response:
        sent: Asset | None = request.app.state.files.get(name)
        if sent is None:
            raise NotFound(f'there is no file "{name}"')
        is_same = revision == request.app.state.revision
        caching = "public, max-age=31536000, immutable" if is_same else "no-store"
        return Response(sent.content, media_type=sent.media_type, headers={"cache-control": caching})

    @app.get("/events")
    async def events(browser: str, request: Request, editor: CurrentEditor) -> Response:
        return EditorEvents(editor, browser, person_of(request), language_of(request))

    @app.get("/state")
    async def state(request: Request, editor: CurrentEditor, browser: str = "") -> Response:
        return _json(request, editor.state(browser))

    @app.post("/selection")
    async def select(selected: Selected, request: Request, editor: CurrentEditor) -> Response:
        known = editor.browsers.get(selected.browser)
        if known is not None and known.person == person_of(request):
            known.selection = None if selected.path is None else path_from(selected.path)
            editor.notify()
        return Response(status_code=204)

    @app.post("/edits")
    async def edit(posted: Edits, request: Request, editor: CurrentEditor) -> Response:
        typed = map(edit_from, posted.edits)
        edits = filled(typed, editor.document.tables, interfaces_of(editor))
        author = person_of(request)
        return _step(
            request, editor, lambda: editor.apply(edits, posted.label, posted.revision, author)
        )

    @app.post("/paste")
    async def paste_text(posted: Pasted, request: Request, editor: CurrentEditor) -> Response:
        edit = paste(editor.document.tables, path_from(posted.path), posted.text)
        return _step(
            request, editor, lambda: editor.apply([edit], posted.label, author=person_of(request))
        )

    @app.post("/files")
    async def upload(path: str, name: str, request: Request, editor: CurrentEditor) -> Response:
        data = bytearray()
        async for chunk in request.stream():
            data += chunk
            if len(data) > uploads.MOST_BYTES:
                break
        author = person_of(request)
        return _step(
            request, editor, lambda: uploads.store(editor, path_of(path), name, bytes(data), author)
        )

    @app.post("/add")
    async def add_part(posted: Addition, request: Request, editor: CurrentEditor) -> Response:
        language, author = language_of(request), person_of(request)
        return _step(request, editor, lambda: add(editor, posted, language, author))

    @app.get("/robot")
    async def robot_values(request: Request, editor: CurrentEditor) -> Response:
        editor.robots.look()
        values = editor.robots.values(editor.preview.panel)
        return _json(
            request, {"values": values, "rows": editor.robots.version_for(editor.preview.panel)}
        )

    @app.post("/undo")
    async def undo(request: Request, editor: CurrentEditor) -> Response:
        return _step(request, editor, lambda: editor.undo(person_of(request)))

    @app.post("/redo")
    async def redo(request: Request, editor: CurrentEditor) -> Response:
        return _step(request, editor, lambda: editor.redo(person_of(request)))

    @app.post("/save")
    async def save(posted: Saving, request: Request, editor: CurrentEditor) -> Response:
        problem = editor.save(person_of(request), recreate=posted.recreate)
        return _json(request, editor.state("") | ({"message": problem} if problem else {}))

    @app.post("/resolve")
    async def resolve(choice: Choice, request: Request, editor: CurrentEditor) -> Response:
        side = (choice.text,) if choice.text is not None else choice.side
        editor.resolve(choice.name, side)
        return _json(request, editor.state(""))

    @app.post("/recovered")
    async def recovered(choice: Recovery, request: Request, editor: CurrentEditor) -> Response:
        if choice.take:
            return _step(request, editor, lambda: editor.take_recovered(person_of(request)))
        editor.drop_recovered()
        return _json(request, editor.state(""))

    @app.post("/start")
    async def start(posted: Start, request: Request, editor: CurrentEditor) -> Response:
        robot = Place(zenoh=settings.zenoh)
        change, page = await started(editor, posted, robot, person_of(request))
        answer = {"revision": change.revision, "drawn": editor.preview.number}
        return _json(request, answer | {"select": change.select, "page": page})

    @app.post("/send/compare")
    async def compare(to: Destination, request: Request, editor: CurrentEditor) -> Response:
        await editor.sending(person_of(request)).compare(to, language_of(request))
        return _json(request, {})

    @app.post("/send/take")
    async def take(request: Request, editor: CurrentEditor) -> Response:
        person = person_of(request)
        sending = editor.sending(person)
        if sign_in is not None and sending.can_send:
            sign_in.log.sent(person, sending.address)
        await sending.send()
        return _json(request, {})

    @app.get("/places")
    async def places(request: Request, editor: CurrentEditor, page: str = "") -> Response:
        return _json(request, place_list(editor, page))

    @app.get("/text")
    async def text(editor: CurrentEditor, path: str = "") -> Response:
        return PlainTextResponse(editor.document.text_of(path_of(path)), headers=NOT_KEPT)

    @app.get("/parts/{name}", response_class=HTMLResponse)
    async def part(name: str, request: Request, editor: CurrentEditor) -> Response:
        if name not in PARTS:
            raise NotFound(f'there is no pane "{name}"')
        query, language = dict(request.query_params), language_of(request)
        path, person = path_of(query.get("path", "")), person_of(request)
        wanted = PartRequest(editor, path, language, query, person)
        template, context = PARTS[name](wanted)
        html = request.app.state.templates.render(f"editor/{template}", language, **context)
        return HTMLResponse(html, headers=NOT_KEPT)


def _step(request: Request, editor: Editor, step: Callable[[], Change]) -> Response:
    change = step()
    answer = {"revision": editor.document.revision, "drawn": editor.preview.number}
    return _json(request, answer | {"select": change.select})


class EditorEvents(Response):
    """The event stream of one browser: the newest state, again after each change."""

    media_type = "text/event-stream"

    def __init__(self, editor: Editor, name: str, person: str, language: str) -> None:
        self._editor = editor
        self._person = person
        self._name = name[:64]
        self._language = language
        self.status_code = 200
        self.background = None
        self.init_headers(NOT_KEPT)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        editor = self._editor
        if len(editor.browsers) >= MOST_BROWSERS and self._name not in editor.browsers:
            await send({"type": "http.response.start", "status": 204, "headers": self.raw_headers})
            await send({"type": "http.response.body", "body": b"", "more_body": False})
            return
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        browser = editor.browser(self._name, self._person)
        writing = asyncio.get_running_loop().create_task(self._write(browser, send))
        try:
            while (await receive())["type"] != "http.disconnect":
                pass
        finally:
            writing.cancel()
            await asyncio.gather(writing, return_exceptions=True)
            editor.browsers.pop(self._name, None)
            editor.notify()

    async def _write(self, browser: Browser, send: Send) -> None:
        while True:
            browser.changed.clear()
            data = json.dumps(localized(self._editor.state(self._name), self._language))
            await _send(send, f"event: state\ndata: {data}\n\n")
            while not browser.changed.is_set():
                try:
                    async with asyncio.timeout(BEAT_S):
                        await browser.changed.wait()
                except TimeoutError:
                    await _send(send, ": \n\n")


async def _send(send: Send, text: str) -> None:
    await send({"type": "http.response.body", "body": text.encode(), "more_body": True})
