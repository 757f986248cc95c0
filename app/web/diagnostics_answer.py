"""What `/diagnostics` gets and answers, for programs."""

from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.commands.press import PRESS_ID
from app.runtime.doctor_process import FoundFault
from app.web.act_answer import ActAnswer

View = Literal["topics", "servers", "graph", "nodes", "links"]
Form = Literal["text", "hex"]
State = Literal["ok", "problem", "unknown"]
MOST_NAME = 520


class DiagnosticsQuery(BaseModel):
    """`robot` is the id of one of several robots. The other fields are for the page only: `view` is
    the list that it shows, `search` a text that the rows contain, `look` the key of the topic that is
    looked into, `form` how; `paused`: the look goes on no longer for this request. `part=content` is
    the page without its frame; `rtt` is how long the last one took, in ms. `act` is the act whose
    receipt is shown."""

    model_config = ConfigDict(extra="forbid")

    robot: Annotated[str, Field(max_length=64)] = ""
    view: View = "topics"
    search: Annotated[str, Field(max_length=100)] = ""
    look: Annotated[str, Field(max_length=MOST_NAME)] = ""
    form: Form = "text"
    paused: bool = False
    part: Literal["", "content"] = ""
    rtt: Annotated[float, Field(ge=0, le=600_000)] | None = None
    act: Annotated[str, Field(max_length=400)] = ""


class LookQuery(BaseModel):
    """`topic` is the key of a topic, its name without the first slash; `form` is for the page."""

    model_config = ConfigDict(extra="forbid")

    topic: Annotated[str, Field(min_length=1, max_length=MOST_NAME)]
    robot: Annotated[str, Field(max_length=64)] = ""
    form: Form = "text"


class DiagnosticActBody(BaseModel):
    """The same `id` again is the same act. `at` is when it was touched, in the server's own time.
    `robot` is the id of one of several robots, whose recording is shared."""

    model_config = ConfigDict(extra="forbid")

    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    robot: Annotated[str, Field(max_length=64)] = ""
    at: AwareDatetime | None = None


class RoundTripsAnswer(BaseModel):
    """Milliseconds, over the last five minutes; `medians` are those of each five seconds."""

    least: float
    median: float
    most: float
    last: float
    medians: list[float]


class LinkAnswer(BaseModel):
    """A link: `state` is "ok", "wait" or "bad", `reason` why, "" for none. `trip_note` says by what its
    round trips are measured, or why there are none."""

    name: str
    state: Literal["ok", "wait", "bad"]
    text: str
    reason: str
    round_trips: RoundTripsAnswer | None = None
    trip_note: str = ""


class UndecodableAnswer(BaseModel):
    """The newest message of `size` bytes that could not be decoded, with its first bytes in
    hexadecimal."""

    first: str
    size: int
    reason: str
    at: AwareDatetime


class TopicAnswer(BaseModel):
    """A topic of the panel: `use` says whether it is subscribed to (`on_demand`: only while a browser
    shows it) or published."""

    name: str
    key: str
    expression: str
    type: str
    use: Literal["subscribed", "on_demand", "published"]
    state: State
    reason: str
    own_qos: str
    robot_qos: list[str]
    count: int
    rate_hz: float | None
    size: int | None
    age_s: float | None
    undecodable_count: int
    undecodable: UndecodableAnswer | None


class ServerAnswer(BaseModel):
    """A service or an action of one control, with its last result."""

    kind: Literal["service", "action"]
    widget: str
    label: str
    name: str
    type: str
    state: State
    reason: str
    running: bool
    outcome: str
    result: str


class ParameterAnswer(BaseModel):
    """A parameter of one control; `read_at` is when its node reported it."""

    widget: str
    label: str
    node: str
    name: str
    type: str
    state: State
    reason: str
    value: str
    read_at: AwareDatetime | None
    running: bool
    outcome: str
    result: str


class NodeAnswer(BaseModel):
    """A node, without what every node has."""

    name: str
    dds: str
    publishes: list[str]
    subscribes: list[str]
    services: list[str]
    actions: list[str]


class GraphTopicAnswer(BaseModel):
    """A topic of the robot's graph; `used` by this panel. `readers` are those of its bridges."""

    name: str
    key: str
    types: list[str]
    publishers: list[str]
    subscribers: list[str]
    publisher_qos: list[str]
    subscriber_qos: list[str]
    forwarding: Literal["forwarded", "denied", "lost"]
    used: bool
    readers: int | None


class GraphAnswer(BaseModel):
    """The ROS graph, as it was read last: `at` is null before that, `fault` why it can't be read."""

    at: AwareDatetime | None
    fault: str
    nodes: list[NodeAnswer]
    topics: list[GraphTopicAnswer]


class DoctorAnswer(BaseModel):
    """The last check: `at` and `well` are null before the first."""

    running: bool
    at: AwareDatetime | None
    fault: str
    well: bool | None
    findings: list[FoundFault]
    more: dict[str, int]
    facts: list[str]


class MqttAnswer(BaseModel):
    """The broker of `[alarms.mqtt]`: `state` is "connected", or why it is not, `since` when. `waiting`
    transitions are not published yet, `dropped` ones found no room."""

    address: str
    connected: bool
    state: str
    since: AwareDatetime | None
    last_error: str
    waiting: int
    published: int
    dropped: int


class DiagnosticsAnswer(BaseModel):
    """`versions` are by the name of the program; `looks` are the keys of topics that are looked into
    now. `mqtt` is null for a panel without `[alarms.mqtt]`."""

    versions: dict[str, str]
    links: list[LinkAnswer]
    topics: list[TopicAnswer]
    servers: list[ServerAnswer]
    parameters: list[ParameterAnswer]
    graph: GraphAnswer
    doctor: DoctorAnswer
    looks: list[str]
    mqtt: MqttAnswer | None


class LookedMessageAnswer(BaseModel):
    """A message: `number` counts those that arrived. `lines` are its fields, without the last
    `cut_lines`; none if it is not decoded, for `reason`. `hex_lines` are its bytes, without the last
    `cut_bytes`."""

    number: int
    at: AwareDatetime
    size: int
    lines: list[str]
    cut_lines: int
    reason: str
    hex_lines: list[str]
    cut_bytes: int


class LookAnswer(BaseModel):
    """The newest messages of a topic, the newest first, at most two of a second. `received` counts
    all."""

    topic: str
    types: list[str]
    received: int
    fault: str
    messages: list[LookedMessageAnswer]


class DiagnosticReceipt(ActAnswer):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name. `recording`
    is the address of the recording that was shared, "" of other acts."""

    recording: str
