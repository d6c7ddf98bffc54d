//! The two views from which a scene is reconstructed first, chosen among all of them.

use crate::uncalibrated::fundamental;
use crate::uncalibrated::{Match, Point};
use hybank_linalg::small;

/// Parallax in pixels from which on more of it does not make a pair better than more matches would.
const PARALLAX: f64 = 4.0;

/// Pairs that are tried, at most: those with most common tracks.
const MOST_PAIRS: usize = 60;

/// All views by number, the base pair first: the pair with the most matches that agree on one F, each
/// counted the more, the more the points move against each other. The first two views if no pair has an F.
pub(super) fn order(tracks: &[Vec<Option<Point>>], views: usize, seed: u64) -> Vec<usize> {
    let pairs = (0..views).flat_map(|i| (i + 1..views).map(move |j| [i, j]));
    let mut common: Vec<([usize; 2], Vec<Match>)> =
        pairs.map(|pair| (pair, matches(tracks, pair[0], pair[1]))).collect();
    common.sort_by_key(|(_, matches)| std::cmp::Reverse(matches.len()));
    let score = |matches: &[Match]| {
        let f = fundamental::robust(matches, seed).ok()?;
        let agreeing: Vec<Match> = f.inliers.iter().map(|i| matches[*i]).collect();
        let parallax = parallax(&agreeing)?;
        Some(agreeing.len() as f64 * parallax / (parallax + PARALLAX))
    };
    let scored = common.iter().take(MOST_PAIRS).filter_map(|(pair, m)| Some((pair, score(m)?)));
    let best = scored.max_by(|a, b| a.1.total_cmp(&b.1)).map_or([0, 1], |(pair, _)| *pair);
    best.into_iter().chain((0..views).filter(|view| !best.contains(view))).collect()
}

/// The points that two columns of the tracks share.
pub(super) fn matches(tracks: &[Vec<Option<Point>>], first: usize, second: usize) -> Vec<Match> {
    let shared =
        |t: &Vec<Option<Point>>| Some(Match { first: (*t.get(first)?)?, second: (*t.get(second)?)? });
    tracks.iter().filter_map(shared).collect()
}

/// How far points move against each other between two views, in pixels: root mean square distance of the
/// second positions from the best affine map of the first ones, which takes rotation and zoom away.
pub(super) fn parallax(matches: &[Match]) -> Option<f64> {
    let rows: Vec<[f64; 3]> = matches.iter().map(|m| [m.first.x, m.first.y, 1.0]).collect();
    let mut sum = 0.0;
    for k in 0..2 {
        let values: Vec<f64> = matches.iter().map(|m| m.second[k]).collect();
        let fit = small::least_squares(&rows, &values)?;
        let miss = |(row, v): (&[f64; 3], &f64)| (0..3).map(|i| row[i] * fit[i]).sum::<f64>() - v;
        sum += rows.iter().zip(&values).map(miss).map(|r| r * r).sum::<f64>();
    }
    Some((sum / matches.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncalibrated::fundamental::tests::Synthetic;

    #[test]
    fn an_affine_map_has_no_parallax() {
        let matches: Vec<Match> = (0..20)
            .map(|i| Point::new(f64::from(i * 37 % 100), f64::from(i * 53 % 90)))
            .map(|p| Match { first: p, second: Point::new(3.0 + 1.1 * p.x - 0.2 * p.y, 0.3 * p.x + p.y) })
            .collect();
        assert!(parallax(&matches).unwrap() < 1e-9);
        let mut moved = matches.clone();
        moved.iter_mut().step_by(2).for_each(|m| m.second.x += 6.0);
        assert!((parallax(&moved).unwrap() - 3.0).abs() < 0.5);
    }

    /// Of three views, two of which hardly differ, the pair with the wide baseline comes first.
    #[test]
    fn the_pair_with_parallax_is_chosen() {
        let scene = Synthetic::new(60, false);
        let close = |j: usize| scene.image(0, j) + (scene.image(1, j) - scene.image(0, j)) * 0.01;
        let track = |j: usize| vec![Some(scene.image(0, j)), Some(close(j)), Some(scene.image(1, j))];
        let tracks: Vec<_> = (0..60).map(track).collect();
        let order = order(&tracks, 3, 1);
        assert!(order[..2].contains(&2) && order.len() == 3, "{order:?}");
    }
}
