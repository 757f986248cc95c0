"""A simulated robot that is stepped by hand."""

from typing import Any, Final

from app.panel import Panel
from app.ros.messages import load_interfaces
from app.tools.simulator.known_types import Moment
from app.tools.simulator.panel_robot import PanelRobot

STEP_S: Final = 0.1


class Stepped:
    """A robot, and the fields that it has published so far: topic → [(time, value)]."""

    def __init__(self, panel: Panel, number: int = 0) -> None:
        self.panel = panel
        self.robot = PanelRobot(panel, number)
        self.interfaces = load_interfaces(panel.distro, panel.interfaces)
        self.said: dict[str, list[tuple[float, bytes]]] = {}
        self.now = 0.0

    def run(self, seconds: float) -> "Stepped":
        for _ in range(round(seconds / STEP_S)):
            for topic, payload in self.robot.step(Moment(1000 + self.now, 10**18)):
                self.said.setdefault(topic, []).append((self.now, payload))
            self.now = round(self.now + STEP_S, 6)
        return self

    def values(self, topic: str, field: str = "data") -> list[Any]:
        return [value for _, value in self.timed(topic, field)]

    def timed(self, topic: str, field: str = "data") -> list[tuple[float, Any]]:
        reader = self.interfaces.field_reader(self.robot.publishes[topic].type, [field])
        return [(at, reader.read(payload).get(field)) for at, payload in self.said.get(topic, ())]

    def hear(self, topic: str, **fields: Any) -> None:
        type_name = self.robot.subscribes[topic].type
        self.robot.receive(topic, self.interfaces.encode(type_name, fields))

    def call(self, service: str, **fields: Any) -> Any:
        request, response = self.interfaces.service_types(self.robot.services[service])
        answer = self.robot.serve(service, self.interfaces.encode(request, fields))
        assert answer is not None
        return self.interfaces.decode(response, answer)
