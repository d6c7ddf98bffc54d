//! The sampling instants of one slow period.

use super::{GridTime, Seconds};

/// The instants of one slow period, which ends with the latest sample. An older sample counts as the sample
/// at the same phase of the period, delayed by whole periods.
#[derive(Debug, Clone)]
pub struct Timeline {
    start: GridTime,
    /// Ascending, each once, the end of the period last.
    instants: Vec<GridTime>,
    /// Index of each sample's instant.
    of: Vec<usize>,
    /// Whole slow periods from a sample's instant to that in which it is counted.
    delay_periods: Vec<f64>,
}

impl Timeline {
    /// Reduces the instants of samples on one grid modulo the slow period of `ratio` fast periods.
    pub fn new(times: &[GridTime], ratio: usize) -> Self {
        let period = ratio as f64;
        let latest = times.iter().copied().max_by(|a, b| a.compare(*b));
        let latest = latest.unwrap_or(GridTime::fast_sample(0.0, Seconds(1.0)));
        let delay_periods: Vec<f64> =
            times.iter().map(|time| latest.whole_periods_since(*time, ratio)).collect();
        let folded = |(time, periods): (&GridTime, &f64)| time.later_by(periods * period);
        let folded: Vec<GridTime> = times.iter().zip(&delay_periods).map(folded).collect();
        let mut instants = folded.clone();
        instants.sort_by(|a, b| a.compare(*b));
        instants.dedup();
        let of = |time: &GridTime| instants.partition_point(|other| other.compare(*time).is_lt());
        let of = folded.iter().map(of).collect();
        Self { start: latest.later_by(-period), instants, of, delay_periods }
    }

    /// The beginning of the period.
    pub fn start(&self) -> GridTime {
        self.start
    }

    /// The different instants, ascending, the end of the period last.
    pub fn instants(&self) -> &[GridTime] {
        &self.instants
    }

    /// Index of a sample's instant.
    pub fn of(&self, sample: usize) -> usize {
        self.of[sample]
    }

    /// For each sample the whole slow periods by which it is older than its instant.
    pub fn delay_periods(&self) -> &[f64] {
        &self.delay_periods
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_older_than_a_period_are_late() {
        let line = |times: &[f64]| {
            let times: Vec<GridTime> =
                times.iter().map(|&t| GridTime::new(Seconds(t), Seconds(1.0))).collect();
            Timeline::new(&times, 2)
        };
        let of_four = line(&[0.0, 1.0, -2.5, -4.0]);
        assert_eq!(of_four.delay_periods(), [0.0, 0.0, 1.0, 2.0]);
        assert_eq!([0, 1, 2, 3].map(|sample| of_four.of(sample)), [1, 2, 0, 1]);
        let since_start = |time: &GridTime| time.since(of_four.start()).0;
        assert_eq!(of_four.instants().iter().map(since_start).collect::<Vec<_>>(), [0.5, 1.0, 2.0]);
        assert_eq!(line(&[0.0, -1e300]).delay_periods(), [0.0, 5e299]);
        // Neighbours stay apart, on both sides of the end of the period.
        let near = line(&[0.0, -2.0 + 1e-15, -2.0 - 1e-15]);
        assert_eq!((near.delay_periods(), near.instants().len()), (&[0.0, 0.0, 1.0][..], 3));
    }
}
