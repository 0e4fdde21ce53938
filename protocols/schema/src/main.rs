//! Writes the generated files and prints the paths of those that changed.

use std::process::ExitCode;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    for (path, text) in skyloop_schema::outputs()? {
        if skyloop_schema::read(&path).is_ok_and(|before| before == text) {
            continue;
        }
        let file = skyloop_schema::protocols().join(&path);
        std::fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
        println!("{path} written");
    }
    Ok(())
}
