"""Reads what is on the robots of a link whose nodes run on rmw_zenoh, from their liveliness tokens."""

import asyncio
import time
from collections import defaultdict
from collections.abc import Iterable
from typing import Final

from app.ros.dialects.rmw_zenoh import (
    ACTION_SERVER,
    ACTION_SERVER_TYPE,
    Token,
    TokenKind,
    is_panel,
    parse_token,
)
from app.ros.graph.model import (
    EndpointQos,
    GraphSnapshot,
    Node,
    RobotGraph,
    Server,
    SurveyedTopic,
    TopicEndpoint,
)
from app.ros.zenoh.answers import GraphLink
from app.system.errors import LinkError

ANNOUNCED_WITHIN_S: Final = 1.5  # a router announces tokens some time after the connection
POLL_S: Final = 0.02
ACTION_PART: Final = "/_action/"


async def observe_nodes(
    link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
) -> GraphSnapshot:
    """The `Observe` of robots without a bridge. Zenoh may answer early, with none or few of the tokens:
    they are read until they stay the same."""
    end = time.monotonic() + ANNOUNCED_WITHIN_S
    before: set[str] = set()
    while True:
        try:
            tokens = set(await link.tokens())
            graph = graph_of(tokens, zid)
            if (graph.robots and before == tokens) or time.monotonic() > end:
                return graph
            before = tokens
        except LinkError:
            if time.monotonic() > end:
                raise
        await asyncio.sleep(POLL_S)


def graph_of(tokens: Iterable[str], zid: str) -> GraphSnapshot:
    """The nodes of the tokens, as one robot; none without a node. Those of the session `zid` and of
    panels are left out."""
    every = [token for token in map(parse_token, tokens) if token is not None and token.zid != zid]
    panels = {(token.zid, token.node) for token in every if is_panel(token)}
    own = sorted(token for token in every if (token.zid, token.node) not in panels)
    if not any(token.kind == "NN" for token in own):
        return GraphSnapshot()
    topics: defaultdict[str, list[Token]] = defaultdict(list)
    for token in own:
        if token.kind in ("MP", "MS") and ACTION_PART not in token.key:
            topics[token.key].append(token)
    robot = RobotGraph(
        nodes=tuple(_node(token, own) for token in own if token.kind == "NN"),
        topics=tuple(_topic(key, topics[key]) for key in sorted(topics)),
        services=tuple(
            _server(token, token.key, token.type)
            for token in own
            if token.kind == "SS" and ACTION_PART not in token.key
        ),
        actions=tuple(
            _server(token, _action(token), token.type.removesuffix(ACTION_SERVER_TYPE))
            for token in own
            if _is_action(token, "SS")
        ),
    )
    return GraphSnapshot(robots=(robot,))


def _is_action(token: Token, kind: TokenKind) -> bool:
    """Whether it is the token by which an action's server ("SS") or client ("SC") is known."""
    return token.kind == kind and token.key.endswith(ACTION_SERVER)


def _action(token: Token) -> str:
    return token.key.removesuffix(ACTION_SERVER)


def _node(own: Token, tokens: Iterable[Token]) -> Node:
    parts = [token for token in tokens if (token.zid, token.node) == (own.zid, own.node)]

    def names(kind: TokenKind) -> tuple[str, ...]:
        keys = {token.key for token in parts if token.kind == kind and ACTION_PART not in token.key}
        return tuple(f"/{key}" for key in sorted(keys))

    def actions(kind: TokenKind) -> tuple[str, ...]:
        return tuple(sorted(f"/{_action(token)}" for token in parts if _is_action(token, kind)))

    return Node(
        name=own.node,
        publishers=names("MP"),
        subscribers=names("MS"),
        services=names("SS"),
        clients=names("SC"),
        actions=actions("SS"),
        action_clients=actions("SC"),
    )


def _topic(key: str, tokens: Iterable[Token]) -> SurveyedTopic:
    ends: dict[str, list[TopicEndpoint]] = {"MP": [], "MS": []}
    for token in tokens:
        qos = EndpointQos(
            reliable=token.qos.reliable,
            transient_local=token.qos.transient_local,
            keep_all=token.qos.keep_all,
            depth=token.qos.depth or None,
        )
        ends[token.kind].append(
            TopicEndpoint(
                type=token.type,
                qos=qos,
                nodes=(token.node,),
                type_hash=token.type_hash,
            )
        )
    return SurveyedTopic(
        name=f"/{key}", key=key, publishers=tuple(ends["MP"]), subscribers=tuple(ends["MS"])
    )


def _server(token: Token, key: str, type_name: str) -> Server:
    return Server(
        name=f"/{key}",
        key=key,
        type=type_name,
        nodes=(token.node,),
        hashes=((token.type, token.type_hash),),
    )
