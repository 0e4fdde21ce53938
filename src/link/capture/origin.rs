//! Settings and input files of a recorded run. A replay compares them with its own.

use skyloop_orbit::Input;
use skyloop_orbit::path_text;
use std::path::{Path, PathBuf};

/// Maximum number of listed input files; further ones are only counted.
const LISTED: usize = 1000;
const SETTING: &str = "setting ";
const INPUT: &str = "input ";
const UNLISTED: &str = "further inputs, not listed: ";

/// Settings and input files of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Origin {
    /// Names and values of the command-line settings, and the version of skyloop.
    pub settings: Vec<(String, String)>,
    /// The files read.
    pub inputs: Vec<Input>,
}

impl Origin {
    /// The lines of a recording, one per item.
    pub(super) fn to_lines(&self) -> Vec<String> {
        let settings = self.settings.iter();
        let settings = settings.map(|(name, value)| format!("{SETTING}{name} = {value}"));
        let inputs = self.inputs.iter().take(LISTED).map(|input| {
            // Unescaped: a replay reads it back.
            let file = input.path.display();
            format!("{INPUT}{:08x} {} {file}", input.crc32, input.bytes)
        });
        let more = self.inputs.len().saturating_sub(LISTED);
        let more = (more > 0).then(|| format!("{UNLISTED}{more}"));
        settings.chain(inputs).chain(more).collect()
    }

    /// Parses the lines of a recording; `None` if they contain no item.
    pub(super) fn of_lines(lines: &[String]) -> Option<Origin> {
        let mut origin = Origin::default();
        for line in lines {
            if let Some((name, value)) = line
                .strip_prefix(SETTING)
                .and_then(|line| line.split_once(" = "))
            {
                let setting = (name.to_string(), value.to_string());
                origin.settings.push(setting);
            }
            origin.inputs.extend(input(line));
        }
        (origin != Origin::default()).then_some(origin)
    }

    /// The differences of `now`, one line per setting and file.
    #[must_use]
    pub fn differences(&self, now: &Origin) -> Vec<String> {
        let mut lines = Vec::new();
        for (name, was) in &self.settings {
            let is = now.settings.iter().find(|(other, _)| other == name);
            match is {
                Some((_, is)) if is == was => {}
                Some((_, is)) => lines.push(format!("{name}: recorded {was}, now {is}")),
                None => lines.push(format!("{name}: recorded {was}, now not set")),
            }
        }
        let mut left: Vec<&Input> = now.inputs.iter().collect();
        for was in &self.inputs {
            let file = path_text(&was.path);
            // Matched by path, else by file name.
            let index = left.iter().position(|is| is.path == was.path);
            let index =
                index.or_else(|| left.iter().position(|is| name(&is.path) == name(&was.path)));
            match index.map(|index| left.swap_remove(index)) {
                None => lines.push(format!("{file}: read for the recording, not now")),
                Some(is) if (is.bytes, is.crc32) != (was.bytes, was.crc32) => lines.push(format!(
                    "{}: changed since the recording ({} bytes with CRC-32 {:08x}, then {} with {:08x})",
                    path_text(&is.path),
                    is.bytes,
                    is.crc32,
                    was.bytes,
                    was.crc32
                )),
                Some(_) => {}
            }
        }
        // In a truncated list, unlisted files look like new ones.
        if self.inputs.len() < LISTED {
            let more = left.iter().map(|is| path_text(&is.path));
            lines.extend(more.map(|file| format!("{file}: read now, not for the recording")));
        }
        lines
    }
}

fn name(path: &Path) -> Option<&std::ffi::OsStr> {
    path.file_name()
}

fn input(line: &str) -> Option<Input> {
    let (crc32, rest) = line.strip_prefix(INPUT)?.split_once(' ')?;
    let (bytes, path) = rest.split_once(' ')?;
    Some(Input {
        path: PathBuf::from(path),
        bytes: bytes.parse().ok()?,
        crc32: u32::from_str_radix(crc32, 16).ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(path: &str, crc32: u32) -> Input {
        Input {
            path: path.into(),
            bytes: 10,
            crc32,
        }
    }

    fn origin(output: &str, inputs: Vec<Input>) -> Origin {
        Origin {
            settings: vec![("output".to_string(), output.to_string())],
            inputs,
        }
    }

    #[test]
    fn lines_read_back_and_other_lines_give_none() {
        let origin = origin(
            "frame",
            vec![input("a b/c = d.toml", 7), input("e", u32::MAX)],
        );
        assert_eq!(
            Origin::of_lines(&origin.to_lines()),
            Some(origin),
            "any characters in a path"
        );
        for lines in [vec![], vec!["first of a batch".to_string()]] {
            assert_eq!(Origin::of_lines(&lines), None);
        }
    }

    #[test]
    fn differences_are_listed() {
        let was = origin("frame", vec![input("x/a.toml", 1), input("x/b.tle", 2)]);
        for (now, lines) in [
            (was.clone(), vec![]),
            (
                origin("frame", vec![input("y/a.toml", 1), input("y/b.tle", 2)]),
                vec![],
            ),
            (
                origin("labels", vec![input("x/a.toml", 1), input("y/b.tle", 3)]),
                vec![
                    "output: recorded frame, now labels",
                    "y/b.tle: changed since the recording (10 bytes with CRC-32 00000003, then 10 with 00000002)",
                ],
            ),
            (
                origin("frame", vec![input("x/a.toml", 1), input("c", 2)]),
                vec![
                    "x/b.tle: read for the recording, not now",
                    "c: read now, not for the recording",
                ],
            ),
        ] {
            assert_eq!(was.differences(&now), lines);
        }
    }
}
