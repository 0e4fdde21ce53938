//! Tests of the wire formats. The fuzz targets are a separate program, which measures its memory.

mod can;
mod common;
mod forms;
mod golden;
mod icd;
mod parts;
mod properties;
mod rice;
mod tidy;
