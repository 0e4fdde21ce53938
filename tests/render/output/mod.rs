//! The files of a run, read back.

mod fits;
mod folder;
mod pictures;
mod synthetic;
