//! The messages and services that a robot offers or takes, field by field as in their `.msg` files, and the hashes
//! under which other nodes look for them (RIHS01, computed by ROS's own generator; Jazzy, Kilted and Lyrical).

mod diagnostic;
mod geometry;
mod nav;
mod navigate;
mod sensor;
mod standard;

pub use diagnostic::{DiagnosticArray, DiagnosticStatus, KeyValue, Level};
pub use geometry::{
    Point, Pose, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion, Transform,
    TransformStamped, Twist, TwistStamped, TwistWithCovariance, Vector3,
};
pub use nav::{MapMetaData, OccupancyGrid, Odometry, Path, TfMessage};
pub use navigate::{
    CancelCode, CancelGoal, CancelGoalRequest, CancelGoalResponse, Distro, ERROR_UNKNOWN, GetResult,
    GetResultRequest, GetResultResponse, GoalId, GoalInfo, GoalStatusArray, GoalStatusEntry, LyricalFeedback,
    NavigateFeedback, SendGoal, SendGoalRequest, SendGoalResponse, Status,
};
pub use sensor::{BatteryState, Imu, LaserScan, Range};
pub use standard::{
    Clock, Duration, EmptyRequest, Header, SetBool, SetBoolRequest, Text, Time, Trigger, Verdict,
};

use crate::cdr::Cdr;

/// What a type is called, and its hash. Two types of one name and different hashes do not hear each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RosType {
    /// As people write it: `geometry_msgs/msg/Twist`.
    pub name: &'static str,
    /// `RIHS01_` and 64 hexadecimal digits.
    pub hash: &'static str,
}

impl RosType {
    /// As it stands in keys and tokens: `geometry_msgs::msg::dds_::Twist_`.
    #[must_use]
    pub fn dds_name(&self) -> String {
        let (package, name) = self.name.rsplit_once('/').unwrap_or_default();
        format!("{}::dds_::{name}_", package.replace('/', "::"))
    }
}

/// A message of a topic.
pub trait Message: Cdr {
    /// What it is called.
    const TYPE: RosType;
}

/// A service: its key has its own type, none of the request's or the response's.
pub trait Service {
    /// What it is called.
    const TYPE: RosType;
    /// What a client asks.
    type Request: Cdr;
    /// What it is told.
    type Response: Cdr;
}

/// Makes structs that are CDR, field by field, in the order in which they are written here; with a name and a hash
/// in front they are messages of topics.
macro_rules! cdr_structs {
    ($(
        $(#[doc = $doc:literal])+
        $([$type:literal, $hash:literal])?
        $name:ident { $($(#[doc = $field_doc:literal])+ $field:ident: $field_type:ty,)+ }
    )+) => {
        $(
            $(#[doc = $doc])+
            #[derive(Debug, Clone, PartialEq, Default)]
            #[cfg_attr(test, derive(proptest_derive::Arbitrary, serde::Serialize, serde::Deserialize))]
            pub struct $name {
                $($(#[doc = $field_doc])+ pub $field: $field_type,)+
            }

            impl $crate::cdr::Cdr for $name {
                const MIN_BYTES: usize = 0 $(+ <$field_type as $crate::cdr::Cdr>::MIN_BYTES)+;

                fn write(&self, to: &mut $crate::cdr::Writer) {
                    $(self.$field.write(to);)+
                }

                fn read(from: &mut $crate::cdr::Reader<'_>) -> Result<Self, $crate::cdr::CdrError> {
                    // In the order in which they are written here.
                    Ok(Self { $($field: $crate::cdr::Cdr::read(from)?,)+ })
                }
            }

            $(impl $crate::types::Message for $name {
                const TYPE: $crate::types::RosType =
                    $crate::types::RosType { name: $type, hash: concat!("RIHS01_", $hash) };
            })?
        )+
    };
}
use cdr_structs;

/// Names a service with its hash, its request and its response.
macro_rules! services {
    ($($(#[doc = $doc:literal])+ [$type:literal, $hash:literal] $name:ident: $request:ty => $response:ty;)+) => {
        $(
            $(#[doc = $doc])+
            #[derive(Debug, Clone, Copy)]
            pub struct $name;

            impl $crate::types::Service for $name {
                const TYPE: $crate::types::RosType =
                    $crate::types::RosType { name: $type, hash: concat!("RIHS01_", $hash) };
                type Request = $request;
                type Response = $response;
            }
        )+
    };
}
use services;

#[cfg(test)]
mod tests;
