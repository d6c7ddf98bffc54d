//! Which channels of an input are invalid at the current frame.
//!
//! Each channel needs only the frame at which its validity returns, so overlapping dropouts cost no more
//! than others: a dropout that begins while its channel is invalid moves that frame.

use super::lost::Dropout;
use std::collections::VecDeque;

/// The dropouts of an input, seen from the current frame.
#[derive(Debug, Default)]
pub(super) struct Dropouts {
    /// The current frame.
    time: u64,
    /// Dropouts that lie ahead, in the order of their first frames.
    ahead: VecDeque<Dropout>,
    /// Each channel is invalid before this frame.
    channels: Vec<u64>,
    /// All channels are invalid before this frame.
    all: u64,
    /// The least of these frames that lies after the current one.
    next_end: Option<u64>,
}

impl Dropouts {
    /// Dropouts in the order of their first frames, for so many channels.
    pub(super) fn new(ahead: Vec<Dropout>, channels: usize) -> Self {
        let mut dropouts = Self { ahead: ahead.into(), channels: vec![0; channels], ..Self::default() };
        dropouts.enter();
        dropouts
    }

    /// Takes a dropout that has become known; true if some of its frames lie before the current one.
    pub(super) fn add(&mut self, dropout: Dropout) -> bool {
        let is_late = dropout.frames.start < self.time;
        let place = self.ahead.partition_point(|other| other.frames.start <= dropout.frames.start);
        self.ahead.insert(place, dropout);
        self.enter();
        is_late
    }

    /// True if a channel is invalid at the current frame.
    pub(super) fn any(&self) -> bool {
        self.next_end.is_some()
    }

    /// True if this channel is invalid at the current frame.
    pub(super) fn covers(&self, channel: usize) -> bool {
        self.all.max(self.channels[channel]) > self.time
    }

    /// Frames from the current one on in which the same channels are invalid.
    pub(super) fn until_change(&self) -> u64 {
        let next = self.ahead.front().map(|dropout| dropout.frames.start);
        self.next_end.into_iter().chain(next).min().map_or(u64::MAX, |frame| frame - self.time)
    }

    /// Goes on by `frames` frames, at most to the next change.
    pub(super) fn advance(&mut self, frames: u64) {
        let change = frames >= self.until_change();
        self.time += frames;
        if change {
            self.enter();
        }
    }

    /// Takes the dropouts that begin now, and those that begin while their channels are invalid anyway.
    fn enter(&mut self) {
        let time = self.time;
        while let Some(dropout) = self.ahead.front() {
            let end = match dropout.channel {
                Some(channel) => &mut self.channels[channel],
                None => &mut self.all,
            };
            if dropout.frames.start > time && (*end <= time || dropout.frames.start > *end) {
                break;
            }
            *end = dropout.frames.end.max(*end);
            self.ahead.pop_front();
        }
        let ends = self.channels.iter().copied().chain([self.all]);
        self.next_end = ends.filter(|&end| end > time).min();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn covered_is_what_some_dropout_contains() {
        let mut dice = Random(18);
        for trial in 0..500 {
            let channels = dice.count(1, 4);
            let mut list: Vec<Dropout> = (0..dice.below(30))
                .map(|_| {
                    let first = dice.below(100) as u64;
                    let channel = dice.below(channels + 1);
                    let frames = first..first + dice.count(1, 40) as u64;
                    Dropout { channel: (channel < channels).then_some(channel), frames }
                })
                .collect();
            list.sort_by_key(|dropout| dropout.frames.start);
            let mut dropouts = Dropouts::new(list.clone(), channels);
            let mut time = 0;
            while time < 200 {
                let step = dropouts.until_change().min(dice.count(1, 10) as u64);
                for frame in time..time + step {
                    for c in 0..channels {
                        let contains = |dropout: &Dropout| {
                            dropout.channel.is_none_or(|channel| channel == c)
                                && dropout.frames.contains(&frame)
                        };
                        let wanted = list.iter().any(contains);
                        assert_eq!(dropouts.covers(c), wanted, "trial {trial}, frame {frame}, channel {c}");
                    }
                }
                dropouts.advance(step);
                time += step;
            }
        }
    }

    #[test]
    fn a_dropout_may_become_known_at_any_time_before_its_frames() {
        let invalid = |channel, frames| Dropout { channel, frames };
        let mut dropouts = Dropouts::new(vec![invalid(None, 50..51)], 2);
        dropouts.advance(10);
        assert!(!dropouts.add(invalid(Some(1), 12..14)) && !dropouts.any());
        assert_eq!(dropouts.until_change(), 2);
        // Of the frames 8 to 10 only the last is still ahead.
        assert!(dropouts.add(invalid(Some(0), 8..11)));
        assert!(dropouts.covers(0) && !dropouts.covers(1) && dropouts.until_change() == 1);
        assert!(dropouts.add(invalid(Some(1), 3..5)) && !dropouts.covers(1));
        dropouts.advance(1);
        dropouts.advance(1);
        assert!(dropouts.covers(1) && !dropouts.covers(0));
    }

    #[test]
    fn overlapping_dropouts_take_one_step() {
        let overlapping = (0..100_000).map(|k| Dropout { channel: None, frames: k..k + 100_000 });
        let mut dropouts = Dropouts::new(overlapping.collect(), 2);
        assert_eq!(dropouts.until_change(), 199_999);
        dropouts.advance(199_999);
        assert!(!dropouts.any() && dropouts.until_change() == u64::MAX);
    }
}
