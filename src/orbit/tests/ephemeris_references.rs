//! OEM against independent programs: interpolated states, and frames.

use crate::support::texts;
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop_orbit::time::{parse_utc, utc_text};
use skyloop_orbit::{Object, StateVector, parse};

/// A message with these states and epochs.
fn message(frame: &str, meta: &str, states: &[(Epoch, String)]) -> String {
    let [start, stop] = [&states[0], &states[states.len() - 1]].map(|(t, _)| utc_text(*t));
    let span = format!("START_TIME = {start}\nSTOP_TIME = {stop}\n");
    let lines = states
        .iter()
        .map(|(epoch, state)| format!("{} {state}", utc_text(*epoch)));
    let meta = format!("{meta}REF_FRAME = {frame}\n{span}");
    texts::oem(&meta, &lines.collect::<Vec<_>>())
}

fn only(text: &str) -> Object {
    let mut loaded = parse(text, "test.oem").unwrap();
    assert_eq!(loaded.rejected, [], "{text}");
    loaded.objects.remove(0)
}

fn remarks(object: &Object) -> Vec<&str> {
    let remarks = object.remarks().into_iter();
    remarks.map(|(_, remark)| remark).collect()
}

/// Distances in m and m/s from a state in km and km/s.
fn off(state: &StateVector, km: &[f64]) -> (f64, f64) {
    let (r, v) = (&state.position_m * 1e-3, &state.velocity_m_s * 1e-3);
    let square = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    (
        square(r.as_slice(), &km[..3]).sqrt() * 1e3,
        square(v.as_slice(), &km[3..]).sqrt() * 1e3,
    )
}

/// A line of data/oem_interpolated.txt.
struct Row {
    method: String,
    degree: usize,
    step_s: u32,
    t: f64,
    state_km: Vec<f64>,
}

fn rows() -> (Vec<Row>, Vec<(u32, f64, String)>) {
    // X-Val: data/make_ephemeris_references.py: an analytic Kepler orbit, and scipy's
    // interpolators on its states.
    let (mut rows, mut states) = (Vec::new(), Vec::new());
    for line in include_str!("data/oem_interpolated.txt").lines().skip(1) {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words[0] == "state" {
            let (step_s, t) = (words[1].parse().unwrap(), words[2].parse().unwrap());
            states.push((step_s, t, words[3..].join(" ")));
        } else {
            rows.push(Row {
                method: words[0].to_owned(),
                degree: words[1].parse().unwrap(),
                step_s: words[2].parse().unwrap(),
                t: words[3].parse().unwrap(),
                state_km: words[4..]
                    .iter()
                    .map(|word| word.parse().unwrap())
                    .collect(),
            });
        }
    }
    (rows, states)
}

fn start() -> Epoch {
    parse_utc("2019-06-15T00:00:00Z").unwrap()
}

/// The states of the reference orbit every `step_s`, in a message with these metadata.
fn orbit(states: &[(u32, f64, String)], step_s: u32, meta: &str) -> Object {
    let of_step = states.iter().filter(|(step, ..)| *step == step_s);
    let states = of_step.map(|(_, t, state)| (start() + *t * Unit::Second, state.clone()));
    only(&message("GCRF", meta, &states.collect::<Vec<_>>()))
}

#[test]
fn interpolated_states_agree_with_an_independent_program() {
    let (rows, states) = rows();
    let compared: Vec<&Row> = rows.iter().filter(|row| row.method != "true").collect();
    assert_eq!(compared.len(), 2 * 9 * 6);
    for row in compared {
        let meta = meta(&row.method, row.degree);
        let object = orbit(&states, row.step_s, &meta);
        assert_eq!(remarks(&object), [""; 0], "{meta}");
        let state = object.state(start() + row.t * Unit::Second).unwrap();
        let (m, m_s) = off(&state, &row.state_km);
        let label = format_args!("{meta}{} s at {}", row.step_s, row.t);
        assert!(m < 1e-5 && m_s < 1e-7, "{label}: {m} m, {m_s} m/s");
    }
}

fn meta(method: &str, degree: usize) -> String {
    format!("INTERPOLATION = {method}\nINTERPOLATION_DEGREE = {degree}\n")
}

