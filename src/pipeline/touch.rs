//! Which outputs of an FIR bank a missing sample affects.
//!
//! Output p of frame k is y\[kM + p\] = sum_i sum_j f_i\[p + jM\] x_i\[k - j\], so a missing x_i\[t\]
//! affects it if and only if f_i\[p + (k - t)M\] is not zero. The nonzero lags of one channel and phase are
//! a few intervals, for ordinary filters a single one. A gap that has ended, x_i\[s\] .. x_i\[e - 1\],
//! affects the frames s + a .. e - 1 + b for each interval a ..= b. So a count changes twice: at the first
//! of these frames and after the last. The counts of all phases are updated per frame. A frame takes M
//! additions for filters of any length, and a gap takes two additions per interval.

use super::Gap;

/// Lags j with f_i[p + jM] != 0 that follow each other, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Lags {
    first: usize,
    last: usize,
}

/// The nonzero lags of a bank, and the future outputs that ended gaps affect.
#[derive(Debug, Clone)]
pub(super) struct Touch {
    ratio: usize,
    /// `lags[i][p]` in ascending order.
    lags: Vec<Vec<Vec<Lags>>>,
    /// The change of the count at each future frame and phase; a ring buffer of [`Touch::span`] frames.
    changes: Vec<i32>,
    span: usize,
    /// Ended gaps that affect output p of the current frame.
    counts: Vec<i32>,
    /// All changes lie before this frame.
    settled: u64,
    /// Number of additions so far; tests use it as the measure of work.
    #[cfg(test)]
    pub(super) additions: u64,
}

impl Touch {
    /// For the filters f_i, `nonzero[i][j]` listing the phases p with f_i[p + jM] != 0 in ascending order.
    pub(super) fn new(ratio: usize, nonzero: &[Vec<Vec<usize>>]) -> Self {
        let span = nonzero.iter().map(Vec::len).max().unwrap_or(0) + 1;
        Self {
            ratio,
            lags: nonzero.iter().map(|channel| intervals(channel, ratio)).collect(),
            changes: vec![0; span * ratio],
            span,
            counts: vec![0; ratio],
            settled: 0,
            #[cfg(test)]
            additions: 0,
        }
    }

    /// True if no gap that has ended affects an output of `frame` or later.
    pub(super) fn is_settled(&self, frame: u64) -> bool {
        frame >= self.settled
    }

    /// Records a gap that ended before `frame`, which has not been marked yet.
    pub(super) fn end(&mut self, gap: &Gap, frame: u64) {
        let mut additions = 0;
        for (p, lags) in self.lags[gap.channel - 1].iter().enumerate() {
            additions += 2 * lags.len();
            for lags in lags {
                let first = (gap.first + lags.first as u64).max(frame);
                let end = gap.first + gap.length + lags.last as u64;
                if end > first {
                    self.changes[(first % self.span as u64) as usize * self.ratio + p] += 1;
                    self.changes[(end % self.span as u64) as usize * self.ratio + p] -= 1;
                    self.settled = self.settled.max(end + 1);
                }
            }
        }
        self.work(additions);
    }

    /// Marks the outputs of `frame`, the next one, that are affected by gaps that have ended or are `open`.
    pub(super) fn mark<'g>(&mut self, frame: u64, open: impl Iterator<Item = &'g Gap>, mask: &mut [u8]) {
        let slot = (frame % self.span as u64) as usize * self.ratio;
        let changes = &mut self.changes[slot..slot + self.ratio];
        for ((mark, count), change) in mask.iter_mut().zip(&mut self.counts).zip(changes) {
            *count += std::mem::take(change);
            *mark = u8::from(*count > 0);
        }
        self.work(self.ratio);
        for gap in open {
            // All samples since the gap's first are missing, so the first lag decides.
            let age = frame - gap.first;
            for (mark, lags) in mask.iter_mut().zip(&self.lags[gap.channel - 1]) {
                *mark |= u8::from(lags.first().is_some_and(|lags| lags.first as u64 <= age));
            }
            self.work(self.ratio);
        }
    }

    #[cfg(test)]
    fn work(&mut self, additions: usize) {
        self.additions += additions as u64;
    }

    #[cfg(not(test))]
    fn work(&mut self, _: usize) {}
}

/// For each phase the intervals of its lags.
fn intervals(nonzero: &[Vec<usize>], ratio: usize) -> Vec<Vec<Lags>> {
    let mut phases: Vec<Vec<Lags>> = vec![Vec::new(); ratio];
    for (j, used) in nonzero.iter().enumerate() {
        for &p in used {
            match phases[p].last_mut() {
                Some(lags) if lags.last + 1 == j => lags.last = j,
                _ => phases[p].push(Lags { first: j, last: j }),
            }
        }
    }
    phases
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lags_that_follow_each_other_are_one_interval() {
        let nonzero = [vec![0, 1], vec![0], vec![], vec![0]];
        let lags = |first, last| Lags { first, last };
        assert_eq!(intervals(&nonzero, 2), [vec![lags(0, 1), lags(3, 3)], vec![lags(0, 0)]]);
    }
}
