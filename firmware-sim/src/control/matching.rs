//! Stars of one frame found again in another.

/// Square of the distance of two places, px^2.
fn apart([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    (ax - bx) * (ax - bx) + (ay - by) * (ay - by)
}

/// The shift (px) that takes most of the `expected` places to places `seen`, by the brightest of both (they come first); `None` if there is
/// not even one pair.
///
/// Every pair of bright stars is asked how many others come to lie on a star by its shift; the mean over those is given.
pub(super) fn shift(expected: &[Option<[f64; 2]>], seen: &[[f64; 2]]) -> Option<[f64; 2]> {
    const BRIGHTEST: usize = 40;
    const FARTHEST_PX: f64 = 100.0;
    /// A star is hit within this, px.
    const HIT_PX: f64 = 1.5;
    let bright: Vec<[f64; 2]> = expected.iter().flatten().copied().take(BRIGHTEST).collect();
    let seen = seen.get(..BRIGHTEST).unwrap_or(seen);
    let mut best: Option<(usize, f64, [f64; 2])> = None;
    for from in &bright {
        for to in seen {
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let far = dx * dx + dy * dy;
            if far > FARTHEST_PX * FARTHEST_PX {
                continue;
            }
            let (mut hits, mut sum) = (0, [0.0, 0.0]);
            for [x, y] in &bright {
                let place = [x + dx, y + dy];
                let off = |at: &[f64; 2]| apart(*at, place);
                let nearest = seen.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
                if let Some(hit) = nearest.filter(|at| apart(**at, place) < HIT_PX * HIT_PX) {
                    hits += 1;
                    sum = [sum[0] + hit[0] - x, sum[1] + hit[1] - y];
                }
            }
            // Of shifts that are as good the smaller one.
            let better =
                best.is_none_or(|(most, least, _)| hits > most || hits == most && far < least);
            if better && hits > 0 {
                let count = f64::from(hits as u32);
                best = Some((hits, far, [sum[0] / count, sum[1] / count]));
            }
        }
    }
    best.map(|(_, _, shift)| shift)
}

/// Nearest pairs within a radius (px), the nearest first, each place once: indices of expected and seen.
pub(super) fn pairs(
    expected: &[Option<[f64; 2]>],
    seen: &[[f64; 2]],
    radius_px: f64,
) -> Vec<(usize, usize)> {
    let mut near = Vec::new();
    for (of, place) in expected.iter().enumerate() {
        let Some(place) = place else { continue };
        let off = seen.iter().map(|at| apart(*at, *place));
        let off = off.enumerate().map(|(to, off)| (off, of, to));
        near.extend(off.filter(|(off, _, _)| *off < radius_px * radius_px));
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut used, mut taken) = (vec![false; expected.len()], vec![false; seen.len()]);
    let mut pairs = Vec::new();
    for (_, of, to) in near {
        if !used[of] && !taken[to] {
            (used[of], taken[to]) = (true, true);
            pairs.push((of, to));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_is_matched_once_and_the_nearest_first() {
        let expected = [Some([0.0, 0.0]), None, Some([1.0, 0.0]), Some([9.0, 9.0])];
        let seen = [[0.9, 0.0], [0.2, 0.0], [50.0, 50.0]];
        assert_eq!(pairs(&expected, &seen, 2.0), [(2, 0), (0, 1)]);
        assert!(pairs(&expected, &[], 2.0).is_empty());
    }

    #[test]
    fn the_shift_of_most_wins() {
        let stars = [[0.0, 0.0], [40.0, 10.0], [13.0, 55.0], [70.0, 71.0]];
        let mut expected: Vec<_> = stars.map(Some).to_vec();
        let mut seen: Vec<_> = stars.map(|[x, y]| [x + 20.5, y - 30.25]).to_vec();
        // Two that stay.
        expected.extend([Some([5.0, 80.0]), Some([90.0, 2.0])]);
        seen.extend([[5.0, 80.0], [90.0, 2.0]]);
        let [dx, dy] = shift(&expected, &seen).unwrap();
        assert!((dx - 20.5).abs() < 1e-9 && (dy + 30.25).abs() < 1e-9);
        assert_eq!(shift(&expected, &[]), None);
    }
}
