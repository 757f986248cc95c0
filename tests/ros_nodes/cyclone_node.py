"""A ROS 2 node on Cyclone DDS itself, on the wire as rmw_cyclonedds makes one.

Topics are `rt/<name>`, a service's requests `rq/<name>Request` and its replies `rr/<name>Reply`,
each with rmw_cyclonedds' header. `ros_discovery_info` says which of them are this node's.
"""

import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

from cyclone_types import Gid, NodeEntitiesInfo, ParticipantEntitiesInfo, framed, ros_type, values
from cyclonedds.core import Entity, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

Answer = Callable[[Any], None]
Handler = Callable[[Any, Answer], None]

ANY_STATE = SampleState.Any | ViewState.Any | InstanceState.Any
CLIENT_WITHIN_S = 2.0


def qos_of(
    depth: int = 10,
    reliability: str = "reliable",
    durability: str = "volatile",
    user_data: str = "",
) -> Qos:
    """A ROS 2 profile as DDS policies; depth 0 keeps all. Plain CDR, as in ROS 2."""
    history = Policy.History.KeepLast(depth) if depth else Policy.History.KeepAll
    policies = [
        history,
        Policy.Reliability.Reliable(duration(infinite=True))
        if reliability == "reliable"
        else Policy.Reliability.BestEffort,
        Policy.DataRepresentation(use_cdrv0_representation=True),
    ]
    if durability == "transient_local":
        policies.append(Policy.Durability.TransientLocal)
        # What a late reader gets is kept by the durability service.
        policies.append(Policy.DurabilityService(duration(seconds=0), history, -1, -1, -1))
    if user_data:
        policies.append(Policy.Userdata(user_data.encode()))
    return Qos(*policies)


def publishers(reader: DataReader) -> int:
    """How many writers of others are matched: the lists of them fail while they grow."""
    return reader.get_subscription_matched_status().current_count


def subscribers(writer: DataWriter) -> int:
    return writer.get_publication_matched_status().current_count


class Service:
    """One service server: `handler(request, answer)` may answer at once, later or never."""

    def __init__(self, requests: DataReader, replies: DataWriter, handler: Handler) -> None:
        self.requests = requests
        self.replies = replies
        self.handler = handler

    def execute(self, request: Any) -> None:
        header = {"guid": request.guid, "sequence_number": request.sequence_number}

        def answer(body: Any) -> None:
            self._await_client()
            self.replies.write(self.replies.data_type(**header, **values(body)))

        self.handler(request, answer)

    @property
    def matched(self) -> bool:
        return publishers(self.requests) > 0 and self._heard

    @property
    def _heard(self) -> bool:
        return subscribers(self.replies) > 0

    def _await_client(self) -> None:
        """A reply before its reader is discovered would be lost; rmw_cyclonedds waits as well."""
        end = time.monotonic() + CLIENT_WITHIN_S
        while not self._heard and time.monotonic() < end:
            time.sleep(0.001)


class Node:
    """The participant, its readers and writers, and the one thread that serves what they receive.

    `called(service, request)` hears of each request before the service executes it.
    """

    def __init__(self, name: str, domain: int, called: Callable[[str, Any], None]) -> None:
        self.name = name
        self._called = called
        self.services: dict[str, Service] = {}
        self.published: dict[str, DataWriter] = {}
        self._participant = DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
        self._waitset = WaitSet(self._participant)
        self._received: list[tuple[DataReader, Callable[[Any], None]]] = []
        self._readers: list[Gid] = []
        self._writers: list[Gid] = []
        self._info = DataWriter(
            self._participant,
            Topic(self._participant, "ros_discovery_info", ParticipantEntitiesInfo),
            qos_of(depth=1, durability="transient_local"),
        )
        self._closing = False
        self._thread = threading.Thread(target=self._receive, daemon=True)

    def advertise(self, topic: str, type_: type, qos: Qos) -> DataWriter:
        self.published[topic] = self._writer(f"rt{topic}", type_, qos)
        return self.published[topic]

    def subscribe(self, topic: str, type_: type, qos: Qos, heard: Callable[[Any], None]) -> DataReader:
        reader = self._reader(f"rt{topic}", type_, qos)
        self._on_each(reader, heard)
        return reader

    def serve(self, name: str, request: type, response: type, handler: Handler) -> None:
        identity = [*_gid(self._participant).data[:15], len(self.services)]
        server = f"serviceid= {'.'.join(f'{byte:x}' for byte in identity)};"
        service = Service(
            self._reader(f"rq{name}Request", framed(request), _qos_of_part(request, server)),
            self._writer(f"rr{name}Reply", framed(response), _qos_of_part(response, server)),
            handler,
        )
        self.services[name] = service

        def execute(sample: Any) -> None:
            self._called(name, sample)
            service.execute(sample)

        self._on_each(service.requests, execute)

    def start(self) -> None:
        self.tell()
        self._thread.start()

    def tell(self) -> None:
        """Publishes which readers and writers are this node's; again whenever they have changed."""
        namespace, _, own = f"/{self.name}".rpartition("/")
        node = NodeEntitiesInfo(namespace or "/", own, list(self._readers), list(self._writers))
        self._info.write(ParticipantEntitiesInfo(_gid(self._participant), [node]))

    def close(self) -> None:
        """Takes leave: others need not wait until the lease ends."""
        self._closing = True
        self._thread.join()
        self._participant.__del__()  # and with it all that it has

    def _reader(self, topic: str, type_: type, qos: Qos) -> DataReader:
        reader = DataReader(self._participant, Topic(self._participant, topic, type_), qos)
        self._readers.append(_gid(reader))
        return reader

    def _writer(self, topic: str, type_: type, qos: Qos) -> DataWriter:
        writer = DataWriter(self._participant, Topic(self._participant, topic, type_), qos)
        self._writers.append(_gid(writer))
        return writer

    def _on_each(self, reader: DataReader, handler: Callable[[Any], None]) -> None:
        condition = ReadCondition(reader, ANY_STATE)
        self._received.append((reader, handler))
        self._waitset.attach(condition)

    def _receive(self) -> None:
        while not self._closing:
            if not self._waitset.wait(duration(milliseconds=100)):
                continue
            for reader, handler in list(self._received):
                try:
                    for sample in reader.take(100):
                        if sample.sample_info.valid_data:
                            handler(sample)
                except Exception:  # one bad request must not end the robot
                    traceback.print_exc(file=sys.stderr)


def _qos_of_part(type_: type, server: str) -> Qos:
    """As rmw_cyclonedds has it since iron: with the type hash of the request or the response."""
    type_hash = json.loads(os.environ.get("TYPE_HASHES", "{}")).get(ros_type(type_), "")
    return qos_of(user_data=server + (f"typehash={type_hash};" if type_hash else ""))


def _gid(entity: Entity) -> Gid:
    return Gid(list(entity.guid.bytes))
