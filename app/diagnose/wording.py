"""The sentences of the findings, by code: what is wrong, and what to do. `{about}` is the name that a
finding is about, `{hint}` a further sentence, or "". They are for the one who sets a panel up, not for
its operators, and in English as the other commands are. Those about a link of the page are the page's.
"""

from collections.abc import Mapping
from typing import Final

from app.i18n import ENGLISH, sentences

Rows = Mapping[str, tuple[str, str]]

_LINKS: Final = sentences(ENGLISH)

_UNREACHABLE: Final = (
    "Check the cable, and that the bridge's machine is on. Then check that it listens there: `listen`"
    " in the bridge's file, `connect` in the Zenoh configuration"
)

_LOST: Final = (
    "Restart its node. If that does not help, restart the bridge. The bridge loses the topics and "
    "services of a node that was killed and restarted at once, about 20 s later (its issue 702)."
)

ERRORS: Final[Rows] = {
    # The panel file
    "panel_fault": (
        "{about}: {detail}.",
        "Correct the panel file; `operator-panel check` names each fault.",
    ),
    "type_unknown": (
        "{about}: {detail}.",
        "Copy the package with the definition to this machine, and name its folder in `interfaces` "
        "of the panel file. For a type of ROS 2 itself, correct its name or `distro`.",
    ),
    # This machine
    "port_in_use": (
        "Another program listens on {about}, and it is not a panel server.",
        "End that program (`ss -ltnp` names it), or run the panel with --port and another number.",
    ),
    "address_unusable": (
        "Nothing can listen on {about}: {detail}.",
        "Give --host an address of this machine (`ip address` lists them), or 127.0.0.1.",
    ),
    "data_unwritable": (
        "The data folder {about} can't be written: {detail}.",
        "Make it writable for the server's user, or name another one in KIOSK_DATA. Without it every "
        "control is locked.",
    ),
    "data_full": (
        "The disk of {about} has {free_mb} MB left; the panel's files take up to {needed_mb} MB.",
        "Free space, or lower size_mb in [log] and max_mb in [record] of the panel file. When the "
        "disk is full every control locks.",
    ),
    "screen_small_targets": (
        "On the screen {about} a button of 20 mm is {real_mm} mm wide: it has {screen} mm for a pixel, "
        "and the panel file says {panel}.",
        "Set mm_per_px = {screen} in the panel file, then check that the pages still fit.",
    ),
    # The way to the robot
    "zenoh_config": ("{detail}.", "Correct the file, or name another one with --zenoh or KIOSK_ZENOH."),
    "host_unknown": (
        "The name in {about} is not known: {detail}.",
        "Write the address of the bridge's machine, such as tcp/192.0.2.10:7447, or enter the name in "
        "/etc/hosts.",
    ),
    "no_router": (
        "Nothing listens at {about}: the connection is refused.",
        "Start the bridge; compare `listen` in its file with `connect` in the Zenoh configuration. As "
        "shipped, the bridge listens for its own machine only.",
    ),
    "no_route": (
        "No response from {about}: {detail}.",
        f"{_UNREACHABLE}; a firewall may be in between.",
    ),
    "not_zenoh": (
        "Something listens at {about}, but it does not respond as Zenoh does.",
        "Correct the port: the bridge's is 7447 unless its file says otherwise. If it is the right "
        "one, the bridge hangs: restart it. tls/ on one side needs tls/ on the other.",
    ),
    "link_no_bridge": (
        _LINKS["link_no_bridge"],
        "Start zenoh-bridge-ros2dds on the robot. It must listen there or connect to this router.",
    ),
    "link_bridge_silent": (
        _LINKS["link_bridge_silent"],
        "Restart the bridge. If it happens again, look at its log.",
    ),
    "link_no_peer": (
        _LINKS["link_no_peer"],
        "Start zenoh-bridge-ros2dds on the robot: it must listen there or connect to this router. If "
        "the robot's nodes run on rmw_zenoh, start them at this router, and set `domain` in the panel "
        "file to their ROS_DOMAIN_ID.",
    ),
    "link_two_kinds": (
        _LINKS["link_two_kinds"],
        'Say which of them is the robot: `dialect = "bridge"` or `dialect = "rmw_zenoh"` in the panel '
        "file.",
    ),
    "link_no_ros_node": (
        _LINKS["link_no_ros_node"],
        "Start the robot's nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp at this router, and set "
        "`domain` in the panel file to their ROS_DOMAIN_ID.",
    ),
    "link_router_silent": (
        _LINKS["link_router_silent"],
        "Restart the router, then the nodes. If it happens again, look at their logs.",
    ),
    "bridge_namespace": (
        'The bridge has the namespace "{theirs}", the panel "{ours}".',
        'Set namespace = "{theirs}" in the panel file, or correct `namespace` in the bridge\'s file.',
    ),
    "bridge_localhost": (
        "The bridge is limited to its own machine (`ros_automatic_discovery_range` is LOCALHOST), and "
        "reaches no ROS 2 node in domain {domain}.",
        "Name the loopback interface in the bridge's environment too: `CYCLONEDDS_URI="
        "'<CycloneDDS><Domain><General><Interfaces>"
        '<NetworkInterface name="lo"/></Interfaces></General></Domain></CycloneDDS>'
        "'`. Where there is another interface, it does not find nodes on Fast DDS otherwise. Are the "
        "nodes running, with the same ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST?",
    ),
    "bridge_domain": (
        "The bridge sees no ROS 2 node at all in domain {domain}.",
        "Set `domain` in the bridge's file to the nodes' ROS_DOMAIN_ID, and restart the bridge. If "
        "they are "
        "equal: are the nodes running, and is the same network allowed (ROS_AUTOMATIC_DISCOVERY_RANGE, "
        "ros_automatic_discovery_range)?",
    ),
    "bridges_two": (
        "{number} bridges forward {about}: {zids}. Each message arrives, and each command acts, "
        "more than once.",
        "Run one bridge for each robot: end the others, or give them another domain or allow-lists "
        "that do not overlap.",
    ),
    "bridge_denies": (
        "The bridge's file does not let {about} through.",
        "Add it to `allow` in the bridge's file, or take it out of `deny`; `operator-panel "
        "bridge-config` "
        "writes a file that fits the panel.",
    ),
    # Topics
    "topic_type": (
        "{about} is {found} on the robot and {wanted} in the panel file.",
        "Correct `type` in the panel file, or the topic's name.",
    ),
    "definition_differs": (
        "The robot's definition of {type} on {about} differs from the one that this panel has.",
        "Name the folder of the robot's package in `interfaces` of the panel file, or set `distro` "
        "to the "
        "robot's distribution.",
    ),
    "topic_qos": (
        "{about}: {detail}",
        "Set `qos` in the panel file to what the robot's node has, or change the node.",
    ),
    "topic_unrouted": (
        "The robot has {about}, and the bridge does not forward it.",
        _LOST,
    ),
    # Permissions
    "permission_no_publisher": (
        "No node publishes the permission {about} (interlock {ids}).{hint}",
        "Start the node; compare the topic's name and namespace (`ros2 topic list -t`).",
    ),
    "permission_ends": (
        "The publisher of the permission {about} (interlock {ids}) ended right after it had published.",
        "Let a node that keeps running publish it, latched or regularly. `ros2 topic pub --once` is "
        "not "
        "enough.",
    ),
    "permission_stale": (
        "The permission {about} (interlock {ids}) came {count} times in {window} s; with max_age_s = "
        "{limit} it locks in between.",
        "Publish it at least twice in {limit} s, or raise max_age_s. A latched value counts from "
        "its second "
        "message on.",
    ),
    # Services, actions, parameters
    "service_absent": (
        "No node offers the service {about}.{hint}",
        "Start its node; compare name and namespace (`ros2 service list`).",
    ),
    "server_unrouted": (
        "A node offers {about}, and the bridge does not forward it.",
        _LOST,
    ),
    "service_type": (
        "The service {about} is {found} on the robot and {wanted} in the panel file.",
        "Correct `type` in the panel file, or the service's name.",
    ),
    "action_absent": (
        "No node offers the action {about}.{hint}",
        "Start its node; compare name and namespace (`ros2 action list`).",
    ),
    "action_type": (
        "The action {about} is {found} on the robot and {wanted} in the panel file.",
        "Correct `type` in the panel file, or the action's name.",
    ),
    "parameters_absent": (
        "The node {about} does not run, or offers no parameters.",
        "Start it; compare its name and namespace (`ros2 node list`).",
    ),
    "wrong_rmw": (
        "{about} is offered by a node on {vendor}: every call through this bridge times out.",
        "Start the node with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp. Topics work with any RMW.",
    ),
}

