//! The uncertain rows of H: how the errors of a box change the samples, to first order, and bounds of the
//! rest.

use super::super::VerifyError;
use super::super::ball::Ball;
use super::super::front_ends::{Equations, FrontEnds};
use super::super::timeline::SamplingInstant;
use super::slopes::{PADE_REMAINDER, cutoff_slope, delay_curvature, delay_slope, pade_width, row_norm};
use crate::analog::CutoffRemainder;
use hybank_core::bank::Bank;
use hybank_core::spec::ErrorBox;
use hybank_core::units::FastPeriods;

/// Makes up for the roundings of a handful of operations in double precision.
const OUTWARD: f64 = 1.0 + 1e-14;

/// The rows that errors of the channels add to H, one for each error of each sample of a frame.
pub(super) struct UncertainRows {
    pub(super) front_ends: FrontEnds,
    /// Each row times the half-width of its error.
    pub(super) rows: Vec<SamplingInstant>,
    /// The sample of a frame that each row belongs to.
    pub(super) samples: Vec<usize>,
    /// For each sample of a frame a bound on the norm of what all these rows leave.
    pub(super) remainders: Vec<f64>,
}

/// What is known of the box of one converter.
#[derive(Debug, Clone, Copy, PartialEq)]
struct HalfWidths {
    delay: FastPeriods,
    gain: f64,
    /// Of x in Phi(s (1 + x)): for a cut-off times 1 + t it is -t / (1 + t).
    cutoff: f64,
}

/// What a row samples: the filter of a front end, or a slope of it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum RowFilter {
    Delay { filter: usize, delta: FastPeriods },
    Plain { filter: usize },
    Cutoff { filter: usize },
}

impl HalfWidths {
    fn of(errors: &ErrorBox, converter: usize) -> Self {
        let cutoff = errors.cutoffs[converter];
        Self {
            delay: errors.delays[converter],
            gain: errors.gains[converter],
            cutoff: if cutoff > 0.0 { cutoff / (1.0 - cutoff) * OUTWARD } else { 0.0 },
        }
    }

    /// The filters of the rows of a sample of front end `filter`, with their half-widths.
    fn rows(self, filter: usize) -> impl Iterator<Item = (RowFilter, f64)> {
        let Self { delay, gain, cutoff } = self;
        let all = [
            (RowFilter::Delay { filter, delta: pade_width(delay) }, delay.0 * (1.0 + gain)),
            (RowFilter::Plain { filter }, gain),
            (RowFilter::Cutoff { filter }, cutoff * (1.0 + gain)),
        ];
        all.into_iter().filter(|(_, half)| *half > 0.0).map(|(row, half)| (row, half * OUTWARD))
    }
}

impl UncertainRows {
    /// Of the samples of a frame of `bank`.
    ///
    /// # Errors
    /// As [`FrontEnds::new`]; [`VerifyError::ErrorBox`] for errors of a cut-off that have no bound.
    pub(super) fn new(bank: &Bank, errors: &ErrorBox) -> Result<Self, VerifyError> {
        let (nominal, instants) = FrontEnds::new(bank)?;
        let owners = bank.layout().owners();
        let mut all = Self {
            front_ends: FrontEnds::driven_by(nominal.signal().cloned()),
            rows: Vec::new(),
            samples: Vec::new(),
            remainders: Vec::new(),
        };
        let mut made: Vec<RowFilter> = Vec::new();
        for (sample, (instant, &converter)) in instants[bank.ratio..].iter().zip(&owners).enumerate() {
            let half_widths = HalfWidths::of(errors, converter);
            for (row, half) in half_widths.rows(instant.filter) {
                let filter = made.iter().position(|known| *known == row).unwrap_or_else(|| {
                    made.push(row);
                    all.front_ends.push(row.equations(&nominal))
                });
                all.rows.push(SamplingInstant { filter, gain: instant.gain * Ball::from(half), ..*instant });
                all.samples.push(sample);
            }
        }
        all.remainders =
            Remainders { bank, nominal: &nominal }.of_samples(&instants[bank.ratio..], &owners, errors)?;
        Ok(all)
    }
}

