"""Panels and machines that are diagnosed in tests."""

import asyncio
from pathlib import Path
from typing import Any

from app.system.settings import Settings
from app.system.time_source import TimeSource
from app.tools.doctor.doctor import Diagnosis, Machine, Options, diagnose
from app.tools.doctor.findings import Finding
from tests.support.parts import free_port, zenoh_file

BOOL = "std_msgs/msg/Bool"
STRING = "std_msgs/msg/String"
LONGEST_S = 2.5  # for which the robot is listened to

HEAD = 'title = "Cell"\nlanguages = ["en"]\n{more}'
PAGE = '[[page]]\nid = "main"\ntitle = "Main"\n'


def interlock(topic: str, **more: Any) -> str:
    return f'[[interlock]]\nid = "{topic[1:]}"\ntopic = "{topic}"\n' + keys(more)


def readout(topic: str, type_name: str = STRING, **more: Any) -> str:
    return widget(
        "readout", topic, topic=topic, type=type_name, field=more.pop("field", "data"), **more
    )


def button(topic: str, type_name: str = STRING) -> str:
    return widget("publish", topic, topic=topic, type=type_name, message={})


def call(service: str, type_name: str) -> str:
    return widget("call", service, service=service, type=type_name)


def action(name: str, type_name: str = "example_interfaces/action/Fibonacci") -> str:
    return widget("action", name, action=name, type=type_name)


def parameter(node: str) -> str:
    return widget("parameter", node, node=node, parameter="speed", type="double")


def widget(kind: str, name: str, **more: Any) -> str:
    about = {"id": name.strip("/").replace("/", "_"), "kind": kind, "label": name}
    return "[[page.widget]]\n" + keys(about | more)


def keys(table: dict[str, Any]) -> str:
    return "".join(f"{key} = {_toml(value)}\n" for key, value in table.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


def panel_of(*parts: str, more: str = "") -> str:
    """A panel file; interlocks first, then widgets, of which there is one at least."""
    locks = [part for part in parts if part.startswith("[[interlock]]")]
    widgets = [part for part in parts if part not in locks]
    return "".join([HEAD.format(more=more), *locks, PAGE, *(widgets or [widget("label", "label")])])


class Setup:
    """A folder with a panel file and a Zenoh file, and what is known of the machine."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.panel = folder / "cell1.toml"
        self.screens = folder / "drm"
        self.screens.mkdir()
        self.data = folder / "data"
        self.port = free_port()
        self.machine: dict[str, Any] = {
            "has_font": lambda language: True,
            "has_browser": lambda: True,
            "screens": self.screens,
            "read_time": lambda: TimeSource(True, "chrony"),
        }

    def diagnose(self, text: str, endpoint: str, listen_s: float = LONGEST_S) -> Diagnosis:
        self.panel.write_text(text)
        settings = Settings(
            panel=self.panel, zenoh=zenoh_file(self.folder, endpoint), mode=None, data=self.data
        )
        options = Options(port=self.port, listen_s=listen_s, machine=Machine(**self.machine))
        return asyncio.run(diagnose(settings, options))

    def findings(self, text: str, endpoint: str, listen_s: float = LONGEST_S) -> list[Finding]:
        """The errors and warnings, and notes but for those about clocks that nothing is known of."""
        findings = self.diagnose(text, endpoint, listen_s).report.findings
        return [finding for finding in findings if finding.code != "clock_unknown"]


def named(findings: list[Finding]) -> list[tuple[str, str]]:
    """(code, name) of each."""
    return [(finding.code, finding.about) for finding in findings]
