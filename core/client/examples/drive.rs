//! Drives the first robot of fleet `lab` to a point: `cargo run -p xtb-client --example drive [X Y]`; the router
//! is the one of this computer, or `XTB_CONNECT`.

#![allow(clippy::print_stdout)]

use xtb_client::goal::{GoalRequest, drive};
use xtb_client::{Client, Control, Settings};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut at = std::env::args().skip(1).map(|text| text.parse::<f64>());
    let (x_m, y_m) = (at.next().unwrap_or(Ok(1.0))?, at.next().unwrap_or(Ok(2.0))?);
    let mut settings = Settings::new("lab")?;
    settings.connect = std::env::var("XTB_CONNECT").map_or(settings.connect, |router| vec![router]);
    let client = Client::open(&settings).await?;
    let robot = client.alive().await?.into_iter().next().ok_or_else(|| client.nobody())?;
    let control = Control::acquire(&client, &robot, false).await?;
    let end = drive(&client, &control, &GoalRequest::to(x_m, y_m)).await;
    control.release().await;
    client.close().await;
    println!("{robot}: {:?}", end?.status);
    Ok(())
}
