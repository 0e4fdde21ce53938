//! Lines of a text with any line end, and the line of an offset.

use memchr::memchr2;

/// The lines of a text with their numbers, counted from 1. They end with LF, CR LF or CR. Trailing
/// blanks are removed, and leading byte order marks, which joined files have.
pub(crate) fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> + Clone {
    let mut rest = text;
    let mut number = 0;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        number += 1;
        let end = memchr2(b'\n', b'\r', rest.as_bytes()).unwrap_or(rest.len());
        let (line, after) = rest.split_at(end);
        rest = after
            .strip_prefix("\r\n")
            .or_else(|| after.strip_prefix(['\n', '\r']))
            .unwrap_or(after);
        let line = line.strip_prefix('\u{feff}').unwrap_or(line);
        Some((number, line.trim_end()))
    })
}

/// Whether a line is blank or a comment.
pub(crate) fn is_comment(line: &str) -> bool {
    line.is_empty() || line.starts_with('#') || line.split_whitespace().next() == Some("COMMENT")
}

/// The offset of the first line that is no comment.
pub(crate) fn start(text: &str) -> usize {
    let mut lines = numbered(text).map(|(_, line)| line.trim_start());
    let first = lines.find(|line| !is_comment(line));
    first.map_or(text.len(), |line| {
        line.as_ptr().addr() - text.as_ptr().addr()
    })
}

/// Finds the lines of increasing offsets in one pass over the text.
pub(crate) struct LineFinder<'a> {
    text: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> LineFinder<'a> {
    /// For a text that follows `lines_before` other lines.
    pub fn new(text: &'a str, lines_before: usize) -> Self {
        LineFinder {
            text: text.as_bytes(),
            at: 0,
            line: lines_before + 1,
        }
    }

    /// The line of the byte at `offset`, counted from 1. For an offset before that of an earlier
    /// call it is the line of that call.
    pub fn line(&mut self, offset: usize) -> usize {
        let passed = self.text.get(self.at..offset).unwrap_or_default();
        for (i, byte) in (self.at..).zip(passed) {
            let ends = match byte {
                b'\n' => true,
                b'\r' => self.text.get(i + 1) != Some(&b'\n'),
                _ => false,
            };
            self.line += usize::from(ends);
        }
        self.at = self.at.max(offset);
        self.line
    }
}

/// A part of a text with messages of one kind.
pub(crate) struct Part<'a> {
    pub text: &'a str,
    /// Lines of the whole text before the part.
    pub lines_before: usize,
}

impl<'a> Part<'a> {
    /// The lines of the part, with their numbers in the whole text.
    pub fn lines(&self) -> impl Iterator<Item = (usize, &'a str)> + Clone + use<'a> {
        let before = self.lines_before;
        numbered(self.text).map(move |(number, line)| (number + before, line))
    }

    /// A finder for offsets in this part; its lines are numbers in the whole text.
    pub fn finder(&self) -> LineFinder<'a> {
        LineFinder::new(self.text, self.lines_before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_line_end_counts_once() {
        let text = "a\nb \r\n\rc\n\nd";
        let lines: Vec<_> = numbered(text).collect();
        assert_eq!(
            lines,
            [(1, "a"), (2, "b"), (3, ""), (4, "c"), (5, ""), (6, "d")]
        );
        let mut finder = LineFinder::new(text, 0);
        for (number, letter) in [(1, 'a'), (2, 'b'), (4, 'c'), (6, 'd')] {
            assert_eq!(finder.line(text.find(letter).unwrap()), number, "{letter}");
        }
        assert_eq!(finder.line(usize::MAX), 6);
    }

    #[test]
    fn comments_before_the_first_line_are_skipped() {
        assert_eq!(
            start("\n# a\r\nCOMMENT b\n  c"),
            "\n# a\r\nCOMMENT b\n  ".len()
        );
        assert_eq!((start(""), start("\n#\n")), (0, 3));
    }
}
