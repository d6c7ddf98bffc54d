//! The stiffness between neighbouring pixels, which falls with the difference of their depths.

use crate::interpolate::Settings;
use crate::occlusion::DepthTest;
use rayon::prelude::*;

/// g of the edge from each pixel to the next one in a direction, and h of the triple that begins there; 0
/// where there is none.
pub(super) struct Springs {
    pub(super) edge: Vec<f32>,
    pub(super) bend: Vec<f32>,
}

impl Springs {
    /// From the depths of the pixels, NaN where unknown: bridged holes count as lying on the surface of the
    /// others. Only pixels `inside` are connected.
    pub(super) fn new(depth: &[f32], width: usize, inside: &[bool], settings: &Settings, down: bool) -> Self {
        let (mut edge, mut bend) = (vec![0.0; depth.len()], vec![0.0; depth.len()]);
        let (stride, plane) = (if down { width } else { 1 }, &settings.plane);
        let (stiffness, bending) = (plane.stiffness as f32, plane.bending as f32);
        let rows = edge.par_chunks_mut(width).zip(bend.par_chunks_mut(width));
        rows.enumerate().with_min_len(8).for_each(|(y, (edge, bend))| {
            for x in 0..width {
                let p = y * width + x;
                // The next pixels, as far as they lie in the image and inside.
                let room = if down { depth.len().saturating_sub(p + 1) / width } else { width - 1 - x };
                let joined = (0..=room.min(2)).take_while(|k| inside[p + k * stride]).count();
                let at = |k: usize| depth[p + k * stride];
                if joined > 1 {
                    let pair = near_and_far(at(0), at(1));
                    edge[x] = stiffness * share(pair, &settings.depth_test) + plane.edge_stiffness as f32;
                    if joined > 2 {
                        let pairs = (pair, near_and_far(at(1), at(2)));
                        let all = (pairs.0.0.min(pairs.1.0), pairs.0.1.max(pairs.1.1));
                        bend[x] = bending * share(all, &settings.depth_test);
                    }
                }
            }
        });
        Self { edge, bend }
    }
}

/// The lesser and the greater of two depths; an unknown one equals the other.
#[inline]
fn near_and_far(a: f32, b: f32) -> (f32, f32) {
    (a.min(b), a.max(b))
}

/// 1 / (1 + (D / sigma)^2) for the range D of some depths and the sigma of the depth test.
#[inline]
fn share((near, far): (f32, f32), test: &DepthTest) -> f32 {
    let range = far - near;
    if range > 0.0 {
        let sigma = test.relative as f32 * near + test.absolute as f32;
        sigma * sigma / (sigma * sigma + range * range)
    } else {
        // One depth, or none is known.
        1.0
    }
}
