//! What goes over a line: I/O board frames, gyro frames, Zenoh keys, messages and their codec.
//!
//! Pure: bytes in, values out. Everything that comes from outside is checked here, once; the layers
//! below get types that cannot hold a bad value.

pub mod bno085;
pub mod board;
pub mod codec;
pub mod gyro_3dmg;
pub mod keys;
pub mod messages;
pub mod text;
pub mod trace;
pub mod wire;

pub use keys::Name;
pub use uuid::Uuid;
