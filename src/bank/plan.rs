//! Compiles a bank into a plan of the runtime.

use super::{Bank, SynthesisFilters};
use crate::runtime::{BuildError, Options, Plan, StateSpace};

impl Bank {
    /// Compiles the bank into a plan, which any number of streams of the runtime may share.
    ///
    /// # Errors
    /// [`BuildError`] if the bank's parts do not fit together, hold values that are not finite, or cannot
    /// run with `options`.
    pub fn plan(&self, options: Options) -> Result<Plan, BuildError> {
        let channels = self.channel_count();
        match &self.filters {
            SynthesisFilters::Fir(taps) if taps.len() != channels => {
                Err(BuildError::FilterCount { delays: channels, filters: taps.len() })
            }
            SynthesisFilters::Fir(taps) => Plan::from_taps(taps, self.ratio, self.latency, options),
            SynthesisFilters::StateSpace(filter) => {
                let [a, b, c, d] = [&filter.a, &filter.b, &filter.c, &filter.d].map(Clone::clone);
                Plan::from_state_space(
                    &StateSpace { a, b, c, d },
                    [channels, self.ratio],
                    self.latency,
                    options,
                )
            }
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
        let refused = Bank { delays: vec![Seconds(0.0)], ..bank }.plan(Options::default()).unwrap_err();
        assert_eq!(refused, BuildError::FilterCount { delays: 1, filters: 2 });
    }
}
