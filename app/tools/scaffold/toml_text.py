"""A draft as the text of a panel file, with comments for those who write their first one."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from app.ros.graph.model import RobotGraph
from app.system.printable import printable
from app.system.toml_values import value_text
from app.tools.scaffold.draft import public_topics
from app.tools.scaffold.parts import Draft, DraftWidget, id_of, label_of

# Several robots behind one bridge, by their namespaces. Pure.

LEAST_ALIKE: Final = 2  # topics that robots of one kind have in common


def alike_namespaces(robot: RobotGraph) -> tuple[str, ...]:
    """The namespaces ("/left", "/right") of which each has at least half of its topics in common with
    one of them: the same names below them, with the same types. () if there are not two."""
    contents: dict[str, set[tuple[str, str]]] = {}
    for topic in public_topics(robot.topics):
        first, _, rest = topic.name[1:].partition("/")
        if rest and not topic.name.startswith("//"):
            contents.setdefault(f"/{first}", set()).add((rest, topic.type))
    groups = (_alike(namespace, contents) for namespace in contents)
    largest = max(groups, key=len, default=())
    return tuple(f"{robot.namespace}{namespace}" for namespace in largest)


def _alike(namespace: str, contents: Mapping[str, set[tuple[str, str]]]) -> tuple[str, ...]:
    """The namespaces that are like one of them, which is among them."""
    own = contents[namespace]

    def is_alike(its: set[tuple[str, str]]) -> bool:
        common = len(own & its)
        return common >= LEAST_ALIKE and 2 * common >= max(len(own), len(its))

    alike = tuple(name for name, its in contents.items() if is_alike(its))
    return alike if len(alike) > 1 else ()


def proposal(namespaces: Sequence[str]) -> str:
    """The sentence about namespaces that look like robots."""
    options = " ".join(f"--robot {namespace}" for namespace in namespaces)
    return (
        f"{', '.join(namespaces)} have the same topics. If each is a robot, {options} makes a [[robot]]"
        " table for each, with the pages for all of them."
    )


WIDTH: Final = 100
CHECK: Final = "operator-panel check"
OVERVIEW: Final = "overview"


def toml_text(draft: Draft, controls: bool = False, trial: bool = False) -> str:
    """The file. `controls`: keys that act on the robot are live, each behind its interlock.
    `trial`: all of them, to be checked."""
    lines = [*_head(draft), *_interlocks(draft), *_alarms(draft)]
    taken: set[str] = set()
    pages: set[str] = set()
    if len(draft.robots) > 1:
        pages.add(OVERVIEW)
        lines += [*_page(OVERVIEW, OVERVIEW), "overview = true  # a tile for each robot"]
    for page, entries in zip(draft.pages, written(draft, controls, trial), strict=True):
        own_id = id_of(page, pages)
        pages.add(own_id)
        lines += _page(page, own_id)
        for entry in entries:
            live = trial or not entry.control or (controls and bool(entry.interlock))
            lines += _widget(entry, id_of(entry.name, taken), live, taken)
    if draft.remarks:
        remarks = (f"# - {' '.join(remark.split())}" for remark in draft.remarks)
        lines += ["", *_comment("Not on the panel:"), *remarks]
    return "\n".join(printable(line) for line in lines) + "\n"


def written(draft: Draft, controls: bool = False, trial: bool = False) -> list[list[DraftWidget]]:
    """The entries of each page in the file's order, also those that are comments."""
    notes = not controls or trial  # a note stands for controls that are commented out
    return [
        [entry for entry in entries if notes or entry.kind != "label"]
        for entries in draft.pages.values()
    ]


