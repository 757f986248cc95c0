"""The dialog that sends the panel file to a kiosk."""

from collections.abc import Mapping
from typing import Any, Final

from app.system.texts import TextLike, say
from app.system.version import installed_version
from app.tools.editor.editor import PartRequest
from app.tools.editor.sending import WAITING, Sending

MOST_LINES: Final = 400  # of a difference

CHANGES: Final = {
    "added": "send_file_added",
    "changed": "send_file_changed",
    "removed": "send_file_removed",
}
WORDS: Final = {
    "title": say("send_title"),
    "about": say("send_about"),
    "address": say("send_address_label"),
    "token": say("send_token_label"),
    "token_kept": say("send_token_kept"),
    "trust": say("send_trust_label"),
    "trust_about": say("send_trust_about"),
    "compare": say("send_compare"),
    "send": say("send_button"),
    "close": say("close"),
    "kiosk": say("send_kiosk"),
    "shows": say("send_shows"),
    "control": say("send_control"),
    "no_control": say("send_no_control"),
    "version": say("send_version"),
    "check": say("send_check"),
    "good": say("editor_no_faults"),
    "files": say("send_files"),
    "difference": say("send_difference"),
    "same": say("send_same"),
}


def send_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    editor = request.editor
    sending = editor.sending(request.person)
    check = sending.check
    lines = str(check.get("diff", "")).splitlines()[2:] if check else []
    return "_send.html", {
        "words": WORDS,
        "file": editor.session.path.name,
        "sending": sending,
        "is_waiting": sending.is_busy or sending.stage in WAITING,
        "unsaved": say("send_unsaved") if editor.session.unsaved else "",
        "status": _status(sending),
        "version_note": _version_note(sending),
        "controllers": [_controller(each) for each in sending.kiosk.get("control", ())],
        "faults": _remarks(check.get("faults", ())),
        "notes": _remarks(check.get("notes", ())),
        "changes": [
            (say(CHANGES[each["change"]]), each["name"])
            for each in check.get("files", ())
            if each.get("change") in CHANGES
        ],
        "lines": [(_kind(line), line) for line in lines[:MOST_LINES]],
        "more": say("send_more_lines", number=str(len(lines) - MOST_LINES))
        if len(lines) > MOST_LINES
        else "",
        "is_same": bool(check) and not check["faults"] and check["sent"] == check["compared"],
    }


def _status(sending: Sending) -> TextLike:
    if sending.stage == "sending":
        return say("send_sending")
    if sending.stage == "starting":
        return say("send_starting")
    if sending.is_busy:
        return say("send_comparing")
    if sending.check and sending.check["refusal"] and sending.stage == "compared":
        return str(sending.check["refusal"])
    return sending.problem or sending.result


def _version_note(sending: Sending) -> TextLike:
    other = sending.other_version if sending.kiosk else ""
    return say("send_other_version", kiosk=other, editor=installed_version()) if other else ""


def _controller(each: Mapping[str, Any]) -> str:
    robot, name = str(each.get("robot", "")), str(each.get("name", ""))
    return f"{robot}: {name}" if robot else name


def _remarks(remarks: Any) -> list[tuple[str, str]]:
    """(place with its line, message)."""
    return [
        (
            ", ".join(filter(None, (str(each["place"]), f"{each['line']}" if each["line"] else ""))),
            str(each["message"]),
        )
        for each in remarks
    ]


def _kind(line: str) -> str:
    return {"+": "added", "-": "removed", "@": "gap"}.get(line[:1], "same")
