//! FITS 4.0: one image in the primary header and data unit.

use super::sip::Sip;
use super::wcs::Wcs;
use nalgebra::Matrix3;
use skyloop_orbit::time::{parse_utc, utc_mjd};
use skyloop_render::camera::Camera;
use skyloop_render::label::Label;
use std::io::{self, Write};

/// Headers and data are padded to whole blocks.
const BLOCK: usize = 2880;
const CARD: usize = 80;

/// Conventions that a reader of the header needs; at most 72 characters per line.
const COMMENT: &str = "\
Attitudes: unit quaternions, Hamilton, scalar last (W), v' = q v q^-1.
They, RA, DEC, PA_PNT and the WCS hold at DATE-AVG; DATE-OBS is
DATE-BEG. The WCS gives apparent directions on ICRF axes; RA and DEC are
those of the boresight, equal to CRVAL. Row 0 of the camera, the first
in memory and the top one of the PNG, is row 1 here, which most viewers
show at the bottom. Pixel (x, y) of a label, counted from 0 at the
centre of the first pixel, is FITS pixel (x + 1, y + 1).";

/// The cards of a header that describe the frame, after those that describe the array.
#[derive(Debug, Clone, Default)]
pub(crate) struct Header {
    cards: Vec<String>,
}

impl Header {
    /// Camera, times, attitude and world coordinates of a frame.
    pub fn of_frame(camera: &Camera, label: &Label) -> Header {
        let mut h = Header::default();
        h.text("INSTRUME", &camera.name, "camera");
        h.text("FILTER", camera.optics.band.name(), "band");
        h.integer("FRAME", u64::from(label.frame), "number in the run, from 0");
        h.integer("SEED", label.seed, "seed of the noise");
        h.text("TIMESYS", "UTC", "of all times");
        h.times(label);
        h.real("XPOSURE", label.exposure_s, "[s] exposure time");
        h.real("EXPTIME", label.exposure_s, "[s] exposure time");
        let detector = &camera.detector;
        h.real("GAIN", detector.gain_e_per_dn, "[electron/adu] gain");
        h.real("OFFSET", detector.offset_dn, "[adu] digits of no charge");
        h.real("RDNOISE", detector.read_noise_e, "[electron] read noise");
        let saturate = u64::from(detector.saturation_dn());
        h.integer("SATURATE", saturate, "[adu] full well or full scale");
        h.real("RA", label.ra_deg, "[deg] boresight, right ascension");
        h.real("DEC", label.dec_deg, "[deg] boresight, declination");
        h.real(
            "PA_PNT",
            label.roll_deg,
            "[deg] roll: -Y from north through east",
        );
        for (axis, q) in ["X", "Y", "Z", "W"].iter().zip(label.q_icrf_to_body) {
            h.real(&format!("Q_{axis}"), q, "attitude, ICRF to body");
        }
        for (axis, q) in ["X", "Y", "Z", "W"].iter().zip(label.q_body_to_camera) {
            h.real(&format!("QMOUNT_{axis}"), q, "mounting, body to camera");
        }
        h.world_coordinates(camera, label);
        for line in COMMENT.lines() {
            h.push(format!("COMMENT {line}"));
        }
        h
    }

    /// Start, middle and end of the exposure, each as a date and as a modified Julian date (FITS
    /// 4.0, section 9.5).
    fn times(&mut self, label: &Label) {
        for (name, text, comment) in [
            ("OBS", &label.epoch_start, "exposure start"),
            ("BEG", &label.epoch_start, "exposure start"),
            ("AVG", &label.epoch_mid, "exposure middle"),
            ("END", &label.epoch_end, "exposure end"),
        ] {
            // FITS times have no zone suffix: TIMESYS gives the zone.
            let date = text.trim_end_matches('Z');
            self.text(&format!("DATE-{name}"), date, comment);
            if let Ok(epoch) = parse_utc(text) {
                let name = format!("MJD-{name}");
                self.real(&name, utc_mjd(epoch), &format!("[d] {comment}"));
            }
        }
    }

