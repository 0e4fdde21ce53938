//! Rules for the code: modules import from lower layers only, dependencies are used in the listed
//! modules only, the registries are in order, files are short, nothing panics.

#[path = "tidy/circles.rs"]
mod circles;
#[path = "tidy/text.rs"]
mod text;
#[path = "tidy/words.rs"]
mod words;

use skyloop::effect::EFFECTS;
use skyloop::link::LINKS;
use skyloop_protocols::personality::PERSONALITIES;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The layers of a crate, lowest first: their modules import from earlier layers only.
type Layers = &'static [&'static [&'static str]];

const RENDER_LAYERS: Layers = &[
    &["attitude", "render_pool", "fidelity", "reduce"],
    &["kernels"],
    &["camera", "frame", "track"],
    &["footprint", "sky"],
    &["scene"],
    &["effect"],
    &["plan"],
    &["label", "render"],
    &["engine", "light_curve", "sensitivity"],
];

const FLIGHT_COMPUTER_LAYERS: Layers = &[
    &[
        "burst", "console", "datagram", "earth", "image", "junit", "pacing", "pointing", "reader",
        "roles", "text", "time", "times",
    ],
    &["address"],
    &["port"],
    &[
        "attitude_list",
        "background",
        "can",
        "cause",
        "serial",
        "udp",
    ],
    &["link", "profile", "signal", "timings"],
    &["blobs", "mission"],
    &["detector"],
    &["control", "received"],
    &["contents", "reassembly", "score"],
    &["join", "recovery", "report"],
    &["event", "exchange", "verdict"],
    &["links"],
    &["flight_computer"],
];

/// Folders of sources and their layers.
const LAYERED: &[(&str, Layers)] = &[
    ("src", &[&["passes"], &["output"]]),
    ("src/base", &[&["abort", "range"], &["load", "rng"]]),
    (
        "src/live",
        &[
            &["host", "realtime", "timing"],
            &["metrics", "soak", "stats"],
            &["serve"],
        ],
    ),
    ("src/render", RENDER_LAYERS),
    ("firmware-sim/src", FLIGHT_COMPUTER_LAYERS),
];

/// A crate, and the crates of this repository that it may depend on.
const CRATES: &[(&str, &[&str])] = &[
    ("protocols", &[]),
    ("src/orbit", &[]),
    ("firmware-sim", &["orbit", "protocols"]),
    ("src/base", &["orbit"]),
    ("src/render", &["base", "orbit", "protocols"]),
    ("src/link", &["base", "firmware-sim", "orbit", "protocols"]),
    (
        "src/config",
        &[
            "base",
            "firmware-sim",
            "link",
            "orbit",
            "protocols",
            "render",
        ],
    ),
    (
        "src/live",
        &[
            "base",
            "config",
            "firmware-sim",
            "link",
            "orbit",
            "protocols",
            "render",
        ],
    ),
    (
        "src/measure",
        &["base", "config", "live", "orbit", "render"],
    ),
];

/// A path, and the files or modules below `src/` that may use it. Manifests restrict whole crates.
const ALLOWED_USERS: &[(&str, &[&str])] = &[
    // In `render`, only `attitude` uses the wire protocol.
    (
        "skyloop_protocols::",
        &["cli", "config", "link", "live", "render/attitude"],
    ),
    ("tokio::", &["link/udp"]),
    (
        "serialport::",
        &["link/low_latency", "link/serial", "link/slcan"],
    ),
    (
        "rustix::",
        &[
            "link/low_latency",
            "link/pseudo",
            "live/metrics",
            "live/realtime/linux",
            "measure",
        ],
    ),
    ("thread_priority::", &["live/realtime/linux"]),
    // With `use`, so that `std::os::unix::` does not match.
    ("use nix::", &["live/host"]),
    (
        "sofars::",
        &[
            "render/sky/bodies",
            "render/sky/moon/series",
            "render/sky/planets",
        ],
    ),
    ("toml::", &["base/load"]),
    ("embedded_graphics::", &["output"]),
    ("plotters::", &["output"]),
    (
        "std::fs::",
        &[
            "cli/ready",
            "link/fault/fault_log",
            "link/name",
            "live/host",
            "output",
        ],
    ),
    // `config/run` reads an address; the others open sockets.
    ("std::net::", &["config/run", "link/udp", "live/metrics"]),
    // Only the command line uses `anyhow`; the libraries have error types.
    ("anyhow::", &["cli"]),
    ("clap::", &["cli", "main"]),
    ("clap_complete::", &["cli/shell"]),
    ("clap_mangen::", &["cli/shell"]),
    ("indicatif::", &["cli"]),
    ("println!", &["main"]),
];

/// Lines that a file may have.
const MAX_LINES: usize = 500;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every file below `folder`, without the products of builds and runs.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let skipped = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        ["target", ".git", "skyloop-out", "Cargo.lock"]
            .iter()
            .any(|n| name == *n)
    };
    paths.retain(|path| !skipped(path));
    paths
        .into_iter()
        .flat_map(|path| {
            if path.is_dir() {
                files(&path)
            } else {
                vec![path]
            }
        })
        .collect()
}

