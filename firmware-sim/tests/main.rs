//! Tests of the flight computer: its parts, links, command line, and runs against a small emulator.

mod can;
mod cli;
mod closed_loop;
mod common;
mod contract;
mod detector;
mod levels;
mod reassembly;
mod recovery;
mod reference_page;
mod roles;
mod silence;
mod steering;