#[test]
fn interpolation_errors_on_an_analytic_orbit_are_within_bounds() {
    let (rows, states) = rows();
    // HERMITE of degree 1, from two states, is a straight line as LINEAR. Without a method it is
    // Hermite's of degree 7.
    for (meta, step_s, min_m, max_m, max_m_s) in [
        ("INTERPOLATION = LINEAR\n".to_owned(), 60, 3e3, 4e3, 5.0),
        (meta("HERMITE", 1), 60, 0.1, 0.4, 0.02),
        (meta("HERMITE", 3), 60, 0.1, 0.4, 0.02),
        (meta("LAGRANGE", 7), 240, 1.0, 4.0, 5e-3),
        (meta("HERMITE", 7), 240, 1e-3, 0.01, 1e-4),
        (String::new(), 240, 1e-3, 0.01, 1e-4),
        (String::new(), 60, 0.0, 1e-5, 1e-7),
    ] {
        let object = orbit(&states, step_s, &meta);
        let (mut m, mut m_s) = (0.0_f64, 0.0_f64);
        for row in rows
            .iter()
            .filter(|row| row.method == "true" && row.step_s == step_s)
        {
            let state = object.state(start() + row.t * Unit::Second).unwrap();
            let found = off(&state, &row.state_km);
            (m, m_s) = (m.max(found.0), m_s.max(found.1));
        }
        println!("{meta:?} {step_s} s: {m:.2e} m, {m_s:.2e} m/s");
        let is_within = (min_m..max_m).contains(&m) && m_s < max_m_s;
        assert!(is_within, "{meta} {step_s} s: {m} m, {m_s} m/s");
    }
}

#[test]
fn the_velocity_is_the_derivative_of_the_position() {
    let (_, states) = rows();
    let h = 0.01;
    // Exact for Hermite, up to the difference quotient. For Lagrange as accurate as the file's
    // velocities.
    for (method, degree, step_s, max_m_s) in [
        ("HERMITE", 3, 60, 1e-5),
        ("HERMITE", 7, 240, 1e-5),
        ("LAGRANGE", 7, 60, 1e-4),
        ("LAGRANGE", 7, 240, 0.1),
    ] {
        let object = orbit(&states, step_s, &meta(method, degree));
        // Between nodes, at one, and near both ends.
        for share in [0.3, 1.0, 5.5, 6.0, 10.7] {
            let t = start() + share * f64::from(step_s) * Unit::Second;
            let at = |dt: f64| object.state(t + dt * Unit::Second).unwrap();
            // Over 0.02 s the third derivative adds 2e-10 m/s.
            let slope = (at(h).position_m - at(-h).position_m) / (2.0 * h);
            let error = (slope - at(0.0).velocity_m_s).norm();
            assert!(
                error < max_m_s,
                "{method} {degree}, {step_s} s at {share}: {error} m/s"
            );
        }
    }
}

#[test]
fn deviations_from_the_metadata_are_remarked() {
    let (_, states) = rows();
    for (method, degree, remark) in [
        ("HERMITE", 8, "not 8: 9 is taken"),
        ("HERMITE", 1, "not 1: 3 is taken"),
        ("LINEAR", 5, "not 5: 1 is taken"),
        ("LAGRANGE", 15, "takes 16 states, and the segment has 12"),
    ] {
        let object = orbit(&states, 60, &meta(method, degree));
        let all = remarks(&object);
        assert!(
            all.len() == 1 && all[0].contains(remark),
            "{method} {degree}: {all:?}"
        );
        assert!(object.remarks()[0].0 >= 3, "the line of the keyword");
    }
    assert_eq!(remarks(&orbit(&states, 60, "")), [""; 0]);
}

/// Two states 1 s apart on a straight line, from a state in m and m/s.
fn around(epoch: Epoch, state: &[f64]) -> Vec<(Epoch, String)> {
    let states = [0.0, 1.0].map(|dt| {
        let moved = (0..3).map(|i| state[i] + dt * state[3 + i]);
        let numbers = moved.chain(state[3..6].iter().copied());
        let km: Vec<String> = numbers.map(|x| format!("{:.12}", x / 1e3)).collect();
        (epoch + dt * Unit::Second, km.join(" "))
    });
    states.to_vec()
}