fn is_rust(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "rs")
}

fn name(path: &Path) -> String {
    path.strip_prefix(root()).unwrap().display().to_string()
}

/// The code of a source file up to its unit tests, without comments.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let ends = ["#[cfg(test)]", "#[cfg(all(test"]
        .into_iter()
        .filter_map(|mark| text.find(mark));
    let text = &text[..ends.min().unwrap_or(text.len())];
    let lines = text
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    lines.map(|line| format!("{line}\n")).collect()
}

/// Paths (such as `render/sky/apparent`) and code of the emulator's sources, without `orbit`.
fn sources() -> Vec<(String, String)> {
    let mut all = sources_in("src");
    all.retain(|(file, _)| !belongs(file, "orbit"));
    all
}

/// Whether a file has only tests or their helpers.
fn is_test(path: &Path) -> bool {
    let inside = path.strip_prefix(root()).unwrap();
    (inside.iter()).any(|part| part == "tests" || part == "tests.rs")
}

/// The sources in a folder.
fn sources_in(folder: &str) -> Vec<(String, String)> {
    let src = root().join(folder);
    files(&src)
        .iter()
        .filter(|path| is_rust(path) && !is_test(path))
        .map(|path| {
            let inside = path.strip_prefix(&src).unwrap().with_extension("");
            (inside.display().to_string().replace('\\', "/"), code(path))
        })
        .collect()
}

/// Whether file `sky/apparent` belongs to module or file `place`.
fn belongs(file: &str, place: &str) -> bool {
    file == place
        || file
            .strip_prefix(place)
            .is_some_and(|rest| rest.starts_with('/'))
}

#[test]
fn imports_point_down() {
    for (folder, layers) in LAYERED {
        point_down(folder, layers);
    }
}

fn point_down(folder: &str, layers: Layers) {
    let layer: BTreeMap<&str, usize> = layers
        .iter()
        .enumerate()
        .flat_map(|(depth, modules)| modules.iter().map(move |module| (*module, depth)))
        .collect();
    let mut wrong = Vec::new();
    for (file, code) in sources_in(folder) {
        let module = file.split('/').next().unwrap();
        // Files without a layer: the command line, `lib.rs`, and the crates inside `src`.
        if !layer.contains_key(module) {
            continue;
        }
        for piece in code.split("crate::").skip(1) {
            // `use crate::{a, b}` gives an empty name and is refused: each module needs a `use`.
            let used: String = piece
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect();
            let down = layer
                .get(used.as_str())
                .is_some_and(|of_used| *of_used < layer[module]);
            if used != module && !down {
                wrong.push(format!("{folder}/{file}.rs imports {used:?}"));
            }
        }
        // `super` of a module's own file is the crate; of its other files, the module.
        let climb = if file == module || file == format!("{module}/mod") {
            "super::"
        } else {
            "super::super::"
        };
        assert!(
            !code.contains(climb),
            "{folder}/{file}.rs climbs out of its family: write crate::"
        );
    }
    assert!(wrong.is_empty(), "not downwards:\n{}", wrong.join("\n"));
}

#[test]
fn every_module_has_its_layer() {
    for (folder, layers) in LAYERED {
        let lib = code(&root().join(folder).join("lib.rs"));
        let modules: BTreeSet<&str> = lib
            .lines()
            .map(|line| line.strip_prefix("pub ").unwrap_or(line))
            .filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'))
            .collect();
        let layered = layers.iter().flat_map(|layer| layer.iter().copied());
        assert_eq!(modules, layered.collect(), "{folder}");
    }
}

#[test]
fn dependencies_stay_in_their_rooms() {
    for (token, places) in ALLOWED_USERS {
        let users: Vec<String> = sources()
            .into_iter()
            .filter(|(_, code)| code.contains(token))
            .map(|(file, _)| file)
            .collect();
        for file in &users {
            let allowed = places.iter().any(|place| belongs(file, place));
            assert!(
                allowed,
                "src/{file}.rs uses {token}, which is for {places:?}"
            );
        }
        for place in *places {
            let used = users.iter().any(|file| belongs(file, place));
            assert!(
                used,
                "the fence of {token} names {place}, which does not use it"
            );
        }
    }
}

#[test]
fn crates_depend_downwards() {
    for (folder, allowed) in CRATES {
        let path = root().join(folder).join("Cargo.toml");
        let table: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
        let names = table.get("dependencies").and_then(|d| d.as_table());
        let names = names.into_iter().flat_map(|names| names.keys());
        let own: Vec<&str> = names
            .filter_map(|name| name.strip_prefix("skyloop-"))
            .collect();
        assert_eq!(own, *allowed, "{folder}");
    }
}

