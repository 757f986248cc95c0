//! A robot for the tests, on hiroz: keys, tokens, attachments and hashes are those of its makers.
//!
//! `test-rmw-robot ENDPOINT [DOMAIN]` runs until it is killed. It permits operation, says back what it
//! hears, adds two numbers, counts Fibonacci's and has one parameter. It is on a map of two levels with
//! masks, with transforms at 50 Hz and a scan at 10 Hz. "permit", "forbid", "level NAME" and "clear" (the
//! keep-out mask) do what they say.

use std::f64::consts::FRAC_1_SQRT_2;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use hiroz::action::server::ExecutingGoal;
use hiroz::context::ZContextBuilder;
use hiroz::dynamic::{FieldType, MessageSchema, MessageSchemaTypeDescription};
use hiroz::entity::TypeHash;
use hiroz::parameter::{IntegerRange, ParameterDescriptor, ParameterType, ParameterValue};
use hiroz::qos::{QosDurability, QosHistory, QosProfile};
use hiroz::node::ZNode;
use hiroz::ros_msg::WithTypeInfo;
use hiroz::{Builder, MessageTypeInfo, Result};
use hiroz_cdr::{CdrBuffer, CdrDeserialize, CdrReader, CdrSerialize, CdrSerializedSize, CdrWriter};
use hiroz_msgs::builtin_interfaces::Time;
use hiroz_msgs::example_interfaces::action::Fibonacci;
use hiroz_msgs::example_interfaces::srv::AddTwoInts;
use hiroz_msgs::example_interfaces::{AddTwoIntsResponse, FibonacciFeedback, FibonacciResult};
use hiroz_msgs::geometry_msgs::{Point, Pose, Quaternion, Transform, TransformStamped, Vector3};
use hiroz_msgs::nav_msgs::{MapMetaData, OccupancyGrid};
use hiroz_msgs::sensor_msgs::LaserScan;
use hiroz_msgs::std_msgs::{Bool, Header, String as Text};
use hiroz_msgs::tf2_msgs::TFMessage;

async fn count(goal: ExecutingGoal<Fibonacci>) {
    let mut sequence = vec![0, 1];
    for at in 2..=goal.goal.order.max(1) as usize {
        if goal.is_cancel_requested() {
            goal.canceled(FibonacciResult { sequence }).expect("canceled");
            return;
        }
        sequence.push(sequence[at - 1] + sequence[at - 2]);
        goal.publish_feedback(FibonacciFeedback { sequence: sequence.clone() }).expect("feedback");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    goal.succeed(FibonacciResult { sequence }).expect("succeeded");
}

const SIDE: usize = 40;
const CELL: f32 = 0.1; // m
const FORWARD: Quaternion = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
const LEFT: Quaternion = Quaternion { x: 0.0, y: 0.0, z: FRAC_1_SQRT_2, w: FRAC_1_SQRT_2 };

fn header(frame: &str) -> Header {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("a time after 1970");
    let stamp = Time { sec: now.as_secs() as i32, nanosec: now.subsec_nanos() };
    Header { stamp, frame_id: frame.into() }
}

fn transform(parent: &str, child: &str, x: f64, y: f64, rotation: Quaternion) -> TFMessage {
    let transform = Transform { translation: Vector3 { x, y, z: 0.0 }, rotation };
    let stamped =
        TransformStamped { header: header(parent), child_frame_id: child.into(), transform };
    TFMessage { transforms: vec![stamped] }
}

/// Of nav2_msgs, which hiroz-msgs has not.
struct CostmapFilterInfo {
    header: Header,
    kind: u8,
    filter_mask_topic: String,
    base: f32,
    multiplier: f32,
}

impl MessageTypeInfo for CostmapFilterInfo {
    fn type_name() -> &'static str {
        "nav2_msgs::msg::dds_::CostmapFilterInfo_"
    }

    fn type_hash() -> TypeHash {
        let header = FieldType::Message(Header::message_schema().expect("a schema"));
        let schema = MessageSchema::builder("nav2_msgs/msg/CostmapFilterInfo")
            .field("header", header)
            .field("type", FieldType::Uint8)
            .field("filter_mask_topic", FieldType::String)
            .field("base", FieldType::Float32)
            .field("multiplier", FieldType::Float32)
            .build()
            .expect("a schema");
        let hash = schema.compute_type_hash().expect("a hash");
        TypeHash::from_rihs_string(&hash.to_rihs_string()).expect("a hash")
    }
}

