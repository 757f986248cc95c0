"""The ROS 2 types of the Cyclone DDS robot, as DDS types: fields in the order of their definitions.

A class is named like its ROS type's last part; `ros_type` gives the package and the kind, and the
name on the wire follows ROS 2's mangling: `std_srvs/srv/SetBool_Request` is
`std_srvs::srv::dds_::SetBool_Request_`. A definition without fields has one dummy byte, as in ROS 2.
"""

from dataclasses import dataclass, field, fields
from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl.types import (
    array,
    float32,
    float64,
    int8,
    int16,
    int32,
    int64,
    sequence,
    uint8,
    uint16,
    uint32,
    uint64,
)


def dds_name(ros_name: str) -> str:
    package, kind, name = ros_name.split("/")
    return f"{package}.{kind}.dds_.{name}_"


def ros_type(type_: type) -> str:
    """The ROS type's name, "std_srvs/srv/SetBool_Request"."""
    package, kind, _, name = str(vars(type_)["__idl_typename__"]).split(".")
    return f"{package}/{kind}/{name.removesuffix('_')}"


def framed(type_: type[IdlStruct]) -> type[IdlStruct]:
    """The type on a service's topics: rmw_cyclonedds' request header, then the body, as one struct.

    Both header fields are 8 bytes long, so the body is aligned as it would be alone.
    """
    return make_idl_struct(
        type_.__name__,
        type_.__idl_typename__,
        {"guid": uint64, "sequence_number": int64, **type_.__annotations__},
    )


def values(message: Any) -> dict[str, Any]:
    return {f.name: getattr(message, f.name) for f in fields(message)}


def plain(value: Any) -> Any:
    """A message as plain JSON values."""
    if isinstance(value, IdlStruct):
        return {name: plain(item) for name, item in values(value).items()}
    return [plain(item) for item in value] if isinstance(value, (list, tuple, bytes)) else value


@dataclass
class String(IdlStruct, typename=dds_name("std_msgs/msg/String")):
    data: str = ""


@dataclass
class Bool(IdlStruct, typename=dds_name("std_msgs/msg/Bool")):
    data: bool = False


@dataclass
class Time(IdlStruct, typename=dds_name("builtin_interfaces/msg/Time")):
    sec: int32 = 0
    nanosec: uint32 = 0

    @property
    def nanoseconds(self) -> int:
        return self.sec * 10**9 + self.nanosec

    @classmethod
    def at(cls, nanoseconds: int) -> "Time":
        return cls(*divmod(nanoseconds, 10**9))


@dataclass
class Duration(IdlStruct, typename=dds_name("builtin_interfaces/msg/Duration")):
    sec: int32 = 0
    nanosec: uint32 = 0


# Poses and transforms.


@dataclass
class Header(IdlStruct, typename=dds_name("std_msgs/msg/Header")):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename=dds_name("geometry_msgs/msg/Vector3")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename=dds_name("geometry_msgs/msg/Quaternion")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Point(IdlStruct, typename=dds_name("geometry_msgs/msg/Point")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Pose(IdlStruct, typename=dds_name("geometry_msgs/msg/Pose")):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename=dds_name("geometry_msgs/msg/PoseStamped")):
    header: Header
    pose: Pose


@dataclass
class Transform(IdlStruct, typename=dds_name("geometry_msgs/msg/Transform")):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename=dds_name("geometry_msgs/msg/TransformStamped")):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename=dds_name("tf2_msgs/msg/TFMessage")):
    transforms: sequence[TransformStamped]


# Updates of maps.


@dataclass
class OccupancyGridUpdate(IdlStruct, typename=dds_name("map_msgs/msg/OccupancyGridUpdate")):
    header: Header
    x: int32
    y: int32
    width: uint32
    height: uint32
    data: sequence[int8]


@dataclass
class CostmapFilterInfo(IdlStruct, typename=dds_name("nav2_msgs/msg/CostmapFilterInfo")):
    header: Header
    type: uint8
    filter_mask_topic: str
    base: float32
    multiplier: float32