/// The lint must not apply to tests, so the manifest of the workspace cannot set it.
#[test]
fn libraries_warn_of_disallowed_methods() {
    let folders = LAYERED.iter().map(|(folder, _)| *folder);
    let folders = folders.chain(CRATES.iter().map(|(folder, _)| *folder));
    for folder in folders.filter(|folder| folder.starts_with("src")) {
        let text = std::fs::read_to_string(root().join(folder).join("lib.rs")).unwrap();
        let lint = "#![cfg_attr(not(test), warn(clippy::disallowed_methods))]";
        assert!(text.contains(lint), "{folder}/lib.rs lacks {lint}");
    }
}

#[test]
fn the_registries_are_in_order() {
    let unique = |names: Vec<&str>| {
        let set: BTreeSet<&str> = names.iter().copied().collect();
        assert_eq!(set.len(), names.len(), "{names:?}");
    };
    assert!(
        EFFECTS.is_sorted_by_key(|effect| effect.stage),
        "light, then charge, then digits"
    );
    let rows = EFFECTS.iter().enumerate();
    rows.for_each(|(row, effect)| assert_eq!(effect.id as usize, row, "{}", effect.name));
    unique(EFFECTS.iter().map(|effect| effect.name).collect());
    unique(LINKS.iter().map(|link| link.scheme).collect());
    for link in LINKS {
        assert!(link.example.starts_with(link.scheme), "{}", link.example);
    }
    unique(
        PERSONALITIES
            .iter()
            .map(|personality| personality.name)
            .collect(),
    );
}

/// Two effects of one stream would draw the same numbers.
#[test]
fn every_noise_stream_has_one_effect() {
    let mut owner = BTreeMap::new();
    for (file, code) in sources()
        .into_iter()
        .filter(|(file, _)| belongs(file, "render/effect") || file == "render/camera/radiation")
    {
        for line in code
            .lines()
            .filter(|line| line.contains("const STREAM: u8 ="))
        {
            let other = owner.insert(line.trim().to_string(), file.clone());
            assert_eq!(other, None, "{file}: {line}");
        }
        let (draws, own) = (
            [
                "PixelStream::new",
                "kernels::shot_noise",
                "kernels::read_noise",
            ]
            .iter()
            .any(|draw| code.contains(draw)),
            code.contains("const STREAM: u8"),
        );
        assert_eq!(draws, own, "{file} keys its noise by a STREAM of its own");
    }
    assert!(owner.len() >= 3);
}

#[test]
fn every_effects_file_says_what_it_rests_on() {
    let effects = files(&root().join("src/render/effect"));
    let mut found = 0;
    for path in effects {
        let text = std::fs::read_to_string(&path).unwrap();
        let effects = text.matches(": Effect =").count();
        if effects == 0 {
            continue;
        }
        found += effects;
        let head: Vec<&str> = text.lines().take_while(|l| l.starts_with("//!")).collect();
        for word in ["Reference: ", "Validity: ", "Price: "] {
            assert!(head.join("\n").contains(word), "{}: {word}", name(&path));
        }
    }
    assert_eq!(found, EFFECTS.len());
}

#[test]
fn files_are_short() {
    for path in files(root()).iter().filter(|path| is_rust(path)) {
        let lines = std::fs::read_to_string(path).unwrap().lines().count();
        assert!(lines <= MAX_LINES, "{}: {lines} lines", name(path));
    }
}

/// Outside of tests nothing may panic: invalid input is refused with an error.
#[test]
fn nothing_panics_on_purpose() {
    let panics = [
        ".unwrap()",
        ".expect(",
        "panic!(",
        "unreachable!(",
        "todo!(",
        "unimplemented!(",
    ];
    for folder in [
        "src",
        "protocols/src",
        "protocols/schema/src",
        "firmware-sim/src",
    ] {
        let mut paths = files(&root().join(folder));
        paths.retain(|path| is_rust(path) && !is_test(path));
        for path in &paths {
            let code = code(path);
            for panic in panics {
                assert!(!code.contains(panic), "{} has {panic}", name(path));
            }
        }
    }
}

/// Serde's arrays of fixed length ignore surplus elements; `Fixed` of `load` refuses them.
#[test]
fn arrays_in_files_are_counted() {
    let mut found = 0;
    for (file, code) in sources() {
        for kind in ["struct Raw", "enum Raw"] {
            for piece in code.split(kind).skip(1) {
                let fields = piece.split("\n}").next().unwrap();
                let after = fields.split("; ").skip(1);
                let sized = after.filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
                assert_eq!(sized.count(), 0, "src/{file}.rs: {kind}{fields}");
                found += fields.matches("Fixed<").count();
            }
        }
    }
    assert!(found >= 10, "{found}");
}
