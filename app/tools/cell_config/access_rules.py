"""Access control of a Zenoh router or bridge, as JSON5: what the panel may do there, and TLS. Source of
the keys: `DEFAULT_CONFIG.json5` of Zenoh 1.10, tested. No I/O.

What an access control list does not name is denied, in both directions.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from app.ros.dialects.dialect import caches
from app.ros.zenoh.declarations import Declarations

LOOK: Final = ("declare_liveliness_subscriber", "liveliness_query")
EVERYTHING: Final = "everything"  # the rule of the robot's nodes, in both directions
BOTH: Final = '["ingress", "egress"]'


@dataclass(frozen=True, slots=True)
class Rule:
    """What a panel may do; `inward` is to the router. Nothing without key expressions."""

    id: str
    messages: tuple[str, ...]
    inward: bool
    expressions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class TlsFiles:
    """TLS with certificates of both sides: where the files are on the router's machine, and the common
    name of the panel's certificate."""

    authority: Path
    certificate: Path
    key: Path
    panel: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PanelUse:
    """What a panel's session uses at its peer, as key expressions. `admin` are those of the peer's
    admin space that it asks, `graph` the tokens that it reads, `tokens` those that it declares."""

    declared: Declarations
    on_demand: Iterable[str]
    admin: tuple[str, ...]
    graph: tuple[str, ...]
    tokens: Iterable[str]


def panel_rules(use: PanelUse) -> list[Rule]:
    """All that the panel's session does, from the table that the session itself reads."""
    declared = use.declared
    read = _sorted([*declared.subscribe.values(), *use.on_demand])
    sent, asked = _sorted(declared.publish.values()), _sorted(declared.query.values())
    read_caches = tuple(map(caches, read))
    own_caches = _sorted(caches(declared.publish[key]) for key in declared.latched)
    inward, outward = partial(Rule, inward=True), partial(Rule, inward=False)
    # A cache is asked by the name of its token, and answers by that of its topic. Its publisher puts
    # the number of its last message there.
    return [
        inward("commands", ("put", "reply"), expressions=sent),
        outward("command_subscribers", ("declare_subscriber",), expressions=sent),
        inward("requests", ("query",), expressions=(*asked, *use.admin)),
        outward("answers", ("reply", "declare_queryable"), expressions=(*asked, *use.admin)),
        inward("subscriptions", ("declare_subscriber",), expressions=read),
        outward("values", ("put", "reply"), expressions=read),
        inward("latched_requests", ("query", "declare_subscriber", *LOOK), expressions=read_caches),
        outward("latched", ("declare_queryable", "liveliness_token", "put"), expressions=read_caches),
        inward("graph_requests", LOOK, expressions=use.graph),
        outward("graph", ("liveliness_token",), expressions=use.graph),
        inward("tokens", ("liveliness_token",), expressions=_sorted(use.tokens)),
        inward("own_caches", ("declare_queryable", "liveliness_token"), expressions=own_caches),
        outward("own_cache_requests", ("query", *LOOK), expressions=own_caches),
    ]


@dataclass(frozen=True, slots=True)
class Subject:
    """Who comes to a router: by their certificates' common names, network interfaces and protocols of
    the link; everyone without any. `rules` are the ids of what they may do."""

    id: str
    rules: Sequence[str]
    keys: Mapping[str, Sequence[str]]
    comment: str


def access_control(
    rules: Sequence[Rule], tls: TlsFiles | None, nodes: Mapping[str, Sequence[str]] | None = None
) -> Iterator[str]:
    """The lines of `access_control` for one panel. `nodes` is the subject of the robot's nodes, to
    which the rule `EVERYTHING` applies; a bridge has none."""
    mine = [rule for rule in rules if rule.expressions]
    everything = [rule.id for rule in mine if rule.id == EVERYTHING]
    subjects = []
    if nodes is not None:
        comment = "The robot's nodes, by the way on which they come."
        subjects.append(Subject("nodes", everything, nodes, comment))
    names = {} if tls is None else {"cert_common_names": [tls.panel]}
    comment = "Everyone." if tls is None else "Who has the panel's certificate."
    ids = [rule.id for rule in mine if rule.id != EVERYTHING]
    yield from access_lines(mine, [*subjects, Subject("panel", ids, names, comment)])


def access_lines(rules: Sequence[Rule], subjects: Sequence[Subject]) -> Iterator[str]:
    """The lines of `access_control`: what is not in the rules of a subject is denied."""
    yield "  access_control: {"
    yield "    enabled: true,"
    yield '    default_permission: "deny",'
    yield "    rules: ["
    for rule in rules:
        yield from _rule(rule)
    yield "    ],"
    yield "    subjects: ["
    for subject in subjects:
        keys = {"id": [subject.id], **subject.keys}
        listed = ", ".join(
            f"{key}: {json.dumps(value[0] if key == 'id' else list(value))}"
            for key, value in keys.items()
        )
        yield f"      // {subject.comment}"
        yield f"      {{ {listed} }},"
    yield "    ],"
    yield "    policies: ["
    for subject in subjects:
        yield f'      {{ rules: {json.dumps(list(subject.rules))}, subjects: ["{subject.id}"] }},'
    yield "    ],"
    yield "  },"


def tls_link(tls: TlsFiles, indent: str, connect: tuple[Path, Path] | None = None) -> Iterator[str]:
    """The lines of `transport.link.tls` of who listens; `connect` are the certificate and the key of
    who connects too."""
    ends = {"listen": (tls.certificate, tls.key)} | ({"connect": connect} if connect else {})
    yield f"{indent}// Only who has a certificate of this CA gets in."
    yield f"{indent}tls: {{"
    yield f"{indent}  root_ca_certificate: {json.dumps(str(tls.authority))},"
    for end, (certificate, key) in ends.items():
        yield f"{indent}  {end}_certificate: {json.dumps(str(certificate))},"
        yield f"{indent}  {end}_private_key: {json.dumps(str(key))},"
    yield f"{indent}  enable_mtls: true,"
    yield f"{indent}}},"


def over_tls(endpoints: Iterable[str]) -> tuple[str, ...]:
    """The same places over TLS, of those on TCP."""
    return tuple(
        f"tls/{end.removeprefix('tcp/')}" if end.startswith("tcp/") else end for end in endpoints
    )


def _sorted(expressions: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(set(expressions)))


def _rule(rule: Rule) -> Iterator[str]:
    flows = '["ingress"]' if rule.inward else '["egress"]'
    yield "      {"
    yield f'        id: "{rule.id}",'
    yield '        permission: "allow",'
    yield f"        flows: {BOTH if rule.id == EVERYTHING else flows},"
    yield f"        messages: {json.dumps(rule.messages)},"
    yield "        key_exprs: ["
    yield from (f"          {json.dumps(expression)}," for expression in rule.expressions)
    yield "        ],"
    yield "      },"
