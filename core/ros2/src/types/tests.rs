//! Our CDR against another implementation's, `cdr-encoding` (of RustDDS), on any message; and spoilt bytes.

use super::*;
use crate::cdr::{from_bytes, to_bytes};
use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::{from_bytes as oracle_reads, to_vec as oracle_writes};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

/// Both write the same bytes, and read what the other has written, in both orders.
fn agrees<T: Cdr + Serialize + DeserializeOwned + PartialEq + Debug>(message: &T) {
    let bytes = to_bytes(message);
    let (head, fields) = bytes.split_at(4);
    assert_eq!((head, fields), (&[0, 1, 0, 0][..], &oracle_writes::<T, LittleEndian>(message).unwrap()[..]));
    assert_eq!(&oracle_reads::<T, LittleEndian>(fields).unwrap().0, message);
    assert_eq!(&from_bytes::<T>(&bytes).unwrap(), message);
    assert!(fields.len() >= T::MIN_BYTES);
    let big = [&[0, 0, 0, 0][..], &oracle_writes::<T, BigEndian>(message).unwrap()].concat();
    assert_eq!(&from_bytes::<T>(&big).unwrap(), message);
}

/// Cut off anywhere it is refused, with a byte changed or anything after it nothing panics.
fn is_robust<T: Cdr + PartialEq + Debug>(message: &T, at: usize, value: u8) {
    let mut bytes = to_bytes(message);
    for end in [at % bytes.len(), bytes.len() - 1] {
        assert!(from_bytes::<T>(&bytes[..end]).is_err(), "cut to {end} of {} bytes", bytes.len());
    }
    bytes.extend([value; 5]);
    assert_eq!(from_bytes::<T>(&bytes).as_ref(), Ok(message));
    let at = at % bytes.len();
    bytes[at] = value;
    let _ = from_bytes::<T>(&bytes);
}

macro_rules! differential {
    ($($test:ident: $type:ty;)+) => {
        proptest! {
            #![proptest_config(ProptestConfig::with_cases(64))]
            $(#[test]
            fn $test(message: $type, at: usize, value: u8) {
                agrees(&message);
                is_robust(&message, at, value);
            })+
        }

        proptest! {
            #[test]
            fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), order in 0..2_u8) {
                let bytes = [vec![0, order, 0, 0], bytes].concat();
                $(let _ = from_bytes::<$type>(&bytes);)+
            }
        }
    };
}

differential! {
    clock: Clock;
    text: Text;
    empty_request: EmptyRequest;
    set_bool_request: SetBoolRequest;
    verdict: Verdict;
    twist: Twist;
    twist_stamped: TwistStamped;
    pose_stamped: PoseStamped;
    pose_with_covariance_stamped: PoseWithCovarianceStamped;
    odometry: Odometry;
    occupancy_grid: OccupancyGrid;
    path: Path;
    tf: TfMessage;
    range: Range;
    laser_scan: LaserScan;
    imu: Imu;
    battery_state: BatteryState;
    diagnostic_array: DiagnosticArray;
    goal_status_array: GoalStatusArray;
    cancel_goal_request: CancelGoalRequest;
    cancel_goal_response: CancelGoalResponse;
    send_goal_request: SendGoalRequest;
    send_goal_response: SendGoalResponse;
    get_result_request: GetResultRequest;
    get_result_response: GetResultResponse;
    navigate_feedback: NavigateFeedback;
    lyrical_feedback: LyricalFeedback;
}

#[test]
fn names_of_types_are_those_of_dds() {
    assert_eq!(Twist::TYPE.dds_name(), "geometry_msgs::msg::dds_::Twist_");
    assert_eq!(SendGoal::TYPE.dds_name(), "nav2_msgs::action::dds_::NavigateToPose_SendGoal_");
}

#[test]
fn times_go_to_and_from_ns() {
    assert_eq!(Time::from_ns(7_000_000_005), Time { sec: 7, nanosec: 5 });
    assert_eq!((Time { sec: -1, nanosec: 5 }).ns(), -999_999_995);
    assert_eq!(Time::from_ns(u64::MAX).sec, i32::MAX);
    assert_eq!(Duration::from_s(1.5), Duration { sec: 1, nanosec: 500_000_000 });
    assert_eq!([f64::NAN, -1.0].map(Duration::from_s), [Duration::default(), Duration::default()]);
}
