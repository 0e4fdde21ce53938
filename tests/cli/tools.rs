//! Commands around the command line: camera files, schemas, completions, manual pages, and pointing by options.

use crate::{EPOCH, STATE, names, repository, skyloop};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn printed(at: &Path, args: &[&str]) -> String {
    let done = skyloop(at).args(args).assert().success();
    String::from_utf8(done.get_output().stdout.clone()).unwrap()
}

fn refused(at: &Path, args: &[&str]) -> String {
    let failed = skyloop(at).args(args).assert().failure();
    String::from_utf8(failed.get_output().stderr.clone()).unwrap()
}

#[test]
fn a_cameras_limit_is_where_labels_have_that_snr() {
    let here = tempfile::tempdir().unwrap();
    for camera in ["rigel-l", "cots-wide"] {
        let text = printed(here.path(), &["camera", "check", camera, "--json"]);
        let report: Value = serde_json::from_str(&text).unwrap();
        let limit = report["limiting_mag"].as_f64().unwrap();
        let out = here.path().join(camera);
        // The rich sky of Cygnus; nothing but stars.
        let render = [
            "render",
            "--camera",
            camera,
            "--epoch",
            EPOCH,
            "--radec",
            "310,40,0",
            "--label-snr",
            "3",
        ];
        let mut command = skyloop(here.path());
        command
            .args(render)
            .arg("--out")
            .arg(&out)
            .assert()
            .success();
        let labels = std::fs::read_to_string(out.join("labels.jsonl")).unwrap();
        let label: Value = serde_json::from_str(&labels).unwrap();
        // Stars well on the detector; their light lies between pixels, where it is spread over more of them, and the sky is another.
        let mut off = Vec::new();
        for star in label["objects"].as_array().unwrap() {
            let [snr, mag] = ["snr", "band_mag"].map(|key| star[key].as_f64().unwrap_or(0.0));
            if star["in_frame"] == true && (4.0..6.5).contains(&snr) {
                // Near the limit snr goes as the signal, between its root and itself.
                off.push(mag - limit + 2.5 * (snr / 5.0).log10());
            }
        }
        off.sort_by(f64::total_cmp);
        assert!(off.len() >= 5, "{camera}: {} stars", off.len());
        let median = off[off.len() / 2];
        assert!(
            (-0.35..0.1).contains(&median),
            "{camera}: {median} mag of {off:?}"
        );
    }
}

#[test]
fn a_camera_is_made_checked_and_not_written_over() {
    let here = tempfile::tempdir().unwrap();
    let figures = [
        "--size",
        "640x480",
        "--pixel",
        "5",
        "--focal",
        "20deg",
        "--aperture",
        "f/1.4",
        "--exposure",
        "0.2",
        "--full-well",
        "12000",
    ];
    let new = ["camera", "new", "mine.toml"];
    let said = refused(here.path(), &new);
    assert!(
        said.contains("no terminal") && said.contains("--size, --pixel, --focal"),
        "{said}"
    );
    let all = [&new[..], &figures[..]].concat();
    let text = printed(here.path(), &all);
    assert!(
        text.contains("field of view")
            && text.contains("20.000 x")
            && text.contains("wrote mine.toml"),
        "{text}"
    );
    let checked = printed(here.path(), &["camera", "check", "mine.toml"]);
    assert!(text.starts_with(&checked), "{text} {checked}");
    let said = refused(here.path(), &all);
    assert!(
        said.contains("mine.toml: exists already") && said.contains("--force"),
        "{said}"
    );
    printed(here.path(), &[&all[..], &["--force"]].concat());
    let wrong = [
        &["camera", "new", "other.toml"],
        &figures[..10],
        &["--full-well", "-1"],
    ]
    .concat();
    let said = refused(here.path(), &wrong);
    assert!(
        said.contains("--full-well \"-1\": must be 100 to"),
        "{said}"
    );
    assert_eq!(names(here.path()), ["mine.toml"]);
    let stdout = printed(
        here.path(),
        &[&["camera", "new", "-"], &figures[..]].concat(),
    );
    assert!(
        stdout.starts_with("# Written by `skyloop camera new`"),
        "{stdout}"
    );
    assert_eq!(names(here.path()), ["mine.toml"]);
    for camera in skyloop::load::CAMERAS {
        let text = printed(here.path(), &["camera", "check", camera]);
        for words in [
            "field of view",
            "arcsec/px",
            "limiting magnitude at SNR 5",
            "stars a frame",
            "saturation magnitude",
        ] {
            assert!(text.contains(words), "{camera}: {text}");
        }
    }
}

