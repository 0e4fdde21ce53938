//! Further commands and options: camera files, schemas, completions, manual pages, pointing by
//! options.

use crate::{EPOCH, Folder, STATE, camera, has, rows, with_keys};
use serde_json::Value;
use std::process::Command;

#[test]
fn limiting_magnitudes_agree_with_the_snr_of_labels() {
    let here = Folder::new();
    for camera in ["rigel-l", "cots-wide"] {
        let report = here.run(&format!("camera check {camera} --json"));
        let report = report.exits(0).json();
        let limit = report["limiting_mag"].as_f64().unwrap();
        // The rich sky of Cygnus; only stars.
        let sky = format!("--epoch {EPOCH} --radec 310,40,0 --label-snr 3 --out {camera}");
        here.run(&format!("render --camera {camera} {sky}"))
            .exits(0);
        let label = &here.labels(camera)[0];
        // Stars within the frame. Their centres lie between those of pixels, so that the light is
        // spread over more pixels, and the background differs.
        let mut off = Vec::new();
        for star in label["objects"].as_array().unwrap() {
            let [snr, mag] = ["snr", "band_mag"].map(|key| star[key].as_f64().unwrap_or(0.0));
            if star["in_frame"] == true && (4.0..6.5).contains(&snr) {
                // Near the limit the SNR grows faster than the square root of the signal, and more
                // slowly than the signal.
                off.push(mag - limit + 2.5 * (snr / 5.0).log10());
            }
        }
        off.sort_by(f64::total_cmp);
        assert!(off.len() >= 5, "{camera}: {} stars", off.len());
        let median = off[off.len() / 2];
        assert!((-0.35..0.1).contains(&median), "{camera}: {median} mag");
    }
}

#[test]
fn a_camera_file_is_created_checked_and_not_overwritten() {
    let here = Folder::new();
    let figures = "--size 640x480 --pixel 5 --focal 20deg --aperture f/1.4 --exposure 0.2";
    let new = |file: &str, full_well: &str| {
        here.run(&format!(
            "camera new {file} {figures} --full-well {full_well}"
        ))
    };
    let refused = here.run("camera new mine.toml").exits(1);
    refused.logs(&["no terminal", "--size, --pixel, --focal"]);
    let made = new("mine.toml", "12000").exits(0);
    let made = made.prints(&["field of view", "20.000 x", "wrote mine.toml"]);
    let checked = here.run("camera check mine.toml").exits(0).out;
    assert!(made.out.starts_with(&checked), "{} {checked}", made.out);
    new("mine.toml", "12000")
        .exits(1)
        .logs(&["mine.toml: exists already", "--force"]);
    new("mine.toml", "12000 --force").exits(0);
    let refused = new("other.toml", "-1");
    assert_ne!(refused.code, Some(0));
    refused.logs(&["--full-well \"-1\": must be 100 to"]);
    let printed = new("-", "12000").exits(0).out;
    assert!(
        printed.starts_with("# Written by `skyloop camera new`"),
        "{printed}"
    );
    assert_eq!(here.names(""), ["mine.toml"]);
    for camera in skyloop::load::CAMERAS {
        let checked = here.run(&format!("camera check {camera}")).exits(0);
        let checked = checked.prints(&["field of view", "arcsec/px", "stars a frame"]);
        checked.prints(&["limiting magnitude at SNR 5", "saturation magnitude"]);
    }
}

