//! Objects close to the observer, which may be docked to it: one warning a run.

use crate::Folder;

/// A synthetic station, an object 0.6 km ahead of it and an object 60 km ahead.
const SETS: &str = "\
    OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
    STATION,2026-101A,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270,5,0\n\
    FERRY,2026-101B,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270.005,6,0\n\
    AHEAD,2026-101C,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270.5,7,0\n";

#[test]
fn possibly_docked_objects_are_reported_once() {
    let here = Folder::with(&[("sets.csv", SETS)]);
    let look = |radec: &str| {
        let orbit = "--epoch 2026-07-12T03:04:05Z --orbit sets.csv:STATION --rso sets.csv";
        let render = here.run(&format!(
            "render {orbit} --radec {radec} --frames 2 --out o"
        ));
        render.exits(0)
    };
    // X-Val: the direction of the velocity in the frame's label (state_gcrf_km).
    let says = "1 object in the field within 10 km of the observer (FERRY at 0.601 km)";
    look("-150.420,51.749,0").logs_lines(1).logs(&[says]);
    look("29.580,-51.749,0").lacks("within 10 km");
}
