//! `skyloop camera new`: a camera file from the six figures of a data sheet.

use super::check::report;
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use skyloop::camera::Camera;
use skyloop_firmware_sim::console::say;
use std::fs::OpenOptions;
use std::io::{BufRead, IsTerminal, Write, stderr, stdin};
use std::path::PathBuf;

/// Arguments of `skyloop camera new`.
#[derive(ClapArgs)]
pub struct Args {
    /// The file to write; its name without the end becomes the camera's
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Sensor, columns x rows
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    size: Option<String>,
    /// Pixel pitch, um
    #[arg(long, value_name = "UM", allow_hyphen_values = true)]
    pixel: Option<String>,
    /// Focal length, mm, or the field of view along the rows, such as 20deg
    #[arg(long, value_name = "MM|DEG", allow_hyphen_values = true)]
    focal: Option<String>,
    /// Aperture: diameter in mm, or focal ratio, such as f/1.4
    #[arg(long, value_name = "MM|f/N", allow_hyphen_values = true)]
    aperture: Option<String>,
    /// Exposure time, s
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    exposure: Option<String>,
    /// Full well, e-
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    full_well: Option<String>,
    /// Write over a file that is there
    #[arg(long)]
    force: bool,
}

/// A figure of a data sheet.
struct Question {
    option: &'static str,
    asks: &'static str,
    default: &'static str,
    /// Reads an answer; the error says what is allowed.
    read: fn(&str) -> Result<Answer, String>,
}

/// One or two numbers, and whether the last is in the other of two units: deg for mm, a ratio for mm.
type Answer = ([f64; 2], bool);

const QUESTIONS: [Question; 6] = [
    Question {
        option: "--size",
        asks: "Sensor, columns x rows (px)",
        default: "1280x1024",
        read: size,
    },
    Question {
        option: "--pixel",
        asks: "Pixel pitch (um)",
        default: "4.8",
        read: |text| number(text, 0.3, 1e3, "um"),
    },
    Question {
        option: "--focal",
        asks: "Focal length (mm), or field of view along the rows, such as 20deg",
        default: "16",
        read: focal,
    },
    Question {
        option: "--aperture",
        asks: "Aperture: diameter (mm), or focal ratio, such as f/1.4",
        default: "f/1.4",
        read: aperture,
    },
    Question {
        option: "--exposure",
        asks: "Exposure time (s)",
        default: "0.1",
        read: |text| number(text, 1e-6, 1e4, "s"),
    },
    Question {
        option: "--full-well",
        asks: "Full well (e-)",
        default: "10000",
        read: |text| number(text, 100.0, 1e9, "e-"),
    },
];

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let shown = args.file.display().to_string();
    if args.file.exists() && !args.force {
        bail!("{shown}: is there already; give --force to write over it, or another name");
    }
    let given = [
        args.size,
        args.pixel,
        args.focal,
        args.aperture,
        args.exposure,
        args.full_well,
    ];
    let answers = match stdin().is_terminal() {
        true => ask(&given, &mut stdin().lock(), &mut stderr())?,
        false => all_given(&given)?,
    };
    let name = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let text = file_text(&name, &answers);
    let (camera, notices) = Camera::parse_noticed(&shown, &text)
        .context("these figures make no camera; nothing is written")?;
    let mut options = OpenOptions::new();
    let options = options.write(true).truncate(true);
    let options = match args.force {
        true => options.create(true),
        false => options.create_new(true),
    };
    let written = options.open(&args.file);
    written
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .with_context(|| format!("{shown}: cannot be written"))?;
    say(format_args!(
        "{}wrote {shown}\n",
        report(&camera, notices, false)?
    ))?;
    Ok(())
}

/// Reads the options, and asks for what they do not say.
fn ask(
    given: &[Option<String>; 6],
    input: &mut impl BufRead,
    output: &mut impl Write,
) -> anyhow::Result<Vec<Answer>> {
    let mut answers = Vec::new();
    for (question, given) in QUESTIONS.iter().zip(given) {
        if let Some(text) = given {
            answers.push(read(question, text)?);
            continue;
        }
        loop {
            write!(output, "{} [{}]: ", question.asks, question.default)?;
            output.flush()?;
            let mut line = String::new();
            if input.read_line(&mut line)? == 0 {
                bail!(
                    "the input ended before {}; nothing is written",
                    question.option
                );
            }
            let text = match line.trim() {
                "" => question.default,
                text => text,
            };
            match (question.read)(text) {
                Ok(answer) => {
                    answers.push(answer);
                    break;
                }
                Err(why) => writeln!(output, "  {why}")?,
            }
        }
    }
    Ok(answers)
}

/// Reads the options; an error names those that are missing.
fn all_given(given: &[Option<String>; 6]) -> anyhow::Result<Vec<Answer>> {
    let all = || QUESTIONS.iter().zip(given);
    let missing: Vec<&str> = all()
        .filter(|(_, given)| given.is_none())
        .map(|(question, _)| question.option)
        .collect();
    if !missing.is_empty() {
        bail!(
            "standard input is no terminal to ask at: give {}",
            missing.join(", ")
        );
    }
    let given = all().filter_map(|(question, given)| Some((question, given.as_ref()?)));
    given.map(|(question, text)| read(question, text)).collect()
}

fn read(question: &Question, text: &str) -> anyhow::Result<Answer> {
    (question.read)(text.trim()).map_err(|why| anyhow::anyhow!("{} {why}", question.option))
}

