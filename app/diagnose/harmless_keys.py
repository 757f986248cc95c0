"""The keys whose values are in a support bundle, with what these may be. A key that is not here is left
out: texts, units, options, messages, values and everything with a secret in it."""

import re
from typing import Final

from app.diagnose.harmless import (
    ADDRESS,
    DURATION,
    ENDPOINT,
    FIELD,
    HEX,
    ID,
    NUMBER,
    ROS_KEY,
    ROS_NAME,
    ROS_TYPE,
    TEXT,
    TIME,
    VERSION,
    rules,
    words,
)
from app.panel.widgets.kinds import KINDS
from app.survey.model import CYCLONE_DDS

_VENDOR: Final = re.compile(f"|{CYCLONE_DDS}|Fast DDS|Connext|OpenSplice|OpenDDS|GurumDDS|CoreDX DDS")


_NUMBERS: Final = """
    after_s before_s columns confirm_press days dead_zone depth dim_after_s disk display_hz duration_s
    enabled entries_read fit global high high_high hz keys kiosk lines local low low_low max max_age_s
    max_bytes max_hz max_length max_mb max_side_px min mm_per_px near normal offset one_shot own
    confirm_s period_s press_expires_s progress_falls progress_max ramp_s range rate_hz
    require_publisher required right_max right_min rows rows_shown scale scan setpoint silent size_mb
    sounds span takeover_after_s timeout_s width within_s
"""
_PANEL_TEXTS: Final = """
    answer by constants default demo feedback frame_id goal icon interfaces key label message name note
    off on options parameter parameters pictures ranges release request response result src styles
    template text title unit value values
"""
PANEL: Final = rules(
    (
        "page widget group robot frame screen control diagnostics record qos confirm sort column pen",
        None,
    ),
    ("joint states x_axis y_axis current reported steps recovery options_from", None),
    (_NUMBERS, NUMBER),
    ("step", NUMBER),
    ("keep window windows", DURATION),
    ("id interlock page names condition conditions fault", ID),
    ("topic topics service action node namespace", ROS_NAME),
    ("type", ROS_TYPE),
    ("field deadline_field counter_field progress success", FIELD),
    ("connect", ENDPOINT),
    ("screens", re.compile(r"\d{3,4}x\d{3,4}")),
    ("format", re.compile(r"\+?,?(\.\d{1,2}[feg%]|[feg%d])|time|age|duration")),
    ("kind", words(" ".join(KINDS))),
    ("mode", words("demo live")),
    ("axis", words("left right")),
    ("distro", words("humble iron jazzy kilted lyrical rolling")),
    ("language languages", words("de en ja")),
    ("theme", words("light dark contrast")),
    ("text_size size", words("small normal large")),
    ("hand", words("right left")),
    ("colour", words("grey white black blue yellow red green")),
    ("shape", words("circle square triangle diamond cross bar")),
    ("role", words("start stop reset hold toggle neutral")),
    ("reliability", words("reliable best_effort")),
    ("durability", words("volatile transient_local")),
    ("level log", words("debug info warn error fatal")),
    ("orientation", words("vertical horizontal")),
    ("first", words("largest smallest newest")),
    ("keyboard", words("auto on off")),
    ("publishers", words("one any")),
    ("equals not_equals one_of", words("true false")),
    (_PANEL_TEXTS, TEXT),
)

