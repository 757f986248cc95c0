"""Which topics may permit what the robot does, and which of them a control depends on. Pure."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from app.dialect.endpoint import within
from app.scaffold.draft_parts import DraftWidget, InterlockCandidate
from app.scaffold.labels import own_labels
from app.scaffold.naming import NEGATIVE, id_of, label_of, permits
from app.survey.model import SurveyedTopic

BOOL: Final = "std_msgs/msg/Bool"


def interlock_candidates(topics: Iterable[SurveyedTopic]) -> list[InterlockCandidate]:
    """Bools that look like permissions: those whose name permits first, of these the latched ones."""
    likely = [
        topic
        for topic in topics
        if topic.publishers and topic.types == (BOOL,) and topic.reliable and _may_permit(topic)
    ]
    likely.sort(
        key=lambda candidate: (not permits(candidate.name), not candidate.latched, candidate.name)
    )
    labels = own_labels([(label_of(topic.name), topic.name) for topic in likely])
    taken: set[str] = set()
    candidates = []
    for topic, label in zip(likely, labels, strict=True):
        own_id = id_of(topic.name, taken)
        taken.add(own_id)
        candidates.append(
            InterlockCandidate(
                id=own_id,
                label=label.lower(),
                topic=topic.name,
                type=topic.type,
                kept=topic.latched,
                owners=tuple(node for publisher in topic.publishers for node in publisher.nodes),
                nodes=_several(topic),
            )
        )
    return candidates


def _several(topic: SurveyedTopic) -> str:
    """The names of the nodes if a topic has several publishers; "" if it has one."""
    if max(Counter(publisher.bridge for publisher in topic.publishers).values()) == 1:
        return ""
    return (
        ", ".join(sorted({node for publisher in topic.publishers for node in publisher.nodes})) or "?"
    )


def _may_permit(topic: SurveyedTopic) -> bool:
    """A latched bool is a state that other nodes act on. That of a fault permits nothing."""
    return permits(topic.name) or (topic.latched and not NEGATIVE.search(topic.name))


def interlock_for(control: DraftWidget, candidates: Sequence[InterlockCandidate]) -> str:
    """The id of the candidate for a control; "" for none. It is that of the nearest namespace around
    the control, there of the control's own node if there is one: the permission of another arm says
    nothing of this one. A control without a namespace may depend on those of a single namespace."""
    around = [candidate for candidate in candidates if within(control.scope, _namespace(candidate))]
    if around:
        depth = max(len(_namespace(candidate)) for candidate in around)
        nearest = [candidate for candidate in around if len(_namespace(candidate)) == depth]
        own = [candidate for candidate in nearest if {*candidate.owners} & {*control.nodes}]
        return (own or nearest)[0].id
    if not control.scope and len({_namespace(candidate) for candidate in candidates}) == 1:
        return candidates[0].id
    return ""


def _namespace(candidate: InterlockCandidate) -> str:
    return candidate.topic.rpartition("/")[0]