# ros_discovery_info: which readers and writers make up a node.


@dataclass
class Gid(IdlStruct, typename=dds_name("rmw_dds_common/msg/Gid")):
    data: array[uint8, 16]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename=dds_name("rmw_dds_common/msg/NodeEntitiesInfo")):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class ParticipantEntitiesInfo(
    IdlStruct, typename=dds_name("rmw_dds_common/msg/ParticipantEntitiesInfo")
):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


# Services.


@dataclass
class SetBool_Request(IdlStruct, typename=dds_name("std_srvs/srv/SetBool_Request")):
    data: bool


@dataclass
class SetBool_Response(IdlStruct, typename=dds_name("std_srvs/srv/SetBool_Response")):
    success: bool
    message: str


@dataclass
class Trigger_Request(IdlStruct, typename=dds_name("std_srvs/srv/Trigger_Request")):
    structure_needs_at_least_one_member: uint8


@dataclass
class Trigger_Response(IdlStruct, typename=dds_name("std_srvs/srv/Trigger_Response")):
    success: bool
    message: str


@dataclass
class AddTwoInts_Request(IdlStruct, typename=dds_name("example_interfaces/srv/AddTwoInts_Request")):
    a: int64
    b: int64


@dataclass
class AddTwoInts_Response(IdlStruct, typename=dds_name("example_interfaces/srv/AddTwoInts_Response")):
    sum: int64


# The action.


@dataclass
class UUID(IdlStruct, typename=dds_name("unique_identifier_msgs/msg/UUID")):
    uuid: array[uint8, 16]


@dataclass
class GoalInfo(IdlStruct, typename=dds_name("action_msgs/msg/GoalInfo")):
    goal_id: UUID
    stamp: Time


@dataclass
class GoalStatus(IdlStruct, typename=dds_name("action_msgs/msg/GoalStatus")):
    goal_info: GoalInfo
    status: int8


@dataclass
class GoalStatusArray(IdlStruct, typename=dds_name("action_msgs/msg/GoalStatusArray")):
    status_list: sequence[GoalStatus]


@dataclass
class CancelGoal_Request(IdlStruct, typename=dds_name("action_msgs/srv/CancelGoal_Request")):
    goal_info: GoalInfo


@dataclass
class CancelGoal_Response(IdlStruct, typename=dds_name("action_msgs/srv/CancelGoal_Response")):
    return_code: int8
    goals_canceling: sequence[GoalInfo]


@dataclass(frozen=True)
class ActionTypes:
    """The types of an action on the wire, made of the fields of its goal, result and feedback."""

    name: str
    send_goal: type[IdlStruct]
    accepted: type[IdlStruct]
    get_result: type[IdlStruct]
    result: type[IdlStruct]
    feedback: type[IdlStruct]
    empty: tuple[Any, ...]

    def no_result(self, status: int) -> Any:
        """The result of a goal that is not known."""
        return self.result(status, *self.empty)


def action_types(
    name: str,
    goal: dict[str, Any],
    result: dict[str, Any],
    feedback: dict[str, Any],
    empty: tuple[Any, ...],
) -> ActionTypes:
    """`empty` are the values of a result that says nothing."""
    package, kind, short = name.split("/")

    def part(suffix: str, fields: dict[str, Any]) -> type[IdlStruct]:
        own = f"{short}_{suffix}"
        return make_idl_struct(own, dds_name(f"{package}/{kind}/{own}"), fields)

    return ActionTypes(
        name,
        part("SendGoal_Request", {"goal_id": UUID, **goal}),
        part("SendGoal_Response", {"accepted": bool, "stamp": Time}),
        part("GetResult_Request", {"goal_id": UUID}),
        part("GetResult_Response", {"status": int8, **result}),
        part("FeedbackMessage", {"goal_id": UUID, **feedback}),
        empty,
    )


