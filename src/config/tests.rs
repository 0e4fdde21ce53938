//! Every fault of a scene or population file is reported, and no other.

use super::objects::load_population;
use super::*;

/// Asserts that the loader reports exactly these faults, a line each. Each is the beginning of a
/// line after file, line and column.
fn assert_reported(text: &str, load: impl Fn(&str) -> Option<String>, expected: &[&str]) {
    let error = load(text).unwrap_or_default();
    let lines = error.lines().filter(|line| !line.contains(" faults:"));
    let lines: Vec<&str> = lines.collect();
    assert_eq!(lines.len(), expected.len(), "{text}: {error}");
    for (line, expected) in lines.iter().zip(expected) {
        let fault = line.split_once(": ").map_or(*line, |(_, fault)| fault);
        assert!(fault.starts_with(expected), "{expected}: {line}");
    }
}

fn load(text: &str) -> Option<String> {
    let read = Config::parse("scene.toml", text, &Folder::current());
    read.err().map(|error| error.to_string())
}

#[test]
fn exactly_the_faults_of_a_scene_are_reported() {
    let pointing = "[sequence]\nepoch = \"2026-01-01T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\n";
    let sequence = |keys: &str| format!("{pointing}{keys}\n");
    for (text, expected) in [
        // Each faulty entry of a list has its own line, and its index in the file.
        (
            sequence(
                "attitudes = [[1, 2], { q = [0, 0, 0, 2] }, 7, { utc = 3, q = [0, 0, 0, 1] }, { utc = \"2026-01-01T00:00:00Z\", q = [0, \"a\", 0, true] }]",
            ),
            &[
                "sequence.attitudes[0]: must be a table of keys, not a list",
                "sequence.attitudes[1]: no utc",
                "sequence.attitudes[1].q: quaternion [0.0, 0.0, 0.0, 2.0] has norm 2",
                "sequence.attitudes[2]: must be a table of keys, not 7",
                "sequence.attitudes[3].utc: expected a UTC time",
                "sequence.attitudes[4].q[1]: must be a number, not \"a\"",
                "sequence.attitudes[4].q[3]: must be a number, not true",
            ][..],
        ),
        (
            sequence("attitudes = [[1, 2]]\nrates_deg_s = [0.0, 99999.0, 0.0]"),
            &[
                "sequence.attitudes[0]: must be a table of keys, not a list",
                "sequence.rates_deg_s[1] = 99999: must be -36000 to 36000 deg/s",
            ],
        ),
        (
            "[run]\ncoarsen = [\"a\", \"fast\", \"wing_e = -1\", 7, \"wing_ee = 1\"]".to_string(),
            &[
                "run.coarsen[0] = \"a\": must be one of fast,",
                "run.coarsen[2]: wing_e = -1: must be",
                "run.coarsen[3]: must be a text in quotes, not 7",
                "run.coarsen[4]: unknown tolerance `wing_ee`: did you mean `wing_e`?",
            ],
        ),
        (
            "[run]\ncoarsen = [\"a\"]\ncpus = [-1, \"a\", 0, -2]".to_string(),
            &[
                "run.coarsen[0] = \"a\": must be one of fast,",
                "run.cpus[0] = -1: must be 0 to 4294967295",
                "run.cpus[1]: must be a whole number, 0 to 4294967295, not \"a\"",
                "run.cpus[3] = -2: must be 0 to 4294967295",
            ],
        ),
        (
            "[effects]\noff = [\"a\", \"starlight\", \"readout\", 7]".to_string(),
            &[
                "effects.off[0] = \"a\": must be one of the effects",
                "effects.off[2]: \"readout\" cannot be switched off",
                "effects.off[3]: must be one of \"",
            ],
        ),
        (
            "heads = [7, { name = 7, camera = \"no\", link = [\"tcp://x\", \"x\"] }]".to_string(),
            &[
                "heads[0]: must be a table of keys, not 7",
                "heads[1].name: must be a text in quotes, not 7",
                "heads[1].camera: camera \"no\"",
                "heads[1].link[0]: ",
                "heads[1].link[1]: ",
            ],
        ),
        (
            sequence("attitudes = [{ utc = \"1899-12-31T23:59:59Z\", q = [0, 0, 0, 1] }]")
                .replace("\"2026-01-01T00:00:00Z\"", "2100-01-01T00:00:00Z"),
            &[
                "sequence.epoch = 2100-01-01T00:00:00Z: must be a time of the years 1900 to 2099",
                "sequence.attitudes[0].utc = 1899-12-31T23:59:59Z: must be a time of the years",
            ],
        ),
        (
            sequence("nadir = true").replace(
                "frames = 1\nperiod_s = 1.0",
                "frames = 1000000\nperiod_s = 1e6",
            ),
            &["sequence.frames: 1000000: the last exposure: no Earth and Sun positions for"],
        ),
        // For a wrong type the choices of the key are named.
        (
            format!(
                "camera = 7\nfidelity = {{ preset = 1, psf_loss = \"x\", orbits = 3 }}\n[sky]\ncatalog = 7\n[run]\nclock = 7\ntrigger = {{ own = {{}} }}\n\
                 on_overrun = true\non_stale = 1.5\nout_of_order = 1\noutput = 7\nwindows = 256\n{}",
                sequence("look_at = \"Sun\"\nup = 7")
            ),
            &[
                "camera: must be a text in quotes, not 7",
                "fidelity.preset: must be one of \"fast\", \"realtime\", \"reference\", not 1",
                "fidelity.psf_loss = \"x\": must be 0.000000000001 to 0.01",
                "fidelity.orbits = 3: must be one of ",
                "sky.catalog: must be one of \"hipparcos\", \"bsc\", not 7",
                "run.clock: must be one of \"stepped\", \"wall\", \"external\", not 7",
                "run.trigger: must be one of \"own\", \"packet\", not a table or a date",
                "run.on_overrun: must be one of \"late\", \"drop\", \"coarsen\", not true",
                "run.on_stale: must be one of \"extrapolate\", \"hold\", \"invalid\", not 1.5",
                "run.out_of_order: must be one of \"refuse\", \"use\", not 1",
                "run.output: must be one of \"frame\", \"compressed\", \"windows\", \"labels\", not 7",
                "run.windows: must be a whole number, 0 to 255, not 256",
                "sequence.up: must be one of \"north\", \"velocity\", \"sun\", \"zenith\", not 7",
            ],
        ),
        (
            "fidelity = 7".to_string(),
            &[
                "fidelity: must be one of \"fast\", \"realtime\", \"reference\" or a table of keys, not 7",
            ],
        ),
        // A quoted key may have dots and brackets, or be empty.
        (
            "\"run.clocks\" = 1\n[run]\n\"a[0]\" = 2\n\"\" = 3\nclock = 7\n\"b.c\" = { d = 4 }\nheadz = 5\n[run.\"x.y\"]\nz = 6\n".to_string(),
            &[
                "run.clocks: unknown key `run.clocks`",
                "run.a[0]: unknown key `a[0]`",
                "run.: unknown key ``",
                "run.clock: must be one of \"stepped\", \"wall\", \"external\", not 7",
                "run.b.c: unknown key `b.c`",
                "run.headz: unknown key `headz`",
                "run.x.y: unknown key `x.y`",
            ],
        ),
        // Keys that exclude each other.
        (
            sequence("radec = [1.0, 2.0, 3.0]\nnadir = true\nlook_at = \"Sun\""),
            &[
                "sequence.nadir: given with sequence.radec: leave one of them out",
                "sequence.look_at: given with sequence.radec: leave one of them out",
            ],
        ),
        // The other keys are checked with a faulty preset, too.
        (
            "fidelity = { preset = \"best\", wing_e = 1e9 }".to_string(),
            &[
                "fidelity.preset = \"best\": must be one of fast,",
                "fidelity.wing_e = 1000000000: must be 0.001 to 1000 e-",
            ],
        ),
    ] {
        assert_reported(&text, load, expected);
    }
}