#[test]
fn frames_are_rotated_as_by_independent_programs() {
    // X-Val: data/make_ephemeris_references.py: erfa, and astropy with the Earth orientation of
    // IERS Bulletin B.
    let [mut worst_m, mut worst_m_s, mut pole, mut ut1_as_utc] = [0.0_f64; 4];
    for line in include_str!("data/frames_to_gcrf.txt").lines().skip(1) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (source, frame, ut1_utc, utc) = (words[0], words[1], words[2], words[3]);
        let numbers: Vec<f64> = words[4..]
            .iter()
            .map(|word| word.parse().unwrap())
            .collect();
        let epoch = parse_utc(utc).unwrap();
        let states = around(epoch, &numbers[..6]);
        let across = numbers[0].hypot(numbers[1]);
        let km: Vec<f64> = numbers[6..].iter().map(|x| x / 1e3).collect();
        let names: &[&str] = match frame {
            "ITRF" => &["ITRF", "ITRF2014", "itrf-97", "ITRF2000", "TDR"],
            other => &[other],
        };
        for name in names {
            let meta = format!("COMMENT UT1-UTC = {ut1_utc}\n{}", meta("HERMITE", 3));
            let object = only(&message(name, &meta, &states));
            assert_eq!(remarks(&object), [""; 0], "{name}");
            let (m, m_s) = off(&object.state(epoch).unwrap(), &km);
            if source == "erfa" {
                (worst_m, worst_m_s) = (worst_m.max(m), worst_m_s.max(m_s));
                continue;
            }
            // Polar motion is left out. Without UT1 - UTC the Earth's rotation is off by it.
            pole = pole.max(m / across.hypot(numbers[2]));
            let without = only(&message(name, "", &states));
            let remarks = remarks(&without).concat();
            for part in ["without Earth-orientation data", "460 m at 7,000 km"] {
                assert!(remarks.contains(part), "{remarks}");
            }
            let turned = 7.292_115e-5 * ut1_utc.parse::<f64>().unwrap();
            let (by, _) = off(&without.state(epoch).unwrap(), &km);
            ut1_as_utc = ut1_as_utc.max((by / across - turned.abs()).abs());
        }
    }
    println!(
        "erfa: {worst_m:.2e} m, {worst_m_s:.2e} m/s; polar motion: {pole:.2e} rad; \
         UT1 as UTC: {ut1_as_utc:.2e} rad"
    );
    // Velocities neglect the rotation of axes of date, up to 2e-11 rad/s: 0.8 mm/s at 42,000 km.
    assert!(
        worst_m < 1e-4 && worst_m_s < 2e-3,
        "{worst_m} m, {worst_m_s} m/s"
    );
    // 0.6 arcsec, the largest polar motion since 1988.
    assert!(
        pole > 1e-8 && pole < 2.9e-6 && ut1_as_utc < 2.9e-6,
        "{pole} {ut1_as_utc}"
    );
}

/// UT1 has no leap seconds: UT1 - UTC steps with UTC's, also within a segment.
#[test]
fn ut1_continues_over_a_leap_second() {
    // X-Val: pyerfa 2.0.1.5 (utcut1, gst06, pnm06a), GCRF (m) of 7000 km along the Earth's x axis.
    // UT1 - UTC = -0.4 s before the leap second of 2016-12-31 (IERS Bulletin C 52) and 0.6 s after
    // it. The times in UT1 are those in UTC plus this difference.
    let utc = [
        "2016-12-31T23:58:00",
        "2016-12-31T23:59:60",
        "2017-01-01T00:00:30",
        "2017-01-01T00:01:00",
    ];
    let ut1 = [
        "2016-12-31T23:57:59.6",
        "2016-12-31T23:59:59.6",
        "2017-01-01T00:00:30.6",
        "2017-01-01T00:01:00.6",
    ];
    let expected_m = [
        [-1_229_619.379, 6_891_155.978, 2_339.414],
        [-1_289_872.776, 6_880_132.432, 2_437.657],
        [-1_305_422.369, 6_877_199.021, 2_463.007],
        [-1_320_464.012, 6_874_326.775, 2_487.527],
    ];
    // The first row of the table; in the second START_TIME lies in the leap second.
    for (first, given, is_step_reported) in
        [(0, "-0.4", true), (1, "-0.4", true), (2, "0.6", false)]
    {
        for (system, times) in [("UTC", &utc[first..]), ("UT1", &ut1[first..])] {
            let meta = format!(
                "COMMENT UT1-UTC = {given}\nREF_FRAME = ITRF2014\nTIME_SYSTEM = {system}\n\
                 START_TIME = {}\nSTOP_TIME = {}\n",
                times[0],
                times[times.len() - 1]
            );
            let states = times.iter().map(|at| format!("{at} 7000 0 0 0 0 0"));
            let object = only(&texts::oem(&meta, &states.collect::<Vec<_>>()));
            let remarks = remarks(&object);
            let is_reported = remarks.iter().any(|remark| remark.contains("as 0.6 s at"));
            assert_eq!(is_reported, is_step_reported, "{system}: {remarks:?}");
            for (at, expected_m) in utc.iter().zip(expected_m).skip(first) {
                let state = object.state(parse_utc(at).unwrap()).unwrap();
                let off_m = (state.position_m - Vector3::from(expected_m)).norm();
                assert!(off_m < 0.01, "{system} {at}: {off_m} m");
            }
        }
    }
}
