"""`operator-panel router-config [PANEL]`: a configuration of a Zenoh router (zenohd) for a robot whose
nodes run on rmw_zenoh, by which the panel can send its commands and nothing else.

Exit status: see `peer_config`.
"""

import re
import sys
from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.panel import load_panel
from app.ros.dialects.dialect import WITHOUT_ROUTER
from app.system.certificates import AUTHORITY, CertificateError, CertificateFolder, about
from app.system.errors import KioskError
from app.tools.cell_config.access_rules import TlsFiles, over_tls
from app.tools.cell_config.plant_router import LISTEN as PLANT_LISTEN
from app.tools.cell_config.plant_router import CellAccess, PlantOptions, plant_router_config
from app.tools.cell_config.rmw_zenoh_router import LISTEN, NODES, RouterOptions, router_config
from app.tools.cli.parser import Parser
from app.tools.cli.peer_config import (
    KIOSK,
    add_domain,
    add_options,
    endpoint,
    listen_of,
    read_panel,
    write,
)

PROG: Final = "python -m app.cli router-config"
NO_ROUTER: Final = (
    "this robot is behind a bridge, by the panel file: `operator-panel bridge-config` writes a"
    " configuration of the bridge"
)
CLIENT: Final = "-client"  # after the name of a router's files
NOT_TLS: Final = "--tls needs a place that has TLS: name it with --listen tls/192.0.2.10:7447"
NOT_TOLD_APART: Final = (
    "without certificates cells and walls can't be told apart, and a wall could publish: name the"
    " folder with them by --tls"
)
OVER_TLS: Final = ("tls/", "quic/")
INTERFACE: Final = re.compile(r"[^\s/\"\\]{1,15}")  # as Linux names them


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if options.cells or options.walls:
        return _of_plant(parser, options)
    if (cell := read_panel(parser, options)) is None:
        return 2
    if cell.robot.dialect in WITHOUT_ROUTER:
        parser.error(NO_ROUTER)
    router = RouterOptions(
        domain=cell.robot.domain if options.domain is None else options.domain,
        listen=listen_of(options, cell.entry, LISTEN),
        nodes=tuple(options.nodes or NODES),
        tls=cell.tls,
    )
    if cell.tls is not None and not all(end.startswith(OVER_TLS) for end in router.listen):
        parser.error(NOT_TLS)
    return write(router_config(cell.panel, cell.interfaces, cell.entry, router), options)


def _of_plant(parser: Parser, options: Any) -> int:
    """Of a plant's router, at which cells and walls meet."""
    if options.panel or options.robot or options.nodes or options.domain is not None:
        parser.error("--cell and --wall are for a router of the plant, without a PANEL and its robot")
    if options.tls is None and options.cells and options.walls:
        parser.error(NOT_TOLD_APART)
    try:
        cells = [_cell(parser, *each) for each in options.cells or ()]
        tls = None if options.tls is None else _plant_files(options)
        client = _client_files(options) if tls and options.connect else None
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    if len({(cell.site, cell.cell) for cell in cells}) < len(cells):
        parser.error("two of the cells have the same names: change `cell` in [site] of one of them")
    listen = tuple(options.listen or PLANT_LISTEN)
    plant = PlantOptions(
        cells=cells,
        walls=tuple(options.walls or ()),
        routers=tuple(options.routers or ()),
        listen=listen if tls is None else over_tls(listen),
        connect=tuple(options.connect or ()),
        tls=tls,
        client=client,
    )
    return write(plant_router_config(plant), options)


def _cell(parser: Parser, file: Path, certificate: str) -> CellAccess:
    panel = load_panel(file)
    if panel.site is None:
        parser.error(f"{file} has no [site]: its panel publishes no summary")
    return CellAccess(panel.site.name, panel.site_cell, certificate or f"{file.stem}-{KIOSK}")


def _plant_files(options: Any) -> TlsFiles:
    """CertificateError if one of them is not there."""
    folder = CertificateFolder(options.tls.resolve())
    certificate, key = folder.certificate(options.certificate), folder.key(options.certificate)
    about(certificate)
    if not key.exists():
        raise CertificateError(f"{key} is not there: `operator-panel pki add` makes it")
    return TlsFiles(about(folder.certificate(AUTHORITY)).file, certificate, key, "")


def _client_files(options: Any) -> tuple[Path, Path]:
    """The certificate by which it connects to another router: one for who connects."""
    folder, name = CertificateFolder(options.tls.resolve()), f"{options.certificate}{CLIENT}"
    about(folder.certificate(name))
    return folder.certificate(name), folder.key(name)


def _panel_and_name(text: str) -> tuple[Path, str]:
    file, _, name = text.partition("=")
    if not file:
        raise ArgumentTypeError(f'"{text}" is not a panel file, like cell1.toml=cell1-kiosk')
    return Path(file), name


def _interface(text: str) -> str:
    if not INTERFACE.fullmatch(text):
        raise ArgumentTypeError(f'"{text}" is not a network interface, like lo or eth0')
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a configuration of a Zenoh router for a robot on rmw_zenoh: the robot's"
        " nodes may do everything, and clients at the panel's endpoint only what the panel needs. With"
        " --cell or --wall, of a router of the plant: each cell may publish its own summary, walls may"
        " read all of them, and nothing else passes.",
        epilog="Start the router with it: zenohd -c router.json5",
    )
    add_options(parser, listen=f"{LISTEN[0]} for a panel on the same machine")
    add_domain(parser, None, "that in the panel file")
    parser.add_argument(
        "--nodes",
        action="append",
        type=_interface,
        metavar="INTERFACE",
        help="the network interface by which the robot's nodes come to the router; may be given several"
        f" times; default: {NODES[0]}, for nodes on the router's machine",
    )
    plant = parser.add_argument_group("a router of the plant")
    plant.add_argument(
        "--cell",
        action="append",
        dest="cells",
        type=_panel_and_name,
        metavar="PANEL[=NAME]",
        help="a panel file with [site]: its cell may publish its summary. NAME is the common name of"
        " its panel's certificate; default: as `operator-panel pki new` has it; several are possible",
    )
    plant.add_argument(
        "--wall",
        action="append",
        dest="walls",
        metavar="NAME",
        help="the common name of a wall's certificate: it may read all summaries, and publish nothing;"
        " may be given several times",
    )
    plant.add_argument(
        "--router",
        action="append",
        dest="routers",
        metavar="NAME",
        help="the common name of another router's certificate: summaries pass between both",
    )
    plant.add_argument(
        "--connect",
        action="append",
        type=endpoint,
        metavar="ENDPOINT",
        help="another router of the plant; may be given several times",
    )
    plant.add_argument(
        "--certificate",
        default="router",
        metavar="NAME",
        help="the name of this router's files in the folder of --tls, and with --connect"
        " of NAME-client, for who connects; default: %(default)s",
    )
    return parser