NUMBERS = {"sequence": sequence[int32]}
FIBONACCI = action_types(
    "example_interfaces/action/Fibonacci", {"order": int32}, NUMBERS, NUMBERS, ([],)
)
NAVIGATE_TO_POSE = action_types(
    "nav2_msgs/action/NavigateToPose",
    {"pose": PoseStamped, "behavior_tree": str},
    {"error_code": uint16},
    {
        "current_pose": PoseStamped,
        "navigation_time": Duration,
        "estimated_time_remaining": Duration,
        "number_of_recoveries": int16,
        "distance_remaining": float32,
    },
    (0,),
)
DOCK_ROBOT = action_types(
    "nav2_msgs/action/DockRobot",
    {
        "use_dock_id": bool,
        "dock_id": str,
        "dock_pose": PoseStamped,
        "dock_type": str,
        "max_staging_time": float32,
        "navigate_to_staging_pose": bool,
    },
    {"success": bool, "error_code": uint16, "num_retries": uint16},
    {"state": uint16, "docking_time": Duration, "num_retries": uint16},
    (False, 0, 0),
)


@dataclass
class MissedWaypoint(IdlStruct, typename=dds_name("nav2_msgs/msg/MissedWaypoint")):
    index: uint32
    goal: PoseStamped
    error_code: uint16


FOLLOW_WAYPOINTS = action_types(
    "nav2_msgs/action/FollowWaypoints",
    {"number_of_loops": uint32, "goal_index": uint32, "poses": sequence[PoseStamped]},
    {"missed_waypoints": sequence[MissedWaypoint], "error_code": uint16},
    {"current_waypoint": uint32},
    ([], 0),
)


# Parameters.


@dataclass
class ParameterValue(IdlStruct, typename=dds_name("rcl_interfaces/msg/ParameterValue")):
    type: uint8 = 0
    bool_value: bool = False
    integer_value: int64 = 0
    double_value: float64 = 0.0
    string_value: str = ""
    byte_array_value: sequence[uint8] = field(default_factory=list)
    bool_array_value: sequence[bool] = field(default_factory=list)
    integer_array_value: sequence[int64] = field(default_factory=list)
    double_array_value: sequence[float64] = field(default_factory=list)
    string_array_value: sequence[str] = field(default_factory=list)


@dataclass
class Parameter(IdlStruct, typename=dds_name("rcl_interfaces/msg/Parameter")):
    name: str
    value: ParameterValue


@dataclass
class FloatingPointRange(IdlStruct, typename=dds_name("rcl_interfaces/msg/FloatingPointRange")):
    from_value: float64
    to_value: float64
    step: float64


@dataclass
class IntegerRange(IdlStruct, typename=dds_name("rcl_interfaces/msg/IntegerRange")):
    from_value: int64
    to_value: int64
    step: uint64


@dataclass
class ParameterDescriptor(IdlStruct, typename=dds_name("rcl_interfaces/msg/ParameterDescriptor")):
    name: str
    type: uint8
    description: str = ""
    additional_constraints: str = ""
    read_only: bool = False
    dynamic_typing: bool = False
    floating_point_range: sequence[FloatingPointRange, 1] = field(default_factory=list)
    integer_range: sequence[IntegerRange, 1] = field(default_factory=list)


@dataclass
class SetParametersResult(IdlStruct, typename=dds_name("rcl_interfaces/msg/SetParametersResult")):
    successful: bool
    reason: str = ""


@dataclass
class ListParametersResult(IdlStruct, typename=dds_name("rcl_interfaces/msg/ListParametersResult")):
    names: sequence[str]
    prefixes: sequence[str]


@dataclass
class ParameterEvent(IdlStruct, typename=dds_name("rcl_interfaces/msg/ParameterEvent")):
    stamp: Time
    node: str
    new_parameters: sequence[Parameter]
    changed_parameters: sequence[Parameter]
    deleted_parameters: sequence[Parameter]


def parameter_service(name: str) -> str:
    return dds_name(f"rcl_interfaces/srv/{name}")


@dataclass
class GetParameters_Request(IdlStruct, typename=parameter_service("GetParameters_Request")):
    names: sequence[str]


