"""The application with widgets that can't be shown, for `uvicorn
tests.support.apps.failing_widgets:app`: a gauge above 90 has no attributes, a trend no HTML."""

from typing import Any

from app import main
from app.panel.widgets.gauge import Gauge
from app.view import kinds
from app.web.rendering import page_words

shown = kinds.ATTRIBUTES[Gauge]


def gauge(*parameters: Any) -> kinds.AttributesUntil:
    attributes, until = shown(*parameters)
    if str(attributes["text"]).startswith("9"):
        raise RuntimeError("this gauge fails")
    return attributes, until


def plot(*_: Any) -> Any:
    raise RuntimeError("this plot fails")


vars(kinds)["ATTRIBUTES"] = {**kinds.ATTRIBUTES, Gauge: gauge}
vars(page_words)["plot"] = plot
app = main.app
