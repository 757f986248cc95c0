"""The ROS graph behind the bridges of a link: queried, and built from their answers."""

import asyncio
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, cast

from app.ros.dialects import bridge_dialect as dialect
from app.ros.dialects import bridge_entities as entities
from app.ros.dialects.bridge_entities import DdsEntity, TokenQos
from app.ros.dialects.dialect import Endpoint
from app.ros.graph.model import (
    CALLABLE,
    Bridge,
    BridgeRoute,
    EndpointQos,
    GraphSnapshot,
    Node,
    PeerEndpoint,
    RobotGraph,
    RouteDirection,
    RouteKind,
    Server,
    SurveyedTopic,
    TopicEndpoint,
)
from app.ros.zenoh.answers import GraphLink, ask_json
from app.system.errors import LinkError
from app.system.printable import one_line

# Builds the ROS graph from the bridges' answers: tokens, nodes, DDS entities, routes. Pure.

Answers = list[tuple[str, Any]]  # (admin key, JSON)


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphAnswers:
    """The answers of all bridges of a link about their graph."""

    zid: str = ""  # of the session that asked
    tokens: Iterable[str] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    configs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    nodes: Answers = field(default_factory=list)
    entities: Answers = field(default_factory=list)
    routes: Answers = field(default_factory=list)


def ros_graph(answers: GraphAnswers) -> GraphSnapshot:
    """The graph that these answers describe."""
    endpoints = map(dialect.parsed, answers.tokens)
    parsed = [(t, e) for t, e in zip(answers.tokens, endpoints, strict=True) if e is not None]
    zids = {endpoint.zid for _, endpoint in parsed if endpoint.role is None} | answers.versions.keys()
    bridges = [
        Bridge(zid=zid, version=answers.versions.get(zid, ""), config=answers.configs.get(zid, {}))
        for zid in sorted(zids)
    ]
    by_namespace: defaultdict[str, list[Bridge]] = defaultdict(list)
    for bridge in bridges:
        by_namespace[bridge.namespace].append(bridge)
    parts = _parts(parsed, answers)
    peers = [
        PeerEndpoint(
            zid=endpoint.zid,
            role=str(endpoint.role),
            key=endpoint.key,
            type=endpoint.type,
            qos=_qos(entities.qos_of(token)),
        )
        for token, endpoint in parsed
        if endpoint.zid not in zids and endpoint.zid != answers.zid and endpoint.role in ("MP", "MS")
    ]
    robots = [
        _Robot(namespace, tuple(own_bridges), parts).graph()
        for namespace, own_bridges in sorted(by_namespace.items())
    ]
    return GraphSnapshot(robots=tuple(robots), peers=tuple(sorted(peers, key=lambda p: (p.zid, p.key))))


def _qos(qos: DdsEntity | TokenQos) -> EndpointQos:
    return EndpointQos(
        reliable=qos.reliable,
        transient_local=qos.transient_local,
        keep_all=qos.keep_all,
        depth=qos.depth,
    )


@dataclass(slots=True)
class _BridgeParts:
    """The answers and tokens of one bridge."""

    tokens: list[tuple[str, Endpoint]] = field(default_factory=list)
    nodes: list[tuple[str, Node]] = field(default_factory=list)  # with their participants
    entities: list[DdsEntity] = field(default_factory=list)
    routes: Answers = field(default_factory=list)


def _parts(
    tokens: Iterable[tuple[str, Endpoint]], answers: GraphAnswers
) -> defaultdict[str, _BridgeParts]:
    """Those of each bridge, by its zid."""
    parts: defaultdict[str, _BridgeParts] = defaultdict(_BridgeParts)
    for token, endpoint in tokens:
        if endpoint.role is not None:
            parts[endpoint.zid].tokens.append((token, endpoint))
    for zid, participant, node in _nodes(answers.nodes):
        parts[zid].nodes.append((participant, node))
    for entity in (entities.entity_of(key, answer) for key, answer in answers.entities):
        if entity is not None:
            parts[entity.zid].entities.append(entity)
    for key, answer in answers.routes:
        parts[dialect.zid_of(key)].routes.append((key, answer))
    return parts


