"""The peers of a robot: bridges that respond, of the right namespace, domain and version, and nodes. Of
a robot without bridges, only its nodes. Pure."""

from collections.abc import Sequence
from typing import Final

from app.diagnose.findings import Report, few
from app.diagnose.names import PanelNames
from app.dialect.endpoint import DEMO_VERSION
from app.survey.model import Bridge, GraphSnapshot

TESTED: Final = "1.10.2"  # zenoh-plugin-ros2dds; see docs/compatibility.md


def check_graph(report: Report, graph: GraphSnapshot, behind: PanelNames) -> bool:
    """Whether there is something to be said of the robot's topics."""
    robot = behind.robot
    if not behind.graphs:
        theirs = graph.robots[0].namespace
        report.find("bridge_namespace", robot=robot.id, theirs=theirs, ours=robot.namespace)
        return False
    bridges = [bridge for graph in behind.graphs for bridge in graph.bridges]
    for bridge in bridges:
        _check_bridge(report, bridge, robot.id)
    _check_several(report, behind, robot.id)
    if not any(graph.answers for graph in behind.graphs):
        return False
    return _check_nodes(report, behind, bridges)


def _check_bridge(report: Report, bridge: Bridge, robot: str) -> None:
    if not bridge.answers:
        report.find("link_bridge_silent", bridge.zid, robot=robot)
        return
    version = bridge.version.lstrip("v")
    if version not in (TESTED, DEMO_VERSION.strip('"')):
        report.find("bridge_version", bridge.zid, robot=robot, theirs=version, tested=TESTED)
    if bridge.config.get("reliable_routes_blocking") is False:
        report.find("bridge_drops", bridge.zid, robot=robot)
    where = f'domain {bridge.domain}, namespace "{bridge.namespace or "/"}"'
    report.fact(f"bridge {bridge.zid} is version {version}, {where}")


def _check_several(report: Report, behind: PanelNames, robot: str) -> None:
    """Whether two bridges forward the same for the same namespace."""
    shared = {}
    for name in sorted(behind.robot.needed()):
        there = [t for t in behind.topics(name) if t.announced]
        zids = {e.bridge for t in there for e in (*t.publishers, *t.subscribers)}
        zids |= {server.bridge for server in (*behind.services(name), *behind.actions(name))}
        if len(zids) > 1:
            shared[name] = zids
    if shared:
        bridges = sorted(set[str]().union(*shared.values()))
        report.find("bridges_two", few([*shared]), robot=robot, number=len(bridges), zids=few(bridges))


def _check_nodes(report: Report, behind: PanelNames, bridges: Sequence[Bridge]) -> bool:
    """Whether the bridges see nodes, and any of what the panel needs."""
    topics = sum(len(graph.topics) for graph in behind.graphs)
    nodes = behind.nodes()
    domain = few(sorted({str(bridge.domain) for bridge in bridges}))
    # Limited to its machine and on another interface than the nodes, it learns their names at most.
    forwarded = any(topic.announced for graph in behind.graphs for topic in graph.topics)
    if any(map(_is_limited, bridges)) and not forwarded:
        report.find("bridge_localhost", robot=behind.robot.id, domain=domain)
        return False
    if not topics and not nodes:
        report.find("bridge_domain", robot=behind.robot.id, domain=domain)
        return False
    where = f"domain {domain}" if bridges else "the robot"
    report.fact(f"{where} has nodes: {len(nodes)}, and topics: {topics}")
    needed = behind.robot.needed()
    there = any(behind.topics(n) or behind.offers(n) or behind.has_node(n) for n in needed)
    if not there and (near := next(behind.elsewhere(needed), None)) is not None:
        report.find("robot_elsewhere", robot=behind.robot.id, found=near[0], namespace=near[1])
    return True


def _is_limited(bridge: Bridge) -> bool:
    """Whether its file limits it to its own machine."""
    limited = bridge.config.get("ros_automatic_discovery_range") == "Localhost"
    return limited or bridge.config.get("ros_localhost_only") is True
