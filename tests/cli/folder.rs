//! A folder where a test runs the program, and checks of the outcome.

use crate::support::TIMEOUT;
use crate::table::rows;
use assert_cmd::Command;
use serde_json::Value;
use std::ops::Deref;
use std::path::Path;
use std::process::Output;

/// A file of the repository.
pub fn repository(file: &str) -> String {
    format!("{}/{file}", env!("CARGO_MANIFEST_DIR"))
}

pub fn repository_text(file: &str) -> String {
    std::fs::read_to_string(repository(file)).unwrap()
}

/// Asserts that the text has each of these parts.
#[track_caller]
pub fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
}

/// A temporary folder.
pub struct Folder(tempfile::TempDir);

impl Deref for Folder {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

impl AsRef<Path> for Folder {
    fn as_ref(&self) -> &Path {
        self
    }
}

impl Folder {
    pub fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    /// A folder with these files.
    pub fn with(files: &[(&str, &str)]) -> Folder {
        let folder = Folder::new();
        files
            .iter()
            .for_each(|(name, text)| folder.write(name, text));
        folder
    }

    /// Writes a file and creates its folder.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let file = self.join(name);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, content).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.join(name)).unwrap()
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// The labels of each frame in the folder `out`.
    pub fn labels(&self, out: &str) -> Vec<Value> {
        let lines = self.read(&format!("{out}/labels.jsonl"));
        let lines = lines.lines().map(serde_json::from_str);
        lines.map(Result::unwrap).collect()
    }

    /// The files of the folder `name` with their contents, sorted.
    pub fn contents(&self, name: &str) -> Vec<(String, Vec<u8>)> {
        let entries = std::fs::read_dir(self.join(name)).unwrap();
        let file = |entry: std::io::Result<std::fs::DirEntry>| {
            let entry = entry.unwrap();
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read(entry.path()).unwrap())
        };
        let mut files: Vec<_> = entries.map(file).collect();
        files.sort();
        files
    }

    pub fn names(&self, name: &str) -> Vec<String> {
        let files = self.contents(name).into_iter();
        files.map(|(name, _)| name).collect()
    }

    /// A named pipe.
    pub fn pipe(&self, name: &str) {
        let made = std::process::Command::new("mkfifo")
            .arg(self.join(name))
            .status();
        assert!(made.unwrap().success());
    }

    /// Runs `skyloop` with the arguments in `words`, separated by blanks.
    pub fn run(&self, words: &str) -> Outcome {
        self.run_args(&words.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `skyloop` with these arguments.
    pub fn run_args(&self, args: &[&str]) -> Outcome {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
        let command = command.args(args).current_dir(self).timeout(TIMEOUT * 3);
        Outcome::of(&args.join(" "), command.output().unwrap())
    }

    /// Asserts that each row of a table (see [`rows`]), after `before`, exits with `code` and
    /// prints its texts.
    #[track_caller]
    pub fn runs(&self, before: &str, code: i32, table: &str) {
        for (words, says) in rows(table) {
            self.run(&format!("{before} {words}"))
                .exits(code)
                .says(&says);
        }
    }

    /// Asserts that each row of a table, after `before`, is refused with its texts in one line, and
    /// that nothing is written into the folder `o`.
    #[track_caller]
    pub fn refuses(&self, before: &str, table: &str) {
        for (words, says) in rows(table) {
            let refused = self.run(&format!("{before} {words}")).logs(&says);
            refused.is_refusal();
            assert!(!self.join("o").exists(), "{words}: something is written");
        }
    }

    /// Runs `skyloop` with a limit of `blocks` blocks of 512 bytes a file.
    pub fn run_limited(&self, blocks: u32, words: &str) -> Outcome {
        let mut shell = limited_shell(blocks);
        shell.args(words.split_whitespace()).current_dir(self);
        Outcome::of(words, shell.output().unwrap())
    }
}

/// A shell that sets the limit and executes `skyloop` with the arguments that follow.
pub fn limited_shell(blocks: u32) -> std::process::Command {
    let mut shell = std::process::Command::new("sh");
    // The limit's signal would kill the program.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_skyloop")]);
    shell
}

/// Outcome of a command: exit code, standard output and standard error.
pub struct Outcome {
    words: String,
    pub code: Option<i32>,
    pub out: String,
    pub log: String,
}

impl Outcome {
    pub fn of(words: &str, output: Output) -> Outcome {
        let [out, log] =
            [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        Outcome {
            words: words.to_string(),
            code: output.status.code(),
            out,
            log,
        }
    }

    /// The command and both outputs, for messages.
    pub fn all(&self) -> String {
        format!("{}:\n{}{}", self.words, self.out, self.log)
    }

    #[track_caller]
    pub fn exits(self, code: i32) -> Outcome {
        assert_eq!(self.code, Some(code), "{}", self.all());
        self
    }

    /// Asserts exit code 0 and an empty log; returns standard output.
    #[track_caller]
    pub fn quiet(self) -> String {
        let ended = self.exits(0);
        assert!(ended.log.is_empty(), "{}", ended.all());
        ended.out
    }

    /// Asserts that one of the outputs has each of these parts.
    #[track_caller]
    pub fn says(self, parts: &[&str]) -> Outcome {
        let is_said = |part: &&&str| self.out.contains(**part) || self.log.contains(**part);
        let missing: Vec<_> = parts.iter().filter(|part| !is_said(part)).collect();
        assert!(missing.is_empty(), "no {missing:?} in {}", self.all());
        self
    }

    #[track_caller]
    pub fn prints(self, parts: &[&str]) -> Outcome {
        has(&self.out, parts);
        self
    }

    #[track_caller]
    pub fn logs(self, parts: &[&str]) -> Outcome {
        has(&self.log, parts);
        self
    }

    /// Asserts that no output has this part.
    #[track_caller]
    pub fn lacks(self, part: &str) -> Outcome {
        let is_said = self.out.contains(part) || self.log.contains(part);
        assert!(!is_said, "{part:?} in {}", self.all());
        self
    }

    /// Asserts the number of lines in the log.
    #[track_caller]
    pub fn logs_lines(self, count: usize) -> Outcome {
        assert_eq!(self.log.lines().count(), count, "{}", self.all());
        self
    }

    /// Asserts code 2 for a wrong option, else 1, and after warnings an error in one line. A wrong
    /// option adds lines on the help; several faults of a file have a line each.
    #[track_caller]
    fn is_refusal(&self) {
        let is_usage = self.log.contains("try '--help'");
        assert_eq!(self.code, Some(1 + i32::from(is_usage)), "{}", self.all());
        let mut lines = self.log.lines().filter(|line| !line.starts_with(" WARN "));
        let line = lines.next().unwrap_or_default();
        assert!(line.starts_with("error: "), "{}", self.all());
        if !is_usage && !self.log.contains(" faults:\n") {
            assert_eq!(lines.next(), None, "{}", self.all());
        }
        let half: String = line.chars().skip(line.chars().count() / 2).collect();
        let is_repeated = half.len() >= 20 && line.matches(&half).count() > 1;
        assert!(!is_repeated, "repeated text: {line}");
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {}", self.all()))
    }
}
