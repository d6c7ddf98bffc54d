//! Signals that are clipped below the rails of the converter, as by an amplifier before it.

use super::super::block::{Block, Numbers, with_numbers};
use crate::io::InputFault;
use crate::runtime::Sample;
use std::f64::consts::PI;

/// Samples of each channel that are looked at.
const LOOKED_AT: usize = 1 << 18;
/// Numbers of one level differ by the rounding of what computed them: this share of it.
const SAME: f64 = 1.0 / 65536.0;
/// So many times as often as a sine with the same step below its top does a clipped signal reach its top.
const FACTOR: f64 = 2.0;
/// A step or a pulse comes to its top once and stays.
const FEW_VISITS: usize = 8;
/// As many samples may be there by chance in a short recording.
const FEW: f64 = 64.0;

/// The top of a signal: its largest level, how often it is there, and the next one below.
#[derive(Debug, Clone, Copy)]
struct Top {
    level: f64,
    count: usize,
    next: f64,
    /// How often the signal came there, and whether it is there.
    visits: usize,
    is_there: bool,
}

impl Top {
    const NONE: Self = Self { level: 0.0, count: 0, next: f64::NEG_INFINITY, visits: 0, is_there: false };

    fn take(&mut self, x: f64) {
        let same = SAME * self.level.abs();
        if self.count == 0 && x.is_finite() {
            *self = Self { level: x, count: 1, visits: 1, is_there: true, ..Self::NONE };
        } else if x > self.level + same {
            *self = Self { level: x, count: 1, next: self.level, visits: 1, is_there: true };
        } else if x >= self.level - same {
            self.count += 1;
            self.visits += usize::from(!self.is_there);
            self.is_there = true;
        } else {
            self.next = if x > self.next { x } else { self.next };
            self.is_there = false;
        }
    }

    /// A sine of this amplitude is at most `step` below its top for the share arccos(1 - step / amplitude) /
    /// pi of the time, which is about that of the square root.
    fn is_flat(&self, amplitude: f64, of: usize) -> bool {
        let step = (self.level - self.next).max(SAME * amplitude);
        let of_sine = (2.0 * step / amplitude).sqrt() / PI;
        self.level != 0.0
            && self.visits >= FEW_VISITS
            && self.count as f64 > (FACTOR * of_sine * of as f64).max(FEW)
    }
}

/// The tops of the channels so far, and those of their opposites.
#[derive(Debug, Clone, Default)]
pub(super) struct FlatTops {
    tops: Vec<[Top; 2]>,
    frames: usize,
}

impl FlatTops {
    /// Takes the frames of a block from frame `first` on, of complex samples their real parts.
    pub(super) fn take(&mut self, block: &Block, first: usize) {
        let channels = block.channels().max(1);
        let frames = (block.frames() - first).min(LOOKED_AT.saturating_sub(self.frames));
        self.tops.resize(channels, [Top::NONE; 2]);
        self.frames += frames;
        let Some(part) = block.parts.first() else { return };
        with_numbers!(part, numbers => {
            for frame in numbers[first * channels..].chunks_exact(channels).take(frames) {
                for ([high, low], x) in self.tops.iter_mut().zip(frame) {
                    high.take(x.to_f64());
                    low.take(-x.to_f64());
                }
            }
        });
    }

    /// The share of all samples that is at the rails in channels that are not flat there: a tone that
    /// repeats after few samples has few levels, and is at the largest one often.
    pub(super) fn share_at_rails(&self, rails: (f64, f64)) -> f64 {
        let counts = self.tops.iter().map(|[high, low]| {
            let amplitude = 0.5 * (high.level + low.level);
            let is_plain = |top: &Top| !top.is_flat(amplitude, self.frames);
            let high = Some(high).filter(|top| top.level >= rails.1 && is_plain(top));
            let low = Some(low).filter(|top| -top.level <= rails.0 && is_plain(top));
            high.into_iter().chain(low).map(|top| top.count).sum::<usize>()
        });
        counts.sum::<usize>() as f64 / (self.frames * self.tops.len()).max(1) as f64
    }

    /// The first channel that is clipped within the rails.
    pub(super) fn fault(&self, rails: (f64, f64)) -> Option<InputFault> {
        self.tops.iter().enumerate().find_map(|(channel, [high, low])| {
            let amplitude = 0.5 * (high.level + low.level);
            let is_flat = |top: &Top| amplitude > 0.0 && top.is_flat(amplitude, self.frames);
            let high = Some(high).filter(|top| is_flat(top) && top.level < rails.1).map(|top| top.level);
            let low = Some(low).filter(|top| is_flat(top) && -top.level > rails.0).map(|top| -top.level);
            let level = high.or(low)?;
            Some(InputFault::FlatTop { channel: channel + 1, level })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{PcmFormat, SampleLayout, StreamHeader};

    fn level(samples: impl Iterator<Item = f64>) -> Option<f64> {
        let header = StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), 2);
        let mut tops = FlatTops::default();
        let samples: Vec<f64> = samples.flat_map(|x| [0.0, x]).collect();
        for part in samples.chunks(2000) {
            let mut block = Block::default();
            block.begin(&header);
            block.extend(part.iter().copied());
            tops.take(&block, 0);
        }
        match tops.fault((-1.0, 1.0)) {
            Some(InputFault::FlatTop { channel: 2, level }) => Some(level),
            None => None,
            other => panic!("{other:?}"),
        }
    }

    fn sine(per_sample: f64) -> impl Iterator<Item = f64> {
        (0..20_000).map(move |k| 0.7 * (per_sample * f64::from(k)).sin())
    }

    fn rounded(samples: impl Iterator<Item = f64>, steps: f64) -> impl Iterator<Item = f64> {
        samples.map(move |x| (x * steps).round() / steps)
    }

    #[test]
    fn clipped_sines_are_told() {
        assert_eq!(level(sine(0.1).map(|x| x.clamp(-0.5, 0.5))), Some(0.5));
        assert_eq!(level(sine(0.1).map(|x| x.max(-0.3))), Some(-0.3));
        assert_eq!(level(rounded(sine(0.1).map(|x| x.min(0.6999)), 32768.0)), Some(22934.0 / 32768.0));
        assert_eq!(level(rounded(sine(0.1).map(|x| x.clamp(-0.3, 0.3)), 2048.0)), Some(614.0 / 2048.0));
        // At the rails it is another fault.
        assert_eq!(level(sine(0.1).map(|x| (2.0 * x).clamp(-1.0, 1.0))), None);
    }

    #[test]
    fn what_is_not_clipped_is_left_alone() {
        for steps in [10.0, 100.0, 2048.0, 32768.0, 1e15] {
            for per_sample in [0.1, 0.003, 1.0, PI / 8.0, PI / 500.0] {
                assert_eq!(level(rounded(sine(per_sample), steps)), None, "{steps} {per_sample}");
            }
            for period in 3..200 {
                let coherent = rounded(sine(2.0 * PI / f64::from(period)), steps);
                assert_eq!(level(coherent), None, "{steps} {period}");
            }
        }
        let square = (0..20_000).map(|k| if k % 20 < 10 { 0.5 } else { -0.5 });
        let pulses = (0..20_000).map(|k| if k % 20 < 10 { 0.0 } else { 1e-3 * f64::from(k % 7) });
        assert_eq!((level(square), level(pulses)), (None, None));
        assert_eq!(level(std::iter::repeat_n(0.25, 20_000)), None);
        assert_eq!(level((0..20_000).map(|k| 1.0 - 0.99_f64.powi(k))), None);
        assert_eq!(level([f64::NAN; 1000].into_iter()), None);
    }
}
