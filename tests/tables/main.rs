//! The examples that reproduce tables of the paper.

#[path = "../support/table.rs"]
mod refusals;

mod table_3;
mod table_a1;