class _Robot:
    """Builds the graph of one robot from the parts of its bridges."""

    def __init__(
        self, namespace: str, bridges: tuple[Bridge, ...], parts: Mapping[str, _BridgeParts]
    ) -> None:
        self._namespace = namespace
        self._bridges = bridges
        own = [(bridge.zid, parts[bridge.zid]) for bridge in bridges]
        self._tokens = [token for _, part in own for token in part.tokens]
        # (bridge, participant) → its nodes: a process may have several.
        self._nodes: defaultdict[tuple[str, str], list[Node]] = defaultdict(list)
        for zid, part in own:
            for participant, node in part.nodes:
                self._nodes[zid, participant].append(node)
        self._entities = [entity for _, part in own for entity in part.entities]
        self._parts: defaultdict[tuple[str, str], list[DdsEntity]] = defaultdict(list)  # of servers
        for entity in self._entities:
            self._parts[entity.zid, entity.name.partition(entities.ACTION_PART)[0]].append(entity)
        self._routes = [route for _, part in own for route in _routes(part.routes, namespace)]

    def graph(self) -> RobotGraph:
        nodes = [node for several in self._nodes.values() for node in several]
        return RobotGraph(
            namespace=self._namespace,
            bridges=self._bridges,
            nodes=tuple(sorted(nodes, key=lambda node: node.name)),
            topics=tuple(self._topics()),
            services=tuple(self._servers("SS")),
            actions=tuple(self._servers("AS")),
            routes=tuple(
                sorted(self._routes, key=lambda route: (route.kind, route.key, route.direction))
            ),
        )

    def _name(self, key: str) -> str:
        """The name on the robot of a key behind the bridge's namespace."""
        return f"/{key}".removeprefix(self._namespace)

    def _topics(self) -> Iterator[SurveyedTopic]:
        publishers: defaultdict[str, list[TopicEndpoint]] = defaultdict(list)
        subscribers: defaultdict[str, list[TopicEndpoint]] = defaultdict(list)
        for entity in self._entities:
            if entities.ACTION_PART not in entity.name and not entity.of_service:
                (publishers if entity.writer else subscribers)[entity.name].append(
                    self._endpoint(entity)
                )
        announced = {self._name(e.key) for _, e in self._tokens if e.role in ("MP", "MS")}
        for token, endpoint in self._tokens:  # a bridge that knows no DDS, as the simulated robot's
            name = self._name(endpoint.key)
            known = {"MP": publishers, "MS": subscribers}.get(str(endpoint.role))
            if known is not None and all(e.bridge != endpoint.zid for e in known[name]):
                known[name].append(self._by_token(token, endpoint))
        for name in sorted(publishers.keys() | subscribers.keys()):
            if publishers[name] or subscribers[name]:
                yield SurveyedTopic(
                    name=name,
                    key=f"{self._namespace}{name}"[1:],
                    publishers=tuple(publishers[name]),
                    subscribers=tuple(subscribers[name]),
                    announced=name in announced,
                )

    def _endpoint(self, entity: DdsEntity) -> TopicEndpoint:
        nodes = [
            node.name
            for node in self._nodes.get((entity.zid, entity.participant), ())
            if entity.name in (node.publishers if entity.writer else node.subscribers)
        ]
        return TopicEndpoint(
            type=entity.type,
            qos=_qos(entity),
            bridge=entity.zid,
            nodes=tuple(sorted(nodes)),
            dds=entity.vendor,
            type_hash=entity.type_hash,
        )

    def _by_token(self, token: str, endpoint: Endpoint) -> TopicEndpoint:
        announced = entities.qos_of(token)
        return TopicEndpoint(
            type=endpoint.type,
            qos=_qos(announced),
            bridge=endpoint.zid,
            type_hash=announced.type_hash,
        )

    def _servers(self, role: str) -> Iterator[Server]:
        servers = {
            (e.key, e.zid): Server(
                name=self._name(e.key), key=e.key, type=e.type, bridge=e.zid, **self._serving(role, e)
            )
            for _, e in self._tokens
            if e.role == role and entities.ACTION_PART not in e.key
        }
        yield from (servers[key] for key in sorted(servers))

    def _serving(self, role: str, endpoint: Endpoint) -> dict[str, Any]:
        """The nodes that serve an endpoint, their DDS and type hashes. If there are several, one that
        can't be called through the bridge counts, as each of them gets the request."""
        name = self._name(endpoint.key)
        nodes = [
            node
            for (zid, _), several in self._nodes.items()
            for node in several
            if zid == endpoint.zid and name in (node.services if role == "SS" else node.actions)
        ]
        vendors = sorted({node.dds for node in nodes}, key=lambda dds: dds in CALLABLE)
        return {
            "nodes": tuple(sorted(node.name for node in nodes)),
            "dds": vendors[0] if vendors else "",
            "hashes": entities.with_entities(endpoint, name, self._parts[endpoint.zid, name]).hashes,
        }