_ALLOWED_NAMES: Final = re.compile(r"[\w/.*|^$()+?\[\]\\:=\-]{0,300}", re.ASCII)
_ROUTES: Final = "publishers subscribers service_servers service_clients action_servers action_clients"
_ZENOH_NUMBERS: Final = """
    period_init_ms period_max_ms period_increase_factor enabled timeout delay timeout_ms exit_on_failure
    ttl connect_scouted declares lease keep_alive batch_size size wait_before_drop wait_before_close
    control real_time interactive_high interactive_low data_high data data_low background qos lowlatency
    compression open_timeout accept_timeout accept_pending max_sessions max_links buffer_size
    max_message_size threads max_wait_before_drop_fragments drop_timeout time_limit enable_mtls
    verify_name_on_connect close_link_on_expiration read write domain ros_localhost_only shm_enabled
    reliable_routes_blocking queries_timeout default transient_local_cache_multiplier work_thread_num
    max_block_thread_num timestamping http_port queries_default_timeout __required__
"""
_ZENOH_TEXTS: Final = """
    access_control auth certificate certificate_base64 connect_certificate connect_private_key
    listen_certificate listen_private_key metadata password private_key pubkey root_ca_certificate tls
    user usrpwd
"""
ZENOH: Final = rules(
    (
        "connect listen retry open return_conditions scouting multicast gossip transport unicast link",
        None,
    ),
    ("tx rx queue congestion_control drop block plugins ros2dds rest allow deny adminspace", None),
    ("permissions shared_memory ros_localhost", None),
    (_ZENOH_NUMBERS, NUMBER),
    ("mode", words("peer client router")),
    ("endpoints", ENDPOINT),
    ("address", ADDRESS),
    ("interface", re.compile(r"auto|lo|(?:eth|en|wl|br|docker|veth)\w{0,12}", re.ASCII)),
    ("autoconnect target", words("router peer client")),
    ("router peer client", re.compile(rf"router|peer|client|{NUMBER.pattern}")),
    ("autoconnect_strategy strategy", words("always greater-zid")),
    ("protocols", words("tcp udp tls quic ws vsock serial unixsock-stream unixpipe")),
    ("sequence_number_resolution", words("8bit 16bit 32bit 64bit")),
    ("ros_automatic_discovery_range", words("SUBNET LOCALHOST OFF SYSTEM_DEFAULT")),
    ("ros_static_peers", re.compile(rf"(?:{ADDRESS.pattern}|;)*")),
    ("namespace nodename", ROS_KEY),
    ("id", HEX),
    (f"{_ROUTES} pub_max_frequencies", _ALLOWED_NAMES),
    (_ZENOH_TEXTS, TEXT),
)

_GRAPH_NAMES: Final = "name namespace nodes services clients actions topics local_nodes"
GRAPH: Final = ZENOH | rules(
    ("robots bridges routes peers config", None),
    ("keep_all reliable transient_local depth announced active", NUMBER),
    ("zid bridge endpoint", HEX),
    ("version", VERSION),
    ("dds", _VENDOR),
    (f"{_GRAPH_NAMES} key action_clients", ROS_KEY),
    ("publishers subscribers", _ALLOWED_NAMES),
    ("type", ROS_TYPE),
    ("type_hash", re.compile(r"(?:RIHS01_[0-9a-f]{64})?")),
    ("kind direction role", words("topic service action pub sub srv cli MP MS")),
    ("remote", re.compile(r"[0-9a-f]{1,32}:[\w/]{1,250}", re.ASCII)),
)

VERSIONS: Final = re.compile(r"\(a checkout, not installed\)|[\w.+\-/() ]{1,80}", re.ASCII)
SETTINGS: Final = rules(
    ("mode", words("demo live")),
    ("axis", words("left right")),
    ("hosts", re.compile(r"\[[0-9a-f:.]+\]|[a-z0-9._-]{1,80}")),
    ("proxies", re.compile(r"[0-9a-fA-F:./]{2,50}")),
    ("log_level", words("debug info warn error fatal")),
    ("dev", NUMBER),
)
SNAPSHOT: Final = rules(("id revision", re.compile(r"[0-9a-f\-]{1,80}")))
WIDGET: Final = rules(
    ("enabled busy stoppable held settable askable", NUMBER),
    ("state outcome goal level", ID),
)
LINK: Final = rules(("state", ID), ("since", TIME))
_LOG_ID: Final = re.compile(r"[0-9a-f\-]{1,40}")
LOG: Final = rules(
    ("seq monotonic of", NUMBER),
    ("at pressed_at", TIME),
    ("kind robot widget action verdict outcome", ID),
    ("boot press seen board prev hash", _LOG_ID),
    ("address", ADDRESS),
)
# Parameters of sentences, by their names.
SENTENCE: Final = rules(
    ("topic service action node namespace", ROS_NAME),
    ("limit age seconds count number since", NUMBER),
    ("type wanted", ROS_TYPE),
    ("at", TIME),
    ("id", ID),
)
DETAILS: Final = rules(
    ("count domain free_mb limit needed_mb number panel real_mm screen seconds times window", NUMBER),
    ("found wanted type", ROS_TYPE),
    ("ours theirs tested", re.compile(rf"{VERSION.pattern}|{ROS_NAME.pattern}", re.ASCII)),
    ("namespace nodes", ROS_NAME),
    ("vendor", _VENDOR),
    ("direction", words("ahead behind")),
    ("package", re.compile(r"fonts-[a-z0-9\-]{1,40}")),
    ("ids", ID),
    ("zids", HEX),
)
