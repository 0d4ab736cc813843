//! What a router with identities says of one of them; always JSON.

use super::{Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Whether, and as what, a router admits an identity. Whoever has any certificate of the fleet may ask, so that
/// one who is not admitted learns why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct IdentityStatus {
    /// Whose.
    pub name: Name,
    /// Its role as in the registry; `None` = the registry does not have it.
    #[serde(deserialize_with = "text::read_option")]
    pub role: Option<String>,
    /// The certificate that is admitted; 0 = none is.
    pub generation: u32,
    /// Not admitted any more.
    pub revoked: bool,
    /// Admitted by the registry, and by the router when no robot is driven. Since version 2.
    #[serde(default)]
    pub waiting: bool,
}

impl Message for IdentityStatus {
    const NAME: &'static str = "IdentityStatus";
    const VERSION: u32 = 2;

    fn validate(&self) -> Result<(), CodecError> {
        let length = self.role.as_ref().map_or(0, String::len);
        bounded("role", length as f64, 0.0, 32.0, "characters")
    }
}
