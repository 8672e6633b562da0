//! Calls `take_off` of a UAV by ros2-client, a client of ROS 2 in Rust that shares no code with ROS' own.
//!
//! `take_off /uav_1/ual DOMAIN HEIGHT` prints `success reason message`.

use std::env;

use ros2_client::{
    Context, ContextOptions, Message, Name, NodeName, NodeOptions, QosProfile, ServiceMapping, ServiceTypeName,
};
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Serialize, Deserialize)]
struct TakeOffRequest {
    height: f32,
    blocking: bool,
}
impl Message for TakeOffRequest {}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct KeyValue {
    key: String,
    value: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct TakeOffResponse {
    success: bool,
    reason: String,
    message: String,
    metadata: Vec<KeyValue>,
}
impl Message for TakeOffResponse {}

fn main() {
    let words: Vec<String> = env::args().collect();
    let domain = words[2].parse().expect("a domain");
    let height = words[3].parse().expect("a height");

    let options = ContextOptions::new().domain_id(domain);
    let context = Context::with_options(options).expect("a participant");
    let name = NodeName::new("/", "take_off").expect("a name");
    let mut node = context.new_node(name, NodeOptions::new()).expect("a node");
    let qos = QosProfile::publisher_default();
    let client = node
        .create_client::<TakeOffRequest, TakeOffResponse>(
            ServiceMapping::Enhanced,
            &Name::new(&words[1], "take_off").expect("a name"),
            &ServiceTypeName::new("ual_msgs", "TakeOff"),
            qos.clone(),
            qos,
        )
        .expect("a client");
    smol::spawn(node.spinner().expect("a spinner").spin()).detach();

    let answer = smol::block_on(async {
        client.wait_for_service(&node).await;
        let request = TakeOffRequest { height, blocking: true };
        client.async_call_service(request).await.expect("an answer")
    });
    println!("{} {} {}", answer.success, answer.reason, answer.message);
}
