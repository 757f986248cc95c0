"""The findings of the doctor, by their severity. The sentences are in the catalogue: `finding_` and the
code is what is wrong, with `_do` behind it what to do. `{about}` is the name that a finding is about,
`{hint}` a further sentence, or "". Those about a link of the page are the page's.
"""

from typing import Final

ERRORS: Final = (
    # The panel file
    "panel_fault",
    "type_unknown",
    # This machine
    "port_in_use",
    "address_unusable",
    "data_unwritable",
    "data_full",
    "screen_small_targets",
    # The way to the robot
    "zenoh_config",
    "host_unknown",
    "no_router",
    "no_route",
    "not_zenoh",
    "link_no_bridge",
    "link_bridge_silent",
    "link_no_peer",
    "link_two_kinds",
    "link_no_ros_node",
    "link_router_silent",
    "link_router_no_admin",
    "bridge_namespace",
    "bridge_localhost",
    "bridge_domain",
    "bridges_two",
    "bridge_denies",
    # Topics
    "topic_type",
    "definition_differs",
    "topic_qos",
    "topic_unrouted",
    # Maps
    "map_unreadable",
    "map_no_transform",
    "map_pose_frame",
    # Permissions
    "permission_no_publisher",
    "permission_ends",
    "permission_stale",
    # Services, actions, parameters
    "service_absent",
    "server_unrouted",
    "service_type",
    "action_absent",
    "action_type",
    "parameters_absent",
    "wrong_rmw",
)

WARNINGS: Final = (
    "data_in_use",
    "server_not_ready",
    "options_unknown",
    "fonts_missing",
    "screen_scale",
    "page_too_large",
    "zenoh_version",
    "bridge_version",
    "bridge_drops",
    "bridge_piled_readers",
    "peer_at_routers",
    "robot_elsewhere",
    "log_room",
    "clock_differs",
    "other_time",
    "topic_no_publisher",
    "topic_no_subscriber",
    "map_not_latched",
    "map_zones_outdated",
    "permission_publishers",
    "permission_not_latched",
)

NOTES: Final = (
    "server_running",
    "demo_mode",
    "permission_refused",
    "simulated_time",
    "simulated_clock",
    "clock_unknown",
    "screen_unknown",
    "time_unsynchronised",
    "time_unknown",
)


def sentence_code(code: str) -> str:
    """Of what is wrong, in the catalogue."""
    return code if code.startswith("link_") else f"finding_{code}"


def remedy_code(code: str) -> str:
    """Of what to do about it, in the catalogue."""
    return f"finding_{code}_do"
