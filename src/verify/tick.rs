//! One slow period of the analog side: how the state and all samples of a tick depend on the state before and on the
//! input, the latter only through the Gram matrix of the maps from input to numbers (theory: K K* knows no more).
//!
//! For two samples at instants t_a >= t_b of the period, rows c_a, c_b, the entry of the Gram matrix is
//! `c_a e^{A (t_a - t_b)} G(t_b) c_b'`. The labels of time are such that the latest sample is taken at the very end of the
//! period; the others follow at their instants, whole ticks later where they are older than a period.

use super::ball::{self, Ball, Matrix};
use super::flow::{Flow, flow};
use super::front_ends::{FrontEnds, Tap};

/// x+ = transition x + w, and for each sample s: s = readout x + v, counted `ticks_late` ticks later.
#[derive(Debug, Clone)]
pub(super) struct Tick {
    /// e^{A M}.
    pub(super) transition: Matrix,
    /// One row a sample.
    pub(super) readouts: Matrix,
    /// Gram matrix of (w, v), states first.
    pub(super) gram: Matrix,
    /// For each sample.
    pub(super) ticks_late: Vec<usize>,
}

/// A sample placed in the period.
#[derive(Debug, Clone, Copy)]
struct Placed {
    instant: Ball,
    ticks_late: usize,
}

/// In fast periods before the end of a period of `ratio` of these.
fn place(age: Ball, ratio: usize) -> Placed {
    let period = ratio as f64;
    let mut ticks = (age.nearest() / period).floor();
    let mut rest = age - Ball::from(ticks * period);
    // The quotient may have been rounded up to a whole number.
    if rest.nearest() < 0.0 {
        ticks -= 1.0;
        rest = rest + Ball::from(period);
    }
    // From here on the rounded instant is the instant: a shift of less than 1e-25 fast periods.
    Placed { instant: Ball::exactly((Ball::from(period) - rest).mid()), ticks_late: ticks as usize }
}

/// The instants at which something is sampled, ascending; equal ones are one, and the end of the period is the last.
struct Timeline {
    instants: Vec<Ball>,
    /// Index of each sample's instant.
    of: Vec<usize>,
}

impl Timeline {
    fn new(placed: &[Placed]) -> Self {
        let mut order: Vec<usize> = (0..placed.len()).collect();
        let key = |i: usize| placed[i].instant.mid();
        order.sort_by(|&i, &j| (key(i) - key(j)).nearest().total_cmp(&0.0));
        let (mut instants, mut of): (Vec<Ball>, Vec<usize>) = (Vec::new(), vec![0; placed.len()]);
        for i in order {
            if instants.last() != Some(&placed[i].instant) {
                instants.push(placed[i].instant);
            }
            of[i] = instants.len() - 1;
        }
        Self { instants, of }
    }
}

impl Tick {
    /// Follows `front_ends` through a period of `ratio` fast ones with the samples `taps`.
    pub(super) fn new(front_ends: &FrontEnds, taps: &[Tap], ratio: usize) -> Self {
        let latest = taps.iter().map(|tap| tap.time).fold(f64::NEG_INFINITY, f64::max);
        let placed: Vec<Placed> = taps.iter().map(|tap| place(tap.age(latest), ratio)).collect();
        let timeline = Timeline::new(&placed);
        let since_start: Vec<Flow> =
            timeline.instants.iter().map(|&t| flow(&front_ends.a, &front_ends.b, t)).collect();
        let rows: Vec<Matrix> = taps.iter().map(|tap| front_ends.readout(tap.filter)).collect();
        let n = front_ends.order();
        let mut readouts = ball::zeros(taps.len(), n);
        for (i, row) in rows.iter().enumerate() {
            readouts.set_row(i, &ball::product(row, &since_start[timeline.of[i]].transition).row(0));
        }
        // The latest sample ends the period.
        let end = &since_start[since_start.len() - 1];
        let mut gram = ball::zeros(n + taps.len(), n + taps.len());
        gram.view_mut((0, 0), (n, n)).copy_from(&end.gramian);
        correlate(&mut gram, front_ends, &timeline, &since_start, &rows);
        let ticks_late = placed.iter().map(|sample| sample.ticks_late).collect();
        Self { transition: end.transition.clone(), readouts, gram: ball::symmetric(&gram), ticks_late }
    }

    /// Number of analog states.
    pub(super) fn order(&self) -> usize {
        self.transition.nrows()
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.readouts.nrows()
    }
}

/// Fills the lower triangle beyond the states: each sample with all that is not earlier.
fn correlate(
    gram: &mut Matrix,
    front_ends: &FrontEnds,
    timeline: &Timeline,
    since_start: &[Flow],
    rows: &[Matrix],
) {
    let (n, count) = (front_ends.order(), timeline.instants.len());
    let between: Vec<Matrix> = (1..count)
        .map(|k| {
            flow(&front_ends.a, &front_ends.b, timeline.instants[k] - timeline.instants[k - 1]).transition
        })
        .collect();
    for (b, row) in rows.iter().enumerate() {
        // What the state at some later instant has in common with sample b.
        let mut common = ball::product_transposed(&since_start[timeline.of[b]].gramian, row);
        for k in timeline.of[b]..count {
            if k > timeline.of[b] {
                common = ball::product(&between[k - 1], &common);
            }
            for a in (0..rows.len()).filter(|&a| timeline.of[a] == k) {
                let value = ball::product(&rows[a], &common)[(0, 0)];
                gram[(n + a.max(b), n + a.min(b))] = value;
            }
        }
        for i in 0..n {
            gram[(n + b, i)] = common[(i, 0)];
        }
    }
}