#[test]
fn exactly_the_faults_of_a_population_are_reported() {
    let body = "object = \"../../configs/scenes/rcm-2019-06-15/rcm-1-A.oem\"\nshape = \"stage\"\nattitude = { mode = \"nadir\" }\n";
    for (text, expected) in [
        // A list of tables, and a list, in place of named tables.
        (
            format!("[[objects]]\n{body}[[shapes.stage]]\nparts = []\n"),
            &["shapes.stage: must be a table of keys, not a list"][..],
        ),
        (
            format!("shapes = [\"stage\"]\n[[objects]]\n{body}"),
            &["shapes: must be a table of keys, not a list"],
        ),
        (
            format!("[[objects]]\n{body}[[shapes]]\nparts = []\n"),
            &["shapes: must be a table of keys, not a list"],
        ),
        // A fault of one part hides no other fault.
        (
            "objects = []\n[shapes.stage]\nparts = [\n{ kind = \"sphere\", diameter_m = \"3\" },\n7,\n{ kind = \"sphere\", diameter_m = -1.0 },\n\
             { kind = \"cone\", axis = [1, 0, 0], length_m = -1.0, ends = \"all\" },\n{ kind = \"ball\", lobe_deg = 99.0 },\n\
             { kind = \"plate\", area_m2 = 1.0, normal = [\"a\", 1e9, 0], sun_axis = [0, 1, 0] },\n\
             { kind = \"sphere\", diameter_m = 1.0, specular = \"a\", lobe_deg = 5.0 }]\n"
                .to_string(),
            &[
                "shapes.stage.parts[0].diameter_m: must be 0.001 to 10000 m, not \"3\"",
                "shapes.stage.parts[1]: must be a table of keys, not 7",
                "shapes.stage.parts[2].diameter_m = -1: must be 0.001 to 10000 m",
                "shapes.stage.parts[3].diameter_m: the key `diameter_m` is missing",
                "shapes.stage.parts[3].length_m = -1: must be 0.001 to 10000 m",
                "shapes.stage.parts[3].ends = \"all\": must be one of",
                "shapes.stage.parts[4].kind = \"ball\": must be one of",
                "shapes.stage.parts[4].lobe_deg = 99: must be",
                "shapes.stage.parts[5].normal[0]: must be -1000000 to 1000000, not \"a\"",
                "shapes.stage.parts[5].normal[1] = 1000000000: must be",
                "shapes.stage.parts[6].specular: must be 0 to 1, not \"a\"",
            ],
        ),
        // A faulty shape does not hide faults of its attitude.
        (
            "[[objects]]\nobject = \"../../configs/scenes/rcm-2019-06-15/rcm-1-A.oem\"\nshape = 2.5\nattitude = { mode = \"spin\", q = [0, 0, 0, 1] }\n".to_string(),
            &[
                "objects[0].shape: must be a text in quotes, not 2.5",
                "objects[0].attitude.utc: the key `utc` is missing",
                "objects[0].attitude.rates_deg_s: the key `rates_deg_s` is missing",
            ],
        ),
        (
            "shapes = 7\n[[objects]]\nobject = \"../../configs/scenes/rcm-2019-06-15/rcm-1-A.oem\"\nshape = \"stage\"\n[objects.attitude]\nmode = \"spin\"\nq = [0, 0, \"a\", 1]\n\
             utc = \"noon\"\nrates_deg_s = [0, true, 99999]\n"
                .to_string(),
            &[
                "shapes: must be a table of keys, not 7",
                "objects[0].attitude.q[2]: must be a number, not \"a\"",
                "objects[0].attitude.utc: \"noon\"",
                "objects[0].attitude.rates_deg_s[1]: must be -36000 to 36000 deg/s, not true",
                "objects[0].attitude.rates_deg_s[2] = 99999: must be",
            ],
        ),
    ] {
        assert_reported(&text, load_population, expected);
    }
}
