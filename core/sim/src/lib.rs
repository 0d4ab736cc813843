//! xtb-sim
