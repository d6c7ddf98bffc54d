//! The row fit: one regularised B-spline a row (thesis eq. 2.4 and 2.5).
//!
//! ```text
//! J(x) = sum_m c_m beta(x - m)
//! f(c) = sum_s w_s ((I_s - J(x_s))^2 + lambda V_s J'(x_s)^2) + tau sum_m (c_m - c_{m-1})^2
//! ```

use super::extend::{Level, mean};
use super::holes::{GAP, reach};
use super::{Cover, HoleFill, Settings};
use crate::depth::{fill_empty_rows, for_holes};
use crate::sample::Sample;
use hybank_sampling::{Fit, FitSample};

/// Keeps the normal equations definite if lambda and tau are 0; negligible beside any other weight.
const RIDGE: f64 = 1e-9;

pub(crate) const ORDER: usize = 4;

/// Distance outside the image up to which samples are used, in pixels.
pub const MARGIN: f64 = (ORDER - 2) as f64;

/// Work memory of the row fit, reused from row to row. `ibr/tests/views/allocation.rs` runs the three stages
/// of rows one after the other.
#[derive(Debug, Clone)]
pub struct RowWork<const C: usize> {
    fit: Fit<ORDER, C>,
    smoothing: Vec<f64>,
    sums: Vec<(f64, f64)>,
    width: usize,
}

impl<const C: usize> RowWork<C> {
    /// For rows of `width` >= 1 pixels.
    pub fn new(width: usize) -> Self {
        let fit = Fit::covering(width.max(1) - 1);
        Self { fit, smoothing: Vec::new(), sums: Vec::new(), width }
    }

    /// Interpolates one row from its visible samples, sorted by column.
    ///
    /// Writes `width * C` values 0..255 and the mask, one entry per pixel. A row without samples is left
    /// as it is, with every pixel a disocclusion, and false is returned.
    ///
    /// # Errors
    /// The solver's error, possible only if tau is 0 and the holes are not filled.
    pub fn interpolate(
        &mut self,
        samples: &[Sample<C>],
        settings: &Settings,
        values: &mut [f32],
        mask: &mut [Cover],
    ) -> Result<bool, hybank_sampling::SamplingError> {
        mask.fill(Cover::Disocclusion);
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Ok(false) };
        self.fit.clear();
        self.weigh(samples, settings);
        self.fit.add_all(samples.iter().zip(&self.smoothing).map(|(s, v)| FitSample {
            x: s.x,
            values: s.value.map(f64::from),
            weight: f64::from(s.weight),
            slope_weight: settings.fit.lambda * v,
        }));
        mark(samples, settings, mask);
        if settings.fill == HoleFill::Background {
            self.continue_background(samples, settings);
            let edge = self.width as f64 - 1.0;
            self.replicate(clean(samples.iter(), settings).unwrap_or(first), -1.0, first.x, settings);
            self.replicate(
                clean(samples.iter().rev(), settings).unwrap_or(last),
                last.x,
                edge + 1.0,
                settings,
            );
        }
        self.fit.regularise(settings.fit.tau, RIDGE);
        self.fit.solve()?;
        for (out, value) in values.as_chunks_mut::<C>().0.iter_mut().zip(self.fit.knot_values(0)) {
            *out = value.map(|v| v.clamp(0.0, 255.0) as f32);
        }
        if settings.fill == HoleFill::Leave {
            blacken(mask, values, C);
        }
        Ok(true)
    }

    /// V_s of every sample, from the variance of the depth within max(epsilon, 1 px).
    fn weigh(&mut self, samples: &[Sample<C>], settings: &Settings) {
        self.smoothing.clear();
        let s0 = settings.fit.variation;
        let mean = samples.iter().map(|s| f64::from(s.depth)).sum::<f64>() / samples.len() as f64;
        // Prefix sums of z and z^2; about the mean, so that their differences keep their digits.
        let share = 1.0 / mean;
        self.sums.clear();
        self.sums.push((0.0, 0.0));
        let (mut sum, mut squares) = (0.0, 0.0);
        self.sums.extend(samples.iter().map(|s| {
            let z = f64::from(s.depth) * share - 1.0;
            (sum, squares) = (sum + z, squares + z * z);
            (sum, squares)
        }));
        let radius = settings.depth_test.epsilon.max(1.0);
        let (mut from, mut to) = (0, 0);
        self.smoothing.extend(samples.iter().map(|s| {
            while samples[from].x < s.x - radius {
                from += 1;
            }
            while to < samples.len() && samples[to].x <= s.x + radius {
                to += 1;
            }
            let (a, b, n) = (self.sums[from], self.sums[to], (to - from) as i32);
            let (sum, squares, n) = (b.0 - a.0, b.1 - a.1, f64::from(n));
            // V = 1 / (1 + var / s0^2) with n^2 var = n sum z^2 - (sum z)^2, in a single division.
            let (floor, spread) = (n * n * s0 * s0, n * squares - sum * sum);
            floor / (floor + if spread > 0.0 { spread } else { 0.0 })
        }));
    }

    /// Fills the gaps between two surfaces with copies of the farther one, about a pixel apart. Gaps within
    /// one surface are left to the fit, which bridges them.
    fn continue_background(&mut self, samples: &[Sample<C>], settings: &Settings) {
        for i in 1..samples.len() {
            let (left, right) = (&samples[i - 1], &samples[i]);
            if right.x - left.x > GAP && !one_surface(left, right, settings) {
                let farther = if right.depth > left.depth {
                    clean(samples[i..].iter(), settings).unwrap_or(right)
                } else {
                    clean(samples[..i].iter().rev(), settings).unwrap_or(left)
                };
                self.replicate(farther, left.x, right.x, settings);
            }
        }
    }

    fn replicate(&mut self, sample: &Sample<C>, from: f64, to: f64, settings: &Settings) {
        let parts = (to - from).round().max(1.0);
        let value = sample.value.map(f64::from);
        for k in 1..parts as usize {
            let x = from + (to - from) * k as f64 / parts;
            self.fit.add(x, &value, 1.0, settings.fit.lambda);
        }
    }
}

