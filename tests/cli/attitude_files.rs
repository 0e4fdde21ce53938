//! `[sequence] attitude_file`: attitudes of an AEM or of lines, in all their conventions.

use crate::{Folder, Q};

/// A scene of three frames, 1 s apart, the first at the time of `Q`, and an attitude file.
fn scene(sequence: &str, (name, text): (&str, &str)) -> Folder {
    let scene = format!(
        "[sequence]\nepoch = \"2019-06-15T23:35:50Z\"\nframes = 3\nperiod_s = 1.0\n{sequence}\n"
    );
    Folder::with(&[("scene.toml", &scene), (name, text)])
}

const RENDER: &str = "render --scene scene.toml --out o";

/// An AEM of version 1.0 whose second segment covers only the third frame.
fn message(meta: &str, first: &str, second: &str) -> String {
    let segment = |start: u32, stop: u32, q: &str| {
        let at = |second| format!("2019-06-15T23:35:{second}");
        let (start, stop) = (at(start), at(stop));
        format!(
            "META_START\nOBJECT_NAME = A\nOBJECT_ID = 2013-055A\nREF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\n{meta}TIME_SYSTEM = UTC\n\
             START_TIME = {start}\nSTOP_TIME = {stop}\nATTITUDE_TYPE = QUATERNION/RATE\nMETA_STOP\nDATA_START\n{start} {q} 0 0 0\n{stop} {q} 0 0 0\nDATA_STOP\n"
        )
    };
    let segments = segment(49, 51, first) + &segment(52, 53, second);
    format!(
        "CCSDS_AEM_VERS = 1.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n{segments}"
    )
}

const A2B_LAST: &str = "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = LAST\n";

#[test]
fn labels_have_the_attitudes_of_the_file() {
    // The attitude `Q` in each convention: the quaternion of CCSDS from A to B is its conjugate.
    let a2b_last = message(A2B_LAST, "0.070834 0.644137 -0.733522 -0.204975", "0 0 0 1");
    let b2a_first = message(
        "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = FIRST\n",
        "-0.204975 -0.070834 -0.644137 0.733522",
        "1 0 0 0",
    );
    let blanks = Q.replace(',', " ");
    let lines = format!(
        "# UTC x y z w\n2019-06-15T23:35:49 {blanks}\n2019-06-15T23:35:51 {blanks}\n2019-06-15T23:35:52 0 0 0 1\n"
    );
    let wanted: Vec<f64> = Q.split(',').map(|x| x.parse().unwrap()).collect();
    let norm = wanted.iter().map(|x| x * x).sum::<f64>().sqrt();
    for (name, text) in [
        ("a.aem", &a2b_last),
        ("b.txt", &b2a_first),
        ("lines", &lines),
    ] {
        let here = scene(&format!("attitude_file = \"{name}\""), (name, text));
        let log = here.run(RENDER).exits(0).log;
        let has_rates = log.contains("those of the file are not used");
        assert_eq!(has_rates, name != "lines", "{log}");
        let labels = here.labels("o");
        for (label, wanted, norm) in [
            (&labels[0], &wanted[..], norm),
            (&labels[1], &wanted, norm),
            (&labels[2], &[0.0, 0.0, 0.0, 1.0], 1.0),
        ] {
            let q = &label["q_icrf_to_body"];
            let products = (0..4).map(|i| q[i].as_f64().unwrap() * wanted[i] / norm);
            assert!(products.sum::<f64>().abs() > 1.0 - 1e-12, "{name}: {q}");
        }
    }
}

#[test]
fn invalid_attitude_files_are_refused_with_a_reason() {
    let good = "2019-06-15T23:35:50 0 0 0 1\n2019-06-15T23:35:55 0 0 0 1\n";
    let stk = "stk.v.11.0\nBEGIN Attitude\n";
    let spin = message(A2B_LAST, "0 0 0 1", "0 0 0 1");
    let gap = spin.replace("2019-06-15T23:35:52", "2019-06-15T23:35:52.5");
    let odd = spin.replacen("0 0 0 1 0 0 0", "0 0 0 2 0 0 0", 1);
    let spin = spin.replace("QUATERNION/RATE", "SPIN");
    const FILE: &str = "attitude_file = \"f\"";
    const BOTH: &str = "attitude_file = \"f\"\nattitudes = [{ q = [0, 0, 0, 1] }]";
    let of_file = [
        (&spin[..], "f:14: ATTITUDE_TYPE 'SPIN'; expected QUATERNION"),
        (
            &gap,
            "covers 2019-06-15T23:35:52.500Z to 2019-06-15T23:35:53.000Z",
        ),
        (&odd, "f:17: the quaternion's norm is 2"),
        (
            stk,
            "f: an STK attitude file (.a), which is not read: export it as a CCSDS AEM",
        ),
        (
            "CCSDS_OEM_VERS = 2.0\n",
            "f: a CCSDS OEM, which holds orbits: give it under [objects] files",
        ),
        (
            "[{\"EPOCH\":\"2019-06-15\"}]",
            "f: a CCSDS OMM, which holds orbits",
        ),
        (
            "CCSDS_OPM_VERS = 2.0\n",
            "f: a CCSDS OPM, a single state, which is not read",
        ),
        ("now 0 0 0 1\n", "f:1: "),
    ];
    let of_sequence = [
        ("attitude_file = \"none\"", "sequence.attitude_file: "),
        (
            BOTH,
            "sequence.attitude_file: given with sequence.attitudes: leave one of them out",
        ),
        ("", "sequence: give one of attitudes"),
    ];
    let of_file = of_file.map(|(text, part)| (FILE, text, part));
    let of_sequence = of_sequence.map(|(sequence, part)| (sequence, good, part));
    for (sequence, text, part) in of_file.into_iter().chain(of_sequence) {
        let here = scene(sequence, ("f", text));
        here.run(RENDER).exits(1).logs(&[part]);
        assert!(!here.join("o").exists(), "{part}");
    }
}
