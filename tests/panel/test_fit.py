"""What `app.check` says of the screens that a page fits, without a browser."""

from typing import Any

import pytest

from app.panel import Panel
from app.panel.checks.fit import fit_notes
from app.panel.layout import Group

KEY = {"kind": "publish", "topic": "/a", "type": "std_msgs/msg/Empty", "message": {}}


def keys(count: int, **each: Any) -> list[dict[str, Any]]:
    return [{"id": f"k{n}", "label": f"K{n}", **KEY, **each} for n in range(count)]


def panel(screens: list[str], *groups: dict[str, Any], **page: Any) -> Panel:
    whole = {"id": "p", "title": "P", "fit": True, "group": list(groups), **page}
    return Panel.model_validate({"title": "T", "screens": screens, "page": [whole]})


def said(checked: Panel) -> str:
    return "".join(note.message for note in fit_notes(checked))


@pytest.mark.parametrize(("rows", "fits"), [(6, True), (7, False)])
def test_as_many_rows_as_there_is_height_for(rows: int, fits: bool) -> None:
    """A key of 20 mm takes 101.6 px with its gap above, and 12 px lie between rows."""
    stacked = panel(["1280x800"], {"columns": 1, "widget": keys(rows)})
    assert said(stacked).startswith("fits" if fits else 'does not fit 1280x800: "P" needs 807 px')


def test_a_group_that_takes_turns_needs_height_for_itself_alone() -> None:
    groups = [{"columns": 1, "span": 12, "title": str(n), "widget": keys(3)} for n in range(2)]
    assert "does not fit 1280x800" in said(panel(["1280x800"], *groups))
    assert said(panel(["1024x600"], *groups)) == "fits 1024x600"


def test_a_key_that_would_be_narrower_than_20_mm_is_named() -> None:
    narrow = panel(["800x480"], {"columns": 8, "widget": keys(8)})
    assert said(narrow) == 'does not fit 800x480: "K0" would be 76 px wide and needs 91'


def test_only_pages_that_must_fit_are_judged_and_only_with_screens() -> None:
    assert not said(panel([], {"widget": keys(20)}))
    assert not said(panel(["800x480"], {"widget": keys(20)}, fit=False))


def test_page_with_its_own_template_is_not_judged_for_fit() -> None:
    crowded = panel(["800x480"], {"widget": keys(20)})
    own = crowded.pages[0].model_copy(update={"template": "plan.html"})
    theirs = crowded.model_copy(update={"pages": (own,)})
    assert said(theirs) == "plan.html decides what fits: look at it in a browser"


def test_widgets_are_placed_as_a_grid_places_them() -> None:
    """One that spans two rows keeps its cells free of those after it."""
    tall, wide, small = keys(3)
    group = Group.model_validate(
        {"columns": 3, "widget": [{**tall, "rows": 2}, {**wide, "span": 2}, {**small, "span": 2}]}
    )
    assert [(w.id, row, rows) for w, row, rows in group.cells()] == [
        ("k0", 0, 2),
        ("k1", 0, 1),
        ("k2", 1, 1),
    ]


@pytest.mark.parametrize(("low_screens", "fits"), [("badge", True), ("line", False)])
def test_the_line_of_alarms_takes_its_height_unless_low_screens_have_a_badge(
    low_screens: str, fits: bool
) -> None:
    alarm = {"id": "apart", "text": "No connection", "lost": "robot"}
    rules = {"alarms": {"low_screens": low_screens}, "alarm": [alarm]}
    rows = {"title": "T", "columns": 1, "widget": keys(3)}
    page = {"id": "p", "title": "P", "fit": True, "group": [rows]}
    checked = Panel.model_validate({"title": "T", "screens": ["800x480"], "page": [page], **rules})
    assert said(checked).startswith("fits" if fits else "does not fit")
