"""What the pages showed at a stop, as it is kept: the same values are read again, it is bounded, and a
damaged file is named."""

import gzip
import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.robot.log_lines import Line
from app.cell.stops import shown as kept
from app.cell.stops.shown import (
    FOLDER,
    MOST_BYTES,
    ShownFault,
    ShownView,
    as_bytes,
    from_bytes,
    shown_near,
    write,
)
from app.cell.stops.story import AFTER_S
from app.cell.view.trend import Band, Plot, PlotLimit, PlotLine, Tick
from app.cell.view.view import build_view
from app.panel import load_panel
from app.panel.model import Panel
from app.ros.messages import load_interfaces
from app.system.clock import format_datetime
from app.system.errors import LogError
from app.system.texts import joined, localized, number, say
from tests.support.builders import FREE, GUARDED, HEARD, NOW, panel_of, permits, robot_there, says
from tests.support.parts import ROOT

AT: Final = 1_800_000_000.123
PLOT: Final = Plot(
    [PlotLine("M0 1L2 3", 99.5, 12.0), PlotLine("", None, 0.0)],
    [Tick(50.0, number("1.5", "bar"))],
    [Tick(20.0, "16:42")],
    [PlotLimit(0, 30.0, number("5"), "L")],
    [Band(0, 10.0, 20.0)],
    [],
)


def shown_of(panel: Panel, at: float = AT, robot: str = "", said: str = "hello") -> ShownView:
    state = robot_there(panel)
    permits(state)
    says(state, "/heard", said)
    view = build_view(panel, state, NOW).view
    return ShownView(at=at, robot=robot, revision=panel.revision, version="1", view=view)


def small(**about: Any) -> ShownView:
    return shown_of(panel_of(FREE, GUARDED, HEARD), **about)


def with_widget(shown: ShownView, **widgets: Any) -> ShownView:
    view: Any = {**shown.view, "widgets": {**shown.view["widgets"], **widgets}}
    return replace(shown, view=view)


@pytest.mark.parametrize(
    "value",
    [
        "text",
        "",
        "\ud800 half of a pair",
        None,
        True,
        -0.5,
        [1, ["x", None]],
        {"a": {"b": []}},
        say("ready"),
        say("stop_view_at", time=format_datetime(AT)),
        joined([say("ready"), number("1,234.5", "mm")], "between_names"),
        {"nested": [say("ready"), {"deep": number("3")}]},
        {"code": "ready", "params": {}},
    ],
)
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_values_are_read_as_they_were(value: Any, language: str) -> None:
    shown = with_widget(small(), heard={"text": value})
    read = from_bytes(as_bytes(shown))
    assert localized(read.view, language) == localized(shown.view, language)
    assert read.view["widgets"]["heard"]["text"] == value


def test_numbers_that_are_none_stay_so() -> None:
    shown = with_widget(small(), heard={"a": math.nan, "b": math.inf})
    attributes = from_bytes(as_bytes(shown)).view["widgets"]["heard"]
    assert math.isnan(attributes["a"])
    assert attributes["b"] == math.inf


def test_curves_and_lines_are_kept() -> None:
    lines = [(7, Line(30, 12.5, "cell", "waiting: air low"))]
    shown = replace(small(), plots={"curve": PLOT}, lines={"log": lines})
    read = from_bytes(as_bytes(shown))
    assert read.plots == {"curve": PLOT}
    assert read.plots["curve"].limits[0].named_above == PLOT.limits[0].named_above
    assert read.lines == {"log": lines}


@pytest.mark.parametrize(
    "file", ["app/panel.toml", "docs/examples/mobile-robot/panel.toml", "docs/examples/oven.toml"]
)
def test_the_view_of_a_shipped_panel_is_read_as_it_was(file: str) -> None:
    panel = load_panel(ROOT / file)
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    view = build_view(panel, robot_there(panel, interfaces=interfaces), NOW).view
    shown = ShownView(at=AT, robot="", revision=panel.revision, version="1", view=view)
    read = from_bytes(as_bytes(shown))
    assert json.dumps(localized(read.view, "de")) == json.dumps(localized(view, "de"))
    assert read.revision == panel.revision
    assert not read.left_out


def test_the_largest_parts_are_left_out_and_named() -> None:
    lines = [(n, Line(20, 1.0, "cell", "x" * 1000)) for n in range(20)]
    shown = with_widget(small(), big={"text": "x" * 50_000}, table={"rows": ["x" * 30_000]})
    shown = replace(shown, lines={"log": lines})
    whole = from_bytes(as_bytes(shown))
    assert whole.left_out == ()
    cut = from_bytes(as_bytes(shown, most=20_000))
    assert cut.left_out == ("big", "table", "log")
    assert cut.view["widgets"].keys() == shown.view["widgets"].keys() - {"big", "table"}
    assert cut.view["widgets"]["heard"] == shown.view["widgets"]["heard"]
    assert not cut.lines


def test_rows_of_alarms_are_a_part_too() -> None:
    shown = small()
    rows = {f"a{n}": {"id": f"a{n}", "text": "x" * 100} for n in range(100)}
    view: Any = {**shown.view, "alarms": {**shown.view["alarms"], "rows": rows}}
    cut = from_bytes(as_bytes(replace(shown, view=view), most=8_000))
    assert cut.left_out == ("rows",)
    assert cut.view["alarms"] == {**shown.view["alarms"], "rows": {}}


