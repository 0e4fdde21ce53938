//! `docs/reference/command-line-fc.md` states the options of `skyloop-fc`. After a change:
//! `SKYLOOP_WRITE_DOCS=1 cargo test --test main reference_page`.

#[path = "../../tests/reference_pages/commands.rs"]
mod commands;
#[path = "../../tests/reference_pages/page.rs"]
mod page;

#[test]
fn the_page_of_the_command_line_is_current() {
    let sections = commands::sections("skyloop-fc", env!("CARGO_BIN_EXE_skyloop-fc"));
    page::check(
        "command-line-fc.md",
        "commands",
        &sections,
        "main reference_page",
    );
}
