//! Building blocks of the generated texts: lists, nested blocks, names.

use std::fmt::Display;

/// The items, separated by `between`.
pub fn join<T: Display>(items: impl IntoIterator<Item = T>, between: &str) -> String {
    let texts: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    texts.join(between)
}

/// The concatenated texts of all items.
pub fn each<T>(items: impl IntoIterator<Item = T>, text: impl FnMut(T) -> String) -> String {
    items.into_iter().map(text).collect()
}

/// Every line indented by `spaces` spaces; empty lines stay empty.
pub fn indent(text: &str, spaces: usize) -> String {
    each(text.lines(), |line| match line {
        "" => "\n".to_owned(),
        line => format!("{:spaces$}{line}\n", ""),
    })
}

/// `head {`, the indented body, `}`: in Rust and C.
pub fn braces(head: &str, body: &str) -> String {
    format!("{head} {{\n{}}}", indent(body, 4))
}

/// The same as [`braces`], with a final line break.
pub fn block(head: &str, body: &str) -> String {
    braces(head, body) + "\n"
}

/// `FrameHeader` as `frame_header`.
pub fn snake(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

/// `FrameHeader` as `FRAME_HEADER`.
pub fn upper(name: &str) -> String {
    snake(name).to_uppercase()
}
