"""What may be in a support bundle: known keys, entries and findings, without texts of operators and of
others."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

from app.panel.widgets.kinds import KINDS as WIDGET_KINDS
from app.records.database import LogRow
from app.ros.graph.model import CYCLONE_DDS
from app.system.texts.catalogue import files
from app.tools.doctor.doctor import Diagnosis
from app.tools.doctor.findings import KINDS, Finding

# What may leave the machine in a support bundle: values of known keys, in a form that is known to be
# harmless. All else is left out, however it is written: a password has no form of its own. Pure.

LEFT_OUT: Final = "(left out)"
DEEPEST: Final = 20  # of nested values
LONGEST: Final = 300  # of a value

# What a key's value may be. None: a table or list with keys of its own, no value. TEXT: the key alone.
Rule = re.Pattern[str] | None
TEXT: Final = re.compile(r"(?!)")
Rules = dict[str, Rule]


def words(text: str) -> re.Pattern[str]:
    """One of these words."""
    return re.compile("|".join(map(re.escape, text.split())))


def rules(*rows: tuple[str, Rule]) -> Rules:
    """Key → rule, from rows of keys with spaces between."""
    return {key: rule for keys, rule in rows for key in keys.split()}


NUMBER: Final = re.compile(
    r"[+\-]?(?:\d{1,20}(?:\.\d{0,20})?|\.\d{1,20})(?:[eE][+\-]?\d{1,3})?|true|false|null|[+\-]?(?:inf|nan)"
)
DURATION: Final = re.compile(rf"[1-9]\d{{0,5}}[smhd]|{NUMBER.pattern}")
ID: Final = re.compile(r"[a-z][a-z0-9_]{0,63}")
ROS_NAME: Final = re.compile(r"(?:/{1,2}[A-Za-z_]\w*(?:/\w+)*/?)?", re.ASCII)
ROS_KEY: Final = re.compile(rf"[A-Za-z_]\w*(?:/\w+)*|{ROS_NAME.pattern}", re.ASCII)
ROS_TYPE: Final = re.compile(
    r"[a-z]\w*(?:/(?:msg|srv|action))?/[A-Z]\w*|(?:bool|integer|double|string)(?:\[\])?", re.ASCII
)
_PATH: Final = r"[a-z]\w*(?:\.[a-z]\w*|\[\d{1,6}\])*"
FIELD: Final = re.compile(rf"{_PATH}|[a-z]{{3,6}}\({_PATH}(?:, ?{_PATH})?\)", re.ASCII)
HEX: Final = re.compile(r"[0-9a-f.\-]{1,64}")
VERSION: Final = re.compile(r"v?\d[\w.+\-]{0,60}", re.ASCII)
TIME: Final = re.compile(r"[\dT:.+\- Z]{4,40}")
ADDRESS: Final = re.compile(r"[0-9a-fA-F:.]{2,45}|localhost")
# A locator of Zenoh, without the settings that may follow it.
ENDPOINT: Final = re.compile(
    r"(?:tcp|udp|tls|quic|ws|wss|vsock|serial|unixsock-stream|unixpipe)/[\w.:\[\]%\-]{1,200}", re.ASCII
)
# The files of an installation; where a user has files is not said.
PLACE: Final = re.compile(r"/(?:etc|opt|var/lib|run)/operator-panel(?:/[\w.\-]{1,80}){0,6}", re.ASCII)


def redact(text: str, rule: Rule) -> str:
    """The text if it is what the rule expects, else LEFT_OUT."""
    if rule is None or len(text) > LONGEST:
        return LEFT_OUT
    if rule is ENDPOINT:
        text = re.split("[?#]", text, maxsplit=1)[0]
    return text if rule.fullmatch(text) else LEFT_OUT


def redact_value(value: Any, keys: Rules, rule: Rule = None, depth: int = 0) -> Any:
    """The same for JSON values: of a table the known keys, of a list each value by its key's rule.
    Numbers are harmless where a rule is."""
    if depth > DEEPEST or rule is TEXT:
        return LEFT_OUT
    if isinstance(value, Mapping):
        return {
            key: redact_value(inner, keys, keys[key], depth + 1)
            for key, inner in value.items()
            if key in keys
        }
    if isinstance(value, list | tuple):
        return [redact_value(inner, keys, rule, depth + 1) for inner in value]
    if value is None or isinstance(value, bool):
        return value
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    kept = redact(text, rule)
    return value if kept == text else kept


# The keys whose values are in a support bundle, with what these may be. A key that is not here is left
# out: texts, units, options, messages, values and everything with a secret in it.

_VENDOR: Final = re.compile(f"|{CYCLONE_DDS}|Fast DDS|Connext|OpenSplice|OpenDDS|GurumDDS|CoreDX DDS")


_NUMBERS: Final = """
    after_s before_s columns confirm_press days dead_zone depth dim_after_s disk display_hz duration_s
    enabled entries_read fit global high high_high hz keys kiosk lines local low low_low max max_age_s
    max_bytes max_hz max_length max_mb max_side_px min mm_per_px near normal offset one_shot own
    confirm_s period_s press_expires_s progress_falls progress_max ramp_s range rate_hz
    require_publisher required right_max right_min rows rows_shown scale scan setpoint silent size_mb
    sounds span takeover_after_s timeout_s width within_s
