"""What the pages of a robot showed at a stop: the values of its view, from which they are rendered
again by the same templates. Pure, and the folder of the files that are kept.

A file is written whole or not at all, has a number of bytes at most, and makes room for newer ones.
"""

import json
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

from app.cell.robot.log_lines import Line
from app.cell.stops.story import AFTER_S
from app.cell.view.trend import Band, Plot, PlotLimit, PlotLine, Tick
from app.cell.view.view import View
from app.system.errors import LogError
from app.system.texts import Text
from app.system.texts.text import text_from
from app.system.whole_file import SUFFIX, write_whole

FOLDER: Final = "stop-views"  # of the data folder
MOST_FILES: Final = 100
MOST_BYTES: Final = 2_000_000  # of a view as JSON; a file is packed
LEAST_LEFT_OUT: Final = 2_000  # bytes of a part that is left out
FORMAT: Final = 1
NAME: Final = re.compile(r"(?P<ms>[0-9]{13})(?:-(?P<robot>[A-Za-z0-9_-]{1,64}))?\.json\.gz")
TEXT: Final = "=text"  # the only key of a Text
ROWS: Final = "rows"  # of alarms, the name of their part
PACKED: Final = 31  # gzip, for zlib
# The rows of a plot, by their names.
PLOT_ROWS: Final[Mapping[str, Callable[..., Any]]] = {
    "lines": PlotLine, "values": Tick, "times": Tick, "limits": PlotLimit, "bands": Band,
    "right_values": Tick,
}  # fmt: skip


class ShownFault(LogError):
    """What was kept can't be used, or can't be kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownView:
    """What the pages of a robot ("" for the only one) showed at `at`, in seconds since the epoch.
    `revision` is that of the panel file, `version` that of the program. `plots` and `lines` are the
    curves of trends and the newest lines of logs with their numbers, by the ids of the widgets;
    `left_out` names the widgets that were too large, and "rows" for those of alarms."""

    at: float
    robot: str
    revision: str
    version: str
    view: View
    plots: Mapping[str, Plot] = field(default_factory=dict)
    lines: Mapping[str, Sequence[tuple[int, Line]]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


class Found(NamedTuple):
    """The view nearest to a stop, None without one, and the files that could not be used, with why."""

    shown: ShownView | None
    faults: tuple[tuple[str, str], ...] = ()


def as_bytes(shown: ShownView, most: int = MOST_BYTES) -> bytes:
    """The content of a file. The largest parts are left out until it has `most` bytes before it is
    packed; ShownFault if it can't have so few."""
    view: Mapping[str, Any] = shown.view
    alarms = {**view["alarms"], ROWS: {}}
    about = {
        "format": FORMAT, "at": shown.at, "robot": shown.robot, "revision": shown.revision,
        "version": shown.version, "view": {**view, "alarms": alarms, "widgets": {}},
    }  # fmt: skip
    parts = {("alarms", ROWS): _json(view["alarms"][ROWS])}
    # One by one: other threads run in between.
    parts |= {("widgets", name): _json(shown_as) for name, shown_as in view["widgets"].items()}
    parts |= {("plots", name): _json(_plot_rows(plot)) for name, plot in shown.plots.items()}
    parts |= {("lines", name): _json(lines) for name, lines in shown.lines.items()}
    left_out = [*shown.left_out]
    size = len(_json(about)) + sum(len(text) + len(name) + 8 for (_, name), text in parts.items())
    for key, text in sorted(parts.items(), key=lambda part: -len(part[1])):
        if size <= most:
            break
        if len(text) < LEAST_LEFT_OUT:
            raise ShownFault(f"it has {size:,} bytes, more than {most:,}")
        del parts[key]
        size -= len(text)
        left_out.append(key[1])
    kept = b",".join(b"[%b,%b]" % (_json(list(key)), text) for key, text in parts.items())
    content = b'%b,"parts":[%b]}' % (_json({**about, "left_out": left_out})[:-1], kept)
    packer = zlib.compressobj(level=6, wbits=PACKED)
    return packer.compress(content) + packer.flush()


