//! The objects and artifacts of a frame, as one array of the label's text.

use super::artifact::ArtifactLabel;
use super::object::ObjectLabel;
use rayon::prelude::*;
use serde_json::{Result, to_writer};
use std::ops::{Deref, DerefMut};

/// Typical maximum length of an object's text, bytes.
pub(super) const BYTES: usize = 1024;

/// Minimum number of objects whose texts one thread makes.
const TASK: usize = 64;

/// Sources of light and artifacts of a frame: one array in the text. Dereferences to the list of
/// sources.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Objects {
    /// The stars and RSOs in the frame or with light on the detector.
    pub sources: Vec<ObjectLabel>,
    /// Particles and defective pixels.
    pub artifacts: Vec<ArtifactLabel>,
}

impl From<Vec<ObjectLabel>> for Objects {
    fn from(sources: Vec<ObjectLabel>) -> Self {
        let artifacts = Vec::new();
        Objects { sources, artifacts }
    }
}

impl Deref for Objects {
    type Target = Vec<ObjectLabel>;

    fn deref(&self) -> &Self::Target {
        &self.sources
    }
}

impl DerefMut for Objects {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.sources
    }
}

impl<'a> IntoIterator for &'a Objects {
    type Item = &'a ObjectLabel;
    type IntoIter = std::slice::Iter<'a, ObjectLabel>;

    fn into_iter(self) -> Self::IntoIter {
        self.sources.iter()
    }
}

impl Objects {
    /// Appends them as a JSON array. They are most of a label, so their texts are made in parallel
    /// if there are threads for it.
    pub(super) fn write(&self, text: &mut Vec<u8>) -> Result<()> {
        text.push(b'[');
        let empty = text.len();
        write_all(&self.sources, ObjectLabel::write, text)?;
        write_all(
            &self.artifacts,
            |artifact, text| to_writer(text, artifact),
            text,
        )?;
        if text.len() > empty {
            text.pop();
        }
        text.push(b']');
        Ok(())
    }
}

/// Appends all items, each followed by a comma.
fn write_all<T: Sync>(
    all: &[T],
    write: impl Fn(&T, &mut Vec<u8>) -> Result<()> + Sync,
    text: &mut Vec<u8>,
) -> Result<()> {
    let append = |some: &[T], text: &mut Vec<u8>| -> Result<()> {
        for one in some {
            write(one, text)?;
            text.push(b',');
        }
        Ok(())
    };
    if rayon::current_num_threads() == 1 || all.len() <= TASK {
        return append(all, text);
    }
    let texts = all.par_chunks(TASK).map(|some| {
        let mut text = Vec::with_capacity(BYTES * some.len());
        append(some, &mut text).map(|()| text)
    });
    for part in texts.collect::<Result<Vec<Vec<u8>>>>()? {
        text.extend_from_slice(&part);
    }
    Ok(())
}