    fn world_coordinates(&mut self, camera: &Camera, label: &Label) {
        let [x, y, z] = label.r_icrf_to_camera;
        let matrix = Matrix3::from_rows(&[x.into(), y.into(), z.into()]);
        let wcs = Wcs::new(camera, &matrix);
        let suffix = if wcs.sip.is_some() { "-SIP" } else { "" };
        let kind = |axis: &str| format!("{axis}{}{suffix}", wcs.name);
        self.integer("WCSAXES", 2, "world coordinate axes");
        self.text("RADESYS", "ICRS", "axes of the coordinates");
        let geometry = if wcs.name == "TAN" {
            "gnomonic"
        } else {
            "equidistant"
        };
        self.text(
            "CTYPE1",
            &kind("RA---"),
            &format!("right ascension, {geometry}"),
        );
        self.text(
            "CTYPE2",
            &kind("DEC--"),
            &format!("declination, {geometry}"),
        );
        self.text("CUNIT1", "deg", "");
        self.text("CUNIT2", "deg", "");
        self.real("CRPIX1", wcs.reference_px[0], "principal point, column + 1");
        self.real("CRPIX2", wcs.reference_px[1], "principal point, row + 1");
        self.real("CRVAL1", wcs.reference_deg[0], "[deg] boresight");
        self.real("CRVAL2", wcs.reference_deg[1], "[deg] boresight");
        for (i, row) in (1..).zip(wcs.cd_deg_px) {
            for (j, value) in (1..).zip(row) {
                self.real(&format!("CD{i}_{j}"), value, "[deg/pix]");
            }
        }
        // The default would be 0 for a boresight exactly at the pole.
        self.real("LONPOLE", 180.0, "[deg] native longitude of the pole");
        if let Some(sip) = &wcs.sip {
            self.distortion(sip);
        }
    }

    fn distortion(&mut self, sip: &Sip) {
        for (names, terms) in [(["A", "B"], &sip.forward), (["AP", "BP"], &sip.back)] {
            for (k, name) in names.into_iter().enumerate() {
                self.integer(
                    &format!("{name}_ORDER"),
                    sip.order as u64,
                    "of the polynomial",
                );
                for ([p, q], values) in terms {
                    self.real(&format!("{name}_{p}_{q}"), values[k], "");
                }
            }
        }
        self.real("A_DMAX", sip.most_px, "[pix] greatest correction");
        self.real("B_DMAX", sip.most_px, "[pix] greatest correction");
        self.real(
            "SIPERR",
            sip.residual_px,
            "[pix] greatest error of the polynomials",
        );
    }

    /// A string card: quotes doubled, at least 8 characters, truncated to the length of a card.
    fn text(&mut self, keyword: &str, value: &str, comment: &str) {
        let mut quoted = String::new();
        for c in value.chars() {
            let printable = if matches!(c, ' '..='~') { c } else { '?' };
            let width = if printable == '\'' { 2 } else { 1 };
            if quoted.len() + width > 68 {
                break;
            }
            quoted.extend(std::iter::repeat_n(printable, width));
        }
        self.card(
            keyword,
            &format!("{:<20}", format!("'{quoted:<8}'")),
            comment,
        );
    }

    fn integer(&mut self, keyword: &str, value: u64, comment: &str) {
        self.card(keyword, &format!("{value:>20}"), comment);
    }

    fn real(&mut self, keyword: &str, value: f64, comment: &str) {
        self.card(keyword, &format!("{:>20}", real(value)), comment);
    }

    fn logical(&mut self, keyword: &str, comment: &str) {
        self.card(keyword, &format!("{:>20}", "T"), comment);
    }

    fn card(&mut self, keyword: &str, value: &str, comment: &str) {
        let slash = if comment.is_empty() { "" } else { " / " };
        self.push(format!("{keyword:<8}= {value}{slash}{comment}"));
    }

    /// Adds a card. Every character is ASCII, so bytes are characters.
    fn push(&mut self, mut card: String) {
        card.truncate(CARD);
        self.cards.push(format!("{card:<CARD$}"));
    }
}

/// A number in at most 20 characters, the fixed format's width: the shortest form if it fits, else
/// with 14 significant digits; empty (FITS: undefined) if it is not finite.
fn real(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    let short = format!("{value:?}").replace('e', "E");
    let text = if short.len() <= 20 {
        short
    } else {
        format!("{value:.13E}")
    };
    // FITS requires a decimal point before an exponent too.
    match text.split_once('E') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.0E{exponent}"),
        _ => text,
    }
}