fn one_surface<const C: usize>(a: &Sample<C>, b: &Sample<C>, settings: &Settings) -> bool {
    let (near, far) = (a.depth.min(b.depth), a.depth.max(b.depth));
    !settings.depth_test.hides(f64::from(near), f64::from(far))
}

/// Samples at the edge of a hole that may be passed over for one further in.
const EDGE: usize = 6;

/// The first of the samples, or the next on its surface whose colour is not in doubt: the outermost pixel of
/// a surface beside a nearer one shows a mixture of both.
fn clean<'a, const C: usize>(
    samples: impl Iterator<Item = &'a Sample<C>> + Clone,
    settings: &Settings,
) -> Option<&'a Sample<C>> {
    let edge = samples.clone().next()?;
    samples.take(EDGE).find(|s| !s.doubtful && one_surface(s, edge, settings))
}

/// Marks the pixels near a sample and those between neighbours on one surface as seen, and those in wider
/// gaps of one depth as cracks.
fn mark<const C: usize>(samples: &[Sample<C>], settings: &Settings, mask: &mut [Cover]) {
    let reach = |s: &Sample<C>| reach(s.spacing);
    for pair in samples.windows(2) {
        let gap = pair[1].x - pair[0].x;
        if gap > GAP && one_surface(&pair[0], &pair[1], settings) {
            let near = gap <= 2.0 * reach(&pair[0]).max(reach(&pair[1]));
            let seen = if pair.iter().any(|s| s.origin.is_guess()) { Cover::Guessed } else { Cover::Seen };
            let cover = if near { seen } else { Cover::Crack };
            let end = ((pair[1].x + 1.0) as usize).min(mask.len());
            let start = (pair[0].x.max(0.0).ceil() as usize).min(end);
            mask[start..end].fill(cover);
        }
    }
    for (is_guess, cover) in [(true, Cover::Guessed), (false, Cover::Seen)] {
        let mut ahead = samples.iter().filter(|s| s.origin.is_guess() == is_guess).peekable();
        let mut behind = None;
        for (j, pixel) in mask.iter_mut().enumerate() {
            let x = j as f64;
            while let Some(s) = ahead.next_if(|s| s.x < x) {
                behind = Some(s);
            }
            let reaches = |s: &&Sample<C>| (s.x - x).abs() <= reach(s);
            if *pixel != Cover::Seen
                && (behind.as_ref().is_some_and(reaches) || ahead.peek().is_some_and(reaches))
            {
                *pixel = cover;
            }
        }
    }
}

