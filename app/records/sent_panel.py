"""A panel file that was sent to this server: how it replaces the one in force, on the disk.

Beside the panel file, in the folder `.panel.toml.sent`:

    staged/<hash>/        a sent panel with its files, checked, and `<hash>.json` with their names
    backups/0001/         what a take replaced, the newest `BACKUPS`
    drafts/               what is written next
    state.json            the last take, and its result

A take is `writing`, then `trial` until the server has run with it for a moment, then `kept`. A server
that starts in between finds it: what was only half written, and a panel with which the server did not
come up, is `restored` from the backup before any panel is read. All of this blocks.
"""

import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Final, Literal

from app.records.entry import Origin, reason_as_json
from app.records.starts import list_digest, sha256
from app.system.errors import KioskError, os_error_text
from app.system.texts import Text, TextLike, say, text_in
from app.system.whole_file import sync_folder, write_whole

if TYPE_CHECKING:
    from app.panel import Panel

SENT_NAME: Final = "panel.toml"  # of the panel file in what is sent
MOST_BYTES: Final = 32_000_000  # of all files together
MOST_FILES: Final = 2_000
LONGEST_NAME: Final = 200
BACKUPS: Final = 20
STAGED: Final = 2

Phase = Literal["writing", "trial", "kept", "restored"]


class SentPanelError(KioskError):
    """What was sent can't be taken; the text says what is right."""

    status = 422


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """The last take. `old` and `new` are the hashes of the panel with its files; `created` are the
    files that were not there before, `at` and `since` are ISO 8601, `reason` is a text as JSON.
    `logged`: the operator's log has its result."""

    phase: Phase
    old: str
    new: str
    backup: int
    at: str
    created: tuple[str, ...] = ()
    who: str = ""
    address: str = ""
    browser: str = ""
    since: str = ""
    starts: int = 0
    reason: str = ""
    logged: bool = False

    @property
    def reason_text(self) -> TextLike:
        try:
            return text_in(self.reason) if self.reason else ""
        except ValueError:
            return self.reason


def panel_files(path: Path, panel: "Panel") -> dict[str, Path]:
    """What a loaded panel uses of the folder of its file: names relative to it → paths. The panel file
    itself is `SENT_NAME`; what has an absolute path elsewhere is not there."""
    from app.ros.messages.packages import package_files

    named: list[Path] = [*panel.templates, *panel.styles, *panel.geojson_files, *panel.font_files]
    named += panel.picture_files.values()
    for folder in panel.interfaces:
        named += package_files(Path(folder))
    files = {SENT_NAME: path}
    for each in named:
        with suppress(ValueError):
            files[Path(each).relative_to(path.parent).as_posix()] = Path(each)
    return files


def files_hash(contents: Mapping[str, bytes]) -> str:
    """One hash for a panel with its files, by their names."""
    return list_digest((name, sha256(data)) for name, data in contents.items())


def check_name(name: str) -> None:
    """SentPanelError for a name that is not below the panel's folder, or could be a file of the
    installation."""
    path = PurePosixPath(name)
    parts = name.split("/")
    is_plain = name.isprintable() and "\\" not in name and len(name) <= LONGEST_NAME
    if not is_plain or path.is_absolute() or any(part in ("", ".", "..") for part in parts):
        raise SentPanelError(say("panel_sent_name", name=name[:80]))
    if name != SENT_NAME and (parts[0].startswith(".") or (len(parts) == 1 and _is_reserved(name))):
        raise SentPanelError(say("panel_sent_name", name=name[:80]))


def _is_reserved(name: str) -> bool:
    """Whether a name is that of another file of an installation."""
    return name.startswith((SENT_NAME, "zenoh.json5", "kiosk.toml", "router.json5", "release-keys.pub"))