def _head(draft: Draft) -> Iterator[str]:
    yield from _comment(
        "A first panel, made from what is on the robot now. Delete what you do not need, and give"
        f" labels, units and limits of your own. `{CHECK} FILE` names every mistake with its line."
    )
    if draft.alike:
        yield from _comment(proposal(draft.alike))
    yield ""
    yield f"title = {value_text(draft.title)}"
    yield 'mode = "live"'
    yield f"distro = {value_text(draft.distro)}  # of the robot's ROS 2"
    if draft.interfaces:
        yield f"interfaces = {value_text(list(draft.interfaces))}  # with the robot's own types"
    for key, value in draft.reached.items() if not draft.robots else ():
        yield f"{key} = {value_text(value)}"
    if draft.namespace and not draft.robots:
        yield f"namespace = {value_text(draft.namespace)}  # it stands before each name below"
    for robot in draft.robots:
        yield ""
        yield "[[robot]]"
        yield from (f"{key} = {value_text(item)}" for key, item in robot.items())


def _interlocks(draft: Draft) -> Iterator[str]:
    if not draft.interlocks:
        yield ""
        yield from _comment(
            "No topic was found that looks like a permission of the robot. A control needs one: a topic"
            " with a bool that is true while the robot permits it."
        )
        yield from ("#", "# [[interlock]]", '# id = "operation"', '# topic = "/operation_enabled"')
        yield from ('# type = "std_msgs/msg/Bool"', "# max_age_s = 2.0")
        return
    yield ""
    yield from _comment(
        "Topics that look like permissions, by their names and QoS. Check what each of them means"
        " before a control depends on it. A control is locked while its interlock is not true, is"
        " unknown, or the robot is cut off."
    )
    for interlock in draft.interlocks:
        yield "[[interlock]]"
        yield f"id = {value_text(interlock.id)}"
        yield f"label = {value_text(interlock.label)}"
        yield f"topic = {value_text(interlock.topic)}"
        yield f"type = {value_text(interlock.type)}"
        if interlock.nodes:
            yield from _comment(
                f"It has several publishers, of which the last counts: {interlock.nodes}"
            )
        else:
            yield 'publishers = "one"  # locks while another node publishes it too'
        if interlock.is_latched:
            yield "require_publisher = true  # locks when its publisher is gone"
        else:
            yield "max_age_s = 2.0  # locks when no message arrives for so long"
        yield ""


def _alarms(draft: Draft) -> Iterator[str]:
    if not draft.alarms:
        return
    yield ""
    yield from _comment(
        "The robot's diagnostics: each status that is WARN, ERROR or STALE is an alarm with the robot's"
        ' own message. Give the names of those that an operator has to act on, such as ["motor *"].'
    )
    taken: set[str] = set()
    for row in draft.alarms:
        own_id = id_of(row.topic, taken)
        taken.add(own_id)
        yield "[[alarm]]"
        yield f"id = {value_text(own_id)}"
        yield from (f"{key} = {value_text(value)}" for key, value in row.keys.items())
        yield ""


def _page(page: str, own_id: str) -> Iterator[str]:
    yield ""
    yield "[[page]]"
    yield f"id = {value_text(own_id)}"
    yield f"title = {value_text(label_of(page))}"


def _widget(entry: DraftWidget, own_id: str, live: bool, taken: set[str]) -> Iterator[str]:
    taken.add(own_id)
    yield ""
    if entry.comment:
        yield from _comment(entry.comment)
    if not live:
        yield from _comment("It acts on the robot. Uncomment it when you know what it does.")
    body = ["[[page.widget]]", f"id = {value_text(own_id)}", f"kind = {value_text(entry.kind)}"]
    for key, value in entry.keys.items():
        body += _key(key, value)
    if entry.is_input:
        pass  # its commands have the interlock
    elif entry.interlock:
        body.append(f"interlock = {value_text(entry.interlock)}")
    elif entry.control:
        body.append('# interlock = "…": it needs one')
    yield from body if live else (f"# {line}" for line in body)


def _key(key: str, value: Any) -> Iterator[str]:
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        yield f"{key} = ["
        yield from (f"  {value_text(element)}," for element in value)
        yield "]"
    else:
        yield f"{key} = {value_text(value)}"


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(printable(text), WIDTH)]
