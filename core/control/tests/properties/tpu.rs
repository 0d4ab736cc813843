//! TPU set-up and reset (§4.2, Figs. 8 and 9).

use crate::any::{config, remote_sample, ticks};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::controller::RemoteSample;
use xtb_control::tpu::{PinChannel, SetupTask, TpuSetup};
use xtb_control::units::Stamp;
use xtb_control::{Controller, Sample, VehicleConfig};

fn setup() -> TpuSetup {
    TpuSetup::of(&VehicleConfig::default()).unwrap()
}

proptest! {
    #[test]
    fn the_set_up_of_every_valid_configuration_survives_the_line(config in config()) {
        let setup = TpuSetup::of(&config).unwrap();
        prop_assert_eq!(TpuSetup::from_bytes(&setup.to_bytes()), setup);
        for (i, code) in setup.channels.iter().enumerate() {
            prop_assert!(PinChannel::from_code(*code).is_some());
            prop_assert!(!setup.channels[..i].contains(code), "no two pins on one channel");
        }
    }

    #[test]
    fn every_code_is_a_channel_that_reads_back_or_none(code: u8) {
        if let Some(channel) = PinChannel::from_code(code) {
            prop_assert_eq!(channel.code(), code);
            prop_assert_eq!(channel.to_string().parse(), Ok(channel));
        }
    }

    #[test]
    fn words_that_are_no_channel_are_refused(word in "[a-z]{0,5}[0-9]{0,3}") {
        if let Ok(channel) = word.parse::<PinChannel>() {
            prop_assert_eq!(PinChannel::from_code(channel.code()), Some(channel));
        }
    }

    #[test]
    fn the_gate_opens_for_exactly_this_set_up_alone(other: u16, ready: bool) {
        let mut task = SetupTask::new(setup());
        task.confirm(ready, other);
        prop_assert_eq!(task.is_done(), ready && other == setup().checksum());
        task.forget();
        prop_assert!(!task.is_done());
    }

    #[test]
    fn it_asks_at_most_every_100_ms_and_never_once_it_is_confirmed(pauses_ms in vec(0_u64..150, 1..50)) {
        let (mut task, mut now, mut asked) = (SetupTask::new(setup()), Stamp::ZERO, None);
        for pause_ms in pauses_ms {
            let due = asked.is_none_or(|at| now.since_ms(at) >= 100);
            prop_assert_eq!(task.request(now).is_some(), due);
            asked = if due { Some(now) } else { asked };
            now = now.plus_ms(pause_ms);
        }
        task.confirm(true, setup().checksum());
        prop_assert!(task.request(now.plus_ms(1000)).is_none());
    }

    #[test]
    fn a_reset_is_asked_for_by_impossible_readings_alone_and_for_their_own_channel(
        before in remote_sample(), speed in ticks(), steering in ticks(), selector in ticks(),
    ) {
        let mut controller = Controller::new(VehicleConfig::default());
        controller.step(Stamp::ZERO, &Sample::Remote(before));
        let sample = RemoteSample { speed, steering, selector };
        let reset = controller.step(Stamp::from_ms(22), &Sample::Remote(sample)).reset;
        // 22.2 ms are 13,875 ticks.
        let impossible = [speed, steering, selector].map(|ticks| ticks.is_some_and(|ticks| ticks > 13_875));
        prop_assert_eq!([reset.speed, reset.steering, reset.selector], impossible);
        let gyro = Sample::Gyro(Default::default());
        prop_assert!(!controller.step(Stamp::from_ms(30), &gyro).reset.any(), "asked for once");
    }
}
