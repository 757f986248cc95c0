"""The three links between browser and robot, each with what it locks: pure, from (panel, robot, time).

Browser to server, server to the peer that the robot is reached by, peer to the robot's nodes. The code
of a verdict decides to which link it belongs. In the view the peer's link has the key "bridge".
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from typing import Final, Literal, TypedDict

from app.cell.permission.interlocks import LINK_CODES
from app.cell.permission.verdict import PERMITTED, Verdict, topic_mismatch
from app.cell.robot.definitions import DefinitionDifference, is_unhashed, uncallable_dds
from app.cell.robot.graph import LiveGraph, cached_until_change
from app.cell.robot.state import RobotState
from app.cell.view.clock_status import clock_note
from app.panel.model import Panel
from app.panel.shared_keys import stale_at
from app.ros.dialects.dialect import Role
from app.ros.dialects.peer_traits import EVERY_SENTENCES, PeerSentences
from app.ros.messages import has_key
from app.system.clock import format_datetime
from app.system.texts import Text, TextLike, joined, number, say
from app.system.texts.text import longest

# What the details of a robot's link say of its definitions: which differ from the panel's, and which
# can't be compared. Pure.

NAMED_MOST: Final = 3


def definition_notes(robot: RobotState) -> TextLike:
    """A line for each difference, and one for all that can't be compared; "" for neither."""
    return _notes(robot.graph, robot)


@cached_until_change
def _notes(graph: LiveGraph, robot: RobotState) -> TextLike:
    differing: dict[str, DefinitionDifference] = {}
    unhashed: list[str] = []
    for role, name in robot.presence.required:
        key = robot.key(name)
        if (difference := robot.difference(role, key)) is not None:
            differing[name] = difference
        elif not graph.is_simulated and _can_not_be_compared(graph, role, key):
            unhashed.append(name)
    return joined([*_differences(differing, robot), *_unhashed(unhashed)], "between_lines")


def _can_not_be_compared(graph: LiveGraph, role: Role, key: str) -> bool:
    is_read = role in ("MP", "MS") or graph.nodes_read_at > -math.inf
    return is_read and is_unhashed(graph, role, key) and not uncallable_dds(graph, role, key)


def _differences(differing: dict[str, DefinitionDifference], robot: RobotState) -> Iterator[TextLike]:
    for name, difference in [*differing.items()][:NAMED_MOST]:
        yield say(
            "link_definition_hashes",
            name=name,
            type=difference.type,
            node=difference.node or say("link_definition_node_unknown"),
            theirs=difference.theirs,
            ours=difference.ours,
            source=robot.definition_source(difference.type),
        )
    if len(differing) > NAMED_MOST:
        yield say("link_definitions_more", number=len(differing) - NAMED_MOST)


def _unhashed(names: list[str]) -> Iterator[TextLike]:
    if not names:
        return
    named, more = tuple(names[:NAMED_MOST]), len(names) - NAMED_MOST
    yield say("link_no_hashes", names=say("and_more", names=named, number=more) if more > 0 else named)


State = Literal["ok", "wait", "bad"]

PEER: Final = LINK_CODES | {sentences.unrouted for sentences in EVERY_SENTENCES}
GONE: Final = frozenset({"interlock_no_publisher", "service_unavailable", "parameter_node_unavailable"})
NODE: Final = GONE.union(sentences.uncallable for sentences in EVERY_SENTENCES) | {
    "interlock_waiting",
    "interlock_connection_lost",
    "interlock_publisher_ended",
    "interlock_foreign",
    "interlock_stale",
    "interlock_stale_field",
    "interlock_unreadable",
    "interlock_new_publisher",
    "interlock_several_publishers",
    "interlock_reading",
    "interlock_field_missing",
    "interlock_not_a_number",
    "interlock_field_ambiguous",
    "interlock_field_no_value",
    "clock_awaited_lock",
    "topic_wrong_type",
    "topic_definition_differs",
    "qos_robot_best_effort",
    "qos_robot_volatile",
    "qos_robot_requires_reliable",
    "qos_robot_requires_transient_local",
    "service_connecting",
    "parameter_waiting",
    "parameter_no_reply",
    "parameter_unreadable",
}

LONGEST_LIST: Final = 120  # characters of labels that are listed; the rest is counted


class Lamp(TypedDict):
    """One light: `state` is "ok", "wait" or "bad"."""

    name: TextLike
    state: State
    text: TextLike


