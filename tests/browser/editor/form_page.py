"""The form of a panel file on a page of its own, without the editor's server: requests are answered in
the test's process."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from playwright.sync_api import Locator, Page, Request, Route, expect

from app.panel.file.load import faults_of_text
from app.panel.file.toml_lines import Path
from app.ros.messages import load_interfaces
from app.system.errors import KioskError
from app.system.settings import shipped_path
from app.tools.editor.document import Document, edit_from
from app.tools.editor.forms import FormPage, Link, element_id, form_context, form_of
from app.web.pages.page_templates import PageTemplates

URL: Final = "http://form.test"
STATIC: Final = shipped_path("static")
TEMPLATES: Final = PageTemplates(shipped_path("templates"))
INTERFACES: Final = load_interfaces("jazzy", ())
SHEETS: Final = ("tokens", "priorities", "editor/form")
KINDS: Final = {".js": "text/javascript", ".css": "text/css", ".woff2": "font/woff2"}
PAGE: Final = """<!doctype html>
<html lang="{language}" data-theme="{theme}"><head><meta charset="utf-8">
<title>Form</title><link rel="icon" href="data:,">{sheets}
<style>* {{ box-sizing: border-box; margin: 0 }} body {{ display: flex;
font: 16px/1.25 "IBM Plex Sans", "Noto Sans",
"Noto Sans JP", sans-serif; color: var(--ink); background: var(--ground) }} .tabs {{ display: flex }}
.tabs button {{ flex: 1; min-height: 46px; border: 0; background: var(--frame); color: var(--ink);
font: inherit }}
main {{ display: flex; flex-direction: column; width: 360px; height: 100vh; margin-left: auto;
background: var(--surface) }}</style></head><body><header><h1>Form</h1></header><main></main>
<script type="module">
import {{ Form }} from "/static/js/editor/form.js";
// A test may leave the page before an answer is there.
const fetched = (...request) => fetch(...request).catch(() => new Promise(() => {{}}));
const send = async (path, body) => {{
  const response = await fetched(path, {{ method: "POST", body }});
  return {{ ok: response.ok, ...(await response.json()) }};
}};
globalThis.form = new Form(document.querySelector("main"), {{
  post: (edits, label) => send("/edits", JSON.stringify({{ edits, label }})),
  load: async (query) => (await fetched(`/parts/form?${{new URLSearchParams(query)}}`)).text(),
  select: (path) => globalThis.form.show(path),
  upload: (path, file) => send(`/upload?path=${{JSON.stringify(path)}}&name=${{file.name}}`, file),
}});
await globalThis.form.show({path});
document.documentElement.dataset.there = "";
</script></body></html>"""


class FormBrowser:
    """A page with the form of the table at `path` of the file with `text`. `labels` are those of the
    posted steps; `hold` delays the answers to edits until it is called again."""

    def __init__(
        self,
        page: Page,
        text: str,
        path: Path,
        folder: FilePath,
        language: str = "en",
        theme: str = "light",
    ) -> None:
        self.page = page
        self.document = Document(text)
        self.labels: list[str] = []
        self.edits: list[Any] = []
        self.uploads: list[str] = []
        self._path, self._folder, self._language, self._theme = path, folder, language, theme
        page.route(f"{URL}/**", self._answer)
        page.goto(f"{URL}/")
        expect(page.locator("html[data-there]")).to_be_attached()

    def field(self, *path: str | int) -> Locator:
        """The entry of a key, by its path."""
        name = element_id(path).replace('"', '\\"')
        return self.page.locator(f'[id="{name}"]')

    @property
    def saved(self) -> dict[str, Any]:
        """The tables of the document, after the requests that the page has sent."""
        self.page.evaluate("0")  # Playwright answers requests only while it waits for the page
        return tomllib.loads(self.document.text)

    def change_elsewhere(self, *edits: dict[str, Any]) -> None:
        """Another browser, or undo, changes the document."""
        self.document.apply([edit_from(edit) for edit in edits], "elsewhere")
        self.page.evaluate("globalThis.form.refresh()")

    def undo(self) -> None:
        self.document.undo()
        self.page.evaluate("globalThis.form.refresh()")

    def _answer(self, route: Route, request: Request) -> None:
        parts = urlsplit(request.url)
        answer: dict[str, Callable[[], Any]] = {
            "/": lambda: route.fulfill(content_type="text/html", body=self._page()),
            "/parts/form": lambda: route.fulfill(
                content_type="text/html", body=self._form(parse_qs(parts.query))
            ),
            "/edits": lambda: self._edit(route, json.loads(request.post_data or "")),
            "/upload": lambda: self._upload(route, parse_qs(parts.query)),
        }
        if parts.path in answer:
            answer[parts.path]()
            return
        file = STATIC / parts.path.removeprefix("/static/")
        if not file.is_file():
            route.fulfill(status=404)
            return
        route.fulfill(body=file.read_bytes(), content_type=KINDS[file.suffix])

    def _page(self) -> str:
        sheets = "".join(f'<link rel="stylesheet" href="/static/css/{name}.css">' for name in SHEETS)
        return PAGE.format(
            language=self._language, theme=self._theme, sheets=sheets, path=json.dumps(self._path)
        )

    def _form(self, query: dict[str, list[str]]) -> str:
        asked = {name: values[0] for name, values in query.items()}
        path = tuple(json.loads(asked["path"]))
        form = form_of(
            self.document.tables,
            path,
            interfaces=INTERFACES,
            faults=faults_of_text(self.document.text, self._folder),
            language=self._language,
            kind=asked.get("kind", ""),
            used_by=1,
        )
        used = (Link(("alarm", 0), "boxes_full", "alarm"),)
        first, last = self.document.lines(form.path)
        picked = tuple(json.loads(asked["pick"])) if asked.get("pick") else None
        view = asked.get("view", "form")
        shown = FormPage(view, self.document.text_of(form.path), (first, last), used, picked)
        return TEMPLATES.render("editor/_form.html", self._language, **form_context(form, shown))

    def _edit(self, route: Route, body: dict[str, Any]) -> None:
        self.labels.append(body["label"])
        self.edits.append(body["edits"])
        try:
            self.document.apply([edit_from(edit) for edit in body["edits"]], body["label"])
        except KioskError as error:
            route.fulfill(status=422, json={"message": str(error)})
            return
        route.fulfill(json={"revision": self.document.revision})

    def _upload(self, route: Route, query: dict[str, list[str]]) -> None:
        self.uploads.append(query["name"][0])
        edit = {"op": "set", "path": json.loads(query["path"][0]), "value": query["name"][0]}
        self._edit(route, {"edits": [edit], "label": "upload"})