#[test]
fn all_faults_of_a_file_are_reported_at_once() {
    let good = camera("cots-wide", &[]);
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
    let here = Folder::with(&[("bad.toml", &bad)]);
    let line_of = |word: &str| 1 + bad.lines().position(|line| line.contains(word)).unwrap();
    let said = here.run("camera check bad.toml").exits(1).log;
    assert!(said.starts_with("error: bad.toml: 8 faults:\n"), "{said}");
    for (word, messages) in rows(
        "[optics] | optics: the key `aperture_mm` is missing
         lenght   | did you mean `focal_length_mm`?
         | optics.focal_length_mm = 1000000000: must be 0.5 to 1000000 mm
         = \"wide  | optics.psf.sigma_px: must be 0.01 to 100 px, not \"wide\"
         = -3.0   | detector.full_well_e = -3: must be 1 to 1000000000 e-
         = 99     | detector.adc_bits = 99: must be 1 to 16 bits
         whatever | unknown key `whatever`
         = 50.0   | timing.rate_hz = 50: must be at most 10 Hz",
    ) {
        let place = format!("  bad.toml:{}:", line_of(word));
        for message in messages {
            let is_it = |said: &str| said.starts_with(&place) && said.contains(message);
            assert!(said.lines().any(is_it), "{place} {message}: {said}");
        }
    }
    // Faults in optional tables do not hide others.
    let optional = format!(
        "{good}\n[optics.vignetting]\ncos4 = true\ntable = [[0.0, 2.0]]\n[radiation]\nflux_cm2_s = \"much\"\nthickness_um = 0.0\nenergy_mev = \
         1.0\n[mounting]\nmisalignment_arcsec = [1e9, 0.0, 0.0]\n"
    );
    let moffat = "kind = \"moffat\"\nfwhm_px = 0.0\nbeta = 0.0\n#";
    let optional = optional.replace("kind = \"gaussian\" ", moffat);
    let optional = optional.replace("sigma_px", "# sigma_px");
    here.write("optional.toml", with_keys(&optional, &[("adc_bits", "99")]));
    here.run("camera check optional.toml").exits(1).logs(&[
        "optional.toml: 9 faults",
        "optics.psf.fwhm_px = 0: must be",
        "optics.psf.beta = 0: must be",
        "optics.vignetting.table[0][1] = 2: must be",
        "optics.vignetting.cos4: given with optics.vignetting.table",
        "detector.adc_bits = 99",
        "radiation.flux_cm2_s = \"much\"",
        "radiation.thickness_um = 0: must be",
        "radiation.energy_mev = 1: must be",
        "mounting.misalignment_arcsec[0] = 1000000000: must be",
    ]);
    // A scene reports the faults of its camera file, too.
    let scene = "sed = 4\nlabel_snr = -1\ncamera = \"bad.toml\"\n[sequence]\nepoch = \"noon\"\nframes = 0\nnadir = true\n[run]\nidle_s = -4\n";
    here.write("scene.toml", scene);
    here.run("render --scene scene.toml --out o")
        .exits(1)
        .logs(&[
            "scene.toml:1:1: sed: unknown key `sed`: did you mean `seed`?",
            "scene.toml:2:13: label_snr = -1",
            "bad.toml: 8 faults",
            "detector.adc_bits = 99",
            "scene.toml:4:1: sequence: the key `period_s` is missing",
            "scene.toml:5:9: sequence.epoch: \"noon\"",
            "scene.toml:6:10: sequence.frames = 0",
            "scene.toml:9:10: run.idle_s = -4",
        ]);
}

#[test]
fn schemas_have_keys_with_descriptions() {
    let here = Folder::new();
    for (kind, key) in [
        ("camera", "detector"),
        ("scene", "sequence"),
        ("run", "heads"),
        ("population", "shapes"),
        ("labels", "objects"),
    ] {
        let schema = here.run(&format!("schema {kind}")).exits(0).json();
        let version = "https://json-schema.org/draft/2020-12/schema";
        assert_eq!(schema["$schema"], version);
        assert!(schema["properties"][key].is_object(), "{kind}: {schema}");
        // Unknown keys are refused, except in labels.
        let is_closed = schema["additionalProperties"] == false;
        assert_eq!(is_closed, kind != "labels", "{kind}");
        for (name, property) in schema["properties"].as_object().unwrap() {
            let is_described = property["description"].is_string() || property["$ref"].is_string();
            assert!(is_described, "{kind}: {name}");
        }
    }
}

