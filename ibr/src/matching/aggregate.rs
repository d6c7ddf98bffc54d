//! Semi-global aggregation: the sums of the costs of the best paths to a pixel from eight directions.
//!
//! ```text
//! L(p, k) = C(p, k) + min(L(q, k), L(q, k +- 1) + P1, min_j L(q, j) + P2) - min_j L(q, j)
//! ```
//!
//! with q before p on the path. P1 is the price of a slant and P2 that of a jump, which is lower where the
//! photograph has an edge.

use super::census::Costs;

/// P1.
const SLANT: i16 = 4;

/// P2 where the photograph is flat. It halves where neighbours differ by so many grey levels, and is a
/// little more than P1 at least.
const JUMP: f32 = 40.0;
const EDGE: f32 = 10.0;

/// More than every path, and so little that prices can be added.
const NEVER: i16 = i16::MAX / 2;

/// The best paths of one direction to the pixels of a row: [`NEVER`], the costs of the hypotheses and
/// [`NEVER`] for each pixel.
#[derive(Clone)]
struct Paths {
    values: Vec<i16>,
    least: Vec<i16>,
    stride: usize,
}

impl Paths {
    fn new(width: usize, hypotheses: usize) -> Self {
        let stride = hypotheses + 2;
        Self { values: vec![NEVER; width * stride], least: vec![0; width], stride }
    }

    fn at(&self, x: usize) -> &[i16] {
        &self.values[x * self.stride..(x + 1) * self.stride]
    }

    /// Goes on to pixel `x` and adds its paths to `sums`. `from` are the paths to the pixel before with the
    /// least of them, and the price of a jump.
    fn extend(&mut self, x: usize, costs: &[u8], from: Option<(&[i16], i16, i16)>, sums: &mut [i16]) {
        let count = costs.len();
        let here = &mut self.values[x * self.stride + 1..][..count];
        match from {
            None => here.iter_mut().zip(costs).for_each(|(path, cost)| *path = i16::from(*cost)),
            Some((from, least, jump)) => {
                let near = from[..count].iter().zip(&from[1..=count]).zip(&from[2..count + 2]);
                for ((path, cost), ((below, same), above)) in here.iter_mut().zip(costs).zip(near) {
                    let best = (*same).min((*below).min(*above) + SLANT).min(least + jump);
                    *path = i16::from(*cost) + best - least;
                }
            }
        }
        sums.iter_mut().zip(&*here).for_each(|(sum, path)| *sum += path);
        self.least[x] = here.iter().copied().min().unwrap_or(0);
    }
}

/// The sums over all directions, in the order of the costs; `greys` are the grey levels of these rows.
pub(super) fn aggregated(costs: &Costs, greys: &[f32]) -> Vec<i16> {
    let mut sums = vec![0; costs.values.len()];
    sweep(costs, greys, true, &mut sums);
    sweep(costs, greys, false, &mut sums);
    sums
}

/// Adds the paths from the left and from the three pixels above, or else the opposite ones.
fn sweep(costs: &Costs, greys: &[f32], is_forward: bool, sums: &mut [i16]) {
    let (width, count) = (costs.width, costs.hypotheses);
    let height = greys.len() / width;
    let place = |k: usize, length: usize| if is_forward { k } else { length - 1 - k };
    let jump = |p: usize, q: usize| {
        let edge = 1.0 + (greys[p] - greys[q]).abs() / EDGE;
        ((JUMP / edge) as i16).max(SLANT + 1)
    };
    let mut above = [(); 3].map(|()| Paths::new(width, count));
    let mut now = above.clone();
    let mut along = Paths::new(width, count);
    let mut beside = vec![NEVER; count + 2];
    for j in 0..height {
        let row = place(j, height) * width;
        for i in 0..width {
            let x = place(i, width);
            let p = row + x;
            let costs = &costs.values[p * count..(p + 1) * count];
            let sums = &mut sums[p * count..(p + 1) * count];
            let previous = (i > 0).then(|| place(i - 1, width));
            if let Some(q) = previous {
                beside.copy_from_slice(along.at(q));
            }
            let from = previous.map(|q| (&beside[..], along.least[q], jump(p, row + q)));
            along.extend(x, costs, from, sums);
            let row_before = if j > 0 { place(j - 1, height) * width } else { 0 };
            for (k, (above, now)) in above.iter().zip(&mut now).enumerate() {
                let q = (x + k).checked_sub(1).filter(|q| j > 0 && *q < width);
                let from = q.map(|q| (above.at(q), above.least[q], jump(p, row_before + q)));
                now.extend(x, costs, from, sums);
            }
        }
        std::mem::swap(&mut above, &mut now);
    }
}

/// The hypothesis with the least sum of each pixel, refined by the parabola through it and its neighbours.
pub(super) fn best(sums: &[i16], count: usize) -> impl Iterator<Item = f32> + '_ {
    sums.chunks_exact(count).map(|sums| {
        let least = (0..sums.len()).min_by_key(|k| sums[*k]).unwrap_or(0);
        if least == 0 || least + 1 == sums.len() {
            return least as f32;
        }
        let [a, b, c] = [least - 1, least, least + 1].map(|k| f32::from(sums[k]));
        // Half a step at most, as b is the least.
        least as f32 + 0.5 * (a - c) / (a - 2.0 * b + c).max(1.0)
    })
}