/// Depth of the sample nearest to each pixel of a row, NaN where none reaches it. The samples are sorted by
/// column.
pub fn nearest_depths<const C: usize>(samples: &[Sample<C>], depths: &mut [f32]) {
    let mut next = 0;
    for (j, depth) in depths.iter_mut().enumerate() {
        let x = j as f64;
        while next < samples.len() && samples[next].x < x {
            next += 1;
        }
        let sides = [next.checked_sub(1), Some(next)].into_iter().flatten().filter_map(|i| samples.get(i));
        let within = sides.filter(|s| !s.origin.is_guess() && (s.x - x).abs() <= reach(s.spacing));
        let nearest = within.min_by(|a, b| (a.x - x).abs().total_cmp(&(b.x - x).abs()));
        *depth = nearest.map_or(f32::NAN, |s| s.depth);
    }
}

/// Adds the samples to the counts of the pixels of their row that are nearest to them.
pub fn count<const C: usize>(samples: &[Sample<C>], counts: &mut [u16]) {
    for s in samples.iter().filter(|s| s.x >= -0.5) {
        if let Some(count) = counts.get_mut((s.x + 0.5) as usize) {
            *count = count.saturating_add(1);
        }
    }
}

pub(super) fn blacken(mask: &[Cover], values: &mut [f32], channels: usize) {
    for (pixel, _) in values.chunks_exact_mut(channels).zip(mask).filter(|(_, c)| c.is_hole()) {
        pixel.fill(0.0);
    }
}

/// What rows do together when each is fitted: rows without samples are copied from the nearest one that is
/// `filled`, and the surfaces around disocclusions are continued into them.
pub(crate) fn finish<const C: usize>(
    filled: &[bool],
    mask: &[Cover],
    depths: &[f32],
    settings: &Settings,
    values: &mut [f32],
) {
    let fill = settings.fill;
    if fill != HoleFill::Leave {
        fill_empty_rows(filled, values);
    }
    if fill == HoleFill::Background && mask.contains(&Cover::Disocclusion) {
        continue_surfaces::<C>(mask, depths, mask.len() / filled.len().max(1), values);
    }
}

