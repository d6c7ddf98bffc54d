//! One plant for all errors of a box.
//!
//! The rows of H for a converter depend on its errors alone. So one lifted plant whose measurements are the
//! samples of every converter with each of several errors holds the rows of all their combinations, with one
//! input for all. No other plant is lifted while the worst combination is searched.

use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use hybank_core::spec::{ConverterErrors, ErrorBox, ErrorPoint};
use hybank_core::units::FastPeriods;
use hybank_linalg::CMat;
use std::ops::Range;

/// The golden ratio, whose multiples have the most even fractional parts.
const SPREAD: f64 = 0.618_033_988_749_894_9;

/// For each converter the index of one of its options; zeros for no errors.
pub(in crate::design) type Combination = Vec<usize>;

/// All front ends of a box.
#[derive(Debug)]
pub(in crate::design) struct BoxPlant {
    pub(in crate::design) problem: Problem,
    pub(in crate::design) errors: ErrorBox,
    /// Its measurements are the samples of all options.
    pub(super) plant: LiftedPlant,
    /// Of each converter: no errors first, then the corners of its own box.
    pub(super) options: Vec<Vec<ErrorOption>>,
}

/// Errors that a converter may have.
#[derive(Debug, Clone)]
pub(super) struct ErrorOption {
    errors: ConverterErrors,
    /// The rows of its samples of a frame.
    rows: Range<usize>,
}

/// The responses of all options and of the references at one frequency.
pub(in crate::design) struct BoxResponse {
    samples: CMat,
    pub(in crate::design) references: CMat,
}

impl BoxPlant {
    /// The front ends of `problem` over `errors`.
    ///
    /// # Errors
    /// As [`Problem::check_size`].
    pub(in crate::design) fn new(problem: &Problem, errors: &ErrorBox) -> Result<Self, DesignError> {
        let converters = problem.converters();
        for sign in [-1.0, 1.0] {
            let delays = errors.delays.iter().map(|&half| half * sign).collect();
            problem.perturbed(&ErrorPoint::of_delays(delays)).check_size()?;
        }
        let (mut all, mut channels) = (problem.clone(), Vec::new());
        let mut option = |own: &Range<usize>, errors: ConverterErrors| {
            let first = channels.len();
            channels.extend(problem.channels[own.clone()].iter().map(|sample| all.perturb(*sample, errors)));
            ErrorOption { errors, rows: first..channels.len() }
        };
        let options = converters
            .iter()
            .enumerate()
            .map(|(i, own)| choices(errors.of(i)).into_iter().map(|errors| option(own, errors)).collect())
            .collect();
        all.noise = vec![0.0; channels.len()];
        let plant = LiftedPlant::new(&Problem { channels, ..all });
        Ok(Self { problem: problem.clone(), errors: errors.clone(), plant, options })
    }

    /// Corners of the box, spread by the fractional parts of multiples of an irrational number for each
    /// converter.
    pub(super) fn corners(&self, count: usize) -> Vec<Combination> {
        let choice = |corner: usize, converter: usize| {
            let others = self.options[converter].len() - 1;
            let share = (corner as f64 * (SPREAD * (converter + 1) as f64).fract()).fract();
            others.min(1) + (share * others as f64) as usize
        };
        let converters = self.options.len();
        (0..count).map(|corner| (0..converters).map(|i| choice(corner, i)).collect()).collect()
    }

    /// The errors of a combination.
    pub(in crate::design) fn point(&self, combination: &[usize]) -> ErrorPoint {
        let chosen = || self.chosen(combination).map(|option| option.errors);
        ErrorPoint {
            delays: chosen().map(|errors| errors.delay).collect(),
            gains: chosen().map(|errors| errors.gain).collect(),
            cutoffs: chosen().map(|errors| errors.cutoff).collect(),
        }
    }

    /// The plant with the errors of a combination.
    pub(in crate::design) fn moved(&self, combination: &[usize]) -> LiftedPlant {
        LiftedPlant::new(&self.problem.perturbed(&self.point(combination)))
    }

    /// All responses at a frequency in radians per slow period.
    pub(in crate::design) fn response(&self, omega: f64) -> BoxResponse {
        let all = self.plant.at_frequency(omega);
        let count = self.plant.channels();
        BoxResponse {
            samples: all.rows(0, count).into_owned(),
            references: all.rows(count, self.plant.ratio()).into_owned(),
        }
    }

    /// H of a combination.
    pub(in crate::design) fn measurements(&self, response: &BoxResponse, combination: &[usize]) -> CMat {
        let rows: Vec<usize> = self.chosen(combination).flat_map(|option| option.rows.clone()).collect();
        response.samples.select_rows(&rows)
    }

    fn chosen(&self, combination: &[usize]) -> impl Iterator<Item = &ErrorOption> {
        self.options.iter().zip(combination).map(|(options, &choice)| &options[choice])
    }
}

/// No errors, and the corners of a box of these half-widths.
fn choices(half_widths: ConverterErrors) -> Vec<ConverterErrors> {
    let mut all = vec![ConverterErrors::default()];
    if half_widths == all[0] {
        return all;
    }
    let ends = |half: f64| if half > 0.0 { vec![-half, half] } else { vec![0.0] };
    for delay in ends(half_widths.delay.0) {
        for gain in ends(half_widths.gain) {
            let corner = |cutoff| ConverterErrors { delay: FastPeriods(delay), gain, cutoff };
            all.extend(ends(half_widths.cutoff).into_iter().map(corner));
        }
    }
    all
}
