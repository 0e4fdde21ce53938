//! Tables of refused inputs, as text: a line a case, ` | ` between the input and the words that its
//! refusal has.

/// Calls `refusal` with the input of each row (`\n` is a line's end) and looks for the row's words
/// in it.
pub fn check_refusals(table: &str, refusal: impl Fn(&str) -> String) {
    for row in table.trim().lines() {
        let mut cells = row.split(" | ");
        let input = cells.next().unwrap().replace("\\n", "\n");
        let message = refusal(&input);
        for word in cells {
            assert!(message.contains(word), "{row}\n{message}\nhas no {word:?}");
        }
    }
}
