//! Properties of the crate: no `std`, no allocation, no dependencies, no `unsafe`.

#[test]
fn bare_and_safe() {
    let library = include_str!("../src/lib.rs");
    assert!(library.contains("#![no_std]") && library.contains("#![forbid(unsafe_code)]"));
    assert!(!library.contains("extern crate"), "neither std nor alloc");
}

#[test]
fn no_dependencies() {
    let manifest = include_str!("../Cargo.toml");
    let sections = manifest
        .lines()
        .filter(|line| line.starts_with('[') && line.contains("dependencies"));
    assert_eq!(sections.collect::<Vec<_>>(), ["[dev-dependencies]"]);
}
