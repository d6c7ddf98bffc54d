//! From modes to segments: linking neighbours, then merging small regions.

use super::filter::Mode;
use super::{MeanShift, Segments};

/// Disjoint sets; the representative is always the smallest member.
struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    fn new(n: usize) -> Self {
        Self { parent: (0..n as u32).collect() }
    }

    fn find(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let above = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = above;
            i = above;
        }
        i
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// Labels 0.. in the order of the smallest members, and their number.
    fn labels(&mut self) -> (Vec<u32>, usize) {
        let mut names = vec![0; self.parent.len()];
        let mut count = 0;
        let labels = (0..self.parent.len() as u32)
            .map(|i| {
                let root = self.find(i);
                if root == i {
                    names[i as usize] = count;
                    count += 1;
                }
                names[root as usize]
            })
            .collect();
        (labels, count as usize)
    }
}

/// Calls `visit` with every pair of 4-neighbours.
fn neighbours((width, height): (usize, usize), mut visit: impl FnMut(usize, usize)) {
    for p in 0..width * height {
        if p % width + 1 < width {
            visit(p, p + 1);
        }
        if p + width < width * height {
            visit(p, p + width);
        }
    }
}

fn colour_distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Links, labels and merges.
pub(super) fn connect(size: (usize, usize), modes: &[Mode], settings: &MeanShift) -> Segments {
    let mut sets = Sets::new(modes.len());
    let (colour, spatial) = ((settings.range / 2.0).powi(2), (settings.spatial as f32).powi(2));
    neighbours(size, |p, q| {
        let (a, b) = (&modes[p], &modes[q]);
        let near = (a.x - b.x).powi(2) + (a.y - b.y).powi(2) < spatial;
        if near && colour_distance(&a.luv, &b.luv) < colour {
            sets.join(p as u32, q as u32);
        }
    });
    let (mut labels, mut count) = sets.labels();
    // Every small region merges in each round, so the number of small ones at least halves.
    while let Some(merged) = merge_small(size, &labels, count, modes, settings.smallest) {
        (labels, count) = merged;
    }
    Segments { width: size.0, height: size.1, labels, count }
}

/// Merges each region below `smallest` pixels into its neighbour of nearest mean mode; `None` if there is
/// no such region.
fn merge_small(
    size: (usize, usize),
    labels: &[u32],
    count: usize,
    modes: &[Mode],
    smallest: usize,
) -> Option<(Vec<u32>, usize)> {
    let (pixels, colours) = means(labels, count, modes);
    if count < 2 || pixels.iter().all(|n| *n >= smallest) {
        return None;
    }
    let mut best: Vec<Option<(f32, u32)>> = vec![None; count];
    neighbours(size, |p, q| {
        let (a, b) = (labels[p], labels[q]);
        for (small, other) in [(a, b), (b, a)] {
            if a != b && pixels[small as usize] < smallest {
                let offer = (colour_distance(&colours[small as usize], &colours[other as usize]), other);
                let slot = &mut best[small as usize];
                if slot.is_none_or(|now| offer.0.total_cmp(&now.0).then(offer.1.cmp(&now.1)).is_lt()) {
                    *slot = Some(offer);
                }
            }
        }
    });
    let mut sets = Sets::new(count);
    best.iter().enumerate().for_each(|(small, offer)| {
        if let Some((_, other)) = offer {
            sets.join(small as u32, *other);
        }
    });
    let (names, remaining) = sets.labels();
    Some((labels.iter().map(|l| names[*l as usize]).collect(), remaining))
}

/// Pixels and mean mode colour of each region.
fn means(labels: &[u32], count: usize, modes: &[Mode]) -> (Vec<usize>, Vec<[f32; 3]>) {
    let (mut pixels, mut sums) = (vec![0; count], vec![[0.0_f64; 3]; count]);
    for (label, mode) in labels.iter().zip(modes) {
        pixels[*label as usize] += 1;
        sums[*label as usize].iter_mut().zip(mode.luv).for_each(|(s, c)| *s += f64::from(c));
    }
    let colours = sums.iter().zip(&pixels).map(|(s, n)| s.map(|c| (c / *n as f64) as f32)).collect();
    (pixels, colours)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modes(values: &[f32]) -> Vec<Mode> {
        values.iter().map(|v| Mode { luv: [*v, 0.0, 0.0], ..Mode::default() }).collect()
    }

    fn labels(values: &[f32], size: (usize, usize), smallest: usize) -> Vec<u32> {
        connect(size, &modes(values), &MeanShift { smallest, ..MeanShift::default() }).labels
    }

    #[test]
    fn chains_link_and_steps_separate() {
        assert_eq!(labels(&[0.0, 3.0, 6.0, 30.0, 31.0], (5, 1), 1), [0, 0, 0, 1, 1]);
        // Regions of equal colour that do not touch remain separate.
        assert_eq!(labels(&[0.0, 50.0, 0.0], (3, 1), 1), [0, 1, 2]);
    }

    #[test]
    fn small_regions_join_the_nearest_colour() {
        let row = [0.0, 0.0, 0.0, 40.0, 100.0, 100.0, 100.0];
        assert_eq!(labels(&row, (7, 1), 2), [0, 0, 0, 0, 1, 1, 1]);
        assert_eq!(labels(&row, (7, 1), 100), [0; 7]);
        assert_eq!(labels(&[5.0], (1, 1), 20), [0]);
    }
}
