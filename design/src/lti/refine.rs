//! Local maxima of the gain, and their refinement between neighbouring frequencies.

use std::f64::consts::PI;

/// What the search for peaks tolerates.
pub(super) struct Settings {
    /// Relative accuracy of the returned peak: far above the roundings of a gain, and far below what any
    /// figure shows.
    pub(super) accuracy: f64,
    /// Frequencies closer than this count as equal: at a smooth peak their gains agree to all digits.
    pub(super) same_frequency: f64,
    /// How far off the axis (relative) an eigenvalue may lie and still suggest a frequency. If the level
    /// almost touches a peak, two eigenvalues meet on the axis, and a rounding error of the matrix moves
    /// them by its square root. Errors of 1e-4 are common if the gain is small relative to terms that
    /// cancel. A false suggestion costs one evaluation; a missed one loses a peak.
    pub(super) near_axis: f64,
    /// A frequency whose gain is this close to the level (relative) is a bad centre of the Cayley
    /// transform.
    pub(super) near_level: f64,
    /// Radius of a pole from which on it may cause a peak that the first grid misses. That of a smaller one
    /// is about a radian wide or more.
    pub(super) resonant_radius: f64,
    /// Relative difference of gains at which a refinement ends that nothing else limits: a hundredth of
    /// [`Self::accuracy`].
    pub(super) flat_gain: f64,
    /// Gains with a relative difference below this count as equal: some hundred roundings.
    pub(super) equal_gains: f64,
    /// Frequencies closer than this are the same in doubles. A resonance may be that narrow, so its peak is
    /// not reached before.
    pub(super) least_width: f64,
    /// Steps of a refinement are at least this part of the width that is left: a shorter one shows rounding
    /// only.
    pub(super) least_step: f64,
}

/// Of every search.
pub(super) const SETTINGS: Settings = Settings {
    accuracy: 1e-9,
    same_frequency: 1e-9,
    near_axis: 1e-2,
    near_level: 1e-2,
    resonant_radius: 0.5,
    flat_gain: 1e-11,
    equal_gains: 1e-13,
    least_width: 4.0 * f64::EPSILON,
    least_step: 1e-3,
};

/// A peak gain and where it is attained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// The largest gain, with a relative accuracy of 1e-9. It is
    /// attained at `frequency`, so it is never too large.
    pub gain: f64,
    /// Radians per step, in [0, pi].
    pub frequency: f64,
}

impl Peak {
    /// The same peak with its frequency brought into [0, pi].
    pub(super) fn folded(self) -> Self {
        let w = self.frequency.rem_euclid(2.0 * PI);
        Self { gain: self.gain, frequency: w.min(2.0 * PI - w) }
    }
}

/// Refines the peak between the outer of three neighbouring points by parabolas through the last three
/// points, falling back on golden sections; `at` evaluates the gain. The gain is flat at its peak: its
/// value converges twice as fast as the frequency. Ends at relative differences of gains below `flat`.
pub(crate) fn refine<E>(
    at: impl Fn(f64) -> Result<Peak, E>,
    [mut low, start, mut high]: [Peak; 3],
    flat: f64,
) -> Result<Peak, E> {
    let mut best = start;
    let (mut stalls, mut flats) = (0, 0);
    while high.frequency - low.frequency > SETTINGS.least_width && flats < 2 {
        let w = next_abscissa(low, best, high, stalls);
        let tried = at(w)?;
        let gained = tried.gain - best.gain;
        stalls = if gained < flat * best.gain { stalls + 1 } else { 0 };
        // A gain far below the best one shows a poor step, not convergence.
        flats = if gained.abs() <= flat * best.gain { flats + 1 } else { 0 };
        // Of equal gains the first stays, so that peaks at 0 and pi are exactly there.
        if gained > SETTINGS.equal_gains * best.gain {
            if w < best.frequency {
                high = best
            } else {
                low = best
            }
            best = tried;
        } else if w < best.frequency {
            low = tried;
        } else {
            high = tried;
        }
    }
    Ok(best.folded())
}

/// Vertex of the parabola through three points, at least [`Settings::least_step`] of their width away from
/// the best one (a shorter step finds the same gain up to rounding, wherever the peak is), or, where it is
/// no use, a golden section of the longer side.
fn next_abscissa(low: Peak, best: Peak, high: Peak, stalls: usize) -> f64 {
    const GOLDEN: f64 = 0.381_966_011_250_105_1;
    let (a, m, b) = (low.frequency, best.frequency, high.frequency);
    let (left, right) = ((m - a) * (best.gain - high.gain), (b - m) * (best.gain - low.gain));
    let step = -0.5 * ((m - a) * left - (b - m) * right) / (left + right);
    let longer = if m - a > b - m { a - m } else { b - m };
    let least = SETTINGS.least_step * (b - a);
    let step = if step.abs() < least { least.copysign(longer) } else { step };
    let inside = m + step > a && m + step < b;
    if stalls % 3 < 2 && inside { m + step } else { m + GOLDEN * longer }
}

pub(super) fn higher(a: Peak, b: Peak) -> Peak {
    if b.gain > a.gain { b } else { a }
}

/// The local maxima between their neighbours. The gain is even about 0 and about pi, so the neighbours
/// there are mirror images.
pub(crate) fn local_maxima(grid: &[Peak]) -> Vec<[Peak; 3]> {
    let last = grid.len() - 1;
    let neighbours = |k: usize| {
        let mirror = |about: f64, peak: Peak| Peak { frequency: 2.0 * about - peak.frequency, ..peak };
        let low = if k == 0 { mirror(0.0, grid[1]) } else { grid[k - 1] };
        let high = if k == last { mirror(PI, grid[last - 1]) } else { grid[k + 1] };
        [low, grid[k], high]
    };
    let is_maximum = |[low, middle, high]: &[Peak; 3]| middle.gain >= low.gain.max(high.gain);
    (0..=last).map(neighbours).filter(is_maximum).collect()
}

/// An upper estimate of the gain between `low` and `high`; `middle` is the largest gain evaluated there. A
/// gain that is concave there lies below the chords on each side of `middle`, extended to the other side.
pub(super) fn upper_estimate(low: Peak, middle: Peak, high: Peak) -> f64 {
    let (left, right) = (middle.frequency - low.frequency, high.frequency - middle.frequency);
    let beyond_left = (middle.gain - low.gain) * right / left;
    let beyond_right = (middle.gain - high.gain) * left / right;
    middle.gain + beyond_left.max(beyond_right)
}