impl RowFilter {
    fn equations(self, nominal: &FrontEnds) -> Equations {
        match self {
            Self::Delay { filter, delta } => delay_slope(nominal.filter(filter), delta),
            Self::Plain { filter } => nominal.filter(filter).clone(),
            Self::Cutoff { filter } => cutoff_slope(nominal.filter(filter)),
        }
    }
}

/// What is known of the samples of one filter and box.
struct FilterBox {
    filter: usize,
    half_widths: HalfWidths,
    bound: f64,
}

/// Bounds of what first order leaves.
///
/// With E = e^{-s d} - 1 = d P + R and Phi(s (1 + x)) = Phi + x S + T, where P and S are the first-order
/// terms, a sample that is off by a gain g, a delay d and a cut-off x has
///
/// ```text
/// (1 + g) (1 + E) (Phi + x S + T) = Phi + g Phi + (1 + g) (d P Phi + x S)
///                                     + (1 + g) (R Phi + E x S + (1 + E) T),
/// ```
///
/// |1 + E| = 1. The last term is bounded here.
struct Remainders<'a> {
    bank: &'a Bank,
    nominal: &'a FrontEnds,
}

impl Remainders<'_> {
    fn of_samples(
        &self,
        instants: &[SamplingInstant],
        owners: &[usize],
        errors: &ErrorBox,
    ) -> Result<Vec<f64>, VerifyError> {
        let mut known: Vec<FilterBox> = Vec::new();
        let bound = |(instant, &converter): (&SamplingInstant, &usize)| {
            let half_widths = HalfWidths::of(errors, converter);
            let first_order = self.known_of_slopes(instant.filter, half_widths, &mut known);
            let own = self.of_cutoff(converter, half_widths.cutoff)?;
            let gain = (1.0 + half_widths.gain) * instant.gain.magnitude();
            Ok(gain * (first_order + own) * OUTWARD)
        };
        instants.iter().zip(owners).map(bound).collect()
    }

    /// The bound of [`Self::of_slopes`], computed once.
    fn known_of_slopes(&self, filter: usize, half_widths: HalfWidths, known: &mut Vec<FilterBox>) -> f64 {
        let found = known.iter().find(|known| known.filter == filter && known.half_widths == half_widths);
        found.map(|known| known.bound).unwrap_or_else(|| {
            let bound = self.of_slopes(filter, half_widths);
            known.push(FilterBox { filter, half_widths, bound });
            bound
        })
    }

    /// |R Phi| + |E x S|.
    fn of_slopes(&self, filter: usize, HalfWidths { delay, cutoff, .. }: HalfWidths) -> f64 {
        if delay.0 == 0.0 {
            return 0.0;
        }
        let (delta, equations) = (pade_width(delay), self.nominal.filter(filter));
        let curved = PADE_REMAINDER * delta.0.powi(2) * self.norm(delay_curvature(equations, delta));
        let mixed = match cutoff {
            0.0 => 0.0,
            x => 2f64.sqrt() * x * delta.0 * self.norm(delay_slope(&cutoff_slope(equations), delta)),
        };
        (curved + mixed) * OUTWARD
    }

    /// |T| of a converter's own filter.
    fn of_cutoff(&self, converter: usize, error: f64) -> Result<f64, VerifyError> {
        let channel =
            self.bank.spec.as_ref().and_then(|spec| Some((spec.fast_period, spec.channels.get(converter)?)));
        let Some((h, channel)) = channel.filter(|_| error > 0.0) else { return Ok(0.0) };
        let refused =
            |source| VerifyError::FrontEnd { place: format!("spec.channel[{converter}].filter"), source };
        let CutoffRemainder { filter, share } = CutoffRemainder::new(&channel.filter, h, error)
            .map_err(refused)?
            .ok_or_else(|| unbounded(converter))?;
        Ok(share * self.norm(filter) * OUTWARD)
    }

    fn norm(&self, filter: Equations) -> f64 {
        row_norm(self.nominal.signal(), filter, self.bank.ratio)
    }
}

fn unbounded(converter: usize) -> VerifyError {
    let rule = format!(
        "the cut-off of channel {} may be off by more than the width of a resonance of its filter, or the filter is \
         written as matrices; give a smaller error, or poles and zeros",
        converter + 1
    );
    VerifyError::ErrorBox { rule }
}
