//! The captured samples of one channel.

use crate::sine_fit::Channel;
use crate::spec::{ChannelSpec, Spec};
use std::ops::Range;

/// Least share of equal samples in two records of the same recording.
const SAME_SAMPLES_SHARE: f64 = 0.999;

/// Captures that were taken together: one record for each sample of a frame, whose samples of one index
/// belong to one frame.
#[derive(Debug, Clone, Copy)]
pub struct Acquisition<'a> {
    /// What it is called in messages.
    pub name: &'a str,
    /// In the order of the spec, with those of one converter one after the other.
    pub records: &'a [Record],
}

/// The samples of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// The samples, or the real parts of complex ones; the full scale of integer formats is 1.
    pub samples: Vec<f64>,
    /// The imaginary parts of complex samples, as many.
    pub imaginary: Option<Vec<f64>>,
    /// False where a sample is clipped or not finite.
    pub keep: Vec<bool>,
    /// Number of clipped samples.
    pub clipped: usize,
}

impl Record {
    /// A record without clipped samples, unless some are not finite.
    pub fn new(samples: Vec<f64>) -> Self {
        Self::within(samples, f64::NEG_INFINITY, f64::INFINITY)
    }

    /// A record whose converter cannot deliver values outside `lowest` ..= `highest`: samples at either end
    /// are clipped.
    pub fn within(samples: Vec<f64>, lowest: f64, highest: f64) -> Self {
        let clips = |x: f64| x.is_finite() && (x <= lowest || x >= highest);
        let clipped = samples.iter().filter(|&&x| clips(x)).count();
        let keep = samples.iter().map(|&x| x.is_finite() && !clips(x)).collect();
        Self { samples, imaginary: None, keep, clipped }
    }

    /// Complex samples from the records of both parts. A sample that is left out of one part is left out of
    /// both, and so are samples beyond the end of the shorter part.
    pub fn complex(real: Self, imaginary: Self) -> Self {
        let both = real.keep.iter().zip(&imaginary.keep);
        let keep: Vec<bool> = both.map(|(&real, &imaginary)| real && imaginary).collect();
        let (mut samples, mut others) = (real.samples, imaginary.samples);
        samples.truncate(keep.len());
        others.truncate(keep.len());
        let is_clipped = |&n: &usize| !keep[n] && samples[n].is_finite() && others[n].is_finite();
        let clipped = (0..keep.len()).filter(is_clipped).count();
        Self { samples, imaginary: Some(others), keep, clipped }
    }

    /// The mean of the kept samples, or of their real parts.
    pub fn mean(&self) -> f64 {
        let kept = self.samples.iter().zip(&self.keep).filter(|(_, keep)| **keep);
        kept.map(|(x, _)| x).sum::<f64>() / self.used().max(1) as f64
    }

