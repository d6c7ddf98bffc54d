//! Semi-global aggregation: the sums of the costs of the best paths to a pixel from eight directions.
//!
//! ```text
//! L(p, k) = C(p, k) + min(L(q, k), L(q, k +- 1) + P1, min_j L(q, j) + P2) - min_j L(q, j)
//! ```
//!
//! with q before p on the path. P1 is the price of a slant and P2 that of a jump.

use super::census::Costs;

/// P1.
const SLANT: i16 = 4;

/// P2 where the photograph is flat; it is half of that where neighbours differ by `EDGE` grey levels, and
/// more than P1 everywhere.
const JUMP: f32 = 40.0;
const EDGE: f32 = 10.0;

/// More than every path, and so little that prices can be added.
const NEVER: i16 = i16::MAX / 2;

/// The sums over all directions, in the order of the costs; `greys` are the grey levels of these rows.
pub(super) fn aggregated(costs: &Costs, greys: &[f32]) -> Vec<i16> {
    let mut sums = vec![0; costs.values.len()];
    for (dx, dy) in [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)] {
        add_paths(costs, greys, &Step { dx, dy }, &mut sums);
    }
    sums
}

struct Step {
    dx: isize,
    dy: isize,
}

fn add_paths(costs: &Costs, greys: &[f32], &Step { dx, dy }: &Step, sums: &mut [i16]) {
    let (width, count) = (costs.width, costs.hypotheses);
    // The paths to the pixels of a row, each between two that are never taken, and the least of each pixel.
    let stride = count + 2;
    let mut rows = [(); 2].map(|()| (vec![NEVER; width * stride], vec![0; width]));
    let mut from = vec![NEVER; stride];
    for k in 0..greys.len() {
        let p = if (dy, dx) > (0, 0) { k } else { greys.len() - 1 - k };
        let (x, y) = (p % width, p / width);
        let [(paths, least), before] = &mut rows;
        let q = x.checked_add_signed(-dx).zip(y.checked_add_signed(-dy)).map(|(x, y)| (x, y * width + x));
        let q = q.filter(|(x, q)| *x < width && *q < greys.len());
        let mut price = [0; 2];
        if let Some((x, q)) = q {
            let (paths, least) = if dy == 0 { (&*paths, &*least) } else { (&before.0, &before.1) };
            from.copy_from_slice(&paths[x * stride..][..stride]);
            let jump = (JUMP / (1.0 + (greys[p] - greys[q]).abs() / EDGE)) as i16;
            price = [least[x], least[x] + jump.max(SLANT + 1)];
        } else {
            from[1..=count].fill(0);
        }
        let paths = &mut paths[x * stride + 1..][..count];
        let near = from.iter().zip(&from[1..]).zip(&from[2..]);
        let costs = costs.values[p * count..].iter().zip(&mut sums[p * count..]);
        for ((path, (cost, sum)), ((below, same), above)) in paths.iter_mut().zip(costs).zip(near) {
            let best = (*same).min((*below).min(*above) + SLANT).min(price[1]);
            *path = i16::from(*cost) + best - price[0];
            *sum += *path;
        }
        least[x] = paths.iter().copied().min().unwrap_or(0);
        if (k + 1) % width == 0 {
            rows.swap(0, 1);
        }
    }
}

/// The hypothesis with the least sum, refined by the parabola through it and its neighbours.
pub(super) fn best(sums: &[i16]) -> f32 {
    let least = (0..sums.len()).min_by_key(|k| sums[*k]).unwrap_or(0);
    if least == 0 || least + 1 == sums.len() {
        return least as f32;
    }
    let [a, b, c] = [least - 1, least, least + 1].map(|k| f32::from(sums[k]));
    // Half a step at most, as b is the least.
    least as f32 + 0.5 * (a - c) / (a - 2.0 * b + c).max(1.0)
}
