//! The versions of VDA 5050, and what is called differently in them.

/// Which version a master control speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// 2.0.0: as 2.1.0, but for the number in the header.
    V2_0,
    /// 2.1.0.
    V2_1,
    /// 3.0.0.
    V3_0,
}

impl Protocol {
    /// As it stands in headers.
    #[must_use]
    pub fn version(self) -> &'static str {
        match self {
            Self::V2_0 => "2.0.0",
            Self::V2_1 => "2.1.0",
            Self::V3_0 => "3.0.0",
        }
    }

    /// The level of topics that names the version.
    #[must_use]
    pub fn topic_level(self) -> &'static str {
        if self.is_v3() { "v3" } else { "v2" }
    }

    /// The usual first level of topics.
    #[must_use]
    pub fn interface(self) -> &'static str {
        if self.is_v3() { "vda5050" } else { "uagv" }
    }

    /// Whether it is a 3.x.
    #[must_use]
    pub fn is_v3(self) -> bool {
        self == Self::V3_0
    }

    /// One of two names.
    #[must_use]
    pub fn pick<T>(self, v2: T, v3: T) -> T {
        if self.is_v3() { v3 } else { v2 }
    }
}
