//! `skyloop camera new`: a camera file from the six values of a data sheet.

use super::check::report;
use crate::cli::common::{Force, is_stdout};
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use skyloop::camera::Camera;
use skyloop::orbit::path_text;
use skyloop::orbit::{NO_MARK, OutputFile};
use skyloop_firmware_sim::console::{printable, say, write_out};
use std::io::{BufRead, IsTerminal, Write, stderr, stdin};
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// File to write, or - for standard output; its name without extension becomes the name of the
    /// camera
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
    #[command(flatten)]
    force: Force,
}

struct Question {
    option: &'static str,
    prompt: &'static str,
    default: &'static str,
    /// Parses an answer; the error names the permitted values.
    read: fn(&str) -> Result<Answer, String>,
}

/// One or two numbers, and whether the value is in the alternative unit: deg or a ratio instead of
/// mm.
type Answer = ([f64; 2], bool);

const QUESTIONS: [Question; 6] = [
    Question {
        option: "--size",
        prompt: "Sensor, columns x rows (px)",
        default: "1280x1024",
        read: size,
    },
    Question {
        option: "--pixel",
        prompt: "Pixel pitch (um)",
        default: "4.8",
        read: |text| number(text, 0.3, 1e3, "um"),
    },
    Question {
        option: "--focal",
        prompt: "Focal length (mm), or field of view along the rows, such as 20deg",
        default: "16",
        read: focal,
    },
    Question {
        option: "--aperture",
        prompt: "Aperture: diameter (mm), or focal ratio, such as f/1.4",
        default: "f/1.4",
        read: aperture,
    },
    Question {
        option: "--exposure",
        prompt: "Exposure time (s)",
        default: "0.1",
        read: |text| number(text, 1e-6, 1e4, "s"),
    },
    Question {
        option: "--full-well",
        prompt: "Full well (e-)",
        default: "10000",
        read: |text| number(text, 100.0, 1e9, "e-"),
    },
];

pub fn run(args: Args) -> anyhow::Result<()> {
    let shown = path_text(&args.file);
    let to_stdout = is_stdout(&args.file);
    // Users edit camera files, so an existing one is replaced by force only. It is opened before
    // the prompts.
    let output = (!to_stdout).then(|| OutputFile::open(&args.file, NO_MARK, args.force.force));
    let output = output.transpose().with_context(|| shown.clone())?;
    let given = [
        args.size,
        args.pixel,
        args.focal,
        args.aperture,
        args.exposure,
        args.full_well,
    ];
    let answers = if stdin().is_terminal() {
        prompt_for(&given, &mut stdin().lock(), &mut stderr())?
    } else {
        all_given(&given)?
    };
    let name = if to_stdout {
        "camera".into()
    } else {
        args.file.file_stem().unwrap_or_default().to_string_lossy()
    };
    let text = file_text(&name, &answers);
    let (camera, notices) = Camera::parse_noticed(&shown, &text)
        .context("no valid camera from these values; nothing is written")?;
    let report = report(&camera, notices, false)?;
    let Some(mut output) = output else {
        eprint!("{}", printable(&report));
        write_out(text)?;
        return Ok(());
    };
    let written = output.write(text.as_bytes());
    written.with_context(|| format!("{shown}: cannot be written"))?;
    say(format_args!("{report}wrote {shown}\n"))?;
    Ok(())
}

/// Parses the options, and prompts for the missing ones.
fn prompt_for(
    given: &[Option<String>; 6],
    input: &mut impl BufRead,
    output: &mut impl Write,
) -> anyhow::Result<Vec<Answer>> {
    check(given)?;
    let mut answers = Vec::new();
    for (question, given) in QUESTIONS.iter().zip(given) {
        if let Some(text) = given {
            answers.push(read(question, text).map_err(anyhow::Error::msg)?);
            continue;
        }
        loop {
            write!(output, "{} [{}]: ", question.prompt, question.default)?;
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
                Err(why) => writeln!(output, "  {}", printable(&format!("{text:?}: {why}")))?,
            }
        }
    }
    Ok(answers)
}

/// Parses the options; the error lists all missing and wrong ones.
fn all_given(given: &[Option<String>; 6]) -> anyhow::Result<Vec<Answer>> {
    let missing: Vec<&str> = QUESTIONS
        .iter()
        .zip(given)
        .filter(|(_, given)| given.is_none())
        .map(|(question, _)| question.option)
        .collect();
    if !missing.is_empty() {
        let missing = missing.join(", ");
        let missing = format!("standard input is no terminal for questions: give {missing}");
        bail!(lines(std::iter::once(missing).chain(wrong(given))));
    }
    check(given)?;
    let given = QUESTIONS.iter().zip(given);
    let given = given.filter_map(|(question, given)| Some((question, given.as_ref()?)));
    let answers = given.map(|(question, text)| read(question, text));
    answers
        .collect::<Result<_, _>>()
        .map_err(anyhow::Error::msg)
}

/// Errors: all wrong options, one per line.
fn check(given: &[Option<String>; 6]) -> anyhow::Result<()> {
    let wrong: Vec<String> = wrong(given).collect();
    if wrong.is_empty() {
        return Ok(());
    }
    bail!(lines(wrong.into_iter()));
}

