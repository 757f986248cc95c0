"""The tables `[access]`, `[brand]`, `[control]`, `[diagnostics]`, `[embed]`, `[log]` and `[record]`
of a panel file."""

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field

from app.panel.base import Description, Id, Note, Seconds, TopicName
from app.panel.oidc import OidcRules
from app.pictures import PICTURE
from app.roles import ENGINEER, ROLES


def _not_a_role(group: str) -> str:
    if group in ROLES:
        raise ValueError(f'"{group}" is a role: a group has another name, such as "quality"')
    return group


class AccessRules(Description):
    """Who may use the panel. `open`: without users, everybody may do everything. A user is signed out
    after `idle_s` seconds without a touch; 0: never. `groups` are the panel's own, beside the roles.
    Signed-in users and programs on other machines have at most the role `remote`."""

    open: bool = True
    idle_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 600.0
    groups: Annotated[
        tuple[Annotated[Id, AfterValidator(_not_a_role)], ...], Field(strict=False, max_length=20)
    ] = ()
    remote: Literal["viewer", "operator", "maintenance", "engineer"] = ENGINEER
    oidc: OidcRules | None = None


class BrandRules(Description):
    """What stands in the corner above the tabs: a `logo` from the panel's pictures, or a `text`, on a
    `colour`, which is nowhere else."""

    logo: Annotated[str, Field(pattern=PICTURE)] | None = None
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
