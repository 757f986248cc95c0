//! A robot for the tests, on hiroz: keys, tokens, attachments and hashes are those of its makers.
//!
//! `test-rmw-robot ENDPOINT [DOMAIN]` runs until it is killed. It permits operation, says back what it
//! hears, adds two numbers, counts Fibonacci's and has one parameter.

use std::time::Duration;

use hiroz::action::server::ExecutingGoal;
use hiroz::context::ZContextBuilder;
use hiroz::parameter::{IntegerRange, ParameterDescriptor, ParameterType, ParameterValue};
use hiroz::qos::{QosDurability, QosHistory, QosProfile};
use hiroz::{Builder, Result};
use hiroz_msgs::example_interfaces::action::Fibonacci;
use hiroz_msgs::example_interfaces::srv::AddTwoInts;
use hiroz_msgs::example_interfaces::{AddTwoIntsResponse, FibonacciFeedback, FibonacciResult};
use hiroz_msgs::std_msgs::{Bool, String as Text};

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

    let heard = node.create_sub::<Text>("/operation").build()?;
    let last = node.create_pub::<Text>("/last_heard").build()?;
    eprintln!("test-rmw-robot: running");
    while let Ok(text) = heard.async_recv().await {
        eprintln!("heard {}", text.data);
        last.publish(&text)?;
    }
    Ok(())
}