@dataclass
class GetParameters_Response(IdlStruct, typename=parameter_service("GetParameters_Response")):
    values: sequence[ParameterValue]


@dataclass
class GetParameterTypes_Request(IdlStruct, typename=parameter_service("GetParameterTypes_Request")):
    names: sequence[str]


@dataclass
class GetParameterTypes_Response(IdlStruct, typename=parameter_service("GetParameterTypes_Response")):
    types: sequence[uint8]


@dataclass
class SetParameters_Request(IdlStruct, typename=parameter_service("SetParameters_Request")):
    parameters: sequence[Parameter]


@dataclass
class SetParameters_Response(IdlStruct, typename=parameter_service("SetParameters_Response")):
    results: sequence[SetParametersResult]


@dataclass
class SetParametersAtomically_Request(
    IdlStruct, typename=parameter_service("SetParametersAtomically_Request")
):
    parameters: sequence[Parameter]


@dataclass
class SetParametersAtomically_Response(
    IdlStruct, typename=parameter_service("SetParametersAtomically_Response")
):
    result: SetParametersResult


@dataclass
class ListParameters_Request(IdlStruct, typename=parameter_service("ListParameters_Request")):
    prefixes: sequence[str]
    depth: uint64


@dataclass
class ListParameters_Response(IdlStruct, typename=parameter_service("ListParameters_Response")):
    result: ListParametersResult


@dataclass
class DescribeParameters_Request(IdlStruct, typename=parameter_service("DescribeParameters_Request")):
    names: sequence[str]


@dataclass
class DescribeParameters_Response(IdlStruct, typename=parameter_service("DescribeParameters_Response")):
    descriptors: sequence[ParameterDescriptor]


# Descriptions of types, and a message whose package is not known elsewhere.


@dataclass
class FieldType(IdlStruct, typename=dds_name("type_description_interfaces/msg/FieldType")):
    type_id: uint8
    capacity: uint64
    string_capacity: uint64
    nested_type_name: str


@dataclass
class Field(IdlStruct, typename=dds_name("type_description_interfaces/msg/Field")):
    name: str
    type: FieldType
    default_value: str


@dataclass
class IndividualTypeDescription(
    IdlStruct, typename=dds_name("type_description_interfaces/msg/IndividualTypeDescription")
):
    type_name: str
    fields: sequence[Field]


@dataclass
class TypeDescription(IdlStruct, typename=dds_name("type_description_interfaces/msg/TypeDescription")):
    type_description: IndividualTypeDescription
    referenced_type_descriptions: sequence[IndividualTypeDescription]


@dataclass
class TypeSource(IdlStruct, typename=dds_name("type_description_interfaces/msg/TypeSource")):
    type_name: str
    encoding: str
    raw_file_contents: str


@dataclass
class KeyValue(IdlStruct, typename=dds_name("type_description_interfaces/msg/KeyValue")):
    key: str
    value: str


@dataclass
class GetTypeDescription_Request(
    IdlStruct, typename=dds_name("type_description_interfaces/srv/GetTypeDescription_Request")
):
    type_name: str
    type_hash: str
    include_type_sources: bool


@dataclass
class GetTypeDescription_Response(
    IdlStruct, typename=dds_name("type_description_interfaces/srv/GetTypeDescription_Response")
):
    successful: bool
    failure_reason: str
    type_description: TypeDescription
    type_sources: sequence[TypeSource]
    extra_information: sequence[KeyValue]


@dataclass
class Jaw(IdlStruct, typename=dds_name("gripper_msgs/msg/Jaw")):
    name: str
    force: float32


@dataclass
class Gripper(IdlStruct, typename=dds_name("gripper_msgs/msg/Gripper")):
    width: float64
    jaws: sequence[Jaw]


def described(types: list[dict[str, Any]]) -> TypeDescription:
    """A description from plain values, the type itself first."""
    first, *others = [
        IndividualTypeDescription(
            type_description["type_name"],
            [Field(each["name"], FieldType(**each["type"]), "") for each in type_description["fields"]],
        )
        for type_description in types
    ]
    return TypeDescription(first, others)
