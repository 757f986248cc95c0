"""What `bridge-config` and `router-config` share: which robot it is for, its options, and the file.

Exit status of both: 0 written, 1 it can't be written, 2 a mistake on the command line or a panel with
faults.
"""

import json
import os
import sys
from argparse import ArgumentTypeError
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.panel import Panel, load_panel
from app.panel.base import ENDPOINT
from app.panel.model import RobotEntry
from app.ros.dialects.dialect import DOMAIN_MOST, WITHOUT_BRIDGE
from app.ros.messages import Interfaces, load_interfaces
from app.system.certificates import AUTHORITY, CertificateError, CertificateFolder, Holder, about
from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.cell_config.access_rules import TlsFiles, over_tls
from app.tools.cli.arguments import PANEL_HELP
from app.tools.cli.output import OutputError, add_force, draft_of
from app.tools.cli.parser import Parser

# Whose certificates a panel's cell has: the kiosk, and the bridge or router of each robot.

KIOSK: Final = "kiosk"
HERE: Final = ("localhost", "127.0.0.1", "::1")
PORT: Final = 7447


def peer_files(panel: Panel, entry: RobotEntry | None) -> str:
    """The name of the files of a robot's bridge or router; of several robots each has its own."""
    kind = "router" if (entry or panel).dialect in WITHOUT_BRIDGE else "bridge"
    return f"{kind}-{entry.id}" if entry and len(panel.robots) > 1 else kind


def cell_holders(panel: Panel, cell: str, hosts: Sequence[str]) -> list[tuple[str, Holder]]:
    """(name of the files, holder) of the panel and of each robot's peer. `cell` is put before each
    name, so that the certificates of several cells with the same CA differ. `hosts` are names and
    addresses of the peers beside those in the panel file."""
    holders = [(KIOSK, Holder(f"{cell}-{KIOSK}", "client"))]
    for entry in panel.robots or (None,):
        name = peer_files(panel, entry)
        named = dict.fromkeys((*hosts, *hosts_of(entry.connect if entry else ()), *HERE))
        holders.append((name, Holder(f"{cell}-{name}", "server", tuple(named))))
    return holders


def hosts_of(endpoints: Iterable[str]) -> list[str]:
    """The names and addresses of machines in Zenoh endpoints."""
    places = [end.partition("/")[2].partition("?")[0].partition("#")[0] for end in endpoints]
    return [host.strip("[]") for place in places if (host := place.rpartition(":")[0])]


def kiosk_config(folder: CertificateFolder, endpoints: Sequence[str]) -> str:
    """The Zenoh configuration of a panel over TLS, JSON5 with comments."""
    key, certificate = folder.key(KIOSK), folder.certificate(KIOSK)
    return KIOSK_CONFIG.format(
        endpoints=json.dumps(list(over_tls(endpoints))),
        authority=_quoted(folder.certificate(AUTHORITY)),
        certificate=_quoted(certificate),
        key=_quoted(key),
    )


def _quoted(file: Path) -> str:
    return json.dumps(str(file))


KIOSK_CONFIG: Final = """\
// The kiosk's Zenoh session, over TLS: KIOSK_ZENOH names this file.
// It only connects, to the bridge or router named here; it listens to no one.
{{
  mode: "peer",
  connect: {{
    endpoints: {endpoints},
    retry: {{ period_init_ms: 250, period_max_ms: 1000, period_increase_factor: 2 }},
  }},
  listen: {{ endpoints: [] }},
  scouting: {{
    multicast: {{ enabled: false }},
    gossip: {{ enabled: false }},
  }},
  open: {{ return_conditions: {{ connect_scouted: false }} }},
  transport: {{
    link: {{
      tx: {{ lease: 2000, keep_alive: 4 }},
      tls: {{
        root_ca_certificate: {authority},
        connect_certificate: {certificate},
        connect_private_key: {key},
        enable_mtls: true,
        verify_name_on_connect: true,
      }},
    }},
  }},
}}
"""


def robot_entry(parser: Parser, panel: Panel, name: str | None) -> RobotEntry | None:
    """The robot that the configuration is for: of several one has to be named."""
    names = [entry.id for entry in panel.robots]
    if name is None and len(names) <= 1:
        return panel.robots[0] if panel.robots else None
    for entry in panel.robots:
        if entry.id == name:
            return entry
    listed = ", ".join(names) or "none: leave --robot out"
    parser.error(f"--robot names one of the panel's robots: there is {listed}")


