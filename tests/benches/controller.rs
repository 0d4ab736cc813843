//! Time and allocations of one controller step, by kind of sample.
//!
//! `cargo bench -p fleet-tests --bench controller`: the column of medians is the figure, and the
//! rows `alloc` must be missing or zero.

use divan::{AllocProfiler, Bencher};
use xtb_control::controller::{AdcSample, GyroSample};
use xtb_control::goto::Goal;
use xtb_control::{AdcCount, Command, Controller, Sample, Stamp, VehicleConfig};

#[global_allocator]
static ALLOCATIONS: AllocProfiler = AllocProfiler::system();

fn main() {
    divan::main();
}

fn count(counts: u16) -> AdcCount {
    AdcCount::try_from(counts).expect("in range")
}

/// A controller under way to a goal, as in most of its life.
fn under_way() -> Controller {
    let mut controller = Controller::new(VehicleConfig::default());
    controller.step(Stamp::ZERO, &Sample::Gyro(GyroSample::default()));
    let goal = Goal::new(3.0, 40.0).expect("in range");
    controller.step(Stamp::ZERO, &Sample::Command(Command::Goto(goal)));
    controller
}

/// Steps with the same sample again and again; each iteration is 1000 steps.
fn steps(bencher: Bencher<'_, '_>, sample: Sample) {
    let mut controller = under_way();
    let mut t = Stamp::ZERO;
    bencher.counter(divan::counter::ItemsCount::new(1000_u32)).bench_local(|| {
        for _ in 0..1000 {
            t = t.plus_ms(10);
            divan::black_box(controller.step(t, divan::black_box(&sample)));
        }
    });
}

#[divan::bench]
fn gyro_and_goto(bencher: Bencher<'_, '_>) {
    steps(bencher, Sample::Gyro(GyroSample { roll: 3, pitch: -2, yaw: 120 }));
}

#[divan::bench]
fn encoder_speed_and_odometry(bencher: Bencher<'_, '_>) {
    steps(bencher, Sample::Encoder { pulses: 22 });
}

#[divan::bench]
fn adc_infrared_and_obstacle(bencher: Bencher<'_, '_>) {
    let side = [40, 120, 200, 300, 150, 90].map(count);
    let sample = AdcSample { ir_front: side, ir_rear: side, tilt: [count(512); 2], pistons: [count(500); 4] };
    steps(bencher, Sample::Adc(sample));
}

#[divan::bench]
fn command(bencher: Bencher<'_, '_>) {
    steps(bencher, Sample::Command(Command::Wander));
}