"""
_PANEL_TEXTS: Final = """
    answer by constants default demo feedback frame_id goal icon interfaces key label message name note
    off on options parameter parameters pictures ranges release request response result src styles
    template text title unit value values
"""
PANEL: Final = rules(
    (
        "page widget group robot frame screen control diagnostics record qos confirm sort column pen",
        None,
    ),
    ("joint states x_axis y_axis current reported steps recovery options_from", None),
    (_NUMBERS, NUMBER),
    ("step", NUMBER),
    ("keep window windows", DURATION),
    ("id interlock page names condition conditions fault", ID),
    ("topic topics service action node namespace", ROS_NAME),
    ("type", ROS_TYPE),
    ("field deadline_field counter_field progress success", FIELD),
    ("connect", ENDPOINT),
    ("screens", re.compile(r"\d{3,4}x\d{3,4}")),
    ("format", re.compile(r"\+?,?(\.\d{1,2}[feg%]|[feg%d])|time|age|duration")),
    ("kind", words(" ".join(WIDGET_KINDS))),
    ("mode", words("demo live")),
    ("axis", words("left right")),
    ("distro", words("humble iron jazzy kilted lyrical rolling")),
    ("language languages", words("de en ja")),
    ("theme", words("light dark contrast")),
    ("text_size size", words("small normal large")),
    ("hand", words("right left")),
    ("colour", words("grey white black blue yellow red green")),
    ("shape", words("circle square triangle diamond cross bar")),
    ("role", words("start stop reset hold toggle neutral")),
    ("reliability", words("reliable best_effort")),
    ("durability", words("volatile transient_local")),
    ("level log", words("debug info warn error fatal")),
    ("orientation", words("vertical horizontal")),
    ("first", words("largest smallest newest")),
    ("keyboard", words("auto on off")),
    ("publishers", words("one any")),
    ("equals not_equals one_of", words("true false")),
    (_PANEL_TEXTS, TEXT),
)

_ALLOWED_NAMES: Final = re.compile(r"[\w/.*|^$()+?\[\]\\:=\-]{0,300}", re.ASCII)
_ROUTES: Final = "publishers subscribers service_servers service_clients action_servers action_clients"
_ZENOH_NUMBERS: Final = """
    period_init_ms period_max_ms period_increase_factor enabled timeout delay timeout_ms exit_on_failure
    ttl connect_scouted declares lease keep_alive batch_size size wait_before_drop wait_before_close
    control real_time interactive_high interactive_low data_high data data_low background qos lowlatency
    compression open_timeout accept_timeout accept_pending max_sessions max_links buffer_size
    max_message_size threads max_wait_before_drop_fragments drop_timeout time_limit enable_mtls
    verify_name_on_connect close_link_on_expiration read write domain ros_localhost_only shm_enabled
    reliable_routes_blocking queries_timeout default transient_local_cache_multiplier work_thread_num
    max_block_thread_num timestamping http_port queries_default_timeout __required__
"""
_ZENOH_TEXTS: Final = """
    access_control auth certificate certificate_base64 connect_certificate connect_private_key
    listen_certificate listen_private_key metadata password private_key pubkey root_ca_certificate tls
    user usrpwd
