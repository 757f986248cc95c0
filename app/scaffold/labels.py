"""Labels that tell widgets apart. Pure."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from app.scaffold.draft_parts import DraftWidget
from app.scaffold.naming import words_of

MAX_LABEL: Final = 100


def with_own_labels(entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    """The entries, no two with the same label."""
    labels = own_labels([(str(entry.keys["label"]), entry.name) for entry in entries])
    return [
        entry if label == entry.keys["label"] else replace(entry, keys={**entry.keys, "label": label})
        for entry, label in zip(entries, labels, strict=True)
    ]


def own_labels(labelled: Sequence[tuple[str, str]]) -> list[str]:
    """The labels of (label, ROS name), each once: where several are alike, the parts by which the names
    differ come first ("Left home"), or the whole name is the label."""
    alike: defaultdict[str, list[int]] = defaultdict(list)
    for place, (label, _) in enumerate(labelled):
        alike[label.lower()].append(place)
    labels = [label for label, _ in labelled]
    for places in alike.values():
        for place, parts in zip(places, _differing(labelled[at][1] for at in places), strict=True):
            labels[place] = _label(parts, labels[place]) if len(places) > 1 else labels[place]
    taken: set[str] = set()
    for place, (_, name) in enumerate(labelled):
        if labels[place].lower() in taken:
            labels[place] = next(
                text
                for number in range(1, len(labels) + 2)
                if (text := _numbered(name, number)).lower() not in taken
            )
        taken.add(labels[place].lower())
    return labels


def _label(parts: Sequence[str], label: str) -> str:
    before = " ".join(words_of("/".join(parts)))
    text = f"{before} {label[0].lower()}{label[1:]}" if before else label
    return (text[0].upper() + text[1:])[:MAX_LABEL]


def _numbered(name: str, number: int) -> str:
    return name[-MAX_LABEL:] if number == 1 else f"{name[-MAX_LABEL:]} {number}"


def _differing(names: Iterable[str]) -> list[list[str]]:
    """The parts of each name without those at their begin and end that all have."""
    split = [name.strip("/").split("/") for name in names]
    least = min(map(len, split))
    first = next((n for n in range(least) if len({parts[n] for parts in split}) > 1), least)
    most = least - first
    last = next((n for n in range(most) if len({parts[-1 - n] for parts in split}) > 1), most)
    return [parts[first : len(parts) - last] for parts in split]
