//! The name of an object in a picture.

use skyloop_render::label::ObjectLabel;

/// A star's proper name, else its Bayer or Flamsteed designation, else its HR number; an RSO's
/// first name; the id if there is no name.
pub(crate) fn shown(object: &ObjectLabel) -> &str {
    let best = if object.kind == "star" {
        object.names.iter().min_by_key(|name| rank(name))
    } else {
        object.names.first()
    };
    best.map_or(&object.id, |name| name.trim())
}

/// 0 for a proper name, 1 Bayer, 2 Flamsteed, 3 a catalogue number.
fn rank(name: &str) -> u8 {
    let (first, last) = (
        name.split(' ').next().unwrap_or(name),
        name.rsplit(' ').next().unwrap_or(name),
    );
    if ["HR", "HD", "HIP"].contains(&first) {
        3
    } else if name.starts_with(|c: char| c.is_ascii_digit()) {
        2
    } else if first != last && last.chars().count() == 3 {
        // Constellations have abbreviations of three letters.
        1
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_rank_before_designations_and_numbers() {
        let order = ["Rigil Kentaurus", "alpha1 Cen", "21 And", "HR 5459"];
        let ranks = order.map(rank);
        assert_eq!(ranks, [0, 1, 2, 3]);
        assert_eq!(rank("Alpheratz"), 0);
    }
}
