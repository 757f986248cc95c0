"""The view of control: one for all clients, and one for each role."""

from typing import Final, Literal, TypedDict

from app.i18n import TextLike, number, say
from app.panel.rules import ControlRules
from app.permission.principal import Principal

# What a client is to who has control; "" where control is not required, `embedded` for a page in a
# frame of another site, which may only show.
Role = Literal["", "free", "held", "over", "asking", "holding", "asked", "embedded"]
IN_CONTROL: Final = frozenset[Role]({"", "holding", "asked"})


class ControlView(TypedDict):
    """The state of control. `role` and `shown`, the text for that role, are "" in the view for all. An
    id or a name is "" if there is none; `since` is RFC 3339."""

    required: bool
    holder: str
    holder_name: TextLike
    asker: str
    asker_name: TextLike
    since: str
    holder_text: TextLike
    asker_text: TextLike
    text: TextLike
    role: Role
    shown: TextLike


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
    role="",
    shown="",
)


def control_view(
    rules: ControlRules,
    robot: TextLike,
    holder: Principal | None,
    requester: Principal | None,
    since: str,
) -> ControlView:
    """The view for a robot's name; a requester only where there is a holder."""
    if not rules.required:
        return NO_CONTROL
    view = ControlView(
        required=True,
        holder=holder.client.id if holder else "",
        holder_name=holder.title if holder else "",
        asker=requester.client.id if requester else "",
        asker_name=requester.title if requester else "",
        since=since,
        holder_text=say("control_held_here", robot=robot),
        asker_text="",
        text=say("control_free", robot=robot),
        role="",
        shown="",
    )
    if holder:
        view["text"] = say("control_held", name=holder.title, robot=robot)
    if holder and requester:
        seconds = number(f"{rules.takeover_after_s:g}")
        view["holder_text"] = say(
            "control_requested_by_other", name=requester.title, robot=robot, seconds=seconds
        )
        view["asker_text"] = say("control_request_waiting", name=holder.title, seconds=seconds)
    return view


def role(control: ControlView, who: Principal, rules: ControlRules) -> Role:
    """The role of a client in control; pages show their buttons by it."""
    if not control["required"]:
        return ""
    if not control["holder"]:
        return "free"
    if who.client.id == control["holder"]:
        return "asked" if control["asker"] else "holding"
    if who.client.id and who.client.id == control["asker"]:
        return "asking"
    return "over" if who.client.local and rules.local else "held"


def for_role(control: ControlView, role: Role) -> ControlView:
    """The view for a client of this role."""
    if role == "asking":
        shown = control["asker_text"]
    elif role in ("holding", "asked"):
        shown = control["holder_text"]
    else:
        shown = control["text"]
    return {**control, "role": role, "shown": shown}
