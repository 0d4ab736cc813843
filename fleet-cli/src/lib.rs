//! fleet-cli
