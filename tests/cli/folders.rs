//! Paths of scenes: a folder stands for the `scene.toml` in it.

use crate::{repository, skyloop};
use std::path::Path;

#[test]
fn a_folder_stands_for_the_scene_in_it() {
    let folder = repository("configs/scenes/geo-belt-stare");
    let file = format!("{folder}/scene.toml");
    let here = tempfile::tempdir().unwrap();
    let plan = |at: &Path, flags: &[&str]| {
        let output = skyloop(at).arg("plan").args(flags).output().unwrap();
        let text = |octets| String::from_utf8(octets).unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(output.stderr));
        text(output.stdout)
    };
    let of_file = plan(here.path(), &["--scene", &file]);
    // Each names the scene as it was given.
    let as_given = |text: &str| text.replace(&file, &folder);
    for (at, scene) in [(here.path(), folder.as_str()), (Path::new(&folder), ".")] {
        let of_folder = plan(at, &["--scene", scene]);
        assert_eq!(as_given(&of_file), of_folder.replacen(scene, &folder, 1));
    }
}

#[test]
fn a_folder_without_a_scene_is_named_with_what_it_lacks() {
    let here = tempfile::tempdir().unwrap();
    std::fs::create_dir(here.path().join("inner")).unwrap();
    for folder in [".", "inner", "inner/"] {
        for flags in [
            &["plan", "--scene", folder][..],
            &["run", "--config", folder],
            &["render", "--out", "o", "--scene", folder],
        ] {
            let output = skyloop(here.path()).args(flags).output().unwrap();
            let log = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(1), "{log}");
            let file = Path::new(folder).join("scene.toml");
            for words in [
                &format!("error: {}: No such file", file.display()),
                "a folder stands for the scene.toml in it",
            ] {
                assert!(log.contains(words), "{flags:?}: {log}");
            }
        }
    }
}

#[test]
fn a_path_of_the_command_line_starts_where_the_command_does() {
    let here = tempfile::tempdir().unwrap();
    let flags = ["plan", "--scene", "no/where.toml"];
    let output = skyloop(here.path()).args(flags).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(log.starts_with("error: no/where.toml: "), "{log}");
    assert!(log.ends_with("; check the path\n"), "{log}");
}
