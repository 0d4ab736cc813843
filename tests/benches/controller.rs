//! Time and allocations of one controller step, by kind of sample.
//!
//! `cargo bench -p fleet-tests --bench controller`: the column of medians is the figure, 1000 steps
//! an iteration, so µs are ns a step; the rows `alloc` must be missing or zero. That no step
//! allocates is proven in `core/control/tests/allocations.rs`.

use divan::counter::ItemsCount;
use divan::{AllocProfiler, Bencher};
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::goto::GotoGoal;
use xtb_control::vehicle::Platform;
use xtb_control::{AdcCount, Command, Controller, Sample, Stamp, VehicleConfig};

#[global_allocator]
static ALLOCATIONS: AllocProfiler = AllocProfiler::system();

const STEPS: u64 = 1000;
/// Selector pulses in ticks of 1.6 µs.
const MANUAL: Option<u32> = Some(750);
const AUTOMATIC: Option<u32> = Some(1125);

fn main() {
    divan::main();
}

fn count(counts: u16) -> AdcCount {
    AdcCount::try_from(counts).expect("in range")
}

/// A controller under way to a goal, as in most of its life.
fn under_way(config: VehicleConfig) -> Controller {
    let mut controller = Controller::new(config);
    controller.step(Stamp::ZERO, &Sample::Gyro(GyroSample::default()));
    let goal = GotoGoal::new(3.0, 40.0).expect("in range");
    controller.step(Stamp::ZERO, &Sample::Command(Command::Goto(goal)));
    controller
}

/// Steps with these samples in turn; each iteration is [`STEPS`] of them.
fn steps(bencher: Bencher<'_, '_>, mut controller: Controller, samples: &[Sample]) {
    let mut t = Stamp::ZERO;
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        for sample in samples.iter().cycle().take(STEPS as usize) {
            t = t.plus_ms(10);
            divan::black_box(controller.step(t, divan::black_box(sample)));
        }
    });
}

fn default() -> Controller {
    under_way(VehicleConfig::default())
}

#[divan::bench]
fn gyro_and_goto(bencher: Bencher<'_, '_>) {
    steps(bencher, default(), &[Sample::Gyro(GyroSample { roll: 3, pitch: -2, yaw: 120 })]);
}

#[divan::bench]
fn encoder_speed_and_odometry(bencher: Bencher<'_, '_>) {
    steps(bencher, default(), &[Sample::Encoder { pulses: 22 }]);
}

/// A scan with things in range of all twelve sensors, on a slope of a few degrees.
fn scan() -> Sample {
    let side = [40, 120, 200, 300, 150, 90, 0, 0].map(count);
    let tilt = [count(540), count(500)];
    Sample::Adc(AdcSample { ir_front: side, ir_rear: side, tilt, pistons: [500, 520, 480, 512].map(count) })
}

#[divan::bench(args = [Platform::Off, Platform::Balance, Platform::Pid])]
fn adc_infrared_obstacle_and_platform(bencher: Bencher<'_, '_>, platform: Platform) {
    steps(bencher, under_way(VehicleConfig { platform, ..VehicleConfig::default() }), &[scan()]);
}

fn remote(speed: Option<u32>, selector: Option<u32>) -> Sample {
    Sample::Remote(RemoteSample { speed, steering: Some(1000), selector })
}

#[divan::bench]
fn remote_on_automatic(bencher: Bencher<'_, '_>) {
    steps(bencher, default(), &[remote(Some(938), AUTOMATIC)]);
}

#[divan::bench]
fn remote_on_manual(bencher: Bencher<'_, '_>) {
    steps(bencher, default(), &[remote(Some(1000), MANUAL)]);
}

/// Complements, impossible readings and missing ones.
#[divan::bench]
fn remote_with_wrong_edges(bencher: Bencher<'_, '_>) {
    let speeds = [Some(12_937), Some(58_275), None];
    steps(bencher, default(), &speeds.map(|speed| remote(speed, MANUAL)));
}

#[divan::bench]
fn command(bencher: Bencher<'_, '_>) {
    steps(bencher, default(), &[Sample::Command(Command::Wander)]);
}

/// What a second brings, each kind of sample as often as it comes: 100 gyro, 45 remote, 26 scans, 19
/// encoder windows.
#[divan::bench]
fn a_second_of_everything(bencher: Bencher<'_, '_>) {
    let mut samples = Vec::new();
    for i in 0..100_u16 {
        samples.push(Sample::Gyro(GyroSample { roll: 3, pitch: -2, yaw: 120 }));
        let due = |each_s: u16| i * each_s / 100 != (i + 1) * each_s / 100;
        if due(45) {
            samples.push(remote(Some(938), AUTOMATIC));
        }
        if due(26) {
            samples.push(scan());
        }
        if due(19) {
            samples.push(Sample::Encoder { pulses: 22 });
        }
    }
    steps(bencher, default(), &samples);
}