#[test]
fn bash_completes_the_command_line() {
    let here = Folder::new();
    let printed = |words: &str| here.run(words).exits(0).out;
    here.write("skyloop.bash", printed("completions bash"));
    let complete = |words: &str, last: usize| {
        let line = format!(
            "source ./skyloop.bash; COMP_WORDS=({words}); COMP_CWORD={last}; _skyloop skyloop \"${{COMP_WORDS[{last}]}}\" \"${{COMP_WORDS[{}]}}\"; \
             echo \"${{COMPREPLY[@]}}\"",
            last - 1
        );
        let mut bash = Command::new("bash");
        let done = bash.current_dir(&here).args(["-c", &line]).output();
        let printed = String::from_utf8(done.unwrap().stdout).unwrap();
        printed.trim().to_string()
    };
    assert_eq!(complete("skyloop loo", 1), "loopback");
    assert_eq!(complete("skyloop camera ch", 2), "check");
    assert_eq!(complete("skyloop render --look", 2), "--look-at");
    for shell in ["zsh", "fish"] {
        has(&printed(&format!("completions {shell}")), &["loopback"]);
    }
}

/// Writes the manual pages, and lists them.
fn manual_pages(here: &Folder) -> Vec<String> {
    here.run("man pages").exits(0);
    here.names("pages")
}

#[test]
fn each_command_has_a_manual_page() {
    let here = Folder::new();
    let pages = manual_pages(&here);
    for page in ["skyloop.1", "skyloop-render.1", "skyloop-camera-new.1"] {
        assert!(pages.contains(&page.to_string()), "{page}: {pages:?}");
    }
    has(&here.run("man").exits(0).out, &[".TH skyloop 1"]);
}

#[test]
#[ignore = "tools: needs groff; tests/run all runs it"]
fn tools_groff_formats_the_manual_pages() {
    let here = Folder::new();
    for page in manual_pages(&here) {
        let mut groff = Command::new("groff");
        let groff = groff.args(["-man", "-Tutf8", "-ww"]);
        let groff = groff.arg(here.join("pages").join(&page)).output();
        let groff = groff.expect("groff is missing: apt-get install groff-base");
        let said = String::from_utf8_lossy(&groff.stderr);
        assert!(groff.status.success() && said.is_empty(), "{page}: {said}");
    }
}

#[test]
fn options_point_the_camera_and_report_hidden_objects() {
    let here = Folder::new();
    // The observer flies towards -Z at RA 169, Dec -50; at that time the Moon is at RA 250,
    // Dec -21, the Sun at RA 84, Dec +23.
    let table = |table: &str| table.replace("STATE", &format!("--state {STATE}"));
    let render = format!("render --camera fai-nir --epoch {EPOCH} --out o");
    here.refuses(
        &render,
        &table(
            "--look-at limb:80              | the limb needs an orbit
             --look-at Mooon STATE          | did you mean `Moon`?
             --look-at Moon --up left       | zenith
             --look-at Moon --nadir         | cannot be used with
             --radec 0,0,0 --up north       | --look-at
             --look-at Sun --rates 0,0,1 STATE
             | --look-at have their own: leave --rates out",
        ),
    );
    for (options, words) in rows(&table(
        "--look-at Moon --up north STATE
         --look-at Sun --up sun STATE
         | parallel to up = \"sun\", and north is up instead, in 1 of 1 exposures
         --look-at 350,50 STATE
         | the target is behind the Earth, in 1 of 1 exposures, the first at 2019-06-15T23:35:50
         --look-at limb:80 --roll 10 STATE",
    )) {
        let ended = here.run(&format!("{render} {options}")).exits(0);
        let ended = ended.logs(&words);
        assert_eq!(ended.log.is_empty(), words.is_empty(), "{}", ended.all());
    }
    let plan = here.run("plan --look-at Jupiter --up velocity --json");
    assert_eq!(plan.exits(0).json()["frame"], Value::from(0));
}
