//! Compiles a bank into a plan of the runtime.

use super::{Bank, SynthesisFilters};
use crate::runtime::{BuildError, Options, Plan, Shape};

impl Bank {
    /// Compiles the bank into a plan, which any number of streams of the runtime may share. Its streams
    /// subtract the offsets of the converters.
    ///
    /// # Errors
    /// [`BuildError`] if the bank's parts do not fit together, hold values that are not finite, or cannot
    /// run with `options`.
    pub fn plan(&self, options: Options) -> Result<Plan, BuildError> {
        let channels = self.frame_samples();
        let plan = match &self.filters {
            SynthesisFilters::Fir(taps) if taps.len() != channels => {
                Err(BuildError::FilterCount { delays: channels, filters: taps.len() })
            }
            SynthesisFilters::Fir(taps) => Plan::from_taps(taps, self.ratio, self.output_delay(), options),
            SynthesisFilters::StateSpace(filter) => Plan::from_state_space(
                filter,
                Shape { channels, ratio: self.ratio },
                self.output_delay(),
                options,
            ),
        };
        plan?.with_offsets(&self.layout().each(&self.offsets))
    }

    /// Bytes of memory that the plan of an FIR bank and so many of its streams take, about; 0 for recursive
    /// banks.
    ///
    /// # Errors
    /// As [`Bank::plan`].
    pub fn plan_bytes(&self, options: Options, streams: usize) -> Result<f64, BuildError> {
        match &self.filters {
            SynthesisFilters::Fir(taps) => Plan::bytes_of_taps(taps, self.ratio, options, streams),
            SynthesisFilters::StateSpace(_) => Ok(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Seconds;

    #[test]
    fn a_bank_needs_as_many_filters_as_delays() {
        let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0], vec![1.0]]), 2);
        assert_eq!(bank.plan(Options::default()).unwrap().channels(), 2);
        let refused = Bank { delays: vec![Seconds(0.0)], samples: vec![1], ..bank }
            .plan(Options::default())
            .unwrap_err();
        assert_eq!(refused, BuildError::FilterCount { delays: 1, filters: 2 });
    }

    #[test]
    fn offsets_are_subtracted_before_the_filters() {
        let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0, 2.0], vec![10.0, 20.0]]), 2);
        let bank = Bank { offsets: vec![0.5, -1.0], ..bank };
        let mut stream = crate::runtime::Stream::new(&bank.plan(Options::default()).unwrap());
        let mut out = [0.0; 2];
        stream.process(&[1.5, 0.0], &mut out).unwrap();
        assert_eq!(out, [11.0, 22.0]);
    }
}
