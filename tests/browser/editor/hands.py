"""Hands at an editor: what a person does with mouse and keyboard to write a panel's tables by its panes
and forms."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, Final

from playwright.sync_api import Locator, Page, expect

from app.panel.file.toml_lines import Path
from app.system.toml_values import value_text
from app.tools.editor.forms import element_id
from tests.support.editor import EditorServer, drag_line
from tests.support.parts import until

LISTS: Final = ("group", "widget")  # tables with forms of their own


class Hands:
    """Mouse and keyboard on the page of an editor. `actions` counts what they do: each click, each
    typed text with its Enter, each choice."""

    def __init__(self, page: Page, editor: EditorServer) -> None:
        self.page = page
        self.actions = 0
        self._editor = editor

    @property
    def tables(self) -> dict[str, Any]:
        """The document, as it is now."""
        return tomllib.loads(self._editor.http.get("/text").text)

    def at(self, path: Path) -> Any:
        """What the document has there; None for nothing."""
        value: Any = self.tables
        for step in path:
            try:
                value = value[step]
            except (KeyError, IndexError, TypeError):
                return None
        return value

    def click(self, place: Locator) -> None:
        place.click()
        self.actions += 1

    def type(self, field: Locator, text: str) -> None:
        """Types a text instead of what a field has."""
        field.click()
        self.page.keyboard.press("Control+a")
        if text:
            self.page.keyboard.insert_text(text)
        else:
            self.page.keyboard.press("Delete")
        key = (
            "Control+Enter"
            if "\n" in text or field.evaluate("e => e.localName") != "input"
            else "Enter"
        )
        self.page.keyboard.press(key)
        self.actions += 1

    def line(self, tab: str, name: str) -> Locator:
        """A line of the pane "Robot" or "Parts"."""
        tab_button = self.page.locator(f"#tab-{tab}")
        if tab_button.get_attribute("aria-selected") != "true":
            self.click(tab_button)
        return self.page.locator(".offer").filter(has=self.page.locator(f"b:text-is('{name}')")).first

    def add(self, tab: str, name: str) -> None:
        """Adds a line of a pane by Enter."""
        self.line(tab, name).press("Enter")
        self.actions += 1

    def drop(self, line: Locator, x: float, y: float) -> None:
        """Drags a line of a pane to a point of the window."""
        drag_line(self.page, line, x, y)
        self.actions += 1

    def pick(self, title: str) -> None:
        """Chooses how an item of the robot is shown."""
        self.click(
            self.page.locator(".ways button")
            .filter(has=self.page.locator(f"b:text-is('{title}')"))
            .first
        )

    def added(self, path: Path) -> None:
        """Waits until the form is that of a new table."""
        self._there(path)
        expect(self.page.locator("#form .form")).to_have_attribute("data-form", _json_path(path))

    def fill(self, path: Path, table: Mapping[str, Any]) -> None:
        """Enters each key of a table that differs, and takes back those that it does not have."""
        there = self.at(path) or {}
        for key in there.keys() - table.keys():
            self.put((*path, key), None)
        for key, value in table.items():
            if key not in LISTS or isinstance(value, str):  # an alarm has a group, too
                self.put((*path, key), value)

    def put(self, path: Path, value: Any) -> None:
        """Enters one key in the form that shows it."""
        if self.at(path) == value:
            return
        self._drawn()
        name, form = element_id(path), self.page.locator("#form")
        entry = form.locator(f"[data-path='{_json_path(path)}']:not([data-sends=key], [data-by-edits])")
        table = form.locator(f'[id="{name}"]')
        group = form.locator(f'[aria-labelledby="{name}-name"]')
        expect(entry.or_(table).or_(group).first).to_be_attached()
        shown = next(each for each in (entry, table, group) if each.count()).first
        self._open(shown)
        kind = shown.evaluate("e => e.localName + '.' + e.className + '.' + (e.dataset.sends ?? '')")
        if kind.startswith("select"):
            shown.select_option("" if value is None else _json(value))
            self.actions += 1
        elif kind.startswith("input") or kind.startswith("textarea"):
            self.type(shown, _typed(value, kind.rpartition(".")[2]))
        elif ".seg" in kind:
            chosen = value if value is not None else self.at(path)
            self.click(shown.locator(f'[data-row="{_row(chosen)}"]'))
        elif kind.endswith(".ticks"):
            self._tick(shown, path, _listed(value))
            return
        elif kind.startswith("span.parts"):
            self._message(path, value)
        elif kind.startswith("div.rows"):
            self._rows(shown, path, value)
        else:
            self._table(shown, path, value)
        self._is(path, value)

    def _tick(self, shown: Locator, path: Path, wanted: list[Any]) -> None:
        """Takes back what is not wanted and ticks what is, in its order: what is ticked comes first."""
        there = _listed(self.at(path))
        for each in [*(each for each in there if each not in wanted), *wanted]:
            if each not in there or each not in wanted:
                shown.locator(f"input[value='{_json(each)}']").press("Space")
                self.actions += 1
                self._drawn()
        until(lambda: {*_listed(self.at(path))} == {*wanted}, f"{wanted} are ticked")

    def _drawn(self) -> None:
        """Waits until the form is that of the last edit: until then fields change their places."""
        expect(self.page.locator("#form")).not_to_have_attribute("aria-busy", "true")

    def _there(self, path: Path) -> None:
        until(lambda: self.at(path) is not None, f"{path} is added")
        self._drawn()

    def _is(self, path: Path, value: Any) -> None:
        until(lambda: self.at(path) == value, f"{path} is {value!r}")
        self._drawn()

    def _open(self, element: Locator) -> None:
        """Opens what is folded around an element."""
        folded = element.locator("xpath=ancestor::details[not(@open)]")
        while folded.count():
            self.click(folded.first.locator("xpath=summary"))

    def _table(self, shown: Locator, path: Path, value: Any) -> None:
        if self.at(path) is None:
            add = shown.get_by_role("button", name=re.compile("^Add"))
            self.click(add.first)
            self._there(path)
        self.fill(path, value)

    def _rows(self, shown: Locator, path: Path, value: Sequence[Mapping[str, Any]]) -> None:
        for number, table in enumerate(value):
            at = (*path, number)
            if self.at(at) is None:
                self.click(shown.locator(":scope > button.act").last)
                self._there(at)
                # The focus goes there.
                expect(self.page.locator(f'[id="{element_id(at)}"] :focus')).to_have_count(1)
            self.fill(at, table)

    def _message(self, path: Path, value: Mapping[str, Any]) -> None:
        for key, each in value.items():
            name = element_id((*path, key))
            leaf = self.page.locator(f'[id="{name}"]')
            if not leaf.count():
                parts = self.page.locator(f'[id="{element_id(path)}"]')
                choice = parts.locator("select option").filter(has_text=re.compile(rf"^{key}  "))
                if choice.count():
                    parts.locator("select").select_option(choice.first.get_attribute("value"))
                else:
                    self.type(parts.locator("[data-sends=key]"), key)
                self.actions += 1
                expect(leaf).to_be_attached()
            if self.at((*path, key)) != each:
                self.type(leaf, _typed(each, "literal"))
                self._is((*path, key), each)


def _json_path(path: Path) -> str:
    return json.dumps(path)


def _listed(value: Any) -> list[Any]:
    return [] if value is None else [value] if not isinstance(value, list) else value


def _json(value: Any) -> str:
    return value_text(value) if not isinstance(value, bool) else str(value).lower()


def _row(value: Any) -> str:
    return str(value)


def _typed(value: Any, sends: str) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if sends == "list":
        return "\n".join(map(str, value))
    return value_text(value)
