//! Reads the reference tables of this folder; each says in its first lines which program made it.

use nalgebra::Vector3;

/// The rows of a CSV table, without comments and header.
pub fn rows(table: &str) -> impl Iterator<Item = Vec<&str>> {
    table
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.split(',').collect())
}

/// The number in column `k`.
pub fn number(row: &[&str], k: usize) -> f64 {
    row[k]
        .parse()
        .unwrap_or_else(|e| panic!("column {k}, {:?}: {e}", row[k]))
}

/// The vector in columns `k`, `k + 1` and `k + 2`.
pub fn vector(row: &[&str], k: usize) -> Vector3<f64> {
    Vector3::new(number(row, k), number(row, k + 1), number(row, k + 2))
}
