//! The scenes that ship with the repository.

use std::path::{Path, PathBuf};

/// The scene files, and those of scenes with a folder of their own.
pub fn scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    let entries = std::fs::read_dir(folder).unwrap();
    let files = entries.map(|entry| entry.unwrap().path());
    let files = files.map(|path| {
        if path.is_dir() {
            path.join("scene.toml")
        } else {
            path
        }
    });
    let is_scene = |path: &PathBuf| path.extension().is_some_and(|end| end == "toml");
    let mut scenes: Vec<PathBuf> = files.filter(is_scene).collect();
    scenes.sort();
    assert!(scenes.len() > 2, "{scenes:?}");
    scenes
}
