//! Writes every generated file; says which ones changed.

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
    for output in skyloop_schema::outputs()? {
        let path = skyloop_schema::protocols().join(&output.path);
        let named = |error: std::io::Error| format!("{}: {error}", path.display());
        if std::fs::read_to_string(&path).is_ok_and(|text| text == output.text) {
            continue;
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(named)?;
        }
        std::fs::write(&path, &output.text).map_err(named)?;
        println!("{} written", output.path.display());
    }
    Ok(())
}
