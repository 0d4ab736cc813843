//! The tests of messages, frames and texts, one program.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod board_codec;
mod board_doc;
mod codec_properties;
mod protocol_doc;
mod schemas;
mod text_read;
mod wire;