fn wrong(given: &[Option<String>; 6]) -> impl Iterator<Item = String> {
    let given = QUESTIONS.iter().zip(given);
    given.filter_map(|(question, given)| read(question, given.as_ref()?).err())
}

/// A single fault as it is, several with one line each.
fn lines(faults: impl Iterator<Item = String>) -> String {
    let faults: Vec<String> = faults.collect();
    match &faults[..] {
        [fault] => fault.clone(),
        _ => format!("{} faults:\n  {}", faults.len(), faults.join("\n  ")),
    }
}

fn read(question: &Question, text: &str) -> Result<Answer, String> {
    let text = text.trim();
    (question.read)(text).map_err(|why| format!("{} {text:?}: {why}", question.option))
}

/// A number without a unit.
fn number(text: &str, min: f64, max: f64, unit: &str) -> Result<Answer, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
    match value {
        Some(value) if (min..=max).contains(&value) => Ok(([value, 0.0], false)),
        Some(_) => Err(format!("must be {min} to {max} {unit}")),
        None => Err(format!(
            "must be a number in {unit}, {min} to {max}, without a unit"
        )),
    }
}

fn size(text: &str) -> Result<Answer, String> {
    let sides = text.split(['x', 'X', '*']).map(|side| side.trim().parse());
    let sides: Vec<u32> = sides.collect::<Result<_, _>>().unwrap_or_default();
    match sides[..] {
        [width, height] if (1..=8192).contains(&width) && (1..=8192).contains(&height) => {
            Ok(([f64::from(width), f64::from(height)], false))
        }
        _ => Err("must be columns x rows in px, 1 to 8192 each, such as 1280x1024".to_string()),
    }
}

fn focal(text: &str) -> Result<Answer, String> {
    if let Some(field) = text.strip_suffix("deg") {
        return number(field.trim(), 0.01, 150.0, "deg").map(|(value, _)| (value, true));
    }
    let focal = number(text, 0.5, 1e6, "mm");
    focal.map_err(|why| why + "; or a field of view, such as 20deg")
}

fn aperture(text: &str) -> Result<Answer, String> {
    if let Some(ratio) = text.strip_prefix("f/").or(text.strip_prefix("F/")) {
        let ratio = ratio.trim().parse::<f64>().ok();
        let ratio = ratio.filter(|ratio| (0.5..=500.0).contains(ratio));
        let ratio = ratio.ok_or("must be a focal ratio of 0.5 to 500, such as f/1.4")?;
        return Ok(([ratio, 0.0], true));
    }
    let aperture = number(text, 0.01, 1e5, "mm");
    aperture.map_err(|why| why + "; or a focal ratio, such as f/1.4")
}

fn file_text(name: &str, answers: &[Answer]) -> String {
    let at = |question: usize| answers.get(question).copied().unwrap_or_default();
    let [width, height] = at(0).0;
    let of = |question: usize| (at(question).0[0], at(question).1);
    let (pixel_um, (focal, is_field), (aperture, is_ratio)) = (of(1).0, of(2), of(3));
    let (exposure_s, full_well_e) = (of(4).0, of(5).0);
    // Field w of a pinhole with n pixels of pitch p: f = n p / (2 tan(w/2)).
    let focal_mm = if is_field {
        width * pixel_um * 1e-3 / (2.0 * (focal.to_radians() / 2.0).tan())
    } else {
        focal
    };
    let aperture_mm = if is_ratio {
        focal_mm / aperture
    } else {
        aperture
    };
    // Full well at full scale, with an offset of 32 of 4095.
    let gain = full_well_e / 4063.0;
    let rate_hz = (1.0 / exposure_s).min(5.0);
    format!(
        "# Written by `skyloop camera new`. [given]: from the data sheet. [assumed]: typical; replace it by what you know.\n\
         # All keys: docs/reference/configuration.md. Check: skyloop camera check FILE\n\
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
    fn questions_are_repeated_until_the_answer_is_valid() {
        let given = [None, None, None, Some("12".to_string()), None, None];
        let mut prompts = Vec::new();
        let typed = "huge\n640 x 480\n\n-3\n20deg\nnan\n0.2\n50000\n";
        let answers = prompt_for(&given, &mut typed.as_bytes(), &mut prompts).unwrap();
        let prompts = String::from_utf8(prompts).unwrap();
        for words in [
            "columns x rows in px, 1 to 8192",
            "\"-3\": must be 0.5 to 1000000 mm; or a field",
            "\"nan\": must be a number in s",
        ] {
            assert!(prompts.contains(words), "{words}: {prompts}");
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
        let ended = prompt_for(&given, &mut "".as_bytes(), &mut Vec::new());
        assert!(ended.unwrap_err().to_string().contains("--size"));
        let wrong =
            ["0x4", "5.5um", "1e9", "f/0", "0.1 s", "-1"].map(|text| Some(text.to_string()));
        let text = all_given(&wrong).unwrap_err().to_string();
        for words in [
            "6 faults:\n  --size \"0x4\": must be columns x rows in px",
            "\n  --pixel \"5.5um\": must be a number in um, 0.3 to 1000, without a unit",
            "\n  --focal \"1e9\": must be 0.5 to 1000000 mm; or a field of view",
            "\n  --aperture \"f/0\": must",
            "\n  --exposure \"0.1 s\": must be a number in s",
            "\n  --full-well \"-1\": must be 100 to",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }
}