def test_one_of_many_small_parts_that_is_too_large_is_not_kept(tmp_path: Path) -> None:
    shown = with_widget(small(), **{f"w{n}": {"text": "x" * 1000} for n in range(3000)})
    with pytest.raises(ShownFault, match="bytes, more than"):
        write(tmp_path, shown)
    assert not (tmp_path / FOLDER).exists()


WHOLE: Final = as_bytes(small())


def changed(**more: Any) -> bytes:
    about = json.loads(gzip.decompress(WHOLE))
    return gzip.compress(json.dumps({**about, **more}).encode())


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "it is not whole"),
        (WHOLE[: len(WHOLE) // 2], "it is not whole"),
        (WHOLE[:-4], "it is not whole"),
        (b"\0hostile" * 500, "it is damaged"),
        (gzip.compress(b"[]"), "it is damaged"),
        (gzip.compress(b"{"), "it is damaged"),
        (gzip.compress(b"\xff"), "it is damaged"),
        (gzip.compress(b"[" * 100_000), "it is damaged"),
        (gzip.compress(bytes(3 * MOST_BYTES)), "it is not whole"),
        (changed(format=2), "another version"),
        (changed(view={"alarms": {}}), "another version"),
        (changed(parts=[["widgets"]]), "it is damaged"),
        (changed(parts=[[["elsewhere", "x"], {}]]), "it is damaged"),
        (changed(parts=[[["lines", "x"], [[1, ["too short"]]]]]), "it is damaged"),
        (changed(parts=[[["plots", "x"], {}]]), "it is damaged"),
        (changed(parts=[[["widgets", "x"], {"=text": 5}]]), "it is damaged"),
        (changed(parts=[[["widgets", "x"], {"=text": {"code": 1, "params": 2}}]]), "it is damaged"),
    ],
)
def test_a_damaged_file_is_named_and_another_one_is_read(
    tmp_path: Path, content: bytes, why: str
) -> None:
    write(tmp_path, small(at=AT))
    write(tmp_path, small(at=AT + 2.0, said="later"))
    file = tmp_path / FOLDER / f"{round(AT * 1000)}.json.gz"
    file.write_bytes(content)
    nearest = shown_near(tmp_path, "", AT)
    assert nearest.shown is not None
    assert nearest.shown.at == AT + 2.0
    ((name, said),) = nearest.faults
    assert name == f"{FOLDER}/{file.name}"
    assert why in said


@pytest.mark.parametrize(
    ("robot", "at", "said"),
    [
        ("", AT, "one"),
        ("", AT + AFTER_S - 0.01, "one"),
        ("", AT - AFTER_S + 0.01, "one"),
        ("", AT + AFTER_S + 0.01, None),
        ("", AT + 100.0, "later"),
        ("left", AT, "of left"),
        ("right", AT, None),
    ],
)
def test_the_nearest_of_the_robot_is_found(
    tmp_path: Path, robot: str, at: float, said: str | None
) -> None:
    for text, when, name in (("one", AT, ""), ("later", AT + 97.0, ""), ("of left", AT, "left")):
        write(tmp_path, small(at=when, robot=name, said=text))
    shown = shown_near(tmp_path, robot, at).shown
    assert (shown and shown.view["widgets"]["heard"]["text"]) == said


def test_without_a_folder_none_is_found(tmp_path: Path) -> None:
    assert shown_near(tmp_path, "", AT) == (None, ())


def test_the_oldest_make_room_and_what_a_killed_server_left_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "MOST_FILES", 3)
    folder = tmp_path / FOLDER
    folder.mkdir()
    (folder / "1800000000000.json.gz.new").write_bytes(b"half")
    (folder / "notes.txt").write_text("not of this program")
    for n in range(5):
        write(tmp_path, small(at=AT + n, robot="left" if n % 2 else ""))
    names = {file.name for file in folder.iterdir()}
    first = round(AT * 1000)
    assert names == {
        "notes.txt", f"{first + 2000}.json.gz", f"{first + 3000}-left.json.gz",
        f"{first + 4000}.json.gz",
    }  # fmt: skip
    assert {file.stat().st_mode & 0o777 for file in folder.glob("*.gz")} == {0o600}
    assert folder.stat().st_mode & 0o77 in (0, 0o55)  # made by the test


def test_links_are_not_followed(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(WHOLE)
    (tmp_path / FOLDER).mkdir()
    (tmp_path / FOLDER / f"{round(AT * 1000)}.json.gz").symlink_to(secret)
    nearest = shown_near(tmp_path, "", AT)
    assert nearest.shown is None
    assert len(nearest.faults) == 1


def fails(*_: Any) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("call", ["fsync", "open"])
def test_what_the_disk_refuses_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    refuse: Callable[..., None] = fails
    monkeypatch.setattr(f"app.system.whole_file.os.{call}", refuse)
    with pytest.raises(LogError, match="No space left on device"):
        write(tmp_path, small(at=time.time()))
    assert not list((tmp_path / FOLDER).glob("*.gz"))
