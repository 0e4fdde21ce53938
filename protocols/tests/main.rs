//! Tests of the wire formats. The fuzz targets have a program of their own, which measures its memory.

mod can;
mod common;
mod forms;
mod golden;
mod icd;
mod parts;
mod properties;
mod rice;
mod tidy;
