"""The interfaces of a ROS 2 distribution: rosbags' messages and definitions shipped in `builtin/`."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from app.interfaces import distribution_cache
from app.interfaces.definitions import Definitions, Structure
from app.interfaces.packages import complete_definitions, read_folders

DISTROS: Final = ("humble", "iron", "jazzy", "kilted", "lyrical", "rolling")

# Definitions beside rosbags' messages: services, actions, and packages that it lacks.
BUILTIN: Final = Path(__file__).parent / "builtin"

# rosbags drops default values; these are all that its messages have in ROS.
DEFAULTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "geometry_msgs/msg/Quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    "rcl_interfaces/msg/ParameterDescriptor": {"read_only": False, "dynamic_typing": False},
    "sensor_msgs/msg/NavSatStatus": {"status": -2},
    "type_description_interfaces/msg/FieldType": {"type_id": 0},
}
NO_DEFAULTS: Final = {"humble": "sensor_msgs/msg/NavSatStatus", "iron": "sensor_msgs/msg/NavSatStatus"}

_cache: dict[str, Definitions] = {}


@cache
def _builtin_definitions() -> Definitions:
    return read_folders([BUILTIN])


def read_distribution(distro: str, folder: Path | None = None) -> Definitions:
    """The definitions of a distribution: loaded once, and cached in `folder` for the next start."""
    if distro not in _cache:
        messages = _with_defaults(distro, _load_messages(distro, folder))
        stock = Definitions(messages)
        _cache[distro] = complete_definitions(_builtin_definitions(), stock) | stock
    return _cache[distro]


def _load_messages(distro: str, folder: Path | None) -> dict[str, Structure]:
    messages = distribution_cache.read(folder, distro) if folder else None
    if messages is None:
        from app.interfaces.bundled_messages import load_messages

        messages = load_messages(distro)
        if folder:
            distribution_cache.write(folder, distro, messages)
    return messages


def _with_defaults(distro: str, messages: Mapping[str, Structure]) -> dict[str, Structure]:
    found = dict(messages)
    for name, defaults in DEFAULTS.items():
        if name in found and NO_DEFAULTS.get(distro) != name:
            fields = (replace(one, default=defaults.get(one.name)) for one in found[name].fields)
            found[name] = replace(found[name], fields=tuple(fields))
    return found
