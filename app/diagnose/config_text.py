"""A TOML or JSON5 file without its comments, texts and unknown keys: all else stays in its place, so
that a fault can be found by its line. Linear in the length of a text, also of a broken one. Pure."""

import json
import re
from dataclasses import dataclass, field
from typing import Final

from app.diagnose.harmless import LEFT_OUT, NUMBER, TEXT, Rule, Rules, harmless

MOST_CHARS: Final = 400_000
_QUOTED: Final = r'"(?:\\.|[^"\\\n])*(?:"|(?=\n)|\\?\Z)|' + r"'[^'\n]*(?:'|(?=\n)|\Z)"
# Each alternative that begins also ends, at the end of the text at the latest.
_TOKEN: Final = re.compile(
    r"(?P<comment>//[^\n]*|\#[^\n]*|/\*.*?(?:\*/|\Z))"
    r'|(?P<long>"""(?:[^"\\]|\\.|"(?!""))*(?:"""|\\?\Z)|'
    + r"'''.*?(?:'''|\Z))"
    rf"|(?P<key>(?:{_QUOTED}|[\w.\-]{{1,80}})(?=[ \t]{{0,20}}[:=]))"
    rf"|(?P<quoted>{_QUOTED})"
    r"|(?P<newline>\n)|(?P<space>[^\S\n]+)"
    r"|(?P<begin>[\[{{])|(?P<end>[\]}}])|(?P<comma>,)|(?P<sign>[:=])"
    r"|(?P<word>[^\s\[\]{{}},:=\"'\#/]+)|(?P<other>.)".replace("{{", "{").replace("}}", "}"),
    re.DOTALL | re.ASCII,
)
_HEADER: Final = re.compile(r"[ \t]*(\[{1,2})([^\[\]\n]{0,200})(\]{1,2})[ \t]*(?=[#\n]|\Z)")


@dataclass(slots=True)
class _Filter:
    """`open` has the brackets that are not closed, each with the rule of what is in it and whether its
    key is known. `skipped` is the depth inside a value that is left out."""

    rules: Rules
    is_toml: bool
    parts: list[str] = field(default_factory=list)
    open: list[tuple[str, Rule, bool]] = field(default_factory=list)
    rule: Rule = None
    known: bool = True  # whether the next value's key is
    table: bool = True  # whether the keys of the table may be known
    skipped: int = 0


def harmless_text(text: str, rules: Rules, is_toml: bool) -> str:
    """The text with LEFT_OUT for each value that the rules do not know as harmless, and without its
    comments. Of a longer text the beginning."""
    made = _Filter(rules, is_toml)
    text, at = text[:MOST_CHARS].replace("\r", ""), 0
    while at < len(text):
        if is_toml and not made.open and not made.skipped and (at == 0 or text[at - 1] == "\n"):
            header = _HEADER.match(text, at)
            if header is not None:
                _head(made, header)
                at = header.end()
                continue
        token = _TOKEN.match(text, at)
        assert token is not None  # the last alternative takes any character
        _take(made, token.lastgroup or "", token[0])
        at = token.end()
    return "".join(made.parts)


def _head(made: _Filter, header: re.Match[str]) -> None:
    """The heading of a table."""
    name = header[2].strip()
    made.table = _is_known(made.rules, name)
    made.parts.append(f"{header[1]}{_shown(made.rules, name)}{header[3]}")


def _is_known(rules: Rules, name: str) -> bool:
    """Whether what a key has may be harmless; `name` may be of several parts."""
    return all(part in rules and rules[part] is not TEXT for part in name.split("."))


def _shown(rules: Rules, name: str) -> str:
    return name if all(part in rules for part in name.split(".")) else f'"{LEFT_OUT}"'


def _take(made: _Filter, kind: str, token: str) -> None:
    if kind == "newline":
        made.parts.append(token)
        made.known = made.known and not (made.is_toml and not made.open)
    elif made.skipped:
        made.skipped += (kind == "begin") - (kind == "end")
    elif kind in ("comment", "long"):
        lines = "\n" * token.count("\n")
        made.parts.append(lines if kind == "comment" else f'"{LEFT_OUT}"{lines}')
    elif kind == "key":
        _key(made, token.strip("\"'"))
    elif kind in ("quoted", "word"):
        _value(made, token)
    elif kind == "begin":
        _begin(made, token)
    elif kind == "end":
        _end(made, token)
    elif kind == "space":
        made.parts.append(token)
    elif kind in ("comma", "sign"):
        made.parts.append(token)
        if kind == "comma" and made.open:
            bracket, made.rule, made.known = made.open[-1]
            made.known = made.known and bracket == "["


def _key(made: _Filter, name: str) -> None:
    made.known = made.table and _is_known(made.rules, name)
    made.rule = made.rules[name.rpartition(".")[2]] if made.known else None
    made.parts.append(_shown(made.rules, name))


def _value(made: _Filter, token: str) -> None:
    text = token.strip("\"'")
    kept = harmless(text, made.rule if made.known else None)
    shown = text if kept == text and NUMBER.fullmatch(text) else json.dumps(kept)
    if kept != LEFT_OUT or made.parts[-1:] != [shown]:
        made.parts.append(shown)


def _begin(made: _Filter, bracket: str) -> None:
    if not made.known and (made.open or made.is_toml):
        made.parts.append(f'"{LEFT_OUT}"')
        made.skipped = 1
        return
    made.open.append((bracket, made.rule, made.known))
    made.known = bracket == "["
    made.parts.append(bracket)


def _end(made: _Filter, bracket: str) -> None:
    if not made.open:
        return
    made.open.pop()
    made.parts.append(bracket)
    if made.open:
        inside, made.rule, known = made.open[-1]
        made.known = known and inside == "["
    else:
        made.known = False
