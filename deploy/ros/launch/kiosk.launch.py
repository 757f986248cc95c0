"""`ros2 launch operator_panel kiosk.launch.py panel:=cell1.toml`: the panel's server, and the bridge to
the ROS 2 nodes of this machine's domain. `--show-args` lists the arguments; KIOSK_… set the rest."""

from shutil import which

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction
from launch.conditions import IfCondition
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir

# Where the package is installed: this file is in share/operator_panel/launch.
PREFIX = (ThisLaunchFileDir(), "..", "..", "..")
ARGUMENTS = {
    "panel": (None, "the panel file"),
    "host": ("127.0.0.1", "address that the server listens on"),
    "port": ("8000", "port of the server"),
    "bridge": ("true", "false if the bridge runs elsewhere: KIOSK_ZENOH names a file with its address"),
    "bridge_command": ("zenoh-bridge-ros2dds", "the bridge's program"),
    "bridge_config": (
        PathJoinSubstitution([*PREFIX, "share", "operator_panel", "bridge.json5"]),
        "the bridge's configuration; ROS_DOMAIN_ID goes before the domain in it",
    ),
}


def start_bridge(context: LaunchContext) -> list[ExecuteProcess]:
    """RuntimeError ends the launch: launch itself would go on without the bridge."""
    command = LaunchConfiguration("bridge_command").perform(context)
    if which(command) is None:
        raise RuntimeError(
            f'the bridge\'s program "{command}" is not on the PATH: install it, name it with'
            " bridge_command:=…, or start without it by bridge:=false"
        )
    bridge = ExecuteProcess(
        name="zenoh_bridge",
        cmd=[command, "-c", LaunchConfiguration("bridge_config")],
        output="screen",
        respawn=True,
        respawn_delay=1.0,
    )
    return [bridge]


def generate_launch_description() -> LaunchDescription:
    value = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in ARGUMENTS.items()
    ]
    # Not a launch_ros Node: the server is no ROS 2 node and takes no --ros-args.
    server = ExecuteProcess(
        name="operator_panel",
        cmd=[
            PathJoinSubstitution([*PREFIX, "lib", "operator_panel", "operator-panel"]),
            "run",
            value["panel"],
            ["--host=", value["host"]],
            ["--port=", value["port"]],
        ],
        output="screen",
        # A panel file with a fault ends the launch; its text says what is wrong.
        on_exit=EmitEvent(event=Shutdown(reason="the panel's server has ended")),
    )
    bridge = OpaqueFunction(function=start_bridge, condition=IfCondition(value["bridge"]))
    return LaunchDescription([*declared, bridge, server])
