//! The flight computer as a whole: its parts, its links, its command line, and flights against a small emulator.

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
