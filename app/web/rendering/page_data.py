"""What the scripts of a page read when they start: one block of JSON in its markup."""

import json
from collections.abc import Mapping
from typing import Any, Final

from markupsafe import Markup

from app.i18n import localized, say
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.confirmed import confirmation_of
from app.panel.widgets.families import Command
from app.view.sections import SECTIONS

# The sentences that the browser shows by itself, by their names in the scripts.
SENTENCES: Final = {
    "lost": say("server_lost"),
    "lostShort": say("lost"),
    "locksAll": say("locks_all"),
    "unknown": say("unknown"),
    "unsure": say("server_no_response"),
    "broken": say("widget_failed"),
    "unsent": say("page_press_not_sent"),
    "faulty": say("page_incomplete"),
    "tooOld": say("browser_too_old"),
    "stateUnknown": say("state_unknown"),
}
ESCAPED: Final = str.maketrans({sign: f"\\u{ord(sign):04x}" for sign in "<>&"})


def panel_data(panel: Panel, page: Page, scripts: frozenset[str]) -> Mapping[str, Any]:
    """What a page has from the panel file; `scripts` are the kinds of widgets that have a script."""
    kinds = dict.fromkeys(widget.kind for widget in (*page.widgets, *panel.frame.widgets))
    return {
        "page": page.id,
        "keyboard": panel.keyboard,
        "dimAfterS": panel.screen.dim_after_s,
        "sections": [section.name for section in SECTIONS if section.on_page],
        "confirms": [widget.id for widget in confirmed_commands(panel, page)],
        "kinds": [kind for kind in kinds if kind in scripts],
    }


def confirmed_commands(panel: Panel, page: Page) -> list[Command]:
    """The commands that a page may press and that a person confirms."""
    shown = (*page.widgets, *panel.frame.widgets, *panel.recipe_loads)
    return [w for w in shown if isinstance(w, Command) and confirmation_of(w)]


def page_json(data: Mapping[str, Any], language: str) -> Markup:
    """`data` and the sentences as JSON for a `script` element that is not executed."""
    text = json.dumps(
        localized({**data, "sentences": SENTENCES}, language), ensure_ascii=False, separators=(",", ":")
    )
    return Markup(text.translate(ESCAPED))
