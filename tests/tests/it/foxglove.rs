//! The live scene for Foxglove, over its own protocol: `cargo test -p fleet-tests --features foxglove`.

use fleet_tests::{Fleet, PATIENCE, Setup, name};
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::sync::Arc;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use xtb_client::scene::Scene;
use xtb_client::scene::live::SharedScene;
use xtb_dashboard::foxglove::serve;

#[tokio::test(flavor = "multi_thread")]
async fn foxglove_is_offered_scene_log_and_poses_and_gets_them() {
    let fleet = Fleet::start(Setup { robots: 1, speed: 1.0, ..Setup::default() }).await;
    let shared = Arc::new(SharedScene::new(Scene::new(name("lab"))));
    let into = Arc::clone(&shared);
    let keys = fleet.any_robot().state();
    let each = move |incoming| into.put(&xtb_client::subscription::Item::Message(incoming));
    let _states = fleet.bus.subscribe(&keys, each).await.unwrap();
    let handle = serve(shared, "127.0.0.1:0".parse().unwrap()).await.unwrap();

    let mut request = format!("ws://{}", handle.address()).into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "foxglove.sdk.v1".parse().unwrap());
    let (mut socket, _) = tokio_tungstenite::connect_async(request).await.unwrap();
    let pose = format!("{}/pose", fleet.robot(1).state());
    let mut missing = vec!["foxglove/scene".to_owned(), "foxglove/log".to_owned(), pose.clone()];
    let seen = tokio::time::timeout(PATIENCE, async {
        while let Some(message) = socket.next().await {
            match message.unwrap() {
                Message::Text(text) => {
                    let text: Value = serde_json::from_str(&text).unwrap();
                    for channel in text["channels"].as_array().into_iter().flatten() {
                        missing.retain(|topic| channel["topic"] != **topic);
                        assert_eq!(
                            (&channel["encoding"], &channel["schemaEncoding"]),
                            (&json!("json"), &json!("jsonschema"))
                        );
                        if channel["topic"] == *pose {
                            assert_eq!(channel["schemaName"], "foxglove.PoseInFrame");
                            let wish = json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]});
                            socket.send(Message::text(wish.to_string())).await.unwrap();
                        }
                    }
                }
                // Opcode, subscription, time, and the message.
                Message::Binary(bytes) if bytes[0] == 1 => {
                    return serde_json::from_slice::<Value>(&bytes[13..]).unwrap();
                }
                _ => {}
            }
        }
        panic!("the server has closed");
    });
    let seen = seen.await.unwrap();
    assert_eq!((missing, &seen["frame_id"]), (Vec::<String>::new(), &json!("map")));
    assert!(seen["pose"]["position"]["x"].is_number(), "{seen}");
    drop(handle);
    fleet.end().await;
}

#[tokio::test]
async fn it_is_served_on_the_loopback_only() {
    let shared = Arc::new(SharedScene::new(Scene::new(name("lab"))));
    let refused = serve(shared, "0.0.0.0:0".parse().unwrap()).await.err().unwrap();
    assert!(refused.message.contains("no access token"), "{refused:?}");
}
