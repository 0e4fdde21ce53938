//! The mock flight computer.
