"""Whether the robot's definitions are those of the panel, by their type hashes (REP 2016). Pure.

The definition of a type may differ though its name is the same: a field more, two fields swapped, in
the type or in one that it contains. Then bytes mean something else to the robot than to the panel.
"""

from dataclasses import dataclass
from typing import Final

from app.cell.robot.graph import LiveGraph, cached_until_change
from app.ros.dialects.dialect import Endpoint, Role
from app.ros.graph.model import CALLABLE
from app.ros.messages import Interfaces
from app.system.errors import InterfaceError

HASH: Final = "RIHS01_"  # other versions of hashes can't be compared


@dataclass(frozen=True, slots=True)
class DefinitionDifference:
    """A message whose definition differs: its type, the robot's hash and the panel's, and the robot's
    node, "" if unknown."""

    type: str
    theirs: str
    ours: str
    node: str = ""


@cached_until_change
def difference(
    graph: LiveGraph, role: Role, key: str, interfaces: Interfaces
) -> DefinitionDifference | None:
    """The first difference of an endpoint of the robot; None if none is known. `role` is the
    robot's."""
    differences = (
        _difference(graph, endpoint, interfaces) for endpoint in graph.described_endpoints(role, key)
    )
    return next((difference for difference in differences if difference is not None), None)


def _difference(
    graph: LiveGraph, endpoint: Endpoint, interfaces: Interfaces
) -> DefinitionDifference | None:
    for name, theirs in endpoint.hashes:
        in_key = graph.dialect.key_hash(name)
        ours = in_key or own_hash(name, interfaces)
        if theirs != ours if in_key else ours and differs(theirs, ours):
            return DefinitionDifference(name, theirs, ours, endpoint.node)
    return None


def differs(theirs: str, ours: str) -> bool:
    """Whether two hashes are known to be of different definitions."""
    return theirs.startswith(HASH) and ours.startswith(HASH) and theirs != ours


def own_hash(type_name: str, interfaces: Interfaces) -> str:
    """The hash of the panel's own definition; "" if it has none."""
    try:
        return interfaces.type_hash(type_name)
    except InterfaceError:
        return ""


@cached_until_change
def is_unhashed(graph: LiveGraph, role: Role, key: str) -> bool:
    """Whether an endpoint is there and no hash of it is known: then it can't be compared."""
    known = graph.described_endpoints(role, key)
    present = graph.has_endpoint(role, key)
    return present and not any(server.hashes for server in known)


@cached_until_change
def timeout_hint(graph: LiveGraph, role: Role, key: str, code: str) -> str:
    """The code of what may be the cause if a server does not answer in time: `code` (see
    `PeerSentences`), or "" for a server that is known to be on a DDS that can be called."""
    vendors = {endpoint.dds for endpoint in graph.node_endpoints(role, key)}
    return "" if vendors and vendors <= {*CALLABLE} - {""} else code


@cached_until_change
def uncallable_dds(graph: LiveGraph, role: Role, key: str) -> str:
    """The DDS of a server that can't be called through its peer; "" if there is none. Of several
    servers one is enough: each of them gets the request."""
    vendors = (endpoint.dds for endpoint in graph.node_endpoints(role, key))
    return next((dds for dds in vendors if dds not in CALLABLE), "")