impl WithTypeInfo for CostmapFilterInfo {}

impl CdrSerialize for CostmapFilterInfo {
    fn cdr_serialize<BO: byteorder::ByteOrder, B: CdrBuffer>(&self, w: &mut CdrWriter<'_, BO, B>) {
        self.header.cdr_serialize(w);
        self.kind.cdr_serialize(w);
        self.filter_mask_topic.cdr_serialize(w);
        self.base.cdr_serialize(w);
        self.multiplier.cdr_serialize(w);
    }
}

impl CdrDeserialize for CostmapFilterInfo {
    fn cdr_deserialize<'de, BO: byteorder::ByteOrder>(
        r: &mut CdrReader<'de, BO>,
    ) -> hiroz_cdr::Result<Self> {
        Ok(Self {
            header: Header::cdr_deserialize(r)?,
            kind: u8::cdr_deserialize(r)?,
            filter_mask_topic: String::cdr_deserialize(r)?,
            base: f32::cdr_deserialize(r)?,
            multiplier: f32::cdr_deserialize(r)?,
        })
    }
}

impl CdrSerializedSize for CostmapFilterInfo {
    fn cdr_serialized_size(&self, at: usize) -> usize {
        let at = self.kind.cdr_serialized_size(self.header.cdr_serialized_size(at));
        let at = self.filter_mask_topic.cdr_serialized_size(at);
        self.multiplier.cdr_serialized_size(self.base.cdr_serialized_size(at))
    }
}

/// A mask whose cells are percents: for a keep-out filter (0) or a speed filter (1).
fn filter(kind: u8, topic: &str) -> CostmapFilterInfo {
    let filter_mask_topic = topic.into();
    CostmapFilterInfo { header: header("map"), kind, filter_mask_topic, base: 0.0, multiplier: 1.0 }
}

/// Free floor with one wall, the column at its right edge.
fn map() -> OccupancyGrid {
    grid(|n| if n % SIDE == SIDE - 1 { 100 } else { 0 })
}

/// A mask with this value in the ten columns at its left edge.
fn mask(value: i8) -> OccupancyGrid {
    grid(|n| if n % SIDE < 10 { value } else { 0 })
}

fn grid(cell: impl Fn(usize) -> i8) -> OccupancyGrid {
    let origin = Pose { position: Point { x: -2.0, y: -2.0, z: 0.0 }, orientation: FORWARD };
    let (width, height) = (SIDE as u32, SIDE as u32);
    let info = MapMetaData { map_load_time: Time::default(), resolution: CELL, width, height, origin };
    let data = (0..SIDE * SIDE).map(cell).collect();
    OccupancyGrid { header: header("map"), info, data }
}

/// Beams to the front, the left, the back and the right, 1 m long.
fn scan() -> LaserScan {
    LaserScan {
        header: header("base_link"),
        angle_increment: std::f32::consts::FRAC_PI_2,
        range_min: 0.1,
        range_max: 9.0,
        ranges: vec![1.0; 4],
        ..LaserScan::default()
    }
}