class LinkStatus(Lamp):
    """A link: `since` is when it came to this state, "" if that is not known; `locks` names the
    controls that it locks, `reason` is why it is in this state and what helps, "" for none."""

    since: TextLike
    locks: TextLike
    reason: TextLike


@cache
def _peer_lamps(sentences: PeerSentences) -> Mapping[str, tuple[State, str]]:
    """State and text of the lamp of the peer's link, by the code of the link's verdict."""
    return {
        sentences.unreachable: ("bad", "lost"),
        sentences.absent: ("bad", "absent"),
        sentences.absent_named: ("bad", "absent"),
        sentences.silent: ("bad", "silent"),
        sentences.unqueryable: ("bad", "silent"),
        "link_starting": ("wait", "pending"),
        "link_connecting": ("wait", "pending"),
        "link_catching_up": ("wait", "pausing"),
        "permitted": ("ok", "ok"),
    }


def link_statuses(
    panel: Panel, robot: RobotState, passable: Verdict, verdicts: Mapping[str, Verdict], now: float
) -> tuple[dict[str, LinkStatus], float]:
    """The three links, and when (monotonic seconds) time alone changes them; `verdicts` are those of
    all commands, by their ids. The server's link is always "ok": the browser overrides it when the
    server is lost."""
    verdicts = {name: verdict for name, verdict in verdicts.items() if not verdict.permitted}
    sentences = robot.traits.sentences
    state, text = _peer_lamps(sentences)[passable.code]
    silence, until = silent(panel, robot, now) if passable.permitted else ("", math.inf)
    peer_reason = passable.reason or _first(verdicts, PEER).reason or ""
    node_state, node_text, node_reason = _node(robot, passable, verdicts, silence)
    notes = [node_reason, definition_notes(robot), clock_note(robot, now)]
    node_reason = joined(notes, "between_lines")
    links = {
        "server": _link("server", "ok", "ok", ""),
        "bridge": _link(sentences.lamp, state, text, peer_reason, *labels(panel, verdicts, PEER)),
        "node": _link("robot", node_state, node_text, node_reason, *labels(panel, verdicts, NODE)),
    }
    return links, until


def summary(name: TextLike, link: Mapping[str, Lamp]) -> Lamp:
    """One lamp for a robot: the peer's link if it is not ok, else that of its nodes."""
    shown = link["node"] if link["bridge"]["state"] == "ok" else link["bridge"]
    return Lamp(name=name, state=shown["state"], text=shown["text"])


@lru_cache(maxsize=64)
def _link(name: str, state: State, text: str, reason: TextLike, *locked: TextLike) -> LinkStatus:
    """The same object for the same lamp. It must not be changed."""
    return LinkStatus(
        name=say(name), state=state, text=say(text), since="", locks=locks(locked), reason=reason
    )


def _node(
    robot: RobotState, passable: Verdict, verdicts: Mapping[str, Verdict], silence: TextLike
) -> tuple[State, str, TextLike]:
    """State, text and reason of the link from the peer to the robot's nodes."""
    sentences = robot.traits.sentences
    if ended := robot.presence.ended_nodes(robot.graph):
        return "bad", "link_node_ended", _named("link_node_named_ended", ended)
    if _peer_lamps(sentences)[passable.code][0] == "bad":
        return "bad", "lost", say(sentences.nodes_unknown)
    if silence:
        return "bad", "link_node_silent", silence
    gone = robot.presence.missing(robot.graph)
    if not robot.presence.any_present(robot.graph):
        absent = say(sentences.nodes_absent) if passable.permitted else ""
        return "wait", "link_no_node", _gone(sentences, gone) if gone else absent
    if gone and _first(verdicts, GONE).reason:
        return "ok", "ok", _gone(sentences, gone)
    return "ok", "ok", _first(verdicts, NODE).reason or ""


def silent(panel: Panel, robot: RobotState, now: float) -> tuple[TextLike, float]:
    """Why a node counts as silent, and when that may change: its publisher has a liveliness token, but
    the last message of an interlock is older than the panel allows. "" if no node is silent. A topic
    that is only displayed may be published on events; its display shows its age."""
    until = math.inf
    for interlock in panel.interlocks:
        if interlock.max_age_s is None:
            continue
        key, reading = (
            robot.key(interlock.topic),
            robot.reading(interlock.topic).of_field(interlock.field, math.inf),
        )
        if reading.status not in ("message", "unreadable") or not robot.graph.has_endpoint("MP", key):
            continue
        if topic_mismatch("MS", interlock, robot):
            continue
        old_at = stale_at(reading.at, interlock.max_age_s)
        if now >= old_at:
            limit = number(f"{interlock.max_age_s:g}")
            if has_key(interlock.field):
                return say(
                    "link_node_stale_field", field=interlock.field, topic=interlock.subject, limit=limit
                ), math.inf
            return say("link_node_stale", topic=interlock.subject, limit=limit), math.inf
        until = min(until, old_at)
    return "", until


