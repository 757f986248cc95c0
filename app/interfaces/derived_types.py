"""The message types that ROS 2 derives from a service and from an action.

Source: rosidl (services and their events, since iron) and the design of actions (design.ros2.org,
"actions"); the names are those of `ros2 interface` and of type descriptions.
"""

from dataclasses import dataclass
from typing import Final

from app.interfaces.definitions import Definitions, Field, Structure, Type

UUID: Final = Type("unique_identifier_msgs/msg/UUID")
TIME: Final = Type("builtin_interfaces/msg/Time")
EVENT_INFO: Final = "service_msgs/msg/ServiceEventInfo"


@dataclass(frozen=True, slots=True)
class ActionTypes:
    """The names of the types of an action: message types, and three services."""

    goal: str
    result: str
    feedback: str
    send_goal: str  # a service
    send_goal_request: str  # goal_id, goal
    send_goal_response: str  # accepted, stamp
    get_result: str  # a service
    get_result_request: str  # goal_id
    get_result_response: str  # status (of action_msgs/msg/GoalStatus), result
    feedback_message: str  # goal_id, feedback
    cancel_goal: str = "action_msgs/srv/CancelGoal"  # a service
    status: str = "action_msgs/msg/GoalStatusArray"


def action_types(name: str) -> ActionTypes:
    """The names for an action "package/action/Name"."""
    return ActionTypes(
        goal=f"{name}_Goal",
        result=f"{name}_Result",
        feedback=f"{name}_Feedback",
        send_goal=f"{name}_SendGoal",
        send_goal_request=f"{name}_SendGoal_Request",
        send_goal_response=f"{name}_SendGoal_Response",
        get_result=f"{name}_GetResult",
        get_result_request=f"{name}_GetResult_Request",
        get_result_response=f"{name}_GetResult_Response",
        feedback_message=f"{name}_FeedbackMessage",
    )


def compose_service(name: str, request: Structure, response: Structure) -> Definitions:
    """A service "package/srv/Name" with its event (service introspection's)."""
    event = Structure(
        f"{name}_Event",
        (
            Field("info", Type(EVENT_INFO)),
            Field("request", Type(request.name, container="sequence", size=1)),
            Field("response", Type(response.name, container="sequence", size=1)),
        ),
        source=request.source,
    )
    whole = Structure(
        name,
        (
            Field("request_message", Type(request.name)),
            Field("response_message", Type(response.name)),
            Field("event_message", Type(event.name)),
        ),
        source=request.source,
    )
    return Definitions(
        {structure.name: structure for structure in (request, response, event)}, {name: whole}
    )


def compose_action(name: str, goal: Structure, result: Structure, feedback: Structure) -> Definitions:
    """An action "package/action/Name" with its two services and its feedback message."""
    types, source = action_types(name), goal.source
    goal_id = Field("goal_id", UUID)

    def structure(each: str, *fields: Field) -> Structure:
        return Structure(each, fields, source=source)

    send_goal = compose_service(
        types.send_goal,
        structure(types.send_goal_request, goal_id, Field("goal", Type(goal.name))),
        structure(types.send_goal_response, Field("accepted", Type("bool")), Field("stamp", TIME)),
    )
    status = Field("status", Type("int8"))
    get_result = compose_service(
        types.get_result,
        structure(types.get_result_request, goal_id),
        structure(types.get_result_response, status, Field("result", Type(result.name))),
    )
    message = structure(types.feedback_message, goal_id, Field("feedback", Type(feedback.name)))
    whole = structure(
        name,
        Field("goal", Type(goal.name)),
        Field("result", Type(result.name)),
        Field("feedback", Type(feedback.name)),
        Field("send_goal_service", Type(types.send_goal)),
        Field("get_result_service", Type(types.get_result)),
        Field("feedback_message", Type(types.feedback_message)),
    )
    own = {structure.name: structure for structure in (goal, result, feedback, message)}
    return send_goal | get_result | Definitions(own, {name: whole})
