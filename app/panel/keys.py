"""The keys of a panel file, as fields. docs/reference/panel-file.md describes each."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, WithJsonSchema

from app.panel.alarm import Alarm, AlarmRules
from app.panel.base import (
    Description,
    Endpoint,
    File,
    Folder,
    Id,
    Label,
    PictureFolder,
    SaidLabel,
    Seconds,
    catalogue_default,
    each_once,
    parse_namespace,
)
from app.panel.condition import Interlock, NamedCondition
from app.panel.demo import DemoEntry, StoryName
from app.panel.file.wording import one_of
from app.panel.layout import Frame, Hand, Page, Screens, TextSize, Theme
from app.panel.places import Places, ZoneFiles, Zones
from app.panel.recipe import RecipeSet
from app.panel.robot_texts import RobotText
from app.panel.rules import (
    AccessRules,
    BrandRules,
    ControlRules,
    DiagnosticRules,
    EmbedRules,
    Keyboard,
    LogRules,
    OeeRules,
    RecordRules,
    ScreenRules,
    SiteRules,
    StateRules,
)
from app.panel.shared_keys import NumberKeys, NumberOrTimeFormat
from app.panel.source import Source
from app.panel.widgets.displays import Readout
from app.panel.widgets.families import TopicField
from app.ros.dialects.dialect import DEFAULT_DIALECT, DOMAIN_MOST, DialectName
from app.system.public import PUBLIC
from app.system.texts import ENGLISH
from app.system.texts.catalogue import files

# The keys `language` and `languages` of a panel file: languages that have a catalogue.


def _check_language(tag: str) -> str:
    if tag not in files():
        raise ValueError(one_of([*files()], tag))
    return tag


def _check_languages(tags: tuple[str, ...]) -> tuple[str, ...]:
    if not tags:
        raise ValueError("is empty: name one language at least, or leave the key out")
    return each_once(tags)


Language = Annotated[
    str, AfterValidator(_check_language), WithJsonSchema({"type": "string", "enum": [*files()]}), PUBLIC
]
Languages = Annotated[tuple[Language, ...], Field(strict=False), AfterValidator(_check_languages)]


# The description of one of several robots: `[[robot]]`.

Domain = Annotated[int, Field(ge=0, le=DOMAIN_MOST), PUBLIC]
TILE: Final = "-tile-"  # no widget has an id that begins like this
SUMS: Final = "-sums"  # the line of sums of an overview


class RobotOverview(NumberKeys, TopicField):
    """The figure of a robot on its tile of an overview."""

    label: Label | None = None
    format: NumberOrTimeFormat | None = None


class RobotEntry(Description):
    """One of several robots; `connect` are its endpoints, by default the Zenoh configuration's."""

    id: Id
    name: Label
    namespace: Annotated[str, AfterValidator(parse_namespace), PUBLIC] = ""
    connect: Annotated[tuple[Endpoint, ...], Field(strict=False)] = ()
    dialect: DialectName = DEFAULT_DIALECT
    domain: Domain = 0
    overview: RobotOverview | None = None

    @property
    def tile_id(self) -> str:
        """The id of its tile on an overview."""
        return f"{TILE}{self.id}"

    @cached_property
    def figure(self) -> Readout | None:
        """The figure on its tile, as a readout of its own that is on no page."""
        if self.overview is None:
            return None
        shown: dict[str, Any] = {
            name: getattr(self.overview, name) for name in RobotOverview.model_fields
        }
        own = {"id": f"-figure-{self.id}", "kind": "readout", "label": self.name, "robot": self.id}
        return Readout.model_construct(**{**shown, **own})


# A font of the panel: the files of its two weights, checked by their first bytes.

FontFormat = Literal["woff2", "ttf", "otf"]
FORMATS: Final[dict[bytes, FontFormat]] = {
    b"wOF2": "woff2",
    b"\0\1\0\0": "ttf",
    b"true": "ttf",
    b"OTTO": "otf",
}
OTHERS: Final = {b"wOFF": "WOFF 1", b"ttcf": "a collection of fonts"}
MOST_MB: Final = 8


def font_format(file: Path) -> FontFormat | None:
    """The format of a font file, whatever its name says; None for anything else."""
    with file.open("rb") as opened:
        return FORMATS.get(opened.read(4))