#[test]
fn everything_that_is_wrong_with_a_file_is_said_at_once() {
    let here = tempfile::tempdir().unwrap();
    let good = std::fs::read_to_string(repository("configs/cameras/cots-wide.toml")).unwrap();
    let mut bad = String::new();
    for line in good.lines() {
        bad += match line.split(' ').next().unwrap() {
            "focal_length_mm" => "focal_lenght_mm = 1e9",
            "aperture_mm" => "",
            "sigma_px" => "sigma_px = \"wide\"",
            "full_well_e" => "full_well_e = -3.0",
            "adc_bits" => "adc_bits = 99\nwhatever = 3",
            "rate_hz" => "rate_hz = 50.0",
            _ => line,
        };
        bad += "\n";
    }
    std::fs::write(here.path().join("bad.toml"), &bad).unwrap();
    let line_of = |word: &str| 1 + bad.lines().position(|line| line.contains(word)).unwrap();
    let said = refused(here.path(), &["camera", "check", "bad.toml"]);
    assert!(said.starts_with("error: bad.toml: 8 faults:\n"), "{said}");
    for (word, message) in [
        ("[optics]", "optics: the key `aperture_mm` is missing"),
        ("lenght", "did you mean `focal_length_mm`?"),
        (
            "lenght",
            "optics.focal_length_mm = 1000000000: must be 0.5 to 1000000 mm",
        ),
        (
            "= \"wide",
            "optics.psf.sigma_px: must be 0.01 to 100 px, not \"wide\"",
        ),
        (
            "= -3.0",
            "detector.full_well_e = -3: must be 1 to 1000000000 e-",
        ),
        ("= 99", "detector.adc_bits = 99: must be 1 to 16 bits"),
        ("whatever", "unknown key `whatever`"),
        ("= 50.0", "timing.rate_hz = 50: must be at most 10 Hz"),
    ] {
        let line = line_of(word);
        let found = said
            .lines()
            .any(|said| said.starts_with(&format!("  bad.toml:{line}:")) && said.contains(message));
        assert!(found, "{line} {message}: {said}");
    }
    // Faults in optional tables hide none.
    let optional = format!(
        "{good}\n[optics.vignetting]\ncos4 = true\ntable = [[0.0, 2.0]]\n[radiation]\nflux_cm2_s = \"much\"\nthickness_um = 0.0\nenergy_mev = \
         1.0\n[mounting]\nmisalignment_arcsec = [1e9, 0.0, 0.0]\n"
    );
    let optional = optional.replace(
        "kind = \"gaussian\" ",
        "kind = \"moffat\"\nfwhm_px = 0.0\nbeta = 0.0\n#",
    );
    let optional = optional
        .replace("sigma_px", "# sigma_px")
        .replace("adc_bits = 12", "adc_bits = 99");
    std::fs::write(here.path().join("optional.toml"), optional).unwrap();
    let said = refused(here.path(), &["camera", "check", "optional.toml"]);
    for message in [
        "optional.toml: 9 faults",
        "optics.psf.fwhm_px = 0: must be",
        "optics.psf.beta = 0: must be",
        "optics.vignetting.table[0][1] = 2: must be",
        "optics.vignetting.cos4: cos4 and table exclude each other",
        "detector.adc_bits = 99",
        "radiation.flux_cm2_s = \"much\"",
        "radiation.thickness_um = 0: must be",
        "radiation.energy_mev = 1: must be",
        "mounting.misalignment_arcsec[0] = 1000000000: must be",
    ] {
        assert!(said.contains(message), "{message}: {said}");
    }
    // A scene tells of its camera file too.
    let scene = "sed = 4\nlabel_snr = -1\ncamera = \"bad.toml\"\n[sequence]\nepoch = \"noon\"\nframes = 0\nnadir = true\n[run]\nidle_s = -4\n";
    std::fs::write(here.path().join("scene.toml"), scene).unwrap();
    let said = refused(
        here.path(),
        &["render", "--scene", "scene.toml", "--out", "o"],
    );
    for message in [
        "scene.toml:1:1: sed: unknown key `sed`: did you mean `seed`?",
        "scene.toml:2:13: label_snr = -1",
        "bad.toml: 8 faults",
        "detector.adc_bits = 99",
        "scene.toml:4:1: sequence: the key `period_s` is missing",
        "scene.toml:5:9: sequence.epoch: \"noon\"",
        "scene.toml:6:10: sequence.frames = 0",
        "scene.toml:9:10: run.idle_s = -4",
    ] {
        assert!(said.contains(message), "{message}: {said}");
    }
}

#[test]
fn schemas_have_keys_with_descriptions() {
    let here = tempfile::tempdir().unwrap();
    for (kind, key) in [
        ("camera", "detector"),
        ("scene", "sequence"),
        ("run", "heads"),
        ("population", "shapes"),
        ("labels", "objects"),
    ] {
        let schema: Value = serde_json::from_str(&printed(here.path(), &["schema", kind])).unwrap();
        assert_eq!(
            schema["$schema"],
            "https://json-schema.org/draft/2020-12/schema"
        );
        assert!(schema["properties"][key].is_object(), "{kind}: {schema}");
        let is_closed = schema["additionalProperties"] == false;
        assert_eq!(
            is_closed,
            kind != "labels",
            "{kind}: typing errors are refused, new label keys are not"
        );
        for (name, property) in schema["properties"].as_object().unwrap() {
            assert!(
                property["description"].is_string() || property["$ref"].is_string(),
                "{kind}: {name}"
            );
        }
    }
}

