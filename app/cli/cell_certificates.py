"""Whose certificates a panel's cell has: the kiosk, and the bridge or router of each robot."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from app.certificates.folder import AUTHORITY, CertificateFolder
from app.certificates.issuing import Holder
from app.dialect.dialect import WITHOUT_BRIDGE
from app.panel import Panel
from app.panel.model import RobotEntry
from app.transport.access_rules import over_tls

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
// It only connects, to the bridge or router named here; it listens to nobody.
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
