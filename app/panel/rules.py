"""The tables `[access]`, `[access.oidc]`, `[brand]`, `[control]`, `[diagnostics]`, `[embed]`, `[log]`,
`[oee]`, `[record]`, `[screen]`, `[site]` and `[state]` of a panel file."""

import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, Final, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field

from app.panel.base import (
    Description,
    Endpoint,
    Icon,
    Id,
    Label,
    Note,
    Seconds,
    SecretFile,
    SecretVariable,
    TopicName,
    each_once,
)
from app.panel.checks.types import value_faults
from app.panel.constants import parent_type
from app.panel.roles import ENGINEER, ROLES
from app.panel.shared_keys import NeedsKey
from app.panel.widgets.displays import (
    LampState,
    PictureName,
    StatesKey,
    StateValue,
    resolve_state_value,
    state_faults,
)
from app.panel.widgets.families import CheckContext, Display, TopicField, TopicSource
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault
from app.system.texts import say

# The table `[access.oidc]` of a panel file: sign-in by the plant's own provider (OpenID Connect).

Group = Annotated[str, Field(min_length=1, max_length=200)]
Groups = Annotated[tuple[Group, ...], Field(strict=False, max_length=50)]
Claim = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.:/-]{1,100}$")]
AcrValue = Annotated[str, Field(pattern=r"^[!-~]{1,200}$")]
LOOPBACK: Final = ("localhost", "127.0.0.1", "::1")


def is_protected(url: str) -> bool:
    """Whether no one on the network can read or forge what this address answers."""
    parts = urlsplit(url)
    return parts.scheme == "https" or (parts.scheme == "http" and parts.hostname in LOOPBACK)


def _check_issuer(issuer: str) -> str:
    parts = urlsplit(issuer)
    if not is_protected(issuer) or not parts.hostname or parts.query or parts.fragment:
        raise ValueError(f'"{issuer}" is not an issuer: an https:// address such as "https://id.plant"')
    return issuer


class OidcRules(Description):
    """The provider, and which of its groups have which role here. The secret of the client is in an
    environment variable of the server, or else in a file there, never in the panel file."""

    issuer: Annotated[str, Field(max_length=300), AfterValidator(_check_issuer)]
    client_id: Annotated[str, Field(min_length=1, max_length=200)]
    name: Annotated[str, Field(min_length=1, max_length=40)]
    secret_env: SecretVariable | None = None
    secret_file: SecretFile | None = None
    user_claim: Claim = "preferred_username"
    groups_claim: Claim = "groups"
    acr_values: Annotated[tuple[AcrValue, ...], Field(strict=False, max_length=20)] = ()
    max_age_s: Annotated[int, Field(gt=0, le=86_400)] | None = None
    viewer: Groups = ()
    operator: Groups = ()
    maintenance: Groups = ()
    engineer: Groups = ()


def _not_a_role(group: str) -> str:
    if group in ROLES:
        raise ValueError(f'"{group}" is a role: a group has another name, such as "quality"')
    return group


class AccessRules(Description):
    """Who may use the panel. `open`: without users, everyone may do everything. A user is signed out
    after `idle_s` seconds without a touch, and `longest_s` seconds after the sign-in; 0: never. A user
    is signed in at `max_sessions` browsers at most. `groups` are the panel's own, beside the roles.
    Signed-in users and programs on other machines have at most the role `remote`. `pin`: PINs are taken
    at the kiosk's own machine only, or anywhere."""

    open: bool = True
    idle_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 600.0
    longest_s: Annotated[float, Field(ge=0, le=2_678_400, allow_inf_nan=False)] = 43_200.0
    max_sessions: Annotated[int, Field(ge=1, le=100)] = 10
    groups: Annotated[
        tuple[Annotated[Id, AfterValidator(_not_a_role)], ...], Field(strict=False, max_length=20)
    ] = ()
    remote: Literal["viewer", "operator", "maintenance", "engineer"] = ENGINEER
    pin: Literal["local", "anywhere"] = "local"
    oidc: OidcRules | None = None


class BrandRules(Description):
    """What stands in the corner above the tabs: a `logo` from the panel's pictures, or a `text`, on a
    `colour`, which is nowhere else."""

    logo: PictureName | None = None
    text: Note | None = None
    colour: Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")] | None = None

    @property
    def ink(self) -> str:
        """The colour of a text on it: the one of black and white with the higher contrast."""
        levels = [int((self.colour or "#d3d8dc")[at : at + 2], 16) / 255 for at in (1, 3, 5)]
        red, green, blue = (level**2.2 for level in levels)
        return "#12171b" if 0.2126 * red + 0.7152 * green + 0.0722 * blue > 0.18 else "#fff"


