//! Timestamps of the frames of an input: which frames are consecutive, and how many were lost in between.

use std::collections::VecDeque;

/// Maximum number of frames lost at one break, 2^36 (a minute at a gigahertz).
pub const MAX_LOST_AT_ONCE: u64 = 1 << 36;

/// Default maximum number of frames that an input leaves out, 2^26 (23 minutes at 48 kHz): without a limit a
/// wrong number would lead to endless output.
pub const MAX_LOST: u64 = 1 << 26;

/// Frame `frame` of the input was number `index` at the converter, which counts lost frames too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Timestamp {
    pub(super) frame: u64,
    pub(super) index: u64,
}

impl Timestamp {
    /// Index of the input's first frame, if nothing was lost before this one.
    fn beginning(self) -> Option<u64> {
        self.index.checked_sub(self.frame)
    }
}

/// `lost` frames were lost before frame `frame` of the input; none where only its number is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Break {
    pub(super) frame: u64,
    pub(super) lost: u64,
}

/// Timestamps in their order; without any the frames follow each other from the first to the last.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Timestamps(Vec<Timestamp>);

impl Timestamps {
    /// Checks that time and file run in the same direction.
    pub(super) fn new(timestamps: Vec<Timestamp>) -> Result<Self, String> {
        if let Some(first) = timestamps.first().filter(|first| first.beginning().is_none()) {
            return Err(format!(
                "sample_start {} has global_index {}, so that the samples before it would have been taken before 0; add a constant to all indices",
                first.frame, first.index
            ));
        }
        for pair in timestamps.windows(2) {
            if pair[0].frame == pair[1].frame && pair[0].index != pair[1].index {
                return Err(format!(
                    "sample_start {} has two numbers, global_index {} and {}; give it one",
                    pair[0].frame, pair[0].index, pair[1].index
                ));
            }
            lost_between(pair[0], pair[1])?;
        }
        Ok(Self(timestamps))
    }

    /// The same timestamps counted in frames of M = `converters` samples.
    pub(super) fn grouped(self, converters: usize) -> Result<Self, String> {
        let m = converters as u64;
        if let Some(broken) = self.0.iter().find(|t| !t.frame.is_multiple_of(m) || !t.index.is_multiple_of(m))
        {
            return Err(format!(
                "sample_start {} with global_index {} is not at the beginning of a frame of {m} time-interleaved converters; \
                 cut the capture to whole frames",
                broken.frame, broken.index
            ));
        }
        let grouped = |t: Timestamp| Timestamp { frame: t.frame / m, index: t.index / m };
        Ok(Self(self.0.into_iter().map(grouped).collect()))
    }

    /// True if there are no timestamps.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The first one.
    pub(super) fn first(&self) -> Option<Timestamp> {
        self.0.first().copied()
    }

    /// True if frames are missing between the first and the last.
    pub(super) fn has_losses(&self) -> bool {
        let breaks = self.beginning().map(|origin| self.breaks(origin));
        breaks.is_some_and(|breaks| breaks.is_ok_and(|all| all.iter().any(|one| one.lost > 0)))
    }

    /// Index of the input's first frame, if there are timestamps.
    pub(super) fn beginning(&self) -> Option<u64> {
        self.first().and_then(Timestamp::beginning)
    }

    /// When a frame of the input was taken, counted from `origin`.
    pub(super) fn time_of(&self, frame: u64, origin: u64) -> u64 {
        let before = self.0.partition_point(|timestamp| timestamp.frame <= frame);
        let last = before.checked_sub(1).map(|last| self.0[last]);
        let index = match (last, self.beginning()) {
            (Some(last), _) => last.index.saturating_add(frame - last.frame),
            (None, Some(beginning)) => beginning.saturating_add(frame),
            (None, None) => origin.saturating_add(frame),
        };
        index.saturating_sub(origin)
    }

