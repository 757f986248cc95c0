"""The exceptions of this package, with the HTTP status of each.

    KioskError
    ├── SettingsError          –    an environment variable, or a file it names, is unusable
    ├── PanelError             –    the panel file has faults; `faults` lists them with their places
    ├── KindError              –    a kind of widgets lacks a part
    ├── InterfaceError         –    a ROS 2 type or field does not exist in the definitions
    ├── FieldError             422  a field does not accept a value; `field` is its path
    ├── InputError             422  a request is malformed
    ├── RoleNeeded             403  the client has not the role or group that it needs
    ├── NotFound               404  a page or widget does not exist
    ├── PressRefused           409  the permission was lost right before the message was sent
    ├── TooSlow                408  a request body took too long
    ├── TooMany                429  a limit is reached; `retry_after_s` is when to try again
    ├── RecordingError         –    a recording can't be replayed
    ├── DecodeError            –    bytes are not a message of the type
    ├── LinkError              503  Zenoh refused; nothing was sent
    ├── DoctorError            503  the doctor could not check, or collected no bundle
    └── LogError               503  the operator's log can't be written or read
        ├── SearchTooLong      503  a search takes too long
        ├── LogCorrupt         –    the log's file is damaged; a new one is needed
        ├── LogGone            –    the log's file, or one beside it, was removed or renamed
        └── FolderInUse        –    another process holds the data folder, or may hold it

`app/web/error_pages.py` maps them to HTTP responses. "–": never sent to a client as such.
"""

import errno
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from app.system.printable import printable
from app.system.texts import Text, TextLike, say

# The cause of a refusal, as a receipt has it.
Cause = Literal["", "interlock", "input", "link", "log", "time", "limit", "role"]

# The codes of the system's errors that an operator may read, such as a disk that is full.
OS_ERRORS: Final[Mapping[int, str]] = {
    errno.ENOSPC: "disk_full",
    errno.EROFS: "disk_read_only",
    errno.EIO: "disk_failed",
    errno.EACCES: "disk_file_not_permitted",
    errno.EPERM: "disk_file_not_permitted",
    errno.ENOENT: "disk_file_not_found",
    errno.EEXIST: "disk_not_a_folder",
    errno.ENOTDIR: "disk_not_a_folder",
}


class KioskError(Exception):
    """The base class; `status` is the HTTP status of its response, `text` the message for a reader's
    language. Its text is made printable, because it may contain text of a robot or a browser."""

    status = 500

    def __str__(self) -> str:
        return printable(super().__str__())

    @property
    def text(self) -> TextLike:
        """The sentence that it was raised with, or its message, which is in no language."""
        argument = self.args[0] if self.args else ""
        return argument if isinstance(argument, Text) else str(self)


class SettingsError(KioskError):
    pass


@dataclass(frozen=True, slots=True)
class Remark:
    """A remark about one place of a panel file.

    `place` is like `page[0].widget[2].topic`, "" for the whole file. `id` is that of the widget,
    interlock, robot or page around it, "" if unknown. `line` counts from 1, 0 if unknown.
    """

    place: str
    message: str
    id: str = ""
    line: int = 0

    @property
    def location(self) -> str:
        """`page[0].widget[2].topic "speed", line 41`."""
        named = f'{self.place} "{self.id}"' if self.id else self.place
        return ", ".join(filter(None, (named, f"line {self.line}" if self.line else "")))

    def __str__(self) -> str:
        return f"{self.location}: {self.message}" if self.location else self.message


@dataclass(frozen=True, slots=True)
class Fault(Remark):
    """An error in a panel file. Faults with the same `cause` (not "") are one mistake."""

    cause: str = field(default="", compare=False)

    __str__ = Remark.__str__

    def at(self, place: str) -> "Fault":
        """The fault at another place."""
        return replace(self, place=place)


class Note(Remark):
    """A hint about a panel file that is not an error."""

    __slots__ = ()

    def __str__(self) -> str:
        return f"note: {super().__str__()}"


class PanelError(KioskError):
    def __init__(self, path: str, faults: tuple[Fault, ...], *, unreadable: bool = False) -> None:
        super().__init__("\n".join([f"{path} can't be used:", *(f"  {f}" for f in faults)]))
        self.path = path
        self.faults = faults
        self.unreadable = unreadable


class InterfaceError(KioskError):
    """`source` is the interface file or folder at fault, or None. `package` is the missing package, or
    "". Errors with the same `cause` (not "") are one mistake."""

    def __init__(
        self, message: str, source: Path | None = None, package: str = "", cause: str = ""
    ) -> None:
        super().__init__(message)
        self.source = source
        self.package = package
        self.cause = cause


class KindError(KioskError):
    """A kind of widgets lacks a part, which the message names: an error of the program."""

    def __init__(self, kind: str, part: str, remedy: str) -> None:
        super().__init__(f'the widget kind "{kind}" has no {part}: {remedy}')


class FieldError(KioskError):
    status = 422

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}" if field else message)
        self.field = field
        self.message = message


class InputError(KioskError):
    status = 422


class NotFound(KioskError):
    status = 404


class RoleNeeded(KioskError):
    """`needs` is the role or group."""

    status = 403

    def __init__(self, message: TextLike, needs: str) -> None:
        super().__init__(message)
        self.needs = needs


class PressRefused(KioskError):
    """`reason` and `cause` are those of the receipt."""

    status = 409

    def __init__(self, reason: TextLike, cause: Cause) -> None:
        super().__init__(reason)
        self.reason = reason
        self.cause = cause


class TooSlow(KioskError):
    status = 408


class TooMany(KioskError):
    status = 429

    def __init__(self, message: TextLike, again_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = again_s


class RecordingError(KioskError):
    pass


class DecodeError(KioskError):
    pass


class LinkError(KioskError):
    status = 503


class DoctorError(KioskError):
    status = 503


class LogError(KioskError):
    """The message is a reason to be put into a sentence: "no space left on device"."""

    status = 503


class SearchTooLong(LogError):
    pass


class LogCorrupt(LogError):
    pass


class LogGone(LogError):
    """`itself`: the log's own file is gone, and a new one has to be begun."""

    def __init__(self, message: TextLike, *, itself: bool) -> None:
        super().__init__(message)
        self.is_main_file = itself


class FolderInUse(LogError):
    pass


def os_error_text(error: OSError) -> TextLike:
    """The reason of an error of the operating system, to be put into a sentence, with its file. Rare
    ones are in the system's words, in no language."""
    code = OS_ERRORS.get(error.errno or 0)
    words = error.strerror or str(error)
    why = say(code) if code else words[:1].lower() + words[1:]
    return say("with_file", why=why, file=str(error.filename)) if error.filename else why
