"""The bridges of a robot: there, responding, of the right namespace, domain and version. Pure."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from app.diagnose.findings import Report
from app.diagnose.names import NamesBehindBridge
from app.dialect.endpoint import DEMO_VERSION
from app.graph.model import Bridge, GraphSnapshot

TESTED: Final = "1.10.2"  # zenoh-plugin-ros2dds; see docs/compatibility.md
MOST_NAMED: Final = 3


def check_bridges(
    report: Report, graph: GraphSnapshot, behind: NamesBehindBridge, endpoints: Sequence[str]
) -> bool:
    """Whether there is something to be said of the topics behind them."""
    robot = behind.robot
    if not graph.bridges:
        report.find("no_bridge", ", ".join(endpoints), robot=robot.id)
        return False
    if not behind.graphs:
        theirs = graph.bridges[0].namespace
        report.find("bridge_namespace", robot=robot.id, theirs=theirs, ours=robot.namespace)
        return False
    bridges = [bridge for one in behind.graphs for bridge in one.bridges]
    for bridge in bridges:
        _check_bridge(report, bridge, robot.id)
    _check_several(report, behind, robot.id)
    if not any(bridge.answers for bridge in bridges):
        return False
    return _check_nodes(report, behind, bridges)


def _check_bridge(report: Report, bridge: Bridge, robot: str) -> None:
    if not bridge.answers:
        report.find("bridge_silent", bridge.zid, robot=robot)
        return
    version = bridge.version.lstrip("v")
    if version not in (TESTED, DEMO_VERSION.strip('"')):
        report.find("bridge_version", bridge.zid, robot=robot, theirs=version, tested=TESTED)
    if bridge.config.get("reliable_routes_blocking") is False:
        report.find("bridge_drops", bridge.zid, robot=robot)
    where = f'domain {bridge.domain}, namespace "{bridge.namespace or "/"}"'
    report.fact(f"bridge {bridge.zid} is version {version}, {where}")


def _check_several(report: Report, behind: NamesBehindBridge, robot: str) -> None:
    """Whether two bridges forward the same for the same namespace."""
    found = {}
    for name in sorted(behind.robot.needed()):
        there = [t for t in behind.topics(name) if t.announced]
        zids = {e.bridge for t in there for e in (*t.publishers, *t.subscribers)}
        zids |= {one.bridge for one in (*behind.services(name), *behind.actions(name))}
        if len(zids) > 1:
            found[name] = zids
    if found:
        zids = set().union(*found.values())
        about, more = ", ".join([*found][:MOST_NAMED]), len(found) - MOST_NAMED
        about += f" and {more} more" if more > 0 else ""
        report.find("bridges_two", about, robot=robot, number=len(zids), zids=", ".join(sorted(zids)))


def _check_nodes(report: Report, behind: NamesBehindBridge, bridges: Sequence[Bridge]) -> bool:
    """Whether the bridges see nodes, and any of what the panel needs."""
    topics = sum(len(one.topics) for one in behind.graphs)
    nodes = behind.nodes()
    domain = ", ".join(sorted({str(bridge.domain) for bridge in bridges}))
    if not topics and not nodes:
        report.find("bridge_domain", robot=behind.robot.id, domain=domain)
        return False
    report.fact(f"domain {domain} has nodes: {len(nodes)}, and topics: {topics}")
    needed = behind.robot.needed()
    there = any(behind.topics(n) or behind.offers(n) or behind.has_node(n) for n in needed)
    if not there and (found := next(behind.elsewhere(needed), None)) is not None:
        report.find("robot_elsewhere", robot=behind.robot.id, found=found[0], namespace=found[1])
    return True


def denies(bridges: Sequence[Bridge], kind: str, name: str) -> bool:
    """Whether a bridge's file holds a name back: `kind` is "publishers", "service_servers" or another
    of its lists. The bridge gives each list as one regular expression."""
    return any(_denied(bridge.config, kind, name) for bridge in bridges)


def _denied(config: Mapping[str, Any], kind: str, name: str) -> bool:
    for key, is_denied in _lists(config):
        if not isinstance(key, dict):
            continue
        pattern = key.get(kind)
        listed = isinstance(pattern, str) and _matches(pattern, name)
        return listed if is_denied else not listed
    return False


def _lists(config: Mapping[str, Any]) -> Iterator[tuple[Any, bool]]:
    yield config.get("allow"), False
    yield config.get("deny"), True


def _matches(pattern: str, name: str) -> bool:
    try:
        return re.search(pattern, name) is not None
    except re.error:  # Rust knows some that Python does not: then it is not known
        return True