class ControlRules(Description):
    """After `takeover_after_s` without a touch by the holder, a request succeeds. `local`: browsers on
    the kiosk's own machine may always take over."""

    required: bool
    takeover_after_s: Seconds = 30.0
    local: bool = True


ORIGIN: Final = r"^https?://([a-z0-9-]+(\.[a-z0-9-]+)*|\[[0-9a-f:.]+\])(:[1-9][0-9]{0,4})?$"
Origin = Annotated[str, Field(pattern=ORIGIN, max_length=255)]


class EmbedRules(Description):
    """Pages of these origins may show the panel's pages in a frame. `controls`: also what can be
    pressed."""

    origins: Annotated[tuple[Origin, ...], Field(strict=False, max_length=20)] = ()
    controls: bool = False


class DiagnosticRules(Description):
    """Whether the panel has the page of diagnostics."""

    enabled: bool = True


class LogRules(Description):
    """`required`: while the log can't be written, controls lock. The oldest entries are removed after
    `days`, or when the file is larger than `size_mb` megabytes."""

    enabled: bool = True
    required: bool = True
    days: Annotated[float, Field(gt=0, le=36_500, allow_inf_nan=False)] = 365.0
    size_mb: Annotated[float, Field(ge=8, le=100_000, allow_inf_nan=False)] = 512.0


class RecordRules(Description):
    """Records received messages from `before_s` before each press to `after_s` after it. `topics` are
    some of the panel's subscriptions, None for all. The oldest files are removed when the folder is
    larger than `max_mb` megabytes."""

    before_s: Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)] = 10.0
    after_s: Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)] = 10.0
    max_mb: Annotated[float, Field(ge=16, le=1_000_000, allow_inf_nan=False)] = 512.0
    topics: Annotated[tuple[TopicName, ...] | None, Field(strict=False)] = None


# The table `[site]` of a panel file: what the cell tells of itself to walls, over Zenoh.

# A part of a key expression: none of Zenoh's own signs, and no spaces at its ends.
CHUNK: Final = r"^[^\s/*$?#@]([^/*$?#\x00-\x1f\x7f]{0,62}[^\s/*$?#])?$"


def _check_chunk(name: str) -> str:
    if not re.fullmatch(CHUNK, name):
        raise ValueError(
            f"{format_value(name)} can't be a part of a key expression of Zenoh: 64 characters at most,"
            " none of / * $ ? #, no @ first, and no space at its ends"
        )
    return name


Chunk = Annotated[str, AfterValidator(_check_chunk)]
WALL_URL: Final = r"^https?://[A-Za-z0-9._:\[\]-]+([/?#][!-~]*)?$"
MAX_FIGURES: Final = 4


class SiteRules(Description):
    """The cell is `cell` of the site `name` (default: the panel's title). `url` is where browsers reach
    its panel, `figures` are the ids of readouts, `connect` the Zenoh endpoints of the plant's
    routers."""

    name: Chunk
    cell: Chunk | None = None
    url: Annotated[str, Field(pattern=WALL_URL, max_length=300)] | None = None
    figures: Annotated[
        tuple[Id, ...], Field(strict=False, max_length=MAX_FIGURES), AfterValidator(each_once)
    ] = ()
    connect: Annotated[tuple[Endpoint, ...], Field(strict=False, max_length=8)] = ()


# The table `[screen]` of a panel file: how the touch screen behaves between presses.

Keyboard = Literal["auto", "on", "off"]

CLEANING_S: Final = 30  # how long the screen is locked to be cleaned


class ScreenRules(Description):
    """After `dim_after_s` seconds without a touch the page gets dark; 0: never. `kiosk`: where a finger
    is the main pointer, the browser's own gestures are off. `sounds`: a refused press sounds, unless it
    is turned off in the browser."""

    dim_after_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0
    kiosk: bool = True
    sounds: bool = False


# The table `[state]` of a panel file: what the machine is doing, in one word, as the robot says it.

STATE_ID: Final = "machine_state"
MAX_DETAILS: Final = 2
OF_STOPS: Final = frozenset({"stops", "effects"})  # keys that the display has otherwise, or not


class StateDetail(TopicField):
    """What stands beside the state, such as the mode or the order: a field, after its `label`. `words`
    are what is shown for its values."""

    label: Label | None = None
    words: Mapping[str, Label] = Field(default_factory=dict)