"""
ZENOH: Final = rules(
    (
        "connect listen retry open return_conditions scouting multicast gossip transport unicast link",
        None,
    ),
    ("tx rx queue congestion_control drop block plugins ros2dds rest allow deny adminspace", None),
    ("permissions shared_memory ros_localhost", None),
    (_ZENOH_NUMBERS, NUMBER),
    ("mode", words("peer client router")),
    ("endpoints", ENDPOINT),
    ("address", ADDRESS),
    ("interface", re.compile(r"auto|lo|(?:eth|en|wl|br|docker|veth)\w{0,12}", re.ASCII)),
    ("autoconnect target", words("router peer client")),
    ("router peer client", re.compile(rf"router|peer|client|{NUMBER.pattern}")),
    ("autoconnect_strategy strategy", words("always greater-zid")),
    ("protocols", words("tcp udp tls quic ws vsock serial unixsock-stream unixpipe")),
    ("sequence_number_resolution", words("8bit 16bit 32bit 64bit")),
    ("ros_automatic_discovery_range", words("SUBNET LOCALHOST OFF SYSTEM_DEFAULT")),
    ("ros_static_peers", re.compile(rf"(?:{ADDRESS.pattern}|;)*")),
    ("namespace nodename", ROS_KEY),
    ("id", HEX),
    (f"{_ROUTES} pub_max_frequencies", _ALLOWED_NAMES),
    (_ZENOH_TEXTS, TEXT),
)

_GRAPH_NAMES: Final = "name namespace nodes services clients actions topics local_nodes"
GRAPH: Final = ZENOH | rules(
    ("robots bridges routes peers config", None),
    ("keep_all reliable transient_local depth announced active", NUMBER),
    ("zid bridge endpoint", HEX),
    ("version", VERSION),
    ("dds", _VENDOR),
    (f"{_GRAPH_NAMES} key action_clients", ROS_KEY),
    ("publishers subscribers", _ALLOWED_NAMES),
    ("type", ROS_TYPE),
    ("type_hash", re.compile(r"(?:RIHS01_[0-9a-f]{64})?")),
    ("kind direction role", words("topic service action pub sub srv cli MP MS")),
    ("remote", re.compile(r"[0-9a-f]{1,32}:[\w/]{1,250}", re.ASCII)),
)

VERSIONS: Final = re.compile(r"\(a checkout, not installed\)|[\w.+\-/() ]{1,80}", re.ASCII)
SETTINGS: Final = rules(
    ("mode", words("demo live")),
    ("axis", words("left right")),
    ("hosts", re.compile(r"\[[0-9a-f:.]+\]|[a-z0-9._-]{1,80}")),
    ("proxies", re.compile(r"[0-9a-fA-F:./]{2,50}")),
    ("log_level", words("debug info warn error fatal")),
    ("dev", NUMBER),
)
SNAPSHOT: Final = rules(("id revision", re.compile(r"[0-9a-f\-]{1,80}")))
WIDGET: Final = rules(
    ("enabled busy stoppable held settable askable", NUMBER),
    ("state outcome goal level", ID),
)
LINK: Final = rules(("state", ID), ("since", TIME))
_LOG_ID: Final = re.compile(r"[0-9a-f\-]{1,40}")
LOG: Final = rules(
    ("seq monotonic of", NUMBER),
    ("at pressed_at", TIME),
    ("kind robot widget action verdict outcome", ID),
    ("boot press seen board prev hash", _LOG_ID),
    ("address", ADDRESS),
)
# Parameters of sentences, by their names.
SENTENCE: Final = rules(
    ("topic service action node namespace", ROS_NAME),
    ("limit age seconds count number since", NUMBER),
    ("type wanted", ROS_TYPE),
    ("at", TIME),
    ("id", ID),
)
DETAILS: Final = rules(
    ("count domain free_mb limit needed_mb number panel real_mm screen seconds times window", NUMBER),
    ("found wanted type", ROS_TYPE),
    ("ours theirs tested", re.compile(rf"{VERSION.pattern}|{ROS_NAME.pattern}", re.ASCII)),
    ("namespace nodes", ROS_NAME),
    ("vendor", _VENDOR),
    ("direction", words("ahead behind")),
    ("package", re.compile(r"fonts-[a-z0-9\-]{1,40}")),
    ("ids", ID),
    ("zids", HEX),
)


# Entries of the operator's log for a support bundle: by known columns, a reason by its codes and the
# parameters that are known to be harmless. What was typed in is in neither.


def redact_entry(row: LogRow) -> dict[str, Any]:
    entry = row.entry._asdict() | {"at": _time(row.entry.at), "pressed_at": _time(row.pressed_at)}
    known = redact_value(entry, LOG).items()
    shown = {name: value for name, value in known if value not in ("", None)}
    try:
        texts = list(_texts(json.loads(row.entry.text or "{}")))
    except (ValueError, RecursionError):
        texts = []
    parameters: dict[str, Any] = {}
    for text in texts:
        parameters |= redact_value(text["params"], SENTENCE)
    codes = [redact(text["code"], ID) for text in texts]
    told = {name: value for name, value in parameters.items() if value != LEFT_OUT}
    return shown | {"codes": codes, "parameters": told}


def _texts(value: Any, depth: int = 0) -> Iterator[Mapping[str, Any]]:
    """A sentence and those in its parameters; values such as "=time" are none."""
    if depth > DEEPEST or not isinstance(value, Mapping):
        return
    code, inner = value.get("code"), value.get("params")
    if not isinstance(code, str) or not isinstance(inner, Mapping):
        return
    if not code.startswith("="):
        yield {"code": code, "params": {k: v for k, v in inner.items() if not isinstance(v, Mapping)}}
    for text in inner.values():
        yield from _texts(text, depth + 1)


def _time(ms: int | None) -> str | None:
    if ms is None:
        return None
    return datetime.fromtimestamp(ms / 1000, UTC).isoformat(timespec="milliseconds")


# The doctor's findings for a support bundle: codes, and names that are known to be harmless.

_PORT: Final = re.compile(rf"(?:{ADDRESS.pattern}) port \d{{1,5}}")
_SCREEN: Final = re.compile(r"(?:HDMI|DP|eDP|DVI|VGA|DSI|LVDS)(?:-[A-Z0-9]{1,3}){1,2}")
_ABOUT: Final = (ENDPOINT, ROS_NAME, HEX, PLACE, _PORT, _SCREEN, words(" ".join(files())))
# The place of a fault in the panel file: "page[0].widget[2].topic (line 5)".
_PART: Final = re.compile(r"([A-Za-z0-9_\-]+)((?:\[\d{1,6}\])?)")
_MORE: Final = re.compile(r" and \d{1,9} more")
_LINE: Final = re.compile(r" \(line \d{1,7}\)")
OF_THE_FILE: Final = ("panel_fault", "type_unknown")


def redact_report(diagnosis: Diagnosis, version: str) -> dict[str, Any]:
    report = diagnosis.report
    return {
        "version": version,
        "well": report.is_well,
        "passed": len(report.facts) + report.more_facts,
        "findings": [_finding(finding) for finding in report.findings],
        "more": dict(report.more),
    }


def _finding(finding: Finding) -> dict[str, str]:
    about = _place(finding.about) if finding.code in OF_THE_FILE else _names(finding.about, *_ABOUT)
    details = {
        name: _names(str(value), rule) if (rule := DETAILS.get(name)) else LEFT_OUT
        for name, value in finding.details.items()
    }
    sentence = KINDS[finding.code].sentence.format(about=about, **details)
    shown = {"severity": finding.severity, "code": finding.code, "about": about}
    return shown | {"robot": finding.robot, "what": sentence}


def _names(text: str, *expected: re.Pattern[str]) -> str:
    """Each of the names if one of the rules expects it."""
    more = _MORE.search(text)
    shown = []
    for name in text[: more.start() if more else None].split(", "):
        kept = (redact(name, rule) for rule in expected)
        shown.append(next((name for name in kept if name != LEFT_OUT), LEFT_OUT))
    return ", ".join(shown) + (more[0] if more else "")


def _place(text: str) -> str:
    """A place in the panel file, as far as its keys are those of panel files."""
    line = _LINE.search(text)
    parts = []
    for part in text[: line.start() if line else None].split("."):
        key = _PART.fullmatch(part)
        parts.append(part if key is not None and key[1] in PANEL else LEFT_OUT)
    return ".".join(parts) + (line[0] if line else "")


# A TOML or JSON5 file without its comments, texts and unknown keys: all else stays in its place, so
# that a fault can be found by its line. Linear in the length of a text, also of a broken one. Pure.

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


def redact_text(text: str, rules: Rules, is_toml: bool) -> str:
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
    kept = redact(text, made.rule if made.known else None)
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
