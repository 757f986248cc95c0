"""A sent panel on the disk: which files it may have, and that a take is whole or not at all."""

import io
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import pytest

from app.records import sent_panel
from app.records.entry import Origin
from app.records.sent_panel import (
    BACKUPS,
    SENT_NAME,
    SentPanelError,
    SentPanels,
    answered,
    check_name,
    files_hash,
)
from app.system.texts import Text, text_in
from app.system.whole_file import write_whole

PANEL: Final = """\
title = "Cell"
mode = "demo"
{more}
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "{label}"
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
"""
PICTURE: Final = (
    b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 8"><path d="M0 0h8v8z"/></svg>'
)
WHO: Final = Origin(address="192.0.2.7", who="Ada")


def text(label: str, more: str = "") -> str:
    return PANEL.format(label=label, more=more)


def packed(contents: Mapping[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return data.getvalue()


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell.toml"
    path.write_text(text("Start"))
    return path


def checked(panel: Path, contents: Mapping[str, bytes]) -> dict[str, Any]:
    """The answer of a check, as the child process gives it."""
    archive = panel.parent.parent / "sent.zip"
    archive.write_bytes(packed(contents))
    (answer,) = answered("check", str(panel), str(archive))
    return answer


def taken(panel: Path, answer: Mapping[str, Any]) -> dict[str, Any]:
    about = {"who": WHO.who, "address": WHO.address, "browser": ""}
    (done,) = answered("take", str(panel), answer["sent"], answer["compared"], about)
    return done


def refusal(answer: Mapping[str, Any]) -> str:
    reason = text_in(answer["refusal"])
    assert isinstance(reason, Text)
    return reason.code


NAMES: Final = {
    "pictures/a.svg": True,
    "panel.toml": True,
    "templates/main page.html": True,
    "": False,
    "/etc/passwd": False,
    "../other.svg": False,
    "pictures/../../a": False,
    "pictures//a.svg": False,
    "./a.svg": False,
    "a\\b.svg": False,
    "a\0b": False,
    ".panel.toml.sent/state.json": False,
    ".hidden": False,
    "zenoh.json5": False,
    "kiosk.toml": False,
    "panel.toml.before": False,
    "release-keys.pub": False,
    "x" * 201: False,
}


@pytest.mark.parametrize(("name", "is_good"), NAMES.items(), ids=range(len(NAMES)))
def test_names_of_sent_files(name: str, is_good: bool) -> None:
    if is_good:
        check_name(name)
        return
    with pytest.raises(SentPanelError):
        check_name(name)


REFUSED: Final[Mapping[str, tuple[str, Callable[[], bytes]]]] = {
    "no zip file": ("panel_sent_no_zip", lambda: b"title = 1"),
    "cut off": ("panel_sent_no_zip", lambda: packed({SENT_NAME: b"x" * 5000})[:-40]),
    "no panel file": ("panel_sent_no_zip", lambda: packed({"a.svg": PICTURE})),
    "a name above the folder": (
        "panel_sent_name",
        lambda: packed({SENT_NAME: b"", "../a.svg": PICTURE}),
    ),
    "a bomb": ("panel_sent_large", lambda: packed({SENT_NAME: b" " * (sent_panel.MOST_BYTES + 1)})),
    "too many files": (
        "panel_sent_large",
        lambda: packed({SENT_NAME: b""} | {f"a/{n}": b"" for n in range(sent_panel.MOST_FILES)}),
    ),
}


@pytest.mark.parametrize(("code", "archive"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_panel_is_refused(panel: Path, code: str, archive: Callable[[], bytes]) -> None:
    path = panel.parent / "sent.zip"
    path.write_bytes(archive())
    (answer,) = answered("check", str(panel), str(path))
    assert refusal(answer) == code
    assert panel.read_text() == text("Start")


def test_check_names_faults_notes_and_differences(panel: Path) -> None:
    answer = checked(panel, {SENT_NAME: text("Start", "colour = 1").encode()})
    assert [(fault["place"], fault["line"]) for fault in answer["faults"]] == [("colour", 3)]
    assert answer["sent"] == ""

    more = 'pictures = "pictures"\nbrand = { logo = "logo.svg" }'
    sent = {SENT_NAME: text("Go", more).encode(), "pictures/logo.svg": PICTURE, "other.txt": b"x"}
    answer = checked(panel, sent)
    assert answer["faults"] == []
    assert '-label = "Start"\n+label = "Go"\n' in answer["diff"]
    assert answer["files"] == [{"name": "pictures/logo.svg", "change": "added"}]
    assert panel.read_text() == text("Start")
    staged = sorted(path.name for path in (panel.parent / ".cell.toml.sent/staged").iterdir())
    assert staged == sorted([answer["sent"], f"{answer['sent']}.json"])


def test_take_brings_its_files_and_removes_those_that_nothing_uses(panel: Path) -> None:
    more = 'pictures = "pictures"\nbrand = { logo = "logo.svg" }'
    own = {SENT_NAME: text("Go", more).encode(), "pictures/logo.svg": PICTURE, "other.txt": b"x"}
    os.chmod(panel, 0o640)
    assert taken(panel, checked(panel, own)) == {"is_new": True}
    assert panel.read_bytes() == own[SENT_NAME]
    assert panel.stat().st_mode & 0o777 == 0o640
    assert (panel.parent / "pictures/logo.svg").read_bytes() == PICTURE
    assert not (panel.parent / "other.txt").exists()
    sent = SentPanels(panel)
    last = sent.last()
    assert last is not None
    assert (last.phase, last.who, last.address, last.created) == (
        "trial",
        "Ada",
        "192.0.2.7",
        ("pictures/logo.svg",),
    )
    sent.begin_start()
    sent.came_up()
    back = checked(panel, {SENT_NAME: text("Start").encode()})
    assert back["files"] == [{"name": "pictures/logo.svg", "change": "removed"}]
    assert taken(panel, back) == {"is_new": True}
    assert not (panel.parent / "pictures/logo.svg").exists()
    assert taken(panel, back) == {"is_new": False}
    assert sent.failed("no place")
    assert panel.read_bytes() == own[SENT_NAME]
    assert (panel.parent / "pictures/logo.svg").read_bytes() == PICTURE


def test_take_is_refused_if_the_file_in_force_is_another(panel: Path) -> None:
    answer = checked(panel, {SENT_NAME: text("Go").encode()})
    panel.write_text(text("By hand"))
    assert refusal(taken(panel, answer)) == "panel_sent_changed"
    assert panel.read_text() == text("By hand")
    assert refusal(taken(panel, {"sent": "0" * 64, "compared": "0" * 64})) == "panel_sent_gone"


def test_take_does_not_follow_a_link_out_of_the_folder(panel: Path, tmp_path: Path) -> None:
    outside = tmp_path.parent / f"{tmp_path.name}-outside"
    outside.mkdir()
    (panel.parent / "pictures").symlink_to(outside)
    more = 'pictures = "pictures"\nbrand = { logo = "logo.svg" }'
    sent = {SENT_NAME: text("Go", more).encode(), "pictures/logo.svg": PICTURE}
    assert refusal(taken(panel, checked(panel, sent))) == "panel_sent_name"
    assert panel.read_text() == text("Start")
    assert [*outside.iterdir()] == []


def test_backups_are_numbered_and_bounded(panel: Path) -> None:
    sent = SentPanels(panel)
    for number in range(BACKUPS + 3):
        old, new = ({SENT_NAME: text(f"Start {at}").encode()} for at in (number, number + 1))
        panel.write_bytes(old[SENT_NAME])
        sent.take(new, old, files_hash(old), WHO)
        sent.came_up()
    names = sorted(path.name for path in (sent.folder / "backups").iterdir())
    assert names == [f"{number:04}" for number in range(4, BACKUPS + 4)]
    assert (sent.folder / "backups" / names[-1] / SENT_NAME).read_bytes() == old[SENT_NAME]


# What a start makes of the last take, by its phase and the starts that it had.
STARTS: Final = {
    "half written": ({"phase": "writing"}, "restored", "panel_restored_interrupted"),
    "the first start": ({"phase": "trial", "starts": 0}, "trial", ""),
    "it did not come up": ({"phase": "trial", "starts": 1}, "restored", "panel_restored_no_start"),
    "it came up": ({"phase": "kept"}, "kept", ""),
    "taken back before": ({"phase": "restored"}, "restored", ""),
}


@pytest.mark.parametrize(("change", "phase", "reason"), STARTS.values(), ids=STARTS)
def test_start_after_a_take(panel: Path, change: Mapping[str, Any], phase: str, reason: str) -> None:
    sent, old, new = (
        SentPanels(panel),
        {SENT_NAME: panel.read_bytes()},
        {SENT_NAME: text("Go").encode()},
    )
    sent.take(new, old, files_hash(old), WHO)
    state = sent.folder / "state.json"
    state.write_text(json.dumps(json.loads(state.read_text()) | change))
    for _ in range(2):
        SentPanels(panel).begin_start()
        if reason:
            assert panel.read_bytes() == old[SENT_NAME]
        last = sent.last()
        assert last is not None
        assert last.phase == phase
        assert (last.reason_text.code if isinstance(last.reason_text, Text) else "") == reason
        sent.ended_in_order()


STEPS: Final = 40  # more than a take has


def test_take_that_is_killed_leaves_the_old_or_the_new_panel(panel: Path) -> None:
    folder, sent = panel.parent, SentPanels(panel)
    first = {"pictures/a.svg": PICTURE, "pictures/b.svg": PICTURE}
    old = {SENT_NAME: text("Start", 'pictures = "pictures"').encode(), **first}
    new = {SENT_NAME: text("Go", 'pictures = "pictures"').encode(), "pictures/b.svg": PICTURE + b" "}
    new["pictures/c.svg"] = PICTURE
    (folder / "pictures").mkdir()
    seen = set()
    for step in range(STEPS):
        for path in (folder / "pictures").iterdir():
            path.unlink()
        for name, data in old.items():
            (panel if name == SENT_NAME else folder / name).write_bytes(data)
        if child := os.fork():
            _, status = os.waitpid(child, 0)
        else:
            _take_and_die(sent, new, old, step)
        SentPanels(panel).begin_start()
        there = {
            SENT_NAME: panel.read_bytes(),
            **{f"pictures/{path.name}": path.read_bytes() for path in (folder / "pictures").iterdir()},
        }
        assert there in (old, new), step
        seen.add("old" if there == old else "new")
        if os.waitstatus_to_exitcode(status) == 0:
            break
        sent.came_up()
    assert os.waitstatus_to_exitcode(status) == 0, "all steps were tried"
    assert seen == {"old", "new"}


def _take_and_die(
    sent: SentPanels, new: Mapping[str, bytes], old: Mapping[str, bytes], step: int
) -> None:
    """Ends this process at a change of the disk: a write, a rename or a removal."""
    left = step

    def dying(call: Callable[..., Any]) -> Callable[..., Any]:
        def dies(*arguments: Any, **more: Any) -> Any:
            nonlocal left
            if left == 0:
                os._exit(1)
            left -= 1
            return call(*arguments, **more)

        return dies

    try:
        for name in ("replace", "rename", "unlink"):
            setattr(Path, name, dying(getattr(Path, name)))
        vars(sent_panel)["write_whole"] = dying(write_whole)
        sent.take(new, old, files_hash(old), WHO)
        os._exit(0)
    finally:
        os._exit(2)
