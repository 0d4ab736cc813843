//! xtb-authority
