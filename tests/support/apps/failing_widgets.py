"""The application with widgets that can't be shown, for `uvicorn
tests.support.apps.failing_widgets:app`: a gauge above 90 has no attributes, a trend no HTML."""

from typing import Any

from app import main
from app.cell.view import kinds
from app.panel.widgets.gauge import Gauge
from app.web.pages import words

shown = kinds.ATTRIBUTES[Gauge]


def gauge(*parameters: Any) -> kinds.AttributesUntil:
    attributes, until = shown(*parameters)
    if str(attributes["text"]).startswith("9"):
        raise RuntimeError("this gauge fails")
    return attributes, until


def plot(*_: Any) -> Any:
    raise RuntimeError("this plot fails")


vars(kinds)["ATTRIBUTES"] = {**kinds.ATTRIBUTES, Gauge: gauge}
vars(words)["plot"] = plot
app = main.app
