//! `skyloop camera check`: validity of a camera file, and the camera's sensitivity.

use clap::Args as ClapArgs;
use serde::Serialize;
use skyloop::camera::Camera;
use skyloop::load::Folder;
use skyloop::sensitivity::{CATALOGUE_MAG, LIMIT_SNR, SKY_MAG_ARCSEC2, Sensitivity};
use skyloop::stats::{row, table};
use skyloop_firmware_sim::console::say;

#[derive(ClapArgs)]
pub struct Args {
    /// A camera file, or the name of a built-in camera
    #[arg(value_name = "NAME|FILE")]
    camera: String,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    camera: String,
    #[serde(flatten)]
    sensitivity: Sensitivity,
    warnings: Vec<String>,
}

/// Minimum number of stars in a frame for attitude determination.
const FEW_STARS: f64 = 4.0;

pub fn run(args: Args) -> anyhow::Result<()> {
    let (camera, notices) = Camera::load_noticed(&args.camera, &Folder::current())?;
    say(report(&camera, notices, args.json)?)?;
    Ok(())
}

pub fn report(camera: &Camera, notices: Vec<String>, json: bool) -> serde_json::Result<String> {
    let sensitivity = Sensitivity::of(camera);
    let mut warnings = notices;
    warnings.extend(unusual_values(&sensitivity));
    let report = Report {
        camera: camera.name.clone(),
        sensitivity,
        warnings,
    };
    if json {
        Ok(serde_json::to_string_pretty(&report)? + "\n")
    } else {
        Ok(report.table(camera))
    }
}

/// Warnings about values that are unusual for a star tracker.
fn unusual_values(found: &Sensitivity) -> Vec<String> {
    let mut unusual_values = Vec::new();
    match (found.limiting_mag, found.stars_per_frame) {
        (None, _) if found.saturation_mag.is_some() => unusual_values.push(format!(
            "no star reaches SNR {LIMIT_SNR} before it saturates: no limiting magnitude; check full_well_e, read_noise_e and gain_e_per_dn"
        )),
        (None, _) => unusual_values.push(
            "no star can be seen: dark charge and sky fill every pixel, or no light passes"
                .to_string(),
        ),
        (Some(limit), Some(stars)) if limit < CATALOGUE_MAG && stars < FEW_STARS => unusual_values.push(format!(
            "{stars:.1} stars a frame: most attitude determination needs {FEW_STARS}; widen the field, or gather more light"
        )),
        (Some(limit), _) if limit > CATALOGUE_MAG => unusual_values.push(format!(
            "stars fainter than about V {CATALOGUE_MAG} are missing in the embedded catalogue: frames show fewer than this camera would see"
        )),
        _ => {}
    }
    unusual_values
}

impl Report {
    fn table(&self, camera: &Camera) -> String {
        let found = &self.sensitivity;
        let detector = &camera.detector;
        let [across, down, diagonal] = found.field_deg;
        let mag = |mag: Option<f64>| mag.map_or("none".to_string(), |mag| format!("{mag:.2}"));
        let stars = found.stars_per_frame;
        let background = format!(
            "{:.2} e-/px: dark {:.2}, sky {:.2} (mag {SKY_MAG_ARCSEC2}/arcsec^2)",
            found.dark_e_px + found.sky_e_px,
            found.dark_e_px,
            found.sky_e_px
        );
        let field = format!("{across:.3} x {down:.3} deg, diagonal {diagonal:.3} deg");
        let limiting = format!("limiting magnitude at SNR {LIMIT_SNR}");
        let stars = stars.map_or("none".to_string(), |stars| format!("{stars:.1}"));
        let rows = [
            row(
                "pixels",
                format!("{} x {}", detector.width, detector.height),
            ),
            row("field of view", field),
            row("scale", format!("{:.2} arcsec/px", found.arcsec_per_px)),
            row("background", background),
            row(&limiting, mag(found.limiting_mag)),
            row("stars a frame to that", stars),
            row("saturation magnitude", mag(found.saturation_mag)),
        ];
        let mut text = format!(
            "{}, exposed for {} s (a star at rest on the boresight, in the middle of a pixel; magnitudes in the camera's band)\n",
            self.camera, found.exposure_s
        );
        text += &table(&rows);
        for warning in &self.warnings {
            text += &format!("warning: {warning}\n");
        }
        text
    }
}