def _check_font(file: Path) -> Path:
    if font_format(file) is None:
        with file.open("rb") as opened:
            other = OTHERS.get(opened.read(4), "not a font")
        raise ValueError(f"{file} is {other}: it must be a WOFF2, TrueType or OpenType file")
    if (size := file.stat().st_size) > MOST_MB * 1_000_000:
        raise ValueError(
            f"{file} has {size / 1e6:.1f} MB, and every browser loads it: a font has at most {MOST_MB}"
            " MB. Save it as WOFF2, or keep only the characters that the panel shows"
        )
    return file


FontFile = Annotated[File, AfterValidator(_check_font)]


class Font(Description):
    """The texts of pages are in `regular` and in `bold`."""

    regular: FontFile
    bold: FontFile

    @property
    def files(self) -> dict[str, Path]:
        """The files by the keys that name them."""
        return {"regular": self.regular, "bold": self.bold}


class PanelKeys(Description):
    """The keys of a panel file; `Panel` has what follows from them."""

    title: Label
    mode: Literal["demo", "live"] = "live"
    language: Language = ENGLISH
    languages: Languages = ()
    distro: Literal["humble", "iron", "jazzy", "kilted", "lyrical", "rolling"] = "jazzy"
    interfaces: Annotated[tuple[Folder, ...], Field(strict=False)] = ()
    namespace: Annotated[str, AfterValidator(parse_namespace), PUBLIC] = ""
    dialect: DialectName = DEFAULT_DIALECT
    domain: Domain = 0
    stop_hint: SaidLabel = catalogue_default("stop_hint")
    press_expires_s: Annotated[float, Field(ge=0.5, le=60)] = 2.0
    display_hz: Annotated[float, Field(ge=1, le=60)] = 20.0
    mm_per_px: Annotated[float, Field(gt=0.02, lt=1)] = 0.22
    theme: Theme = "light"
    text_size: TextSize = "normal"
    hand: Hand = "right"
    screens: Screens = ()
    pictures: PictureFolder | None = None
    fonts: Annotated[tuple[Font, ...], Field(strict=False, max_length=4)] = Field((), alias="font")
    keyboard: Keyboard = "auto"
    screen: ScreenRules = ScreenRules()
    brand: BrandRules | None = None
    frame: Frame = Frame.model_validate({})
    state: StateRules | None = None
    oee: OeeRules | None = None
    control: ControlRules = ControlRules(required=False)
    access: AccessRules = AccessRules()
    embed: EmbedRules = EmbedRules()
    record: RecordRules | None = None
    site: SiteRules | None = None
    robots: Annotated[tuple[RobotEntry, ...], Field(strict=False)] = Field((), alias="robot")
    log: LogRules = LogRules()
    diagnostics: DiagnosticRules = DiagnosticRules()
    demo_story: StoryName | None = None
    demo_heals_s: Seconds | None = None
    demo: Mapping[str, DemoEntry] = Field(default_factory=dict)
    alarm_rules: AlarmRules = Field(AlarmRules(), alias="alarms")
    alarms: Annotated[tuple[Alarm, ...], Field(strict=False)] = Field((), alias="alarm")
    robot_texts: Mapping[str, RobotText] = Field(default_factory=dict, alias="texts")
    sources: Annotated[tuple[Source, ...], Field(strict=False)] = Field((), alias="source")
    interlocks: Annotated[tuple[Interlock, ...], Field(strict=False)] = Field((), alias="interlock")
    own_conditions: Annotated[tuple[NamedCondition, ...], Field(strict=False)] = Field(
        (), alias="condition"
    )
    places: Places = Field((), alias="place")
    zones: Zones = Field((), alias="zone")
    zone_files: ZoneFiles = Field((), alias="zone_file")
    recipes: Annotated[tuple[RecipeSet, ...], Field(strict=False)] = Field((), alias="recipe")
    pages: Annotated[tuple[Page, ...], Field(strict=False)] = Field(alias="page")
    # Not of the file: its revision (other pages are out of date), the places of `same` widgets and, in
    # the panel of one robot, the inputs of others, and the conditions of others that its widgets name.
    revision: Annotated[str, Field(exclude=True)] = ""
    copies: Annotated[frozenset[str], Field(exclude=True)] = frozenset()
    inputs_of_others: Annotated[frozenset[str], Field(exclude=True)] = frozenset()
    of_others: Annotated[tuple[NamedCondition, ...], Field(exclude=True)] = ()