fn number(text: &str, least: f64, most: f64, unit: &str) -> Result<Answer, String> {
    match text.parse::<f64>() {
        Ok(value) if (least..=most).contains(&value) => Ok(([value, 0.0], false)),
        _ => Err(format!("{text:?}: must be {least} to {most} {unit}")),
    }
}

fn size(text: &str) -> Result<Answer, String> {
    let sides = text.split(['x', 'X', '*']).map(|side| side.trim().parse());
    let sides: Vec<u32> = sides.collect::<Result<_, _>>().unwrap_or_default();
    match sides[..] {
        [width, height] if (1..=8192).contains(&width) && (1..=8192).contains(&height) => {
            Ok(([f64::from(width), f64::from(height)], false))
        }
        _ => Err(format!(
            "{text:?}: must be columns x rows, 1 to 8192 each, such as 1280x1024"
        )),
    }
}

fn focal(text: &str) -> Result<Answer, String> {
    match text.strip_suffix("deg") {
        Some(field) => number(field.trim(), 0.01, 150.0, "deg").map(|(value, _)| (value, true)),
        None => number(text, 0.5, 1e6, "mm, or a field of view, such as 20deg"),
    }
}

fn aperture(text: &str) -> Result<Answer, String> {
    match text.strip_prefix("f/").or(text.strip_prefix("F/")) {
        Some(ratio) => {
            number(ratio.trim(), 0.5, 500.0, "as focal ratio").map(|(value, _)| (value, true))
        }
        None => number(text, 0.01, 1e5, "mm, or a focal ratio, such as f/1.4"),
    }
}

/// The file of these answers, in the order of the questions.
fn file_text(name: &str, answers: &[Answer]) -> String {
    let at = |question: usize| answers.get(question).copied().unwrap_or_default();
    let [width, height] = at(0).0;
    let of = |question: usize| (at(question).0[0], at(question).1);
    let (pixel_um, (focal, is_field), (aperture, is_ratio)) = (of(1).0, of(2), of(3));
    let (exposure_s, full_well_e) = (of(4).0, of(5).0);
    // A pinhole's field w of n pixels p: f = n p / (2 tan(w/2)).
    let focal_mm = match is_field {
        true => width * pixel_um * 1e-3 / (2.0 * (focal.to_radians() / 2.0).tan()),
        false => focal,
    };
    let aperture_mm = if is_ratio {
        focal_mm / aperture
    } else {
        aperture
    };
    // Full wells at the converter's end, above an offset of 32 of 4095.
    let gain = full_well_e / 4063.0;
    let rate_hz = (1.0 / exposure_s).min(5.0);
    format!(
        "# Written by `skyloop camera new`. [given]: from the data sheet. [assumed]: typical; replace it by what you know.\n\
         # All keys: README.md, Cameras. Check: skyloop camera check FILE\n\
         name = {name:?}\n\
         \n[optics]\n\
         focal_length_mm = {focal_mm:?}    # mm [given]\n\
         aperture_mm = {aperture_mm:?}    # mm, diameter of the entrance pupil [given]\n\
         transmission = 0.8    # 1 [assumed]\n\
         band = \"silicon\"    # \"v\", \"silicon\" (350-1050 nm), or [from, to] in nm [assumed]\n\
         \n[optics.psf]\n\
         kind = \"gaussian\"    # \"gaussian\", \"airy\", \"moffat\" or \"image\" [assumed]\n\
         sigma_px = 0.8    # px [assumed: slightly defocused for centroiding]\n\
         \n[detector]\n\
         width_px = {width}    # px [given]\n\
         height_px = {height}    # px [given]\n\
         pixel_um = {pixel_um:?}    # um [given]\n\
         quantum_efficiency = 0.6    # 1, peak of the band's response [assumed]\n\
         dark_e_s = 30.0    # e-/s a pixel at 20 deg C [assumed]\n\
         read_noise_e = 7.0    # e- rms [assumed]\n\
         full_well_e = {full_well_e:?}    # e- [given]\n\
         gain_e_per_dn = {gain:?}    # e-/DN [assumed: full well at full scale]\n\
         offset_dn = 32.0    # DN [assumed]\n\
         adc_bits = 12    # bits [assumed]\n\
         \n[timing]\n\
         exposure_s = {exposure_s:?}    # s [given]\n\
         rate_hz = {rate_hz:?}    # Hz [assumed: 5, or as exposures allow]\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_asked_for_again_until_they_can_be_used() {
        let given = [None, None, None, Some("12".to_string()), None, None];
        let mut said = Vec::new();
        let typed = "huge\n640 x 480\n\n-3\n20deg\nnan\n0.2\n50000\n";
        let answers = ask(&given, &mut typed.as_bytes(), &mut said).unwrap();
        let said = String::from_utf8(said).unwrap();
        for words in [
            "columns x rows, 1 to 8192",
            "\"-3\": must be 0.5",
            "\"nan\": must be",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
        let (camera, notices) =
            Camera::parse_noticed("new.toml", &file_text("new \"one\"", &answers)).unwrap();
        assert_eq!(notices, Vec::<String>::new());
        assert_eq!(camera.name, "new \"one\"");
        assert_eq!(camera.detector.sides(), [640.0, 480.0]);
        // X-Val: 640 * 4.8 um / (2 tan 10 deg) = 8.711 mm, 1814.9 px.
        assert!(
            (camera.optics.focal_px - 1814.8).abs() < 0.5,
            "{}",
            camera.optics.focal_px
        );
        assert_eq!((camera.optics.aperture_m, camera.exposure_s), (0.012, 0.2));
        let ended = ask(&given, &mut "".as_bytes(), &mut Vec::new());
        assert!(ended.unwrap_err().to_string().contains("--size"));
    }
}