WARNINGS: Final[Rows] = {
    "data_in_use": (
        "The data folder {about} is in use: {detail}.",
        "Stop that server before another one starts, or give each its own KIOSK_DATA.",
    ),
    "server_not_ready": (
        "The panel server on {about} is not ready: {detail}",
        "See the findings about the robot; `operator-panel support` collects what the server knows.",
    ),
    "fonts_missing": (
        "This machine has no font for {about}, a language of the panel.",
        "If the browser runs on this machine: apt-get install {package}.",
    ),
    "screen_scale": (
        "The screen {about} has {screen} mm for a pixel, and the panel file says {panel}: buttons are "
        "{real_mm} mm instead of 20 mm.",
        "Set mm_per_px = {screen} in the panel file.",
    ),
    "page_too_large": (
        "The page {about} does not fit the screen {screen}: {detail}.",
        "Give it fewer widgets, or groups that take turns: see docs/how-to/layout.md.",
    ),
    "zenoh_version": (
        "Zenoh is {theirs} at {about} and {ours} here.",
        "Use the same version on both sides; what was tested together is in docs/compatibility.md.",
    ),
    "bridge_version": (
        "The bridge {about} is version {theirs}; this panel is tested with {tested}.",
        "Install version {tested} of zenoh-bridge-ros2dds.",
    ),
    "bridge_drops": (
        "The bridge {about} has reliable_routes_blocking = false: it drops messages silently.",
        "Set it to true. A lost `false` of a permission would leave a control open.",
    ),
    "bridge_piled_readers": (
        "Each message of {about} arrives {times} times from one bridge: it has accumulated readers.",
        "Restart the bridge (its issue 700).",
    ),
    "robot_elsewhere": (
        "The bridge forwards none of the panel's names, but it knows {found}.",
        'If that is the same topic, set namespace = "{namespace}" in the panel file.',
    ),
    "clock_differs": (
        "The clock of {about} is {seconds} s {direction} this machine's.",
        "Set both by NTP (`timedatectl`, chrony). Until then times in the operator's log and in "
        "recordings "
        "do not fit the robot's.",
    ),
    "topic_no_publisher": (
        "No node publishes {about}.{hint}",
        "Start the node; compare the topic's name and namespace (`ros2 topic list -t`).",
    ),
    "topic_no_subscriber": (
        "No node subscribes to {about}: a press has no effect.{hint}",
        "Start the node; compare the topic's name and namespace (`ros2 topic info -v`).",
    ),
    "permission_publishers": (
        "{count} publishers of the permission {about} (interlock {ids}) are running: {nodes}.",
        "Let one node publish it: the panel cannot tell their values apart, and the last one counts. "
        'With publishers = "one" its controls are locked while there are several.',
    ),
    "permission_not_latched": (
        "The permission {about} (interlock {ids}) is volatile, and came {count} times in {window} s.",
        "Publish it latched (QoS transient local) or regularly: after a restart of the panel or the "
        "bridge "
        "its controls stay locked until it is published again.",
    ),
}

NOTES: Final[Rows] = {
    "server_running": (
        "A panel server is already running on {about}.",
        "Nothing. To run a second one, give it another port and another KIOSK_DATA.",
    ),
    "demo_mode": (
        'The panel runs in demo mode, with a simulated robot; the robot of "{about}" was not examined.',
        'For the real robot set mode = "live" in the panel file, or give --mode live.',
    ),
    "permission_refused": ("{detail}", "This is the robot's answer now. Find out on the robot why."),
    "simulated_time": (
        "The stamps of {about} count from zero: the robot runs on simulated time (use_sim_time).",
        "Nothing, with a simulator. On a real robot set use_sim_time to false.",
    ),
    "clock_unknown": (
        "The robot's clock is not known: no topic of the panel sent anything in {window} s.",
        "Nothing, or listen longer: --listen 30.",
    ),
    "screen_unknown": (
        "The screen {about} does not report its size.",
        "Measure its width, and set mm_per_px in the panel file to that, divided by its pixels.",
    ),
}