class CellPanel(NamedTuple):
    """A panel, the robot of which a file is written, and the files of --tls."""

    panel: Panel
    interfaces: Interfaces
    entry: RobotEntry | None
    tls: TlsFiles | None

    @property
    def robot(self) -> RobotEntry | Panel:
        """What has the robot's dialect and domain."""
        return self.entry or self.panel


def read_panel(parser: Parser, options: Any) -> CellPanel | None:
    """None if it can't be used, after the reason was printed."""
    try:
        panel = load_panel(options.panel or Settings.from_environment().panel)
        interfaces = load_interfaces(panel.distro, panel.interfaces)
        entry = robot_entry(parser, panel, options.robot)
        return CellPanel(panel, interfaces, entry, tls_of(options, panel, entry))
    except KioskError as error:
        print(error, file=sys.stderr)
        return None


def listen_of(options: Any, entry: RobotEntry | None, default: Sequence[str]) -> tuple[str, ...]:
    """Where the panel connects: by the command line, else by the panel file; over TLS with --tls."""
    endpoints = tuple(options.listen or (entry.connect if entry and entry.connect else default))
    return endpoints if options.tls is None else over_tls(endpoints)


def tls_of(options: Any, panel: Panel, entry: RobotEntry | None) -> TlsFiles | None:
    """The files of --tls; CertificateError if one of them is not there."""
    if options.tls is None:
        return None
    folder = CertificateFolder(options.tls.resolve())
    name = peer_files(panel, entry)
    certificate, key = folder.certificate(name), folder.key(name)
    about(certificate)
    if not key.exists():
        raise CertificateError(f"{key} is not there: `operator-panel pki new` makes it")
    kiosk = about(folder.certificate(KIOSK))
    return TlsFiles(about(folder.certificate(AUTHORITY)).file, certificate, key, kiosk.name)


def write(text: str, options: Any) -> int:
    """Writes the file, or prints it without one. Returns the exit status."""
    if options.output is None:
        print(text, end="")
        return 0
    try:
        with draft_of(options.output, options.force) as draft:
            draft.write_text(text, encoding="utf-8")
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def add_options(parser: Parser, *, listen: str) -> None:
    """PANEL, -o, --force, --listen, --robot; `listen` is the default of --listen in words."""
    add = parser.add_argument
    add("panel", nargs="?", type=Path, metavar="PANEL", help=PANEL_HELP)
    add("-o", "--output", type=Path, metavar="FILE", help="where to write it; default: standard output")
    add_force(parser)
    add(
        "--listen",
        action="append",
        type=endpoint,
        metavar="ENDPOINT",
        help="where the panel connects, such as tcp/192.0.2.10:7447; may be given several times;"
        f" default: the robot's `connect` in the panel file, else {listen}",
    )
    add(
        "--tls",
        type=Path,
        metavar="FOLDER",
        help="the folder with certificates, as `operator-panel pki new` makes it: only who has the"
        " panel's certificate can send what the panel sends",
    )
    add("--robot", metavar="ID", help="which robot, of a panel with several")


def add_domain(parser: Parser, default: str | None, described: str) -> None:
    """--domain"""
    parser.add_argument(
        "--domain",
        type=domain,
        default=default,
        metavar="N",
        help=f"ROS_DOMAIN_ID of the robot's nodes; default: {described}",
    )


def own_domain() -> str:
    """The ROS domain of this machine."""
    return os.environ.get("ROS_DOMAIN_ID") or "0"


def domain(text: str) -> int:
    number = int(text) if text.isascii() and text.isdigit() else -1
    if not 0 <= number <= DOMAIN_MOST:
        raise ArgumentTypeError(f'"{text}" is not a ROS_DOMAIN_ID: 0 to {DOMAIN_MOST}')
    return number


def endpoint(text: str) -> str:
    if not ENDPOINT.fullmatch(text):
        raise ArgumentTypeError(
            f'"{text}" is not a Zenoh endpoint: it must be like tcp/192.0.2.10:7447'
        )
    return text