/// Extends the farther surface into each disocclusion, half by its row and half smoothly. The outermost
/// pixels of a surface, whose colours may be mixed, are left out.
fn continue_surfaces<const C: usize>(mask: &[Cover], depths: &[f32], width: usize, values: &mut [f32]) {
    let beside = |p: usize| {
        let (left, right) = (!p.is_multiple_of(width), p % width + 1 < width);
        (left && depths[p - 1].is_nan()) || (right && depths[p + 1].is_nan())
    };
    let sound = |p: usize| if beside(p) { f32::NAN } else { depths[p] };
    let sound: Vec<f32> = (0..depths.len()).map(sound).collect();
    let mut weights = vec![0.0; mask.len()];
    for_holes(&sound, width, |p, [left, right, ..]| {
        let farther = match [left, right].map(|q| sound.get(q as usize)) {
            [Some(a), Some(b)] if a > b => left,
            [Some(_), None] => left,
            _ => right,
        };
        if let Some(weight) = weights.get_mut(farther as usize).filter(|_| mask[p] == Cover::Disocclusion) {
            *weight = 1.0;
        }
    });
    drop(sound);
    if weights.iter().all(|w| *w == 0.0) {
        return;
    }
    let holes = || (0..mask.len()).filter(|p| mask[*p] == Cover::Disocclusion);
    let pixels = values.as_chunks_mut::<C>().0;
    let mut continued = Level { width, values: pixels.to_vec(), weights };
    continued.extend();
    holes().for_each(|p| pixels[p] = mean(pixels[p], continued.values[p]));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x: f64, depth: f32, value: f32) -> Sample<1> {
        Sample { x, depth, value: [value], ..Sample::BLANK }
    }

    fn run(samples: &[Sample<1>], width: usize, settings: &Settings) -> (Vec<f32>, Vec<Cover>) {
        let (mut values, mut mask) = (vec![0.0; width], vec![Cover::Crack; width]);
        let mut depths = vec![f32::NAN; width];
        assert!(RowWork::new(width).interpolate(samples, settings, &mut values, &mut mask).unwrap());
        nearest_depths(samples, &mut depths);
        finish::<1>(&[true], &mask, &depths, settings, &mut values);
        (values, mask)
    }

    fn filling(fill: HoleFill) -> Settings {
        Settings { fill, ..Settings::default() }
    }

    #[test]
    fn a_constant_stays_constant() {
        let samples: Vec<_> = (0..40).map(|i| sample(i as f64 * 0.53 - 0.4, 1.0, 77.0)).collect();
        let (values, mask) = run(&samples, 20, &Settings::default());
        assert!(values.iter().all(|v| (v - 77.0).abs() < 1e-4), "{values:?}");
        assert!(mask.iter().all(|c| *c == Cover::Seen));
    }

    #[test]
    fn disocclusions_take_the_farther_side() {
        // Near and bright on the left, far and dark on the right, a hole of ten pixels between.
        let mut samples: Vec<_> = (0..10).map(|i| sample(i as f64, 1.0, 200.0)).collect();
        samples.extend((20..30).map(|i| sample(i as f64, 4.0, 40.0)));
        let (values, mask) = run(&samples, 30, &Settings::default());
        assert!(values[12..20].iter().all(|v| (v - 40.0).abs() < 6.0), "{values:?}");
        assert!(mask[10..20].iter().all(|c| *c == Cover::Disocclusion), "{mask:?}");
        assert!(mask[..10].iter().chain(&mask[20..]).all(|c| *c == Cover::Seen));
        let (values, _) = run(&samples, 30, &filling(HoleFill::Leave));
        assert!(values[10..20].iter().all(|v| *v == 0.0) && values[5] > 190.0);
        let (values, _) = run(&samples, 30, &filling(HoleFill::Bridge));
        assert!(values[10..19].windows(2).all(|w| w[0] > w[1]), "{values:?}");
    }

    /// A sample of mixed colour yields to a sure one at the same place.
    #[test]
    fn doubtful_samples_weigh_little() {
        let with = |weight: f32| {
            let mut samples: Vec<_> = (0..20).map(|i| sample(f64::from(i), 4.0, 40.0)).collect();
            samples.insert(11, Sample { weight, doubtful: true, ..sample(10.2, 4.0, 120.0) });
            run(&samples, 20, &Settings::default()).0[10] - 40.0
        };
        let (little, full) = (with(crate::propagate::DOUBTFUL_WEIGHT), with(1.0));
        assert!(full > 10.0 && little < 0.3 * full, "{little} {full}");
    }

    #[test]
    fn a_stretched_surface_is_a_crack() {
        let samples: Vec<_> = [0.0, 1.0, 2.0, 5.0, 6.0, 7.0].map(|x| sample(x, 2.0, 10.0)).to_vec();
        let (_, mask) = run(&samples, 10, &Settings::default());
        assert_eq!(mask[3], Cover::Crack);
        assert_eq!(mask[4], Cover::Crack);
        assert_eq!(mask[8], Cover::Disocclusion, "the border is no crack");
        assert_eq!(mask[6], Cover::Seen);
    }

    #[test]
    fn smoothing_weakens_across_depth_edges() {
        let edge = |variation| {
            let settings = Settings {
                fit: super::super::FitSettings { lambda: 1.0, variation, ..Default::default() },
                ..Settings::default()
            };
            let mut samples: Vec<_> = (0..20).map(|i| sample(i as f64 * 0.5, 1.0, 0.0)).collect();
            samples.extend((20..40).map(|i| sample(i as f64 * 0.5, 2.0, 200.0)));
            let (v, _) = run(&samples, 20, &settings);
            v[10] - v[9]
        };
        let (soft, sharp) = (edge(1e9), edge(0.02));
        assert!(sharp > soft + 10.0, "{sharp} {soft}");
    }

    #[test]
    fn one_pixel_is_enough() {
        let (values, mask) = run(&[sample(0.2, 1.0, 99.0)], 1, &Settings::default());
        assert!((values[0] - 99.0).abs() < 1.0 && mask[0] == Cover::Seen);
    }
}