    /// The kept samples, or real parts.
    pub(crate) fn channel(&self) -> Channel<'_> {
        Channel { keep: Some(&self.keep), ..Channel::new(&self.samples) }
    }

    /// Root mean square of the kept samples' deviations from their mean.
    pub(crate) fn rms(&self) -> f64 {
        let squares: f64 = self.channel().deviations().iter().map(|x| x * x).sum();
        (squares / self.used().max(1) as f64).sqrt()
    }

    /// The kept samples of each part, for a sine fit.
    pub(super) fn channels(&self) -> impl Iterator<Item = Channel<'_>> {
        self.parts().map(|part| Channel { keep: Some(&self.keep), ..Channel::new(part) })
    }

    /// The samples, or the real and the imaginary parts of complex ones.
    pub(super) fn parts(&self) -> impl Iterator<Item = &[f64]> {
        std::iter::once(self.samples.as_slice()).chain(self.imaginary.as_deref())
    }

    /// Some of the samples, as far as there are so many.
    pub(crate) fn part(&self, samples: Range<usize>) -> Self {
        let end = samples.end.min(self.samples.len());
        let part = samples.start.min(end)..end;
        let imaginary = self.imaginary.as_ref().map(|all| all[part.clone()].to_vec());
        let keep = self.keep[part.clone()].to_vec();
        Self { samples: self.samples[part].to_vec(), imaginary, keep, clipped: self.clipped }
    }

    /// The samples without a static nonlinearity of the converter.
    pub(super) fn straightened(&self, channel: &ChannelSpec) -> Self {
        let straight = |part: &Vec<f64>| part.iter().map(|&x| channel.straightened(x)).collect();
        let imaginary = self.imaginary.as_ref().map(straight);
        Self { samples: straight(&self.samples), imaginary, keep: self.keep.clone(), clipped: self.clipped }
    }

    /// Samples that are not clipped and finite.
    pub fn used(&self) -> usize {
        self.keep.iter().filter(|&&keep| keep).count()
    }

    /// The same without these samples.
    pub(crate) fn without(&self, rows: &[std::ops::Range<usize>]) -> Self {
        let mut keep = self.keep.clone();
        rows.iter().for_each(|row| keep[row.clone()].fill(false));
        Self { keep, ..self.clone() }
    }

    /// Whether nearly all samples are those of `other`: two converters have noise of their own and sample at
    /// other instants.
    pub(super) fn repeats(&self, other: &Self) -> bool {
        let length = self.samples.len().min(other.samples.len());
        let equal = self.samples.iter().zip(&other.samples).filter(|(a, b)| a == b).count();
        let changes = self.samples.windows(2).any(|pair| pair[0] != pair[1]);
        length > 16 && changes && equal as f64 >= SAME_SAMPLES_SHARE * length as f64
    }
}

/// The records without the nonlinearities that the spec has.
pub(super) fn straightened(spec: &Spec, records: &[Record]) -> Vec<Record> {
    let of_converter = |(channel, range): (&ChannelSpec, Range<usize>)| {
        records[range].iter().map(|record| record.straightened(channel)).collect::<Vec<_>>()
    };
    spec.channels.iter().zip(spec.layout().ranges()).flat_map(of_converter).collect()
}

/// The first and the longest run of frames that every record has, as first frame and length.
pub(crate) fn longest_run(records: &[Record]) -> (usize, usize) {
    let length = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    let (mut best, mut begin) = ((0, 0), 0);
    for k in 0..=length {
        let whole = k < length && records.iter().all(|record| record.keep[k]);
        if !whole {
            if k - begin > best.1 {
                best = (begin, k - begin);
            }
            begin = k + 1;
        }
    }
    best
}

/// Two records that hold the same samples, as indices.
pub(super) fn repeated(records: &[Record]) -> Option<(usize, usize)> {
    let pairs = (0..records.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
    pairs.into_iter().find(|&(j, i)| records[j].repeats(&records[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_samples_and_samples_that_are_not_finite_are_left_out() {
        let record = Record::within(vec![-1.0, 0.5, f64::NAN, 0.999, 1.0, 0.0], -1.0, 0.999);
        assert_eq!(record.keep, [false, true, false, false, false, true]);
        assert_eq!((record.clipped, record.used()), (3, 2));
        assert_eq!(longest_run(&[record, Record::new(vec![0.0; 6])]), (1, 1));
    }

    #[test]
    fn what_a_part_lacks_the_complex_sample_lacks() {
        let real = Record::within(vec![0.0, 1.0, f64::NAN, 0.5, 0.1], -1.0, 1.0);
        let imaginary = Record::within(vec![-1.0, 1.0, 1.0, 0.5], -1.0, 1.0);
        let record = Record::complex(real, imaginary);
        assert_eq!((record.keep.as_slice(), record.clipped), (&[false, false, false, true][..], 2));
        assert_eq!(record.parts().map(<[f64]>::len).collect::<Vec<_>>(), [4, 4]);
    }

    #[test]
    fn a_recording_given_twice_is_found_and_silence_is_not() {
        let wave = |phase: f64| Record::new((0..100).map(|n| (0.3 * n as f64 + phase).sin()).collect());
        assert_eq!(repeated(&[wave(0.0), wave(0.1), wave(0.0)]), Some((0, 2)));
        assert_eq!(repeated(&[Record::new(vec![0.0; 100]), Record::new(vec![0.0; 100])]), None);
    }
}
