//! The stiffness between neighbouring pixels, which falls with the difference of their depths.

use super::grid::Grid;
use crate::interpolate::Settings;
use hybank_sampling::Fit2;
use hybank_sampling::fit2::{Convergence, Direction, Iteration, Springs};

/// Fits the pixels that lie `inside`, with the springs of the surfaces that these depths show. Of the
/// settings those of the springs and of the solver are used.
pub(super) fn solve<const ORDER: usize, const C: usize>(
    fit: Fit2<ORDER, C>,
    size: (usize, usize),
    depth: &[f32],
    inside: &(impl Fn(usize) -> bool + Sync),
    settings: &Settings,
) -> (Vec<f32>, Convergence) {
    let grid = Grid::new(size, &fit);
    let iteration = Iteration { tolerance: settings.plane.tolerance, steps: settings.plane.iterations };
    let springs = |direction, y| of_row(depth, grid, inside, settings, direction, y);
    fit.connect(springs, |coefficient| !inside(grid.pixel(coefficient))).solve(&iteration, &|_| ())
}

/// The springs of one direction that begin in row y of the coefficients, from the depths of the pixels, NaN
/// where unknown: bridged holes count as lying on the surface of the others. Only what lies `inside` is
/// connected.
fn of_row(
    depth: &[f32],
    grid: Grid,
    inside: &(impl Fn(usize) -> bool + Sync),
    settings: &Settings,
    direction: Direction,
    y: usize,
) -> Springs {
    let (width, height) = grid.coefficients;
    let mut springs = Springs::none(width);
    for (x, (edge, bend)) in springs.edge.iter_mut().zip(&mut springs.bend).enumerate() {
        // The next ones, as far as they lie in the grid and inside.
        let (room, step) = match direction {
            Direction::Across => (width - 1 - x, (1, 0)),
            Direction::Down => (height - 1 - y, (0, 1)),
        };
        let pixel = |k: usize| grid.pixel_at(x + k * step.0, y + k * step.1);
        let joined = (0..=room.min(2)).take_while(|k| inside(pixel(*k))).count();
        let depth = |k: usize| if k < joined { depth[pixel(k)] } else { f32::NAN };
        (*edge, *bend) = spring(&[depth(0), depth(1), depth(2)], joined, settings);
    }
    springs
}

/// Edge and bend of `joined` neighbours, at most three, with these depths.
#[inline]
fn spring(depths: &[f32; 3], joined: usize, settings: &Settings) -> (f32, f32) {
    let (plane, test) = (&settings.plane, &settings.depth_test);
    // An unknown depth equals the other one.
    let near_and_far = |a: f32, b: f32| (a.min(b), a.max(b));
    let pair = near_and_far(depths[0], depths[1]);
    let edge = || plane.stiffness as f32 * test.share(pair.0, pair.1) + plane.edge_stiffness as f32;
    let next = near_and_far(depths[1], depths[2]);
    let bend = || plane.bending as f32 * test.share(pair.0.min(next.0), pair.1.max(next.1));
    let bends = joined > 2 && plane.bending > 0.0;
    (if joined > 1 { edge() } else { 0.0 }, if bends { bend() } else { 0.0 })
}
