//! When the frames of an input were taken: which follow one another without a break, and how many
//! were lost in between.

use std::collections::VecDeque;

/// Frames that one break may lose at most, 2^36 (a minute at a gigahertz): a mistaken count would otherwise
/// ask for output without end.
pub const MOST_LOST: u64 = 1 << 36;

/// Frame `frame` of the input was number `index` at the converter, where lost frames count too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Anchor {
    pub(super) frame: u64,
    pub(super) index: u64,
}

impl Anchor {
    /// Index of the input's first frame, if nothing was lost before this one.
    fn beginning(self) -> Option<u64> {
        self.index.checked_sub(self.frame)
    }
}

/// Frames in a row, or a break.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stretch {
    /// So many frames were lost.
    Lost(u64),
    /// So many follow each other; `u64::MAX` to the end.
    Frames(u64),
}

/// Anchors in their order; without any the frames follow each other from the first to the last.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Sequence(Vec<Anchor>);

impl Sequence {
    /// Checks that time and file run in the same direction.
    pub(super) fn new(anchors: Vec<Anchor>) -> Result<Self, String> {
        if let Some(first) = anchors.first().filter(|first| first.beginning().is_none()) {
            return Err(format!(
                "sample_start {} has global_index {}, so that the samples before it would have been taken before 0; add a constant to all indices",
                first.frame, first.index
            ));
        }
        for pair in anchors.windows(2) {
            lost_between(pair[0], pair[1])?;
        }
        Ok(Self(anchors))
    }

    /// True if nothing is known.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Index of the input's first frame, if anything is known.
    pub(super) fn beginning(&self) -> Option<u64> {
        self.0.first().and_then(|first| first.beginning())
    }

    /// Frames and breaks in their order, with time counted from `origin`, which is not later than
    /// the beginning.
    pub(super) fn stretches(&self, origin: u64) -> Result<VecDeque<Stretch>, String> {
        let mut stretches = VecDeque::new();
        let first = Anchor { frame: 0, index: origin };
        let mut last = Anchor { frame: 0, index: self.beginning().unwrap_or(origin) };
        let mut add = |frames, lost| {
            stretches.extend((frames > 0).then_some(Stretch::Frames(frames)));
            stretches.extend((lost > 0).then_some(Stretch::Lost(lost)));
        };
        add(0, lost_between(first, last)?);
        for &anchor in &self.0 {
            add(anchor.frame - last.frame, lost_between(last, anchor)?);
            last = anchor;
        }
        stretches.push_back(Stretch::Frames(u64::MAX));
        Ok(stretches)
    }
}

/// Frames lost between two anchors.
fn lost_between(a: Anchor, b: Anchor) -> Result<u64, String> {
    let lost = b.frame.checked_sub(a.frame).zip(b.index.checked_sub(a.index));
    let lost = lost.and_then(|(frames, time)| time.checked_sub(frames)).ok_or_else(|| {
        format!(
            "sample_start {} with global_index {} does not lie behind sample_start {} with global_index {}; captures must be in order and must not overlap",
            b.frame, b.index, a.frame, a.index
        )
    })?;
    if lost > MOST_LOST {
        return Err(format!(
            "{lost} samples are lost before sample_start {}; more than {MOST_LOST} at once are taken for a mistake, fuse the parts one by one",
            b.frame
        ));
    }
    Ok(lost)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(anchors: &[(u64, u64)]) -> Result<Sequence, String> {
        Sequence::new(anchors.iter().map(|&(frame, index)| Anchor { frame, index }).collect())
    }

    fn stretches(anchors: &[(u64, u64)], origin: u64) -> Vec<Stretch> {
        sequence(anchors).unwrap().stretches(origin).unwrap().into()
    }

    #[test]
    fn breaks_lie_where_the_count_jumps() {
        use Stretch::{Frames, Lost};
        let rest = Frames(u64::MAX);
        assert_eq!(stretches(&[], 7), [rest]);
        assert_eq!(stretches(&[(0, 100)], 100), [rest]);
        assert_eq!(stretches(&[(0, 100)], 98), [Lost(2), rest]);
        // Two late, two lost after three, then up to 3000.
        let want = [Lost(2), Frames(3), Lost(2), Frames(2), Lost(2893), rest];
        assert_eq!(stretches(&[(0, 100), (3, 105), (5, 3000)], 98), want);
        // What stands before the first anchor lies directly before it.
        assert_eq!(stretches(&[(4, 14), (6, 17)], 8), [Lost(2), Frames(4), Frames(2), Lost(1), rest]);
        // Lost at the very beginning, said twice.
        assert_eq!(stretches(&[(0, 5), (0, 6)], 5), [Lost(1), rest]);
        assert_eq!(sequence(&[(4, 14)]).unwrap().beginning(), Some(10));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for (anchors, part) in [
            (&[(0, 5), (4, 6)][..], "must not overlap"),
            (&[(4, 4), (2, 9)], "must not overlap"),
            (&[(4, 3)], "before 0"),
            (&[(0, 0), (1, MOST_LOST + 2)], "mistake"),
            (&[(0, 0), (1, u64::MAX)], "mistake"),
        ] {
            let fault = sequence(anchors).unwrap_err();
            assert!(fault.contains(part), "{fault}");
        }
        assert!(sequence(&[(0, u64::MAX)]).unwrap().stretches(0).unwrap_err().contains("mistake"));
    }
}