/// Writes digital numbers as 16-bit unsigned integers; `size` is columns and rows.
pub(crate) fn write_u16(
    out: &mut impl Write,
    frame: Header,
    size: [usize; 2],
    dn: &[u16],
) -> io::Result<()> {
    let mut array = array(16, size);
    array.integer("BZERO", 32768, "unsigned: stored + 32768");
    array.integer("BSCALE", 1, "");
    array.text("BUNIT", "adu", "digital numbers, raw");
    // FITS 4.0, 5.2.5: subtracting 32768 flips the highest bit.
    let stored = dn.iter().map(|dn| (dn ^ 0x8000).to_be_bytes());
    write(out, [array, frame], stored)
}

/// Writes expected electrons as 32-bit IEEE numbers; `size` is columns and rows.
pub(crate) fn write_f32(
    out: &mut impl Write,
    frame: Header,
    size: [usize; 2],
    electrons: &[f32],
) -> io::Result<()> {
    let mut array = array(-32, size);
    array.text("BUNIT", "electron", "expected, before any noise");
    write(
        out,
        [array, frame],
        electrons.iter().map(|e| e.to_be_bytes()),
    )
}

fn array(bitpix: i64, [columns, rows]: [usize; 2]) -> Header {
    let mut h = Header::default();
    h.logical("SIMPLE", "FITS 4.0");
    h.card("BITPIX", &format!("{bitpix:>20}"), "bits of a stored value");
    h.integer("NAXIS", 2, "");
    h.integer("NAXIS1", columns as u64, "columns");
    h.integer("NAXIS2", rows as u64, "rows");
    h
}

fn write<const N: usize>(
    out: &mut impl Write,
    headers: [Header; 2],
    values: impl ExactSizeIterator<Item = [u8; N]>,
) -> io::Result<()> {
    let mut text: String = headers.iter().flat_map(|h| &h.cards).cloned().collect();
    text.push_str(&format!("{:<CARD$}", "END"));
    out.write_all(text.as_bytes())?;
    fill(out, text.len(), b' ')?;
    let bytes = values.len() * N;
    for value in values {
        out.write_all(&value)?;
    }
    fill(out, bytes, 0)
}

fn fill(out: &mut impl Write, written: usize, with: u8) -> io::Result<()> {
    out.write_all(&vec![with; written.next_multiple_of(BLOCK) - written])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fit_the_fixed_format_with_fourteen_digits() {
        assert_eq!(real(0.1), "0.1");
        assert_eq!(real(180.0), "180.0");
        assert_eq!(real(1e-7), "1.0E-7");
        assert_eq!(real(-1e300), "-1.0E300");
        assert_eq!(real(f64::NAN), "");
        for value in [
            -std::f64::consts::PI * 1e-5,
            248.112_345_678_901_23,
            -1.0 / 3.0,
        ] {
            let text = real(value);
            assert!(text.len() <= 20, "{text}");
            assert!((text.parse::<f64>().unwrap() / value - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn comment_fits_its_cards() {
        let fits = |line: &str| line.len() <= CARD - "COMMENT ".len();
        assert!(COMMENT.is_ascii() && COMMENT.lines().all(fits));
    }

    #[test]
    fn unusual_strings_stay_within_a_card() {
        let mut h = Header::default();
        h.text("INSTRUME", &"it's \u{fc}".repeat(30), "camera");
        h.text("FILTER", "", "band");
        h.integer("SEED", u64::MAX, "seed");
        assert!(
            h.cards
                .iter()
                .all(|card| card.len() == CARD && card.is_ascii())
        );
        assert!(h.cards[0].starts_with("INSTRUME= 'it''s ?it''s ?"));
        let value = &h.cards[0][11..];
        assert_eq!(
            value.matches('\'').count() % 2,
            1,
            "every quote doubled, one that ends: {value}"
        );
        assert!(h.cards[1].starts_with("FILTER  = '        '           / band"));
        assert!(h.cards[2].starts_with("SEED    = 18446744073709551615 / seed"));
    }
}