def from_bytes(data: bytes) -> ShownView:
    """What is in the content of a file; ShownFault for anything else."""
    try:
        unpacker = zlib.decompressobj(wbits=PACKED)
        text = unpacker.decompress(data, 2 * MOST_BYTES)
        if not unpacker.eof:
            raise ShownFault("it is not whole")
        about = json.loads(text.decode("utf-8", "surrogatepass"), object_hook=_with_text)
        if about["format"] != FORMAT:
            raise ShownFault("another version of this program has written it")
        return _shown(about)
    except (zlib.error, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ShownFault(f"it is damaged: {error!r:.200}") from error


def _shown(about: Mapping[str, Any]) -> ShownView:
    parts: dict[str, dict[str, Any]] = {"alarms": {ROWS: {}}, "widgets": {}, "plots": {}, "lines": {}}
    for (group, name), content in about["parts"]:
        parts[group][name] = content
    view = about["view"]
    alarms = {**view["alarms"], **parts["alarms"]}
    whole = {**view, "alarms": alarms, "widgets": parts["widgets"]}
    if whole.keys() != View.__annotations__.keys():
        raise ShownFault("another version of this program has written it")
    return ShownView(
        at=float(about["at"]),
        robot=str(about["robot"]),
        revision=str(about["revision"]),
        version=str(about["version"]),
        view=cast(View, whole),
        plots={name: _plot(rows) for name, rows in parts["plots"].items()},
        lines={
            name: [(number, Line(*line)) for number, line in lines]
            for name, lines in parts["lines"].items()
        },
        left_out=tuple(map(str, about["left_out"])),
    )


def _json(value: Any) -> bytes:
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), default=_plain)
    return text.encode("utf-8", "surrogatepass")


def _plain(value: Any) -> Any:
    if isinstance(value, Text):
        return {TEXT: value.as_json()}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Sequence | frozenset | set):
        return list(value)
    raise TypeError(f"{type(value).__name__} is in no view")


def _with_text(value: dict[str, Any]) -> Any:
    return text_from(value[TEXT]) if value.keys() == {TEXT} else value


def _plot_rows(plot: Plot) -> dict[str, Sequence[Any]]:
    return {name: getattr(plot, name) for name in PLOT_ROWS}


def _plot(rows: Mapping[str, Any]) -> Plot:
    return Plot(**{name: [make(*row) for row in rows[name]] for name, make in PLOT_ROWS.items()})


# The folder.


def write(data: Path, shown: ShownView) -> None:
    """Keeps it in the data folder; the oldest make room. ShownFault for one that is too large,
    LogError if the disk refuses."""
    content = as_bytes(shown)
    folder = data / FOLDER
    name = f"{round(shown.at * 1000):013d}{f'-{shown.robot}' if shown.robot else ''}.json.gz"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for left in folder.glob(f"*{SUFFIX}"):  # of a server that was killed
            left.unlink(missing_ok=True)
        write_whole(folder / name, content)
        for old in sorted(file.name for file in folder.iterdir() if NAME.fullmatch(file.name))[
            :-MOST_FILES
        ]:
            (folder / old).unlink(missing_ok=True)
    except OSError as error:
        raise LogError(f"{folder}: {error.strerror or error}") from error


def shown_near(data: Path, robot: str, at: float) -> Found:
    """What was shown nearest to a stop of a robot, within the seconds that are one stop."""
    faults: list[tuple[str, str]] = []
    for file in _nearest(data / FOLDER, robot, at):
        try:
            content = file.read_bytes() if not file.is_symlink() else b""
            return Found(from_bytes(content), tuple(faults))
        except (ShownFault, OSError) as error:
            faults.append((f"{FOLDER}/{file.name}", str(error)))
    return Found(None, tuple(faults))


def _nearest(folder: Path, robot: str, at: float) -> Iterator[Path]:
    near: list[tuple[float, Path]] = []
    with suppress(OSError):
        for file in folder.iterdir():
            named = NAME.fullmatch(file.name)
            if named is not None and (named["robot"] or "") == robot:
                apart = abs(int(named["ms"]) / 1000 - at)
                if apart <= AFTER_S:
                    near.append((apart, file))
    yield from (file for _, file in sorted(near))
