//! xtb-bus
