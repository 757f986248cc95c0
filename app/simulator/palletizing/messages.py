"""What the palletizing cell publishes: a row for each topic, with the fields of its message. Pure."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.simulator.palletizing import cycle
from app.simulator.palletizing.cell import PalletizingCell
from app.simulator.palletizing.states import Reason, State
from app.simulator.palletizing.surroundings import LOW_BAR, USUAL_BAR
from app.simulator.values.known_types import JOINTS, Moment, header, time

Fields = dict[str, Any]
PA_PER_BAR: Final = 1e5
HOLDING_KPA: Final = -71.0
OPEN_KPA: Final = -64.5
OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/msg/DiagnosticStatus
HOT_C: Final = 60.0


@dataclass(frozen=True, slots=True)
class Row:
    """The fields of a topic. It is published when they change, at most each `least_s`, and again each
    second: a stamp alone is no change, so `value` is compared."""

    value: Callable[[PalletizingCell], Any]
    fields: Callable[[Any, Moment], Fields] = lambda value, _: {"data": value}
    least_s: float = 0.0
    latched: bool = True


def vacuum_kpa(cell: PalletizingCell) -> float:
    """The vacuum at the gripper. An ejector makes it, so it is weaker when air is low."""
    full = HOLDING_KPA if cell.holds_box else OPEN_KPA
    return full * min(1.0, cell.air.bar / USUAL_BAR + 0.03)


def _stamped(name: str) -> Callable[[Any, Moment], Fields]:
    return lambda value, moment: {"header": header(moment), name: value}


def _joints(positions: list[float], moment: Moment) -> Fields:
    return {"header": header(moment), "name": list(JOINTS), "position": positions}


def _parts(cell: PalletizingCell) -> list[Fields]:
    """The statuses of the cell's parts: of each (level, name, message, values)."""
    return [_status(*part) for part in _statuses(cell)]


Status = tuple[int, str, str, Mapping[str, str]]


def _statuses(cell: PalletizingCell) -> Iterator[Status]:
    hot = cell.motor.celsius > HOT_C
    yield WARN if hot else OK, "Arm", cell.state.lower(), {"motor": f"{cell.motor.celsius:.0f} °C"}
    opened, fault = cell.door.is_open, cell.state is State.FAULT
    said = "open" if opened else "closed, needs a reset" if fault else "locked"
    yield ERROR if opened else WARN if fault else OK, "Guard door 1", said, {}
    enough = cell.air.is_enough
    holds = f"holds box {cell.boxes + 1}" if cell.holds_box else "open"
    vacuum = {"vacuum": f"{vacuum_kpa(cell):.0f} kPa"}
    yield OK if enough else WARN, "Gripper", holds if enough else "vacuum is weak", vacuum
    pressure = {"pressure": f"{cell.air.bar:.1f} bar", "low": f"{LOW_BAR:.1f} bar"}
    yield OK if enough else WARN, "Air supply", "enough" if enough else "low", pressure
    full = cell.reason is Reason.PALLET_FULL
    yield WARN if full else OK, "Pallet", "full, waits" if full else f"{cell.boxes} boxes", {}


def _status(level: int, name: str, message: str, values: Mapping[str, str]) -> Fields:
    listed = [{"key": key, "value": value} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": name, "values": listed}


def log_fields(level: int, text: str, moment: Moment) -> Fields:
    """A line of the log of the cell's node."""
    return {"stamp": time(moment), "level": level, "name": "cell", "msg": text, "file": "cell.py"}


MOVING: Final = 0.2  # seconds between the messages of what changes all the time

ROWS: Final[Mapping[str, Row]] = {
    "/cell/state": Row(lambda cell: cell.state.value),
    "/cell/reason": Row(lambda cell: cell.reason.value),
    "/cell/mode": Row(lambda cell: "MANUAL" if cell.state is State.MANUAL else "AUTOMATIC"),
    "/cell/order": Row(lambda cell: cell.order),
    "/cell/next_order": Row(lambda cell: cell.next_order),
    "/cell/phase": Row(lambda cell: cycle.phase_at(cell.part)),
    "/cell/moving": Row(lambda cell: cell.moves),
    "/cell/pallet": Row(lambda cell: cell.pallet),
    "/boxes": Row(lambda cell: cell.boxes),
    "/cell/layer": Row(lambda cell: cell.layer),
    "/cell/pallet_full": Row(lambda cell: cell.is_full),
    "/cell/last_cycle": Row(lambda cell: round(cell.last_cycle_s, 2)),
    "/cell/minutes_left": Row(lambda cell: round(cell.left_s / 60, 1)),
    "/cell/rate": Row(lambda cell: cell.rate),
    "/cell/shift_boxes": Row(lambda cell: cell.shift_boxes),
    "/guard_locked": Row(lambda cell: not cell.door.is_open),
    "/cell/no_fault": Row(lambda cell: cell.state is not State.FAULT),
    "/cell/air_enough": Row(lambda cell: cell.air.is_enough),
    "/operation_enabled": Row(lambda cell: cell.state is not State.FAULT),
    "/cell/start_permitted": Row(lambda cell: cell.may_start),
    "/cell/pause_permitted": Row(lambda cell: cell.state is State.RUNNING),
    "/cell/reset_permitted": Row(lambda cell: cell.may_reset),
    "/cell/jog_permitted": Row(lambda cell: cell.may_jog),
    "/cell/pallet_permitted": Row(lambda cell: cell.may_move_pallet),
    "/gripper_closed": Row(lambda cell: cell.holds_box),
    "/vacuum": Row(lambda cell: round(vacuum_kpa(cell), 1), least_s=MOVING, latched=False),
    "/air_pressure": Row(
        lambda cell: round(cell.air.bar * PA_PER_BAR, -2),
        _stamped("fluid_pressure"),
        least_s=MOVING,
        latched=False,
    ),
    "/motor_temperature": Row(
        lambda cell: round(cell.motor.celsius, 2), _stamped("temperature"), least_s=1.0, latched=False
    ),
    "/joint_states": Row(
        lambda cell: cycle.joints_at(cell.part, cell.layer), _joints, least_s=MOVING, latched=False
    ),
    "/cell/belt_speed": Row(lambda cell: cell.belt_mm_s),
    "/cell/light": Row(lambda cell: cell.light),
    "/diagnostics": Row(_parts, _stamped("status"), least_s=1.0, latched=False),
}