class StateRules(StatesKey, TopicField):
    """The states that the robot reports, with the word and the shape of each; a state that it does not
    report now is shown as not known. `stops` are the values with which the machine has stopped for a
    reason that someone will ask for; `effects` are ids of interlocks, conditions and alarms that only
    follow from a stop."""

    stops: Annotated[tuple[StateValue, ...], Field(strict=False)] | None = None
    effects: Annotated[tuple[Id, ...], Field(strict=False)] = ()
    details: Annotated[tuple[StateDetail, ...], Field(strict=False, max_length=MAX_DETAILS)] = Field(
        (), alias="detail"
    )

    @cached_property
    def display(self) -> "MachineState":
        """The display in the frame of every page."""
        names = type(self).model_fields.keys() - OF_STOPS
        keys: dict[str, Any] = {name: getattr(self, name) for name in names}
        fixed: dict[str, Any] = {"id": STATE_ID, "kind": "state", "label": say("machine_state")}
        fixed["stops"] = self.stop_values
        return MachineState.model_construct(None, **fixed, **keys)

    @cached_property
    def stop_values(self) -> tuple[Any, ...]:
        """The values of `stops`; by default of the states that are red."""
        red = (state.value for state in self.states if state.colour == "red")
        return tuple(red) if self.stops is None else self.stops

    @property
    def playing_values(self) -> tuple[Any, ...]:
        """The values of the states that are shown by the shape "play"."""
        return tuple(state.value for state in self.states if state.shape == "play")

    def with_constants(self, interfaces: Interfaces) -> Self:
        resolved = super().with_constants(interfaces)
        if self.stops is None:
            return resolved
        stops = tuple(self.value_of(value, interfaces) for value in self.stops)
        return resolved.model_copy(update={"stops": stops})

    def value_of(self, value: bool | int | str, interfaces: Interfaces) -> Any:
        """The value of a state in the message: that of a constant by its name."""
        kind = interfaces.field_type(self.type, self.field)
        return resolve_state_value(value, kind, interfaces.constants(parent_type(self, interfaces)))


class MachineState(Display):
    """The state as a display: it is not in a page, but in the frame."""

    kind: Literal["state"]
    states: tuple[LampState, ...]
    details: tuple[StateDetail, ...] = ()
    stops: tuple[Any, ...] = ()

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        for number, detail in enumerate(self.details):
            yield detail.source(f"detail[{number}]")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        for number, detail in enumerate(self.details):
            at = f"{place}.detail[{number}]"
            yield from value_faults(at, detail.type, detail.field, "a detail", checking.interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from state_faults(place, self, field_type, interfaces, "the machine's state")


# The table `[oee]` of a panel file: why the machine stood still, and the figures of a shift.

BREAK: Final = r"^([01][0-9]|2[0-3]):[0-5][0-9]-([01][0-9]|2[0-3]):[0-5][0-9]$"
Break = Annotated[str, Field(pattern=BREAK)]
Percent = Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
MAX_REASONS: Final = 6
MAX_COUNTERS: Final = 3


class OeeReason(Description):
    """Why the machine stood still, as an operator says it by one key. A `planned` one is no loss: its
    time does not count as planned busy time."""

    id: Id
    label: Label
    note: Note | None = None
    icon: Icon | None = None
    planned: bool = False


class OeeCounter(TopicField):
    """A number that rises with each part of a sort. It may begin at zero again."""

    parts: Literal["good", "bad", "all"]


class OeeRules(NeedsKey):
    """Asks for the reason of a stop of at least `reason_after_s`, and has what the figures of a shift
    are computed from. `running` are the values of `[state]` with which the machine produces; by default
    those of the shape "play". `breaks` are times of day that are not planned to be worked. The targets
    are in percent, `target` is that of the OEE. `needs` is the role or group that answers."""

    reason_after_s: Seconds = 120.0
    reasons: Annotated[tuple[OeeReason, ...], Field(strict=False, max_length=MAX_REASONS)] = Field(
        (), alias="reason"
    )
    running: Annotated[tuple[StateValue, ...] | None, Field(strict=False)] = None
    breaks: Annotated[tuple[Break, ...], Field(strict=False, max_length=12)] = ()
    ideal_cycle_s: Seconds | None = None
    target: Percent | None = None
    target_availability: Percent | None = None
    target_performance: Percent | None = None
    target_quality: Percent | None = None
    counters: Annotated[tuple[OeeCounter, ...], Field(strict=False, max_length=MAX_COUNTERS)] = Field(
        (), alias="counter"
    )

    def sources(self) -> Iterator[TopicSource]:
        """The topics of its counters."""
        return (counter.source(f"counter[{n}]") for n, counter in enumerate(self.counters))

    def running_values(self, rules: StateRules) -> tuple[Any, ...]:
        """The values with which the machine produces."""
        if self.running is not None:
            return self.running
        return rules.playing_values

    def with_constants(self, rules: StateRules | None, interfaces: Interfaces) -> Self:
        """The same with values in place of constants' names."""
        if self.running is None or rules is None:
            return self
        running = tuple(rules.value_of(value, interfaces) for value in self.running)
        return self.model_copy(update={"running": running})
