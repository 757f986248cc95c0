"""Every error that the kiosk raises by itself.

    KioskError                 what a client gets for it
    ├── SettingsError          –    an environment variable or a file it names is unusable
    ├── PanelError             –    the panel file has faults; `faults` has each with its place
    ├── InterfaceError         –    a ROS 2 type or field that the definitions don't have
    ├── FieldError             422  a value that its field does not take; `field` names it
    ├── InputError             422  a request that is not what the contract says
    ├── NotFound               404  no such page or widget
    ├── PressRefused           409  what permitted it is gone, right before it would have been sent
    ├── TooSlow                408  a body that took too long
    ├── TooMany                429  more than may be done at a time; `again_s` says when to try again
    ├── DecodeError            –    bytes that are not a message of the type
    ├── LinkError              503  Zenoh refused; nothing was sent
    └── LogError               503  the operator's log can't be written or read
        ├── SearchTooLong      503  what is searched for takes too long to find
        ├── LogCorrupt         –    its file is damaged: a new one has to be begun
        ├── LogGone            –    its file, or one beside it, was removed or renamed
        └── FolderInUse        –    another process holds the data folder, or may do so

One handler (`routes.on_kiosk_error`) maps them to HTTP; "–" never reaches a client by itself.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from app.i18n import Text, TextLike
from app.printable import printable

# Why a receipt says that a press was refused.
Cause = Literal["", "interlock", "input", "link", "log", "time", "limit"]


class KioskError(Exception):
    """The root; `status` is the HTTP status of an answer that carries it. Its message may name what a
    robot or a browser sent, and goes to pages and terminals; `text` is it for a reader's language."""

    status = 500

    def __str__(self) -> str:
        return printable(super().__str__())

    @property
    def text(self) -> TextLike:
        """The sentence that it was raised with, or its message, which is in no language."""
        given = self.args[0] if self.args else ""
        return given if isinstance(given, Text) else str(self)


class SettingsError(KioskError):
    pass


@dataclass(frozen=True, slots=True)
class Remark:
    """About one place of a panel file: `place` as in `page[0].widget[2].topic`, "" for the whole file;
    `id` of the widget, interlock, robot or page that it is in, and `line` from 1, where they are known.
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
    """What keeps a panel file from being used. Faults of one `cause` that is not "" are one mistake."""

    cause: str = field(default="", compare=False)

    __str__ = Remark.__str__


class Note(Remark):
    """What is no fault, and still worth a look."""

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
    """`source` is the interface file or folder at fault, if it is one of those, `package` the package
    that is not there at all."""

    def __init__(self, message: str, source: Path | None = None, package: str = "") -> None:
        super().__init__(message)
        self.source = source
        self.package = package


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


class PressRefused(KioskError):
    """`cause` is that of the receipt which tells it."""

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


class DecodeError(KioskError):
    pass


class LinkError(KioskError):
    status = 503


class LogError(KioskError):
    """The message is why, to stand in a sentence: "no space left on device"."""

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
