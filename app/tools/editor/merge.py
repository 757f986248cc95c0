"""Merges two changed texts of one panel file, table by table: what only one side has changed is taken,
with its comments; what both have changed differently is a conflict. Pure."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from itertools import pairwise
from typing import Any, Final, Literal

from app.panel.file.toml_lines import Path
from app.tools.editor.sections import Section, paths_of, split

FILE: Final = "file"  # the name of a conflict of the whole text
ORDER: Final = "order of "
ENOUGH: Final = 0.5  # of two tables without ids that are the same one with changes

Side = Literal["base", "ours", "theirs"]


@dataclass(frozen=True, slots=True)
class Conflict:
    """A table that both sides have changed. `name` is like "page:cell/widget:start", "order of …" or
    "file"; `place` is its path on our side, or on theirs where ours has none. A text is None where the
    side has no such table."""

    name: str
    place: Path
    base: str | None
    ours: str | None
    theirs: str | None


@dataclass(frozen=True, slots=True)
class Merged:
    """The merged text. While there are conflicts, our side stands in their places."""

    text: str
    conflicts: tuple[Conflict, ...]


# The name of a conflict → a side, or another text.
Choices = Mapping[str, Side | tuple[str]]


@dataclass(frozen=True, slots=True)
class Node:
    """A table with the tables in it. `text` has its header and keys, with the comments that belong to
    them. `is_last`: of a file."""

    name: str
    path: Path
    text: str
    loose: str
    own: Mapping[str, Any]
    children: tuple["Node", ...] = ()
    is_last: bool = False

    @property
    def id(self) -> str:
        """What it is called beside its siblings, "" for a table of a list without an id."""
        if not self.path or isinstance(self.path[-1], str):
            return self.name
        for key in ("id", "same"):
            if isinstance(value := self.own.get(key), str):
                return f"{self.name}:{value}"
        return ""

    @property
    def whole(self) -> str:
        """With the tables in it, without the blank lines at its end."""
        parts = [self.text]
        if self.children:
            parts += [self.loose, *(child.written for child in self.children)]
        return "".join(parts).rstrip()

    @property
    def written(self) -> str:
        return self.text + self.loose + "".join(child.written for child in self.children)


def merge(base: str, ours: str, theirs: str, choices: Choices | None = None) -> Merged:
    """The text with the changes of both sides since `base`. Texts that are not TOML are merged by their
    lines."""
    if ours == theirs or theirs == base:
        return Merged(ours, ())
    if ours == base:
        return Merged(theirs, ())
    chosen = _of_choice((choices or {}).get(FILE), base, ours, theirs)
    if chosen is not None:
        return Merged(chosen, ())
    if all(map(_is_toml, (base, ours, theirs))):
        merging = _Merging(choices or {})
        trees = _tree(base), _tree(ours), _tree(theirs)
        if all(tree.written == text for tree, text in zip(trees, (base, ours, theirs), strict=True)):
            root = merging.node(*trees, "")
            text = _ended(root.written, ours, theirs) if root else ""
            if _is_toml(text):
                return Merged(text, tuple(merging.conflicts))
    lines = merged_lines(base, ours, theirs)
    if lines is not None and _is_toml(lines):
        return Merged(lines, ())
    return Merged(ours, (Conflict(FILE, (), base, ours, theirs),))


def _is_toml(text: str) -> bool:
    try:
        tomllib.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def _ended(text: str, *sides: str) -> str:
    """Without blank lines at the end, if no side has some."""
    if any(side.endswith(("\n\n", "\n\r\n")) for side in sides):
        return text
    stripped = text.rstrip("\r\n")
    return stripped + ("\r\n" if "\r\n" in text else "\n") if stripped else text


def _of_choice(choice: Any, base: Any, ours: Any, theirs: Any) -> Any:
    """What a choice says; None without one."""
    if isinstance(choice, tuple):
        return choice[0]
    return {"base": base, "ours": ours, "theirs": theirs}[choice] if choice else None


def _tree(text: str) -> Node:
    """The tables of a text as a tree, in the order of their headers."""
    sections = split(text, tomllib.loads(text))
    inner: dict[Path, list[Path]] = {}
    by_path: dict[Path, Section] = {}
    for path, section in zip(paths_of(sections), sections, strict=True):
        by_path[path] = section
        parents = (path[:n] for n in range(len(path) - 1, -1, -1))
        if path:
            inner.setdefault(next(p for p in parents if p in by_path), []).append(path)

    def node(path: Path, above: Path) -> Node:
        section = by_path[path]
        name = ".".join(step for step in path[len(above) :] if isinstance(step, str))
        return Node(
            name=name,
            path=path,
            text=section.above + section.header + section.body,
            loose=section.loose,
            own=section.own,
            children=tuple(node(child, path) for child in inner.get(path, ())),
            is_last=section is sections[-1],
        )

    return node((), ())


@dataclass
class _Merging:
    choices: Choices
    conflicts: list[Conflict] = field(default_factory=list)

    def node(self, base: Node | None, ours: Node | None, theirs: Node | None, name: str) -> Node | None:
        """The merged table; None if it goes."""
        sides = (base, ours, theirs)
        if base and ours and theirs:
            return self._changed(base, ours, theirs, name)
        whole = [side.whole if side else None for side in sides]
        if whole[1] == whole[2] or whole[2] == whole[0]:
            return ours
        if whole[1] == whole[0]:
            return theirs
        chosen = self._chosen(name, ours or theirs, whole)
        if chosen is None:
            return ours
        return None if chosen == "" else _replaced(chosen, *sides)

    def _chosen(self, name: str, node: Node | None, texts: Sequence[str | None]) -> str | None:
        """The chosen text of a conflict, "" for none of it; None: not chosen yet."""
        if name in self.choices:
            return _of_choice(self.choices[name], *texts) or ""
        self.conflicts.append(Conflict(name, node.path if node else (), *texts))
        return None

    def _changed(self, base: Node, ours: Node, theirs: Node, name: str) -> Node:
        texts = (base.text, ours.text, theirs.text)
        text = merged_lines(*texts)
        if text is not None and not _is_toml(text):
            text = None
        if text is None:
            text = self._chosen(f"{name or 'keys'}", ours, texts)
        loose = ours.loose if ours.loose != base.loose else theirs.loose
        merged = replace(ours, text=ours.text if text is None else text, loose=loose)
        return replace(merged, children=self._children(base, ours, theirs, name))

    def _children(self, base: Node, ours: Node, theirs: Node, name: str) -> tuple[Node, ...]:
        in_ours, in_theirs = _matches(base, ours), _matches(base, theirs)
        added = _added(ours, in_ours, theirs, in_theirs)
        # Each table of any side, by a number of its own: those of the base first.
        rows: list[tuple[int | None, int | None, int | None]] = [
            (b, in_ours.get(b), in_theirs.get(b)) for b in range(len(base.children))
        ]
        rows += [(None, o, t) for o, t in added]
        merged: dict[int, Node] = {}
        for number, (b, o, t) in enumerate(rows):
            parts = (_child(base, b), _child(ours, o), _child(theirs, t))
            first = next(part for part in parts if part)
            own = first.id or f"{first.name}[{number}]"
            node = self.node(*parts, f"{name}/{own}" if name else own)
            if node is not None:
                merged[number] = node
        orders = [_order_of([row[side] for row in rows]) for side in range(3)]
        order = self._order(orders, merged, ours, name)
        return _separated([merged[number] for number in order], ours)

    def _order(
        self, orders: Sequence[list[int]], merged: Mapping[int, Node], ours: Node, name: str
    ) -> list[int]:
        """The order of the tables: that of the side that has changed it."""
        base, own, other = orders
        common = set(base) & set(own) & set(other)
        was, is_ours, is_theirs = ([n for n in order if n in common] for order in orders)
        if is_theirs in (was, is_ours):
            first, second = own, other
        elif is_ours == was:
            first, second = other, own
        else:
            title = f"{ORDER}{name or 'the file'}"
            choice = self.choices.get(title)
            if choice is None:
                texts = ["\n".join(_title(merged[n]) for n in order if n in merged) for order in orders]
                self.conflicts.append(Conflict(title, ours.path, *texts))
            first, second = (other, own) if choice == "theirs" else (own, other)
        order = [n for n in first if n in merged]
        for at, number in enumerate(second):
            if number in merged and number not in order:
                ahead = next((n for n in reversed(second[:at]) if n in order), None)
                order.insert(order.index(ahead) + 1 if ahead is not None else 0, number)
        return order + [n for n in base if n in merged and n not in order]


def _order_of(places: Sequence[int | None]) -> list[int]:
    """The numbers of the tables that a side has, in its order."""
    return [number for _, number in sorted((at, n) for n, at in enumerate(places) if at is not None)]


def _child(node: Node, number: int | None) -> Node | None:
    return None if number is None else node.children[number]


def _title(node: Node) -> str:
    return node.id or node.text.strip().partition("\n")[0]


def _matches(base: Node, other: Node) -> dict[int, int]:
    """Which table of a side is which of the base: by id, else by what is in it."""
    matches: dict[int, int] = {}
    taken: set[int] = set()
    ids = {child.id: n for n, child in reversed(list(enumerate(other.children))) if child.id}
    for b, child in enumerate(base.children):
        if child.id in ids and ids[child.id] not in taken:
            matches[b] = ids[child.id]
            taken.add(matches[b])
    for least in (1.0, ENOUGH):
        for b, child in enumerate(base.children):
            if child.id or b in matches:
                continue
            alike = [
                (_likeness(child, each), -abs(o - b), o)
                for o, each in enumerate(other.children)
                if o not in taken and not each.id and each.name == child.name
            ]
            likeness, _, best = max(alike, default=(0.0, 0, 0))
            if likeness >= least:
                matches[b] = best
                taken.add(best)
    return matches


def _likeness(first: Node, second: Node) -> float:
    if first.whole == second.whole:
        return 1.0
    ids = [{child.id for child in node.children if child.id} for node in (first, second)]
    if (together := ids[0] | ids[1]) and (same := ids[0] & ids[1]):
        return min(0.99, 0.5 + len(same) / len(together) / 2)
    return min(0.99, SequenceMatcher(None, first.text, second.text).ratio())


def _added(
    ours: Node, in_ours: Mapping[int, int], theirs: Node, in_theirs: Mapping[int, int]
) -> Iterator[tuple[int | None, int | None]]:
    """The tables that the base has not: (of ours, of theirs). The same one of both sides is one."""
    new_ours = [o for o in range(len(ours.children)) if o not in in_ours.values()]
    new_theirs = [t for t in range(len(theirs.children)) if t not in in_theirs.values()]
    for o in new_ours:
        own = ours.children[o]
        same = next(
            (
                t
                for t in new_theirs
                if (own.id and own.id == theirs.children[t].id) or own.whole == theirs.children[t].whole
            ),
            None,
        )
        if same is not None:
            new_theirs.remove(same)
        yield o, same
    yield from ((None, t) for t in new_theirs)


def _replaced(text: str, *sides: Node | None) -> Node:
    """A table with the chosen text, which has the tables in it too."""
    for side in sides:
        if side and side.whole == text:
            return side
    first = next(side for side in sides if side)
    return replace(first, text=text.rstrip("\n") + "\n", loose="\n", children=())


def _separated(nodes: Sequence[Node], parent: Node) -> tuple[Node, ...]:
    """With a newline and a blank line after the table that was the last one of its file."""
    newline = "\r\n" if "\r\n" in parent.text else "\n"
    made = []
    for number, node in enumerate(nodes):
        if number + 1 < len(nodes):
            node = _not_last(node, newline)
        made.append(node)
    return tuple(made)


def _not_last(node: Node, newline: str) -> Node:
    if node.children:
        *others, last = node.children
        return replace(node, children=(*others, _not_last(last, newline)))
    if not node.is_last:
        return node
    text = node.text if node.text.endswith("\n") else node.text + newline
    return replace(node, text=text, loose=node.loose or newline, is_last=False)


def merged_lines(base: str, ours: str, theirs: str) -> str | None:
    """The lines with the changes of both sides; None if they change the same lines."""
    if ours == theirs or theirs == base:
        return ours
    if ours == base:
        return theirs
    lines = base.splitlines(keepends=True)
    hunks = sorted({*_hunks(lines, ours), *_hunks(lines, theirs)})
    for first, second in pairwise(hunks):
        if second[0] < first[1] or second[:2] == first[:2]:
            return None
    text, at = "", 0
    for start, end, new in hunks:
        text += "".join(lines[at:start]) + "".join(new)
        at = end
    return text + "".join(lines[at:])


def _hunks(lines: Sequence[str], side: str) -> Iterator[tuple[int, int, tuple[str, ...]]]:
    new = side.splitlines(keepends=True)
    for kind, start, end, first, last in SequenceMatcher(
        None, lines, new, autojunk=False
    ).get_opcodes():
        if kind != "equal":
            yield start, end, tuple(new[first:last])