def _nodes(answers: Answers) -> Iterator[tuple[str, str, Node]]:
    """(bridge, participant, node)."""
    for key, answer in answers:
        place = entities.node_place(key)
        if place is None or not isinstance(answer, dict):
            continue
        zid, participant, name = place
        yield (
            zid,
            participant,
            Node(
                name=name,
                bridge=zid,
                dds=entities.vendor_of(participant),
                publishers=_names(answer, "publishers"),
                subscribers=_names(answer, "subscribers"),
                services=_names(answer, "service_servers"),
                clients=_names(answer, "service_clients"),
                actions=_names(answer, "action_servers"),
                action_clients=_names(answer, "action_clients"),
            ),
        )


def _names(answer: Mapping[str, Any], part: str) -> tuple[str, ...]:
    return tuple(sorted(name for name, _ in entities.names_of(answer, part)))


def _routes(answers: Answers, namespace: str) -> Iterator[BridgeRoute]:
    for admin_key, answer in answers:
        place = entities.route_place(admin_key)
        if place is None or not isinstance(answer, dict):
            continue
        zid, kind, direction, key = place
        name, active = answer.get("ros2_name"), answer.get("is_active")
        yield BridgeRoute(
            bridge=zid,
            kind=cast("RouteKind", kind),
            direction=cast("RouteDirection", direction),
            name=name if isinstance(name, str) else f"/{key}".removeprefix(namespace),
            key=key,
            type=str(answer.get("ros2_type", "")),
            active=active if isinstance(active, bool) else None,
            local_nodes=_texts(answer.get("local_nodes")),
            remote=_texts(answer.get("remote_routes")),
            endpoint=str(answer.get("dds_reader") or answer.get("dds_writer") or ""),
        )


def _texts(listed: Any) -> tuple[str, ...]:
    return tuple(map(str, listed)) if isinstance(listed, list) else ()


# Reads the whole ROS graph behind all bridges of a link.

ANNOUNCED_WITHIN_S: Final = 1.5
ANSWERED_WITHIN_S: Final = 5.0
POLL_S: Final = 0.02
MOST_VERSION: Final = 40  # characters


async def observe_bridges(
    link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
) -> GraphSnapshot:
    """The `Observe` of robots behind bridges.

    In a new session, a router announces the bridges some time after the connection: without a bridge
    it takes `ANNOUNCED_WITHIN_S`. A bridge that answered for the `earlier` graph has
    `ANSWERED_WITHIN_S` to answer again and to announce what it still has: on a busy machine it stalls
    for seconds and loses its link.
    """

    def is_whole(graph: GraphSnapshot) -> bool:
        if earlier is None:
            return bool(graph.bridges)
        return not graph.silent_since(earlier) and not _unannounced(earlier, graph)

    within_s = ANNOUNCED_WITHIN_S if earlier is None else ANSWERED_WITHIN_S
    return await _read_until(link, zid, is_whole, within_s)


def _unannounced(earlier: GraphSnapshot, graph: GraphSnapshot) -> set[str]:
    """The keys of services and actions that were announced earlier, and are now only known to be
    offered by a node."""
    offered = {
        robot.key(name)
        for robot in graph.robots
        for node in robot.nodes
        for name in (*node.services, *node.actions)
    }
    return (_servers(earlier) - _servers(graph)) & offered


def _servers(graph: GraphSnapshot) -> set[str]:
    return {server.key for robot in graph.robots for server in (*robot.services, *robot.actions)}


async def _read_until(
    link: GraphLink, zid: str, is_whole: Callable[[GraphSnapshot], bool], within_s: float
) -> GraphSnapshot:
    end = time.monotonic() + within_s
    while True:
        try:
            graph = await read_graph(link, zid)
            if is_whole(graph) or time.monotonic() > end:
                return graph
        except LinkError:
            if time.monotonic() > end:
                raise
        await asyncio.sleep(POLL_S)


async def read_graph(link: GraphLink, zid: str) -> GraphSnapshot:
    """The graph now; `zid` is that of the querying session. LinkError without a link, or if the tokens
    do not arrive in time. A bridge that has a token but does not answer has no version."""
    tokens, versions, configs, nodes, dds, routes = await asyncio.gather(
        link.tokens(),
        link.query_all(dialect.VERSION),
        ask_json(link, dialect.CONFIG),
        ask_json(link, dialect.NODES),
        ask_json(link, entities.DDS),
        ask_json(link, entities.EVERY_ROUTE),
    )
    return await asyncio.to_thread(
        ros_graph,
        GraphAnswers(
            zid=zid,
            tokens=tokens,
            versions={
                dialect.zid_of(key): one_line(version.decode(errors="replace").strip('"'), MOST_VERSION)
                for key, version in versions
            },
            configs={
                dialect.zid_of(key): config for key, config in configs if isinstance(config, dict)
            },
            nodes=nodes,
            entities=dds,
            routes=routes,
        ),
    )
