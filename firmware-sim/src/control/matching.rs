//! Matches stars between two frames.

fn squared_distance([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    (ax - bx) * (ax - bx) + (ay - by) * (ay - by)
}

/// The shift (px) from `expected` to `seen` positions on which most of the brightest stars agree.
/// Both lists start with the brightest; `None` without any pair.
///
/// Each pair of bright stars proposes its shift. The shift with the most matches wins; the result
/// is the mean over its matches.
pub(super) fn shift(expected: &[Option<[f64; 2]>], seen: &[[f64; 2]]) -> Option<[f64; 2]> {
    const BRIGHTEST: usize = 40;
    const FARTHEST_PX: f64 = 100.0;
    /// Matching radius, px.
    const MATCH_PX: f64 = 1.5;
    let bright: Vec<[f64; 2]> = expected.iter().flatten().copied().take(BRIGHTEST).collect();
    let seen = seen.get(..BRIGHTEST).unwrap_or(seen);
    let mut best: Option<(usize, f64, [f64; 2])> = None;
    for from in &bright {
        for to in seen {
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let square = dx * dx + dy * dy;
            if square > FARTHEST_PX * FARTHEST_PX {
                continue;
            }
            let (mut matches, mut sum) = (0, [0.0, 0.0]);
            for [x, y] in &bright {
                let position = [x + dx, y + dy];
                let off = |at: &[f64; 2]| squared_distance(*at, position);
                let nearest = seen.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
                if let Some(matched) =
                    nearest.filter(|at| squared_distance(**at, position) < MATCH_PX * MATCH_PX)
                {
                    matches += 1;
                    sum = [sum[0] + matched[0] - x, sum[1] + matched[1] - y];
                }
            }
            // Among equal shifts the smaller one wins.
            let better =
                best.is_none_or(|(max, min, _)| matches > max || matches == max && square < min);
            if better && matches > 0 {
                let count = f64::from(matches as u32);
                best = Some((matches, square, [sum[0] / count, sum[1] / count]));
            }
        }
    }
    best.map(|(_, _, shift)| shift)
}

/// Nearest pairs within a radius (px), each position once: indices of expected and seen.
pub(super) fn pairs(
    expected: &[Option<[f64; 2]>],
    seen: &[[f64; 2]],
    radius_px: f64,
) -> Vec<(usize, usize)> {
    let mut near = Vec::new();
    for (of, position) in expected.iter().enumerate() {
        let Some(position) = position else { continue };
        let off = seen.iter().map(|at| squared_distance(*at, *position));
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
    fn nearest_pairs_match_each_position_once() {
        let expected = [Some([0.0, 0.0]), None, Some([1.0, 0.0]), Some([9.0, 9.0])];
        let seen = [[0.9, 0.0], [0.2, 0.0], [50.0, 50.0]];
        assert_eq!(pairs(&expected, &seen, 2.0), [(2, 0), (0, 1)]);
        assert!(pairs(&expected, &[], 2.0).is_empty());
    }

    #[test]
    fn the_shift_with_most_matches_wins() {
        let stars = [[0.0, 0.0], [40.0, 10.0], [13.0, 55.0], [70.0, 71.0]];
        let mut expected: Vec<_> = stars.map(Some).to_vec();
        let mut seen: Vec<_> = stars.map(|[x, y]| [x + 20.5, y - 30.25]).to_vec();
        // Two stars do not move.
        expected.extend([Some([5.0, 80.0]), Some([90.0, 2.0])]);
        seen.extend([[5.0, 80.0], [90.0, 2.0]]);
        let [dx, dy] = shift(&expected, &seen).unwrap();
        assert!((dx - 20.5).abs() < 1e-9 && (dy + 30.25).abs() < 1e-9);
        assert_eq!(shift(&expected, &[]), None);
    }
}