/// The robot stands at x = 1.25, y = -0.5 and looks to y.
fn stand(node: &ZNode, latched: QosProfile) -> Result<()> {
    let grid = node.create_pub::<OccupancyGrid>("/map").with_qos(latched).build()?;
    let upper = node.create_pub::<OccupancyGrid>("/upper/map").with_qos(latched).build()?;
    let slow = node.create_pub::<OccupancyGrid>("/speed_mask").with_qos(latched).build()?;
    let slow_info = node.create_pub::<CostmapFilterInfo>("/speed_info").with_qos(latched).build()?;
    let keep_info = node.create_pub::<CostmapFilterInfo>("/keepout_info").with_qos(latched).build()?;
    let fixed = node.create_pub::<TFMessage>("/tf_static").with_qos(latched).build()?;
    let moved = node.create_pub::<TFMessage>("/tf").build()?;
    let scanned = node.create_pub::<LaserScan>("/scan").build()?;
    grid.publish(&map())?;
    upper.publish(&map())?;
    slow.publish(&mask(40))?;
    slow_info.publish(&filter(1, "/speed_mask"))?;
    keep_info.publish(&filter(0, "/keepout_mask"))?;
    fixed.publish(&transform("map", "odom", 0.5, 0.0, FORWARD))?;
    tokio::spawn(async move {
        let _latched = (grid, upper, slow, slow_info, keep_info, fixed); // they keep what late subscribers ask for
        let mut ticks = tokio::time::interval(Duration::from_millis(20));
        for tick in 0_u64.. {
            ticks.tick().await;
            moved.publish(&transform("odom", "base_link", 0.75, -0.5, LEFT)).expect("published");
            if tick % 5 == 0 {
                scanned.publish(&scan()).expect("published");
            }
        }
    });
    Ok(())
}

#[tokio::main]
async fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let endpoint = arguments.next().expect("usage: test-rmw-robot ENDPOINT [DOMAIN]");
    let domain = arguments.next().map_or(0, |text| text.parse().expect("a domain"));
    let context = ZContextBuilder::default()
        .with_domain_id(domain)
        .with_connect_endpoints([endpoint])
        .build()?;
    let node = context.create_node("system_controller").build()?;

    let mut speed = ParameterDescriptor::new("max_speed", ParameterType::Integer);
    speed.integer_range = Some(IntegerRange { from_value: 0, to_value: 100, step: 1 });
    node.declare_parameter("max_speed", ParameterValue::Integer(50), speed).expect("declared");

    let latched = QosProfile {
        durability: QosDurability::TransientLocal,
        history: QosHistory::from_depth(1),
        ..QosProfile::default()
    };
    let enabled = node.create_pub::<Bool>("/operation_enabled").with_qos(latched).build()?;
    enabled.publish(&Bool { data: true })?;

    let _counter = node.create_action_server::<Fibonacci>("/count").build()?.with_handler(count);
    let mut adder = node.create_service::<AddTwoInts>("/add").build()?;
    std::thread::spawn(move || {
        while let Ok(request) = adder.take_request() {
            let sum = request.message().a + request.message().b;
            request.reply_blocking(&AddTwoIntsResponse { sum }).expect("replied");
        }
    });

    stand(&node, latched)?;
    let level = node.create_pub::<Text>("/level").with_qos(latched).build()?;
    let keep_out = node.create_pub::<OccupancyGrid>("/keepout_mask").with_qos(latched).build()?;
    keep_out.publish(&mask(100))?;

    let heard = node.create_sub::<Text>("/operation").build()?;
    let last = node.create_pub::<Text>("/last_heard").build()?;
    eprintln!("test-rmw-robot: running");
    while let Ok(text) = heard.async_recv().await {
        eprintln!("heard {}", text.data);
        match text.data.as_str() {
            "permit" => enabled.publish(&Bool { data: true })?,
            "forbid" => enabled.publish(&Bool { data: false })?,
            "clear" => keep_out.publish(&mask(0))?,
            other => {
                if let Some(name) = other.strip_prefix("level ") {
                    level.publish(&Text { data: name.into() })?;
                }
            }
        }
        last.publish(&text)?;
    }
    Ok(())
}
