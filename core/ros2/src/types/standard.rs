//! Time, headers, text, and the two services that only say yes or no.

use super::{cdr_structs, services};

cdr_structs! {
    /// A time of a clock, or since 1970.
    Time {
        /// In s.
        sec: i32,
        /// After that, below 1,000,000,000.
        nanosec: u32,
    }

    /// A length of time.
    Duration {
        /// In s; may be negative.
        sec: i32,
        /// After that, below 1,000,000,000.
        nanosec: u32,
    }

    /// When, and in which frame.
    Header {
        /// When it was so.
        stamp: Time,
        /// The frame of what follows.
        frame_id: String,
    }

    /// A simulator's time.
    ["rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"]
    Clock {
        /// The time.
        clock: Time,
    }

    /// `std_msgs/msg/String`.
    ["std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"]
    Text {
        /// The text.
        data: String,
    }

    /// A request without fields: one byte that means nothing.
    EmptyRequest {
        /// As the generator calls it.
        structure_needs_at_least_one_member: u8,
    }

    /// On or off.
    SetBoolRequest {
        /// Which.
        data: bool,
    }

    /// Whether it was done.
    Verdict {
        /// Done.
        success: bool,
        /// What there is to say of it.
        message: String,
    }
}

services! {
    /// Do it.
    ["std_srvs/srv/Trigger", "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"]
    Trigger: EmptyRequest => Verdict;

    /// Switch it.
    ["std_srvs/srv/SetBool", "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"]
    SetBool: SetBoolRequest => Verdict;
}

impl Time {
    /// This many ns since the beginning. ROS's seconds end in 2038; later times stay there.
    #[must_use]
    pub fn from_ns(ns: u64) -> Self {
        let sec = i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX);
        Self { sec, nanosec: (ns % 1_000_000_000) as u32 }
    }

    /// In ns; negative before the beginning.
    #[must_use]
    pub fn ns(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}

impl Duration {
    /// This many s, to the ns; what is not finite or negative is 0.
    #[must_use]
    pub fn from_s(s: f64) -> Self {
        let ns = if s.is_finite() { (s * 1e9).max(0.0) as u64 } else { 0 };
        let Time { sec, nanosec } = Time::from_ns(ns);
        Self { sec, nanosec }
    }
}

impl Verdict {
    /// Done.
    #[must_use]
    pub fn done(message: impl Into<String>) -> Self {
        Self { success: true, message: message.into() }
    }

    /// Not done, and why.
    #[must_use]
    pub fn refused(message: impl Into<String>) -> Self {
        Self { success: false, message: message.into() }
    }
}
