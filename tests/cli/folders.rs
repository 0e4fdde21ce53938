//! Paths of scenes: a folder stands for the `scene.toml` in it.

use crate::{Folder, Outcome, repository};

#[test]
fn a_folder_stands_for_the_scene_in_it() {
    let here = Folder::new();
    let folder = repository("configs/scenes/geo-belt-stare");
    let file = format!("{folder}/scene.toml");
    let of_file = here.run(&format!("plan --scene {file}")).quiet();
    let of_folder = here.run(&format!("plan --scene {folder}")).quiet();
    // Each command names the scene as on its command line.
    assert_eq!(of_file.replace(&file, &folder), of_folder);
    let mut inside = assert_cmd::Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let inside = inside.current_dir(&folder).args(["plan", "--scene", "."]);
    let inside = Outcome::of("plan --scene .", inside.output().unwrap());
    assert_eq!(inside.quiet().replacen('.', &folder, 1), of_folder);
}

#[test]
fn a_path_without_a_scene_is_reported_as_given() {
    let here = Folder::new();
    std::fs::create_dir(here.join("inner")).unwrap();
    for (folder, file) in [
        (".", "./scene.toml"),
        ("inner", "inner/scene.toml"),
        ("inner/", "inner/scene.toml"),
    ] {
        for command in ["plan --scene", "run --config", "render --out o --scene"] {
            let says = format!("error: {file}: No such file");
            here.run(&format!("{command} {folder}"))
                .exits(1)
                .logs(&[&says, "a folder stands for the scene.toml in it"]);
        }
    }
    let missing = here.run("plan --scene no/where.toml").exits(1).log;
    assert!(missing.starts_with("error: no/where.toml: "), "{missing}");
    assert!(missing.ends_with("; check the path\n"), "{missing}");
}