    /// The breaks in their order, with time counted from `origin`, which is not later than the beginning.
    pub(super) fn breaks(&self, origin: u64) -> Result<VecDeque<Break>, String> {
        let beginning = Timestamp { frame: 0, index: self.beginning().unwrap_or(origin) };
        let mut last = Timestamp { frame: 0, index: origin };
        let mut breaks = VecDeque::new();
        for next in std::iter::once(beginning).chain(self.0.iter().copied()) {
            breaks.push_back(Break { frame: next.frame, lost: lost_between(last, next)? });
            last = next;
        }
        breaks.retain(|b| b.frame > 0 || b.lost > 0);
        Ok(breaks)
    }
}

/// Frames lost between two timestamps.
fn lost_between(a: Timestamp, b: Timestamp) -> Result<u64, String> {
    let lost = b.frame.checked_sub(a.frame).zip(b.index.checked_sub(a.index));
    let lost = lost.and_then(|(frames, time)| time.checked_sub(frames)).ok_or_else(|| {
        format!(
            "sample_start {} with global_index {} does not follow sample_start {} with global_index {}; captures must be in order and must not overlap",
            b.frame, b.index, a.frame, a.index
        )
    })?;
    if lost > MAX_LOST_AT_ONCE {
        return Err(format!(
            "{lost} samples are lost before sample_start {}; more than {MAX_LOST_AT_ONCE} at once are taken for a mistake, fuse the parts one by one",
            b.frame
        ));
    }
    Ok(lost)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timestamps(pairs: &[(u64, u64)]) -> Result<Timestamps, String> {
        Timestamps::new(pairs.iter().map(|&(frame, index)| Timestamp { frame, index }).collect())
    }

    /// Frames, and how many were lost before them.
    fn breaks(pairs: &[(u64, u64)], origin: u64) -> Vec<(u64, u64)> {
        let breaks = timestamps(pairs).unwrap().breaks(origin).unwrap();
        breaks.into_iter().map(|Break { frame, lost }| (frame, lost)).collect()
    }

    #[test]
    fn breaks_lie_where_the_count_jumps() {
        assert_eq!(breaks(&[], 7), []);
        assert_eq!(breaks(&[(0, 100)], 100), []);
        assert_eq!(breaks(&[(0, 100)], 98), [(0, 2)]);
        // Two late, two lost after three, then up to 3000.
        assert_eq!(breaks(&[(0, 100), (3, 105), (5, 3000)], 98), [(0, 2), (3, 2), (5, 2893)]);
        // What stands before the first timestamp lies directly before it.
        assert_eq!(breaks(&[(4, 14), (6, 17)], 8), [(0, 2), (4, 0), (6, 1)]);
        // Said twice.
        assert_eq!(breaks(&[(0, 6), (0, 6)], 5), [(0, 1)]);
        assert_eq!(timestamps(&[(4, 14)]).unwrap().beginning(), Some(10));
    }

    #[test]
    fn the_time_of_a_frame_counts_what_was_lost() {
        let given = timestamps(&[(2, 102), (5, 110)]).unwrap();
        let times: Vec<u64> = (0..7).map(|frame| given.time_of(frame, 98)).collect();
        assert_eq!(times, [2, 3, 4, 5, 6, 12, 13]);
        assert_eq!(Timestamps::default().time_of(7, 98), 7);
    }

    #[test]
    fn frames_begin_with_their_first_converter() {
        assert_eq!(timestamps(&[(0, 8), (4, 16)]).unwrap().grouped(4), timestamps(&[(0, 2), (1, 4)]));
        let broken = timestamps(&[(0, 0), (4, 9)]).unwrap().grouped(4).unwrap_err();
        assert!(broken.contains("global_index 9 is not at the beginning of a frame of 4"), "{broken}");
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for (pairs, part) in [
            (&[(0, 5), (4, 6)][..], "must not overlap"),
            (&[(4, 4), (2, 9)], "must not overlap"),
            (&[(4, 3)], "before 0"),
            (&[(4, 5), (4, 6)], "sample_start 4 has two numbers"),
            (&[(0, 0), (1, MAX_LOST_AT_ONCE + 2)], "mistake"),
            (&[(0, 0), (1, u64::MAX)], "mistake"),
        ] {
            let fault = timestamps(pairs).unwrap_err();
            assert!(fault.contains(part), "{fault}");
        }
        assert!(timestamps(&[(0, u64::MAX)]).unwrap().breaks(0).unwrap_err().contains("mistake"));
    }
}