def labels(panel: Panel, verdicts: Mapping[str, Verdict], codes: frozenset[str]) -> list[TextLike]:
    """The labels of the controls that are locked for one of these codes."""
    by_verdict: dict[int, bool] = {}  # many commands have one verdict
    for verdict in verdicts.values():
        if id(verdict) not in by_verdict:
            by_verdict[id(verdict)] = any(part.code in codes for part in _all(verdict))
    if not any(by_verdict.values()):
        return []
    return [w.label for w in panel.commands if w.id in verdicts and by_verdict[id(verdicts[w.id])]]


def locks(names: Sequence[TextLike]) -> Text:
    """The controls that a link locks, as a text; a long list is cut, and the rest counted."""
    if not names:
        return say("locks_nothing")
    lengths = [longest(name) + len(", ") for name in names]
    count = 1
    while count < len(names) and sum(lengths[: count + 1]) - len(", ") <= LONGEST_LIST:
        count += 1
    shown = tuple(names[:count])
    if count == len(names):
        return say("locks", names=shown)
    return say("locks_more", names=shown, number=len(names) - count)


def _first(verdicts: Mapping[str, Verdict], codes: frozenset[str]) -> Verdict:
    every = (part for verdict in verdicts.values() for part in _all(verdict))
    return next((part for part in every if part.code in codes), PERMITTED)


def _all(verdict: Verdict) -> tuple[Verdict, ...]:
    return (verdict, *verdict.others)


def _gone(sentences: PeerSentences, names: Sequence[str]) -> Text:
    return _named(sentences.node_lost, names)


def _named(code: str, names: Sequence[str]) -> Text:
    more = len(names) - 1
    name = say("and_count", name=names[0], number=more) if more else names[0]
    return say(code, name=name)


BROWSERS_OWN = "server"  # each browser measures for itself how long it has been connected


class LinkTimes:
    """The state of each link, and when it began."""

    def __init__(self, wall: Callable[[], float] = time.time) -> None:
        """`wall` gives seconds since the epoch."""
        self._wall = wall
        self._began: dict[str, tuple[tuple[str, TextLike], TextLike]] = {}
        self._plain: Mapping[str, LinkStatus] = {}
        self._dated: dict[str, LinkStatus] = {}

    def dated(self, links: Mapping[str, LinkStatus]) -> dict[str, LinkStatus]:
        """The same links with `since`, except the browser's own link."""
        if links != self._plain:
            self._plain = links
            self._dated = {name: self._with_since(name, lamp) for name, lamp in links.items()}
        return self._dated

    def _with_since(self, name: str, lamp: LinkStatus) -> LinkStatus:
        if name == BROWSERS_OWN:
            return lamp
        state = (lamp["state"], lamp["text"])
        known = self._began.get(name)
        if known is None or known[0] != state:
            known = self._began[name] = (state, format_datetime(self._wall()))
        return {**lamp, "since": known[1]}


# Whether the robot is there, in one word, as the frame shows it: pure, from the link's verdict.
#
# What the machine does is the robot's to say, see `[state]` of a panel file; what is permitted is said
# at each button.

WAITING: Final = ("link_starting", "link_connecting", "link_catching_up")
RobotPresence = Literal["online", "unknown", "lost"]
PRESENCE_WORDS: Final[Mapping[RobotPresence, str]] = {
    "online": "state_online",
    "unknown": "state_unknown",
    "lost": "state_lost",
}


class RobotWord(TypedDict):
    """`state` is "online" with a connection to the robot, "lost" without one, "unknown" while it is
    being set up."""

    state: RobotPresence
    text: TextLike


def robot_word(passable: Verdict) -> RobotWord:
    """The word for the verdict of the link."""
    if passable.permitted:
        return _word("online")
    return _word("unknown" if passable.code in WAITING else "lost")


@cache
def _word(state: RobotPresence) -> RobotWord:
    """The same object for the same state. It must not be changed."""
    return RobotWord(state=state, text=say(PRESENCE_WORDS[state]))


UNKNOWN: Final = _word("unknown")