#[test]
fn bash_completes_and_manual_pages_are_clean() {
    let here = tempfile::tempdir().unwrap();
    let script = printed(here.path(), &["completions", "bash"]);
    std::fs::write(here.path().join("skyloop.bash"), script).unwrap();
    let complete = |words: &str, last: usize| {
        let line = format!(
            "source ./skyloop.bash; COMP_WORDS=({words}); COMP_CWORD={last}; _skyloop skyloop \"${{COMP_WORDS[{last}]}}\" \"${{COMP_WORDS[{}]}}\"; \
             echo \"${{COMPREPLY[@]}}\"",
            last - 1
        );
        let done = Command::new("bash")
            .current_dir(here.path())
            .args(["-c", &line])
            .output()
            .unwrap();
        String::from_utf8(done.stdout).unwrap().trim().to_string()
    };
    assert_eq!(complete("skyloop loo", 1), "loopback");
    assert_eq!(complete("skyloop camera ch", 2), "check");
    assert_eq!(complete("skyloop render --look", 2), "--look-at");
    for shell in ["zsh", "fish"] {
        assert!(
            printed(here.path(), &["completions", shell]).contains("loopback"),
            "{shell}"
        );
    }

    printed(here.path(), &["man", "pages"]);
    let pages = names(&here.path().join("pages"));
    for page in ["skyloop.1", "skyloop-render.1", "skyloop-camera-new.1"] {
        assert!(pages.contains(&page.to_string()), "{page}: {pages:?}");
    }
    assert!(printed(here.path(), &["man"]).contains(".TH skyloop 1"));
    for page in pages {
        let page = here.path().join("pages").join(page);
        let groff = Command::new("groff")
            .args(["-man", "-Tutf8", "-ww"])
            .arg(&page)
            .output();
        let groff = groff.expect("groff is missing: apt-get install groff-base");
        let said = String::from_utf8_lossy(&groff.stderr).into_owned();
        assert!(
            groff.status.success() && said.is_empty(),
            "{page:?}: {said}"
        );
    }
}

#[test]
fn options_point_the_camera_and_say_what_is_hidden() {
    let here = tempfile::tempdir().unwrap();
    let render = |options: &[&str]| {
        let mut command = skyloop(here.path());
        command.args([
            "render", "--camera", "fai-nir", "--epoch", EPOCH, "--out", "o",
        ]);
        let done = command.args(options).assert();
        let output = done.get_output().clone();
        (
            output.status.success(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    // The observer flies towards -Z at RA 169, Dec -50; at that time the Moon is at RA 250, Dec -21, the Sun at RA 84, Dec +23.
    for (options, works, words) in [
        (
            &["--look-at", "Moon", "--up", "north", "--state", STATE][..],
            true,
            "",
        ),
        (
            &["--look-at", "Sun", "--up", "sun", "--state", STATE],
            true,
            "parallel to up = \"sun\", and north is up instead, in 1 of 1 exposures",
        ),
        (
            &["--look-at", "350,50", "--state", STATE],
            true,
            "the target is behind the Earth, in 1 of 1 exposures, the first at 2019-06-15T23:35:50",
        ),
        (
            &["--look-at", "limb:80", "--roll", "10", "--state", STATE],
            true,
            "",
        ),
        (&["--look-at", "limb:80"], false, "the limb needs an orbit"),
        (
            &["--look-at", "Mooon", "--state", STATE],
            false,
            "did you mean `Moon`?",
        ),
        (&["--look-at", "Moon", "--up", "left"], false, "zenith"),
        (
            &["--look-at", "Moon", "--nadir"],
            false,
            "cannot be used with",
        ),
        (&["--radec", "0,0,0", "--up", "north"], false, "--look-at"),
        (
            &["--look-at", "Sun", "--rates", "0,0,1", "--state", STATE],
            false,
            "--look-at have their own: leave --rates out",
        ),
    ] {
        let (worked, said) = render(options);
        assert_eq!(worked, works, "{options:?}: {said}");
        assert!(said.contains(words), "{options:?}: {said}");
        assert!(!words.is_empty() || said.is_empty(), "{options:?}: {said}");
        let _ = std::fs::remove_dir_all(here.path().join("o"));
    }
    let plan = ["plan", "--look-at", "Jupiter", "--up", "velocity", "--json"];
    let plan: Value = serde_json::from_str(&printed(here.path(), &plan)).unwrap();
    assert_eq!(plan["frame"], 0);
}
