"""A process that imports the libraries of nodes once, and forks the programs of `tests/ros_nodes`:
imports take most of a node's start time.

ROS 2's Python runs it, as `python -m tests.support.processes.ros_parent FD` in the project's folder;
see `fork_parent`. A child's arguments are a program and its own arguments. The
children import rclpy themselves: it loads Fast DDS, which starts threads, and these do not survive a
fork.
"""

import gc
import os
import runpy
import socket
import sys
from importlib import import_module
from pathlib import Path
from typing import Final

from tests.support.processes.fork_parent import ForkParent

PROGRAMS: Final = Path(__file__).resolve().parents[2] / "ros_nodes"
LIBRARIES: Final = (
    "asyncio",
    "numpy",
    "yaml",
    "rosidl_parser.definition",
    "action_msgs.srv",
    "geometry_msgs.msg",
    "rcl_interfaces.msg",
    "rcl_interfaces.srv",
    "sensor_msgs.msg",
    "std_msgs.msg",
    "std_srvs.srv",
    "type_description_interfaces.srv",
    # Of `tests/ros_nodes`.
    "commands",
    "cyclone_action",
    "cyclone_node",
    "cyclone_parameters",
)


def become(arguments: list[str]) -> None:
    """Continues as the program."""
    sys.argv = arguments
    runpy.run_path(arguments[0], run_name="__main__")
    sys.exit(0)


if __name__ == "__main__":
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # NumPy would start threads
    sys.path.insert(0, str(PROGRAMS))
    for name in LIBRARIES:
        import_module(name)
    gc.freeze()  # a child does not scan these objects: it would take a third of its CPU time
    ForkParent(socket.socket(fileno=int(sys.argv[1])), become, {}).run()
