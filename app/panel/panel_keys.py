"""The keys of a panel file, as fields. docs/reference/panel-file.md describes each."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from app.dialect.dialect import DEFAULT_DIALECT, DialectName
from app.i18n import ENGLISH
from app.panel.alarm import Alarm, AlarmRules
from app.panel.base import (
    Description,
    Folder,
    Label,
    PictureFolder,
    SaidLabel,
    catalogue_default,
    parse_namespace,
)
from app.panel.condition import NamedCondition
from app.panel.demo import DemoEntry
from app.panel.font import Font
from app.panel.interlock import Interlock
from app.panel.language_choice import Language, Languages
from app.panel.layout import Frame, Hand, Page, Screens, TextSize, Theme
from app.panel.machine_state import StateRules
from app.panel.recipe import RecipeSet
from app.panel.robot_entry import Domain, RobotEntry
from app.panel.rules import (
    AccessRules,
    BrandRules,
    ControlRules,
    DiagnosticRules,
    EmbedRules,
    LogRules,
    RecordRules,
)
from app.panel.screen import Keyboard, ScreenRules
from app.panel.source import Source
from app.panel.stories import StoryName


class PanelKeys(Description):
    """The keys of a panel file; `Panel` has what follows from them."""

    title: Label
    mode: Literal["demo", "live"] = "live"
    language: Language = ENGLISH
    languages: Languages = ()
    distro: Literal["humble", "iron", "jazzy", "kilted", "lyrical", "rolling"] = "jazzy"
    interfaces: Annotated[tuple[Folder, ...], Field(strict=False)] = ()
    namespace: Annotated[str, AfterValidator(parse_namespace)] = ""
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
    control: ControlRules = ControlRules(required=False)
    access: AccessRules = AccessRules()
    embed: EmbedRules = EmbedRules()
    record: RecordRules | None = None
    robots: Annotated[tuple[RobotEntry, ...], Field(strict=False)] = Field((), alias="robot")
    log: LogRules = LogRules()
    diagnostics: DiagnosticRules = DiagnosticRules()
    demo_story: StoryName | None = None
    demo: Mapping[str, DemoEntry] = Field(default_factory=dict)
    alarm_rules: AlarmRules = Field(AlarmRules(), alias="alarms")
    alarms: Annotated[tuple[Alarm, ...], Field(strict=False)] = Field((), alias="alarm")
    sources: Annotated[tuple[Source, ...], Field(strict=False)] = Field((), alias="source")
    interlocks: Annotated[tuple[Interlock, ...], Field(strict=False)] = Field((), alias="interlock")
    own_conditions: Annotated[tuple[NamedCondition, ...], Field(strict=False)] = Field(
        (), alias="condition"
    )
    recipes: Annotated[tuple[RecipeSet, ...], Field(strict=False)] = Field((), alias="recipe")
    pages: Annotated[tuple[Page, ...], Field(strict=False)] = Field(alias="page")
    # Not of the file: its revision (other pages are out of date), the places of `same` widgets and, in
    # the panel of one robot, the inputs of others, and the conditions of others that its widgets name.
    revision: Annotated[str, Field(exclude=True)] = ""
    copies: Annotated[frozenset[str], Field(exclude=True)] = frozenset()
    inputs_of_others: Annotated[frozenset[str], Field(exclude=True)] = frozenset()
    of_others: Annotated[tuple[NamedCondition, ...], Field(exclude=True)] = ()
