"""Who has control, as the pages show it: one view for all, and what each browser is by it."""

from typing import Final, Literal, TypedDict

from app.i18n import TextLike, say
from app.panel.rules import ControlRules
from app.permission.clients import Client

Role = Literal["free", "held", "over", "asking", "holding", "asked"]


class ControlView(TypedDict):
    """What every page shows; each picks its text by comparing the ids with its own. "" is nobody;
    `since` is RFC 3339."""

    required: bool
    holder: str
    holder_name: TextLike
    asker: str
    asker_name: TextLike
    since: str
    holder_text: TextLike
    asker_text: TextLike
    text: TextLike


NO_CONTROL: Final = ControlView(
    required=False,
    holder="",
    holder_name="",
    asker="",
    asker_name="",
    since="",
    holder_text="",
    asker_text="",
    text="",
)


def control_view(
    rules: ControlRules, robot: TextLike, holder: Client | None, asker: Client | None, since: str
) -> ControlView:
    """The view for a robot's name; there is an asker only where there is a holder."""
    if not rules.required:
        return NO_CONTROL
    view = ControlView(
        required=True,
        holder=holder.id if holder else "",
        holder_name=holder.title if holder else "",
        asker=asker.id if asker else "",
        asker_name=asker.title if asker else "",
        since=since,
        holder_text=say("control_mine", robot=robot),
        asker_text="",
        text=say("control_free", robot=robot),
    )
    if holder:
        view["text"] = say("control_held", name=holder.title, robot=robot)
    if holder and asker:
        seconds = f"{rules.takeover_after_s:g}"
        view["holder_text"] = say("control_asks", name=asker.title, robot=robot, seconds=seconds)
        view["asker_text"] = say("control_asked", name=holder.title, seconds=seconds)
    return view


def role(control: ControlView, client: Client, rules: ControlRules) -> Role:
    """What a browser is to who has control; pages show their buttons by it."""
    if not control["holder"]:
        return "free"
    if client.id == control["holder"]:
        return "asked" if control["asker"] else "holding"
    if client.id and client.id == control["asker"]:
        return "asking"
    return "over" if client.local and rules.local else "held"
