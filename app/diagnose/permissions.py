"""The panel's interlocks: whether their publishers stay, repeat themselves and permit now. Pure."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

from app.diagnose.findings import Report
from app.diagnose.names import PanelNames
from app.diagnose.received import ReceivedSamples
from app.errors import DecodeError
from app.i18n import render
from app.interfaces import Interfaces, has_key
from app.panel.interlock import Interlock
from app.permission.conditions import permits, refusal
from app.robot.sample import Sample
from app.survey.model import TopicEndpoint

REGULAR: Final = 2  # messages while one listens


def check_permissions(
    report: Report, behind: PanelNames, observed: ReceivedSamples, interfaces: Interfaces
) -> None:
    for topic in dict.fromkeys(interlock.topic for interlock in behind.robot.panel.interlocks):
        _check_topic(report, behind, observed, topic)
    for interlock in behind.robot.panel.interlocks:
        _check_value(report, behind, observed, interlock, interfaces)


def _check_topic(report: Report, behind: PanelNames, observed: ReceivedSamples, topic: str) -> None:
    """Whether its publisher stays, and a panel that starts later would get a permission."""
    using = [interlock for interlock in behind.robot.panel.interlocks if interlock.topic == topic]
    key, ids = behind.robot.key(topic), ", ".join(interlock.id for interlock in using)
    count, window = len(observed.live(key)), f"{observed.window_s:.1f}"
    publishers = behind.publishers(topic)
    robot = behind.robot.id
    if not publishers:
        if observed.samples[key] or key in observed.lost:
            report.find("permission_ends", topic, robot=robot, ids=ids)
        else:
            hint = behind.hint(topic, "topics")
            report.find("permission_no_publisher", topic, robot=robot, ids=ids, hint=hint)
        return
    _check_publishers(report, publishers, using, robot)
    if behind.topic_forwarding(topic, "publishers") != "forwarded":
        return  # it is found as a topic
    limits = [interlock.max_age_s for interlock in using if interlock.max_age_s is not None]
    if limits and observed.longest_gap(key) > min(limits):
        report.find(
            "permission_stale",
            topic,
            robot=robot,
            ids=ids,
            count=count,
            window=window,
            limit=f"{min(limits):g}",
        )
    elif count < REGULAR and not any(publisher.qos.transient_local for publisher in publishers):
        report.find("permission_not_latched", topic, robot=robot, ids=ids, count=count, window=window)
    else:
        report.fact(f"permission {topic} came {len(observed.samples[key])} times in {window} s")


def _check_publishers(
    report: Report, publishers: Sequence[TopicEndpoint], using: Sequence[Interlock], robot: str
) -> None:
    """Whether several nodes publish a value of which the last one counts. Two bridges of one domain
    know the same publishers."""
    number = max(Counter(publisher.bridge for publisher in publishers).values())
    whole = [interlock.id for interlock in using if not has_key(interlock.field)]
    if number > 1 and whole:
        nodes = ", ".join(sorted({node for publisher in publishers for node in publisher.nodes})) or "?"
        ids, topic = ", ".join(whole), using[0].topic
        report.find("permission_publishers", topic, robot=robot, ids=ids, count=number, nodes=nodes)


def _check_value(
    report: Report,
    behind: PanelNames,
    observed: ReceivedSamples,
    interlock: Interlock,
    interfaces: Interfaces,
) -> None:
    """Whether the last value permits; nothing is said of one that is unknown."""
    samples = observed.samples[behind.robot.key(interlock.topic)]
    if not samples:
        return
    try:
        value = _last_value(samples, interlock, interfaces)
    except DecodeError:  # another type, which is said of the topic
        return
    if permits(interlock, value):
        return
    reason = refusal(interlock, value).reason or ""
    report.find("permission_refused", interlock.topic, robot=behind.robot.id, detail=render(reason))


def _last_value(samples: Sequence[Sample], interlock: Interlock, interfaces: Interfaces) -> Any:
    """The newest value; of a field with a key, that of the newest message which has it."""
    reader = interfaces.field_reader(interlock.type, [interlock.field])
    newest = samples[::-1] if has_key(interlock.field) else samples[-1:]
    values = (reader.read(bytes(sample.payload), sample.wall).get(interlock.field) for sample in newest)
    return next((value for value in values if value is not None), None)
