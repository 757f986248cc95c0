"""A configuration of a plant's Zenoh router (zenohd), at which cells publish their summaries and walls
read them, with access control: nothing else passes. Source of the keys: `DEFAULT_CONFIG.json5` of Zenoh
1.10, tested. No I/O.

A cell may publish its own summary and sees no robot of another cell; a wall may read all summaries and
publish nothing. Who is who is said by the certificate of the connection.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.ros.zenoh.site import alive_key, summary_key
from app.tools.cell_config.access_rules import LOOK, Rule, Subject, TlsFiles, access_lines, tls_link

LISTEN: Final = ("tcp/0.0.0.0:7447",)
SUMMARIES: Final = (summary_key(),)
TOKENS: Final = (alive_key(),)
EVERYONE: Final = "everyone"


@dataclass(frozen=True, slots=True)
class CellAccess:
    """A cell, by the names in its summary's key, and the common name of its panel's certificate."""

    site: str
    cell: str
    certificate: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantOptions:
    """`walls` and `routers` are common names of certificates, `connect` the endpoints of the plant's
    other routers, to which it is known by the certificate and key `client`. Without `tls` no one can be
    told apart: then there are cells only, or walls only."""

    cells: Sequence[CellAccess] = ()
    walls: Sequence[str] = ()
    routers: Sequence[str] = ()
    listen: Sequence[str] = LISTEN
    connect: Sequence[str] = ()
    tls: TlsFiles | None = None
    client: tuple[Path, Path] | None = None


def plant_router_config(options: PlantOptions) -> str:
    """The file's text, JSON5 with comments."""
    rules = [*_rules(options)]
    return "\n".join(
        [
            "// A Zenoh router of the plant, for the summaries of cells (operator-panel wall).",
            "// zenohd -c router.json5",
            "{",
            '  mode: "router",',
            f"  listen: {{ endpoints: {json.dumps(list(options.listen))} }},",
            "  // The plant's other routers.",
            f"  connect: {{ endpoints: {json.dumps(list(options.connect))} }},",
            _SETTINGS,
            *(tls_link(options.tls, "      ", options.client) if options.tls else ()),
            "    },",
            "  },",
            "  // What is not named here is denied: no topic of a robot passes.",
            *access_lines(rules, [*_subjects(options)]),
            "}",
            "",
        ]
    )


def _rules(options: PlantOptions) -> Iterator[Rule]:
    for number, cell in enumerate(options.cells, 1):
        names = cell.site, cell.cell
        own, token = (summary_key(*names),), (alive_key(*names),)
        sends = ("put", "reply", "declare_queryable", "declare_subscriber")
        yield Rule(f"cell_{number}_summary", sends, True, own)
        yield Rule(f"cell_{number}_alive", ("liveliness_token",), True, token)
        yield Rule(f"cell_{number}_other", ("put",), False, own)  # a second cell with its name
    if options.cells:
        # Who reads: a cell publishes only what someone subscribes to.
        yield Rule("readers", ("declare_subscriber", "query"), False, SUMMARIES)
        yield Rule("look_for_cells", LOOK, False, TOKENS)
    if options.walls:
        yield Rule("read", ("declare_subscriber", "query"), True, SUMMARIES)
        yield Rule("look", LOOK, True, TOKENS)
        yield Rule("summaries", ("put", "reply", "declare_queryable"), False, SUMMARIES)
        yield Rule("tokens", ("liveliness_token",), False, TOKENS)
    if options.routers:
        both = ("put", "reply", "query", "declare_queryable", "declare_subscriber")
        for inward, flow in ((True, "in"), (False, "out")):
            yield Rule(f"routers_{flow}", both, inward, SUMMARIES)
            yield Rule(f"routers_tokens_{flow}", ("liveliness_token", *LOOK), inward, TOKENS)


def _subjects(options: PlantOptions) -> Iterator[Subject]:
    for_cells = ("readers", "look_for_cells")
    for_walls = ("read", "look", "summaries", "tokens")
    of_cells = {
        number: (f"cell_{number}_summary", f"cell_{number}_alive", f"cell_{number}_other")
        for number, _ in enumerate(options.cells, 1)
    }
    if options.tls is None:
        of_all = [rule for rules in of_cells.values() for rule in rules]
        ids = [*of_all, *for_cells] if options.cells else for_walls
        yield Subject(EVERYONE, ids, {}, "Everyone.")
        return
    for number, cell in enumerate(options.cells, 1):
        names = {"cert_common_names": [cell.certificate]}
        comment = f"The cell {cell.site}/{cell.cell}."
        yield Subject(f"cell_{number}", [*of_cells[number], *for_cells], names, comment)
    if options.walls:
        names = {"cert_common_names": [*options.walls]}
        yield Subject("walls", for_walls, names, "Walls: they read, and publish nothing.")
    if options.routers:
        names = {"cert_common_names": [*options.routers]}
        ids = [f"routers_{part}{flow}" for flow in ("in", "out") for part in ("", "tokens_")]
        yield Subject("routers", ids, names, "The plant's other routers.")


_SETTINGS: Final = """\
  scouting: {
    multicast: { enabled: false },
    gossip: { enabled: false },
  },
  transport: {
    link: {
      // One that is silent for this many ms is lost (default: 10000).
      tx: { lease: 2000, keep_alive: 4 },"""
