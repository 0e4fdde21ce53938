//! Output: the files of one run, in one folder.
//!
//! ```text
//! frame_00000.fits            digital numbers, 16 bit, with times, attitude and WCS
//! frame_00000.png             the same DN, 16-bit grey
//! frame_00000_preview.png     a stretched preview, 8-bit grey
//! frame_00000_electrons.fits  expected electrons, float32, where the frame carries them
//! labels.jsonl                one JSON object per line and frame, with the frame's files
//! contact_sheet.png           up to twelve annotated frames, spread over the run
//! ```
//!
//! `skyloop lightcurve` writes `lightcurve.csv` and `lightcurve.svg` instead, `skyloop cost`
//! `cost.csv` and `cost.svg`.

mod canvas;
mod chart;
mod fits;
mod folder;
mod light_curve;
mod names;
mod panel;
pub mod passes;
mod plot;
mod png;
mod scatter;
mod sheet;
mod sip;
mod stretch;
mod text;
mod wcs;

pub use chart::SVG_MARK;
pub use folder::{OutputError, is_of_run};
pub use light_curve::{may_replace_light_curve, write_light_curve};
pub use scatter::{Dot, Scatter, write_scatter};
pub use text::{make_folder, remove_file, write_files, write_text};

use folder::{ELECTRONS, FITS, Folder, LABELS, PNG, PREVIEW, SHEET};
use sheet::ContactSheet;
use skyloop_orbit::{Mark, OutputFile};
use skyloop_render::camera::Camera;
use skyloop_render::engine::ExposedFrame;
use skyloop_render::frame::Frame;
use skyloop_render::label::Label;
use std::path::Path;
use stretch::Levels;

/// Refuses to replace files in `dir`: the `marked` one and `others` that are written with it.
///
/// Errors: this process has read one of them; without `force`: one lacks its mark, or has a format
/// without a mark while the `marked` file lacks its own.
pub fn may_replace(
    dir: &Path,
    marked: (&str, Mark),
    others: &[(&str, Mark)],
    force: bool,
) -> Result<(), OutputError> {
    Folder::at(dir).may_replace(marked, others, force)
}

/// Writes the files of one run. Memory is bounded: only the sheet's panels are stored.
#[derive(Debug)]
pub struct Writer {
    folder: Folder,
    labels: OutputFile,
    sheet: ContactSheet,
}

impl Writer {
    /// Opens `dir`, creating it if needed, for a run of `frames` frames. `frames` selects the
    /// contact sheet's panels; more or fewer may follow.
    ///
    /// Removes the files of an earlier run that its labels list, and no others.
    ///
    /// Errors: the folder cannot be created or is a file; a file that skyloop did not write, or
    /// that this process has read, has the name of one of the run's; an earlier file cannot be
    /// removed; the labels cannot be created.
    pub fn create(dir: &Path, frames: u32) -> Result<Writer, OutputError> {
        Writer::create_over(dir, frames, false)
    }

    /// [`Writer::create`]; with `force` it replaces any file with the name of one of the run's.
    ///
    /// Errors: those of [`Writer::create`].
    pub fn create_over(dir: &Path, frames: u32, force: bool) -> Result<Writer, OutputError> {
        let folder = Folder::open(dir, force)?;
        let labels = folder.output(LABELS)?;
        Ok(Writer {
            folder,
            labels,
            sheet: ContactSheet::new(frames),
        })
    }

    /// Writes a rendered exposure, as [`Writer::write_frame`] does.
    pub fn write(&mut self, exposed: &ExposedFrame) -> Result<(), OutputError> {
        self.write_frame(
            &exposed.camera,
            &exposed.label,
            &exposed.json,
            &exposed.frame,
        )
    }

    /// Writes one frame: FITS, PNG, preview, expected electrons if present, and its line of labels.
    ///
    /// `camera` is the camera as commanded for this frame (with its gain); `label_json` is the
    /// label as sent. Its line of `labels.jsonl` also lists the frame's `files`.
    ///
    /// Errors: a file cannot be written; then the frame's files are removed, and `labels.jsonl` too
    /// if it is empty.
    pub fn write_frame(
        &mut self,
        camera: &Camera,
        label: &Label,
        label_json: &str,
        frame: &Frame,
    ) -> Result<(), OutputError> {
        let name = folder::frame_name(label.frame);
        let files = [FITS, PNG, PREVIEW, ELECTRONS].map(|end| format!("{name}{end}"));
        let count = files.len() - usize::from(frame.expected_e.is_none());
        let files = &files[..count];
        // One unbuffered call per line: a run that is cut short leaves whole lines.
        let written = self
            .write_files(camera, label, frame, files)
            .and_then(|()| {
                let line = with_files(label_json, files);
                let added = self.labels.append(line.as_bytes());
                added.map_err(|error| self.folder.error("write", LABELS, error))
            });
        if written.is_err() {
            self.folder.remove(files);
            self.labels.discard_empty();
        } else {
            self.sheet.add(camera, label, frame);
        }
        written
    }

    fn write_files(
        &self,
        camera: &Camera,
        label: &Label,
        frame: &Frame,
        files: &[String],
    ) -> Result<(), OutputError> {
        let size = [frame.width, frame.height];
        let header = || fits::Header::of_frame(camera, label);

        self.folder.write(&files[0], |out| {
            fits::write_u16(out, header(), size, &frame.dn)
        })?;
        self.folder
            .write(&files[1], |out| png::write_grey16(out, size, &frame.dn))?;
        let greys = stretch::preview(Levels::of(camera, label), &frame.dn);
        self.folder
            .write(&files[2], |out| png::write_grey8(out, size, &greys))?;
        if let Some(electrons) = &frame.expected_e {
            self.folder.write(&files[3], |out| {
                fits::write_f32(out, header(), size, electrons)
            })?;
        }
        Ok(())
    }

    /// Ends the run with the contact sheet, if there is a frame.
    ///
    /// Errors: the sheet cannot be written.
    pub fn finish(self) -> Result<(), OutputError> {
        match self.sheet.draw() {
            None => Ok(()),
            Some(picture) => self
                .folder
                .write(SHEET, |out| png::write_rgb(out, &picture)),
        }
    }
}

/// A label's line of `labels.jsonl`: its JSON object with the frame's files as the last member.
fn with_files(label_json: &str, files: &[String]) -> String {
    let members = label_json.strip_suffix('}').unwrap_or(label_json);
    let comma = if members.ends_with('{') { "" } else { "," };
    // File names contain nothing that JSON escapes.
    format!(
        "{members}{comma}\"files\":[\"{}\"]}}\n",
        files.join("\",\"")
    )
}
