"""`launch_file.py FILE [NAME:=VALUE]…` runs a launch file, in place of `ros2 launch`: the package index
has no wheel of ROS 2's `launch`. This has what the panel's launch file takes of it, with the same names
and meanings; anything else in the file is an error."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from runpy import run_path
from types import ModuleType, SimpleNamespace

FILE = Path(sys.argv[1])
GIVEN = dict(word.split(":=", 1) for word in sys.argv[2:])


class LaunchConfiguration(SimpleNamespace):
    def __init__(self, name):
        self.text = self.perform = lambda values: values[name]


class PathJoinSubstitution(SimpleNamespace):
    def __init__(self, parts):
        self.text = lambda values: os.path.join(*(text(part, values) for part in parts))


class ThisLaunchFileDir(SimpleNamespace):
    def __init__(self):
        self.text = lambda values: str(FILE.parent)


class DeclareLaunchArgument(SimpleNamespace):
    def __init__(self, name, *, default_value, description):
        super().__init__(name=name, default=default_value, about=description)


class IfCondition(SimpleNamespace):
    def __init__(self, value):
        self.holds = lambda values: text(value, values).lower() in ("true", "1")


class Shutdown(SimpleNamespace):
    def __init__(self, *, reason):
        super().__init__(reason=reason)


class EmitEvent(SimpleNamespace):
    def __init__(self, *, event):
        super().__init__(event=event)


class ExecuteProcess(SimpleNamespace):
    def __init__(self, *, name, cmd, output, on_exit=None, respawn=False, respawn_delay=0.0):
        super().__init__(name=name, cmd=cmd, on_exit=on_exit)
        self.respawn = respawn
        self.delay = respawn_delay


class OpaqueFunction(SimpleNamespace):
    def __init__(self, *, function, condition):
        super().__init__(function=function, condition=condition)


MODULES = {
    "launch": {"LaunchContext": dict, "LaunchDescription": list},
    "launch.actions": (DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction),
    "launch.conditions": (IfCondition,),
    "launch.events": (Shutdown,),
    "launch.substitutions": (LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir),
}


def text(value, values):
    """Of a word, a substitution, or a list of both that are one word."""
    if isinstance(value, list):
        return "".join(text(part, values) for part in value)
    return value if isinstance(value, str) else value.text(values)


def run(processes, values):
    """Until SIGINT, or until one ends whose end ends the launch: then the others get SIGINT too."""
    running = {}
    ends = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ends.append("interrupted"))
    while not ends:
        for planned in processes:
            process = running.get(planned.name)
            if process is None:
                running[planned.name] = subprocess.Popen([text(word, values) for word in planned.cmd])
            elif process.poll() is not None:
                print(f"{planned.name}: ended with {process.returncode}", file=sys.stderr)
                if planned.on_exit is not None:
                    ends.append(planned.on_exit.event.reason)
                elif planned.respawn:
                    time.sleep(planned.delay)
                    del running[planned.name]
        time.sleep(0.05)
    for process in running.values():
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in running.values():
        process.wait(20)
    print(f"launch: {ends[0]}", file=sys.stderr)


def main():
    for name, content in MODULES.items():
        module = sys.modules[name] = ModuleType(name)
        vars(module).update(content if isinstance(content, dict) else {c.__name__: c for c in content})
    actions = run_path(str(FILE))["generate_launch_description"]()
    declared = {
        argument.name: argument for argument in actions if isinstance(argument, DeclareLaunchArgument)
    }
    missing = [n for n, argument in declared.items() if argument.default is None and n not in GIVEN]
    if missing or set(GIVEN) - set(declared):
        sys.exit(f"the arguments are {', '.join(declared)}; missing: {', '.join(missing)}")
    values = {
        n: GIVEN[n] if n in GIVEN else text(argument.default, {}) for n, argument in declared.items()
    }
    run(list(processes_of(actions, values)), values)


def processes_of(actions, values):
    """What the actions start, if their conditions hold."""
    for action in actions:
        if isinstance(action, OpaqueFunction) and action.condition.holds(values):
            yield from action.function(values)
        elif isinstance(action, ExecuteProcess):
            yield action


main()
