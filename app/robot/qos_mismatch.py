"""Why DDS would not match a publisher and a subscriber, by their QoS: the codes of sentences. Pure."""

from app.dialect.endpoint import Endpoint
from app.interfaces.names import Qos


def reader_mismatch(publisher: Endpoint, qos: Qos) -> str | None:
    """Why a subscription with this QoS does not match a publisher."""
    if qos.reliable and publisher.reliable is False:
        return "qos_robot_best_effort"
    if qos.transient_local and not publisher.transient_local:
        return "qos_robot_volatile"
    return None


def writer_mismatch(subscriber: Endpoint, qos: Qos) -> str | None:
    """Why a subscriber does not match a publisher with this QoS."""
    if not qos.reliable and subscriber.reliable:
        return "qos_robot_requires_reliable"
    if not qos.transient_local and subscriber.transient_local:
        return "qos_robot_requires_transient_local"
    return None
