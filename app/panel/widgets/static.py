"""What only stands on a page: texts, pictures, links to other pages."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from app.errors import Fault
from app.panel.base import Icon, Id
from app.panel.faults.wording import list_names
from app.panel.widgets.families import BaseWidget, CheckContext
from app.pictures import PICTURE


class Static(BaseWidget):
    """A widget that never changes."""


class TextLabel(Static):
    """A text; its `label` is what it says."""

    kind: Literal["label"]
    size: Literal["small", "normal", "large"] = "normal"


class Picture(Static):
    """A picture from the panel's folder of pictures; its `label` says what it shows."""

    kind: Literal["image"]
    src: Annotated[str, Field(pattern=PICTURE)]

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.src not in checking.pictures:
            there = list_names(checking.pictures)
            message = f'"{self.src}" is not among the pictures; there is {there}'
            yield Fault(f"{place}.src", message, cause=f"picture {self.src}")


class PageLink(Static):
    """A key that opens another page of the panel."""

    kind: Literal["link"]
    page: Id
    icon: Icon | None = None

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.page not in checking.pages:
            message = f'no page "{self.page}"; there is {list_names(checking.pages)}'
            yield Fault(f"{place}.page", message, cause=f"page {self.page}")