class SentPanels:
    """What was sent for one panel file."""

    def __init__(self, panel: Path) -> None:
        self.panel = panel
        self.folder = panel.parent / f".{panel.name}.sent"

    @property
    def _state(self) -> Path:
        return self.folder / "state.json"

    def last(self) -> Take | None:
        """The last take; None without one."""
        try:
            content: dict[str, Any] = json.loads(self._state.read_text(encoding="utf-8"))
            return Take(**{**content, "created": tuple(content["created"])})
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def refusal(self) -> Text | None:
        """Why nothing can be written where the panel file is; None if it can."""
        for place in (self.panel, self.panel.parent):
            if not os.access(place, os.W_OK):
                return say("panel_sent_read_only", file=str(place))
        return None

    # What was sent, until it is taken.

    def stage(self, contents: Mapping[str, bytes]) -> Path:
        """Writes a panel and its files into a folder of their own; returns the panel file there."""
        staged = self.folder / "staged"
        staged.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder = staged / f"new-{secrets.token_hex(8)}"
        for name, data in contents.items():
            check_name(name)
            path = self._place(folder, name)
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder / self.panel.name

    def keep_staged(self, folder: Path, names: Iterable[str]) -> str:
        """Keeps a staged panel, of which these files are used; returns its hash. The newest stay."""
        contents = {name: self._place(folder, name).read_bytes() for name in names}
        digest = files_hash(contents)
        staged = folder.parent
        listed = staged / f"{digest}.json"
        write_whole(listed, json.dumps(sorted(contents)).encode())
        with suppress(OSError):  # it is there already
            folder.rename(staged / digest)
        self.drop_staged(folder)
        os.utime(listed)
        for old in sorted(staged.glob("*.json"), key=lambda path: -path.stat().st_mtime_ns)[STAGED:]:
            self.drop_staged(staged / old.stem)
            old.unlink(missing_ok=True)
        return digest

    def drop_staged(self, folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)

    def is_staged(self, digest: str) -> bool:
        return (self.folder / "staged" / f"{digest}.json").is_file()

    def staged(self, digest: str) -> dict[str, bytes] | None:
        """The files of a staged panel, by their names; None if it is not there any more, or changed."""
        staged = self.folder / "staged"
        try:
            names = json.loads((staged / f"{digest}.json").read_text(encoding="utf-8"))
            contents = {name: self._place(staged / digest, name).read_bytes() for name in names}
        except (OSError, ValueError, TypeError):
            return None
        return contents if files_hash(contents) == digest else None

    # A take, and its end.

    def take(
        self, new: Mapping[str, bytes], old: Mapping[str, bytes], compared: str, origin: Origin
    ) -> Take:
        """Replaces the files in force by others; SentPanelError if what is in force has another hash
        than `compared`, OSError. `origin` is who sent them."""
        before = {**old, **dict(self._overwritten([*new], [*old]))}
        if files_hash(old) != compared:
            raise SentPanelError(say("panel_sent_changed"))
        for name in new:
            self._confine(name)
        number = self._back_up(before)
        created = tuple(sorted(set(new) - set(before)))
        take = Take(
            phase="writing",
            old=compared,
            new=files_hash(new),
            backup=number,
            at=_now(),
            created=created,
            who=origin.who,
            address=origin.address,
            browser=origin.browser,
        )
        self._write_state(take)
        try:
            self._replace(new, set(old) - set(new))
        except OSError:
            self._restore(take, say("panel_restored_not_written"))
            raise
        take = replace(take, phase="trial")
        self._write_state(take)
        return take

    def begin_start(self) -> None:
        """Call it before a start reads the panel file: takes back what is half written or failed."""
        take = self.last()
        if take is None:
            return
        if take.phase == "writing":
            self._restore(take, say("panel_restored_interrupted"))
        elif take.phase == "trial" and take.starts:
            self._restore(take, say("panel_restored_no_start"))
        elif take.phase == "trial":
            self._write_state(replace(take, starts=1))

    def came_up(self) -> None:
        """The server runs with what was sent: it stays."""
        if (take := self.last()) is not None and take.phase == "trial":
            self._write_state(replace(take, phase="kept", since=_now()))

    def ended_in_order(self) -> None:
        """The server was ended before it had run for long enough: its start does not count."""
        if (take := self.last()) is not None and take.phase == "trial":
            self._write_state(replace(take, starts=0))

    def failed(self, reason: str) -> bool:
        """The server can't start with what was sent: it is taken back. False without such a take."""
        take = self.last()
        if take is None or take.phase != "trial":
            return False
        self._restore(take, say("panel_restored_fault", why=reason[:400]))
        return True

    def mark_logged(self) -> None:
        if (take := self.last()) is not None:
            self._write_state(replace(take, logged=True))

    # The disk.

    def _place(self, folder: Path, name: str) -> Path:
        return folder / (self.panel.name if name == SENT_NAME else name)

    def _overwritten(self, new: Sequence[str], known: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """The files that would be overwritten although the panel in force does not use them."""
        for name in set(new) - set(known):
            with suppress(FileNotFoundError):
                yield name, self._place(self.panel.parent, name).read_bytes()

    def _confine(self, name: str) -> None:
        """SentPanelError if a folder of the name is a link out of the panel's folder."""
        parent = self._place(self.panel.parent, name).parent
        if not parent.resolve().is_relative_to(self.panel.parent.resolve()):
            raise SentPanelError(say("panel_sent_name", name=name[:80]))

    def _back_up(self, contents: Mapping[str, bytes]) -> int:
        folder = self.folder / "backups"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        numbers = sorted(int(path.name) for path in folder.iterdir() if path.name.isdecimal())
        number = numbers[-1] + 1 if numbers else 1
        draft = folder / f"new-{secrets.token_hex(4)}"
        for name, data in contents.items():
            path = draft / name
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_whole(path, data)
        draft.rename(folder / f"{number:04}")
        sync_folder(folder)
        for old in numbers[: 1 - BACKUPS]:
            shutil.rmtree(folder / f"{old:04}", ignore_errors=True)
        return number

    def _restore(self, take: Take, reason: Text) -> None:
        """Puts the files of the backup back; done twice, it changes nothing more. OSError."""
        folder = self.folder / "backups" / f"{take.backup:04}"
        contents = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        self._replace(contents, take.created)
        done = replace(take, phase="restored", since=_now(), reason=reason_as_json(reason))
        self._write_state(done)

    def _replace(self, contents: Mapping[str, bytes], removed: Iterable[str]) -> None:
        """Writes all files on the same disk, then takes all places, the panel file's last."""
        folder = self.folder / "drafts"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(mode=0o700, parents=True)
        drafts: list[tuple[Path, Path]] = []
        for number, name in enumerate(sorted(contents, key=lambda name: name == SENT_NAME)):
            path, draft = self._place(self.panel.parent, name), folder / str(number)
            path.parent.mkdir(parents=True, exist_ok=True)
            drafts.append((draft, path))
            write_whole(draft, contents[name], mode=0o644, like=_like(path))
        for draft, path in drafts:
            draft.replace(path)
        for name in removed:
            if name != SENT_NAME:
                self._place(self.panel.parent, name).unlink(missing_ok=True)
        for changed in {path.parent for _, path in drafts}:
            sync_folder(changed)
        shutil.rmtree(folder, ignore_errors=True)

    def _write_state(self, take: Take) -> None:
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_whole(self._state, json.dumps(asdict(take)).encode())


def _like(path: Path) -> os.stat_result | None:
    with suppress(FileNotFoundError):
        return path.stat()
    return None


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


# What a child process does: reading, checking and comparing take time of the interpreter.


def answered(work: str, *arguments: Any) -> Iterator[dict[str, Any]]:
    """The answer of a function below, by its name; `refusal` is why there is none, a text as JSON."""
    try:
        yield WORKS[work](*arguments)
    except SentPanelError as error:
        yield {"refusal": reason_as_json(error.text)}


def _read(path: str) -> dict[str, Any]:
    """The text of the panel file, its hash with its files, and their sizes."""
    contents = _in_force(Path(path))
    return {
        "text": contents[SENT_NAME].decode("utf-8", "replace"),
        "hash": files_hash(contents),
        "files": [
            {"name": name, "sha256": sha256(data), "size": len(data)}
            for name, data in sorted(contents.items())
        ],
    }


def _check(path: str, archive: str) -> dict[str, Any]:
    """Stages what was sent in a zip file, and says what `check` says of it and how it differs from what
    is in force."""
    sent = SentPanels(Path(path))
    old = _in_force(Path(path))
    staged = sent.stage(_unpacked(Path(archive)))
    try:
        answer = _checked(staged)
        names = answer.pop("names")
        new = {name: sent._place(staged.parent, name).read_bytes() for name in names}
        return {
            **answer,
            "compared": files_hash(old),
            "sent": sent.keep_staged(staged.parent, names) if not answer["faults"] else "",
            "diff": _diff(old[SENT_NAME], new[SENT_NAME]),
            "files": _file_changes(old, new) if not answer["faults"] else [],
        }
    finally:
        sent.drop_staged(staged.parent)


def _take(path: str, digest: str, compared: str, about: dict[str, str]) -> dict[str, Any]:
    """Takes a staged panel; `is_new` is false if it is in force already."""
    sent = SentPanels(Path(path))
    old = _in_force(Path(path))
    if files_hash(old) == digest:
        return {"is_new": False}
    new = sent.staged(digest)
    if new is None:
        raise SentPanelError(say("panel_sent_gone"))
    try:
        sent.take(new, old, compared, Origin(**about))
    except OSError as error:
        raise SentPanelError(say("panel_sent_not_written", why=os_error_text(error))) from error
    return {"is_new": True}


WORKS: Final[Mapping[str, Callable[..., dict[str, Any]]]] = {
    "read": _read,
    "check": _check,
    "take": _take,
}


def _in_force(path: Path) -> dict[str, bytes]:
    """The contents of the panel file and of what it uses, by their names; of a file with faults its own
    alone."""
    from app.panel import load_panel
    from app.system.errors import PanelError

    try:
        files = {SENT_NAME: path}
        with suppress(PanelError):
            files = panel_files(path, load_panel(path))
        return {name: each.read_bytes() for name, each in files.items()}
    except OSError as error:
        raise SentPanelError(say("panel_sent_unreadable", why=os_error_text(error))) from error


def _checked(path: Path) -> dict[str, Any]:
    """What `check` says of a staged panel, its title, and the names of the files that it uses."""
    from app.panel import check_panel
    from app.system.errors import PanelError

    try:
        result = check_panel(path)
    except PanelError as error:
        faults = [_remark(fault) for fault in error.faults]
        return {"title": "", "faults": faults, "notes": [], "names": [SENT_NAME]}
    return {
        "title": str(result.panel.title),
        "faults": [],
        "notes": [_remark(note) for note in result.notes],
        "names": sorted(panel_files(path, result.panel)),
    }


def _remark(remark: Any) -> dict[str, Any]:
    return {
        "place": remark.place,
        "id": remark.id,
        "line": remark.line,
        "message": remark.message,
    }


def _unpacked(archive: Path) -> dict[str, bytes]:
    """The files of a zip file, within the limits."""
    import zipfile

    contents: dict[str, bytes] = {}
    room = MOST_BYTES
    try:
        with zipfile.ZipFile(archive) as packed:
            entries = [entry for entry in packed.infolist() if not entry.is_dir()]
            if len(entries) > MOST_FILES:
                raise SentPanelError(say("panel_sent_large", most=str(MOST_BYTES // 1_000_000)))
            for entry in entries:
                check_name(entry.filename)
                with packed.open(entry) as file:
                    data = file.read(room + 1)
                room -= len(data)
                if room < 0:
                    raise SentPanelError(say("panel_sent_large", most=str(MOST_BYTES // 1_000_000)))
                contents[entry.filename] = data
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise SentPanelError(say("panel_sent_no_zip", why=str(error))) from error
    if SENT_NAME not in contents:
        raise SentPanelError(say("panel_sent_no_zip", why=f'it has no "{SENT_NAME}"'))
    return contents


def _diff(old: bytes, new: bytes) -> str:
    """As `diff -u` prints it."""
    import difflib

    before, after = (data.decode("utf-8", "replace").splitlines(keepends=True) for data in (old, new))
    lines = difflib.unified_diff(before, after, "in force", "sent")
    return "".join(line if line.endswith("\n") else f"{line}\n" for line in lines)


def _file_changes(old: Mapping[str, bytes], new: Mapping[str, bytes]) -> list[dict[str, str]]:
    changes = []
    for name in sorted({*old, *new} - {SENT_NAME}):
        if old.get(name) == new.get(name):
            continue
        change = "added" if name not in old else "removed" if name not in new else "changed"
        changes.append({"name": name, "change": change})
    return changes


def short(digest: str) -> str:
    """As the log and the pages show a hash."""
    return digest[:12]
