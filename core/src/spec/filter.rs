//! Filters as they are written, their degrees and their stages. `hybank::analog` checks the poles.

use super::Passband;
use crate::units::{Decibels, Seconds};
use serde::{Deserialize, Serialize};

/// Least ripple or attenuation in decibels; less is numerically none.
pub const MIN_RIPPLE_DB: f64 = 1e-6;

/// Most ripple or attenuation in decibels: 300 dB is the precision of double arithmetic.
pub const MAX_RIPPLE_DB: f64 = 300.0;

/// Largest coefficient of a polynomial, and largest gain: they have the dimension of a power of a frequency,
/// and enter in 512 bits, so only the gain that they have in fast periods has a range.
pub(super) const MAX_COEFFICIENT: f64 = f64::MAX;

/// An analog filter as written; stability is checked by `hybank::analog`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum FilterSpec {
    /// Numerator over denominator in descending powers of s (rad/s).
    TransferFunction {
        /// Numerator coefficients.
        num: Vec<f64>,
        /// Denominator coefficients.
        den: Vec<f64>,
    },
    /// gain * prod(s - z) / prod(s - p), rad/s, complex values as `[re, im]`.
    ZeroPoleGain {
        /// Zeros.
        zeros: Vec<[f64; 2]>,
        /// Poles.
        poles: Vec<[f64; 2]>,
        /// Leading coefficient.
        gain: f64,
    },
    /// dx/dt = a x + b f, out = c x; lists of rows.
    StateSpace {
        /// n x n.
        a: Vec<Vec<f64>>,
        /// n x 1.
        b: Vec<Vec<f64>>,
        /// 1 x n.
        c: Vec<Vec<f64>>,
    },
    /// A classical low-pass or band-pass by name.
    Family {
        /// Which one.
        family: Family,
        /// Number of poles of the low-pass; a band-pass has twice as many.
        #[serde(skip_serializing_if = "Option::is_none")]
        order: Option<usize>,
        /// The cutoff, or the edges of the band.
        #[serde(flatten)]
        passband: Passband,
        /// Pass-band ripple in decibels (Chebyshev 1, elliptic).
        #[serde(skip_serializing_if = "Option::is_none")]
        ripple_db: Option<f64>,
        /// Stop-band attenuation in decibels (Chebyshev 2, elliptic).
        #[serde(skip_serializing_if = "Option::is_none")]
        attenuation_db: Option<f64>,
    },
    /// Filters one after the other, for example a ladder filter and the pole of the sampling switch.
    /// Only the whole cascade has to be strictly proper.
    Cascade {
        /// The stages; none of them a cascade itself.
        cascade: Vec<FilterSpec>,
    },
}

/// The classical families.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Maximally flat magnitude.
    Butterworth,
    /// Equiripple pass band.
    Chebyshev1,
    /// Equiripple stop band.
    Chebyshev2,
    /// Equiripple in both bands.
    Elliptic,
    /// Maximally flat group delay, normalised by phase.
    Bessel,
    /// One pole; with a band, the resonator of two poles.
    Rc,
}

impl Family {
    /// Every family, in the order of the documentation.
    pub const ALL: [Self; 6] =
        [Self::Butterworth, Self::Chebyshev1, Self::Chebyshev2, Self::Elliptic, Self::Bessel, Self::Rc];

    /// The name in spec files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Butterworth => "butterworth",
            Self::Chebyshev1 => "chebyshev1",
            Self::Chebyshev2 => "chebyshev2",
            Self::Elliptic => "elliptic",
            Self::Bessel => "bessel",
            Self::Rc => "rc",
        }
    }

    /// Whether `ripple_db` belongs to the family.
    pub const fn has_ripple(self) -> bool {
        matches!(self, Self::Chebyshev1 | Self::Elliptic)
    }

    /// Whether `attenuation_db` belongs to the family.
    pub const fn has_attenuation(self) -> bool {
        matches!(self, Self::Chebyshev2 | Self::Elliptic)
    }
}

impl FilterSpec {
    /// Degrees of numerator and denominator as written (leading zeros of polynomials do not count; a
    /// state-space form without direct term counts one zero less than poles).
    pub fn degrees(&self) -> (usize, usize) {
        match self {
            Self::TransferFunction { num, den } => (degree(num), degree(den)),
            Self::ZeroPoleGain { zeros, poles, .. } => (zeros.len(), poles.len()),
            Self::StateSpace { a, .. } => (a.len().saturating_sub(1), a.len()),
            Self::Family { family, order, passband, .. } => {
                let order = order.unwrap_or(1);
                // The even orders with stop-band ripple have a zero for every pole.
                let zeros = if family.has_attenuation() { order - order % 2 } else { 0 };
                passband.degrees(zeros, order)
            }
            Self::Cascade { cascade } => {
                cascade.iter().map(Self::degrees).fold((0, 0), |sum, d| (sum.0 + d.0, sum.1 + d.1))
            }
        }
    }

    /// Phi(s / `factor`): every frequency of the filter, its cutoff or both edges of its band among them, is
    /// multiplied by `factor`, and the gain stays. The written form stays too.
    #[must_use]
    pub fn with_cutoff_scaled(&self, factor: f64) -> Self {
        let scaled = |list: &[[f64; 2]]| list.iter().map(|x| x.map(|part| part * factor)).collect();
        // A coefficient of s^k is divided by factor^k.
        let polynomial = |list: &[f64]| {
            let power = |i: usize| factor.powi((list.len() - 1 - i) as i32);
            list.iter().enumerate().map(|(i, c)| c / power(i)).collect()
        };
        let rows = |m: &[Vec<f64>]| m.iter().map(|row| row.iter().map(|x| x * factor).collect()).collect();
        match self {
            Self::TransferFunction { num, den } => {
                Self::TransferFunction { num: polynomial(num), den: polynomial(den) }
            }
            Self::ZeroPoleGain { zeros, poles, gain } => Self::ZeroPoleGain {
                zeros: scaled(zeros),
                poles: scaled(poles),
                gain: gain * factor.powi(poles.len() as i32 - zeros.len() as i32),
            },
            Self::StateSpace { a, b, c } => Self::StateSpace { a: rows(a), b: rows(b), c: c.clone() },
            Self::Family { family, order, passband, ripple_db, attenuation_db } => Self::Family {
                family: *family,
                order: *order,
                passband: passband.scaled(factor),
                ripple_db: *ripple_db,
                attenuation_db: *attenuation_db,
            },
            Self::Cascade { cascade } => Self::Cascade {
                cascade: cascade.iter().map(|stage| stage.with_cutoff_scaled(factor)).collect(),
            },
        }
    }

    /// The filters that follow each other: those of a cascade, or this one.
    pub fn stages(&self) -> &[Self] {
        match self {
            Self::Cascade { cascade } => cascade,
            single => std::slice::from_ref(single),
        }
    }

    /// [`Self::with_cutoff_scaled`] for one of the [`stages`](Self::stages), from 0; the others stay. `None`
    /// without such a stage.
    #[must_use]
    pub fn with_stage_scaled(&self, stage: usize, factor: f64) -> Option<Self> {
        let scaled = self.stages().get(stage)?.with_cutoff_scaled(factor);
        let Self::Cascade { cascade } = self else { return Some(scaled) };
        let mut cascade = cascade.clone();
        cascade[stage] = scaled;
        Some(Self::Cascade { cascade })
    }
}

fn degree(coefficients: &[f64]) -> usize {
    let leading = coefficients.iter().position(|&x| x != 0.0).unwrap_or(coefficients.len());
    (coefficients.len() - leading).saturating_sub(1)
}

/// What is known of a front end: the file of a measurement, and the size of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFilter {
    /// The file, as the spec names it: relative to the folder of the spec.
    pub path: String,
    /// What the file is.
    pub measurement: MeasurementFile,
    /// Poles of the model.
    pub order: usize,
    /// A delay of the measurement that is not of the filter: a cable's, for example.
    pub deembed: Seconds,
}

/// The kinds of files.
#[derive(Debug, Clone, PartialEq)]
pub enum MeasurementFile {
    /// Touchstone; the scattering parameter, if it is named.
    Touchstone(Option<String>),
    /// Comma-separated frequency, decibels and degrees.
    Response,
}

/// The model of a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct FilterModel {
    /// In rad/s.
    pub filter: FilterSpec,
    /// The largest |model - measurement| over the largest gain, e, as 20 log10(1 + e).
    pub error: Decibels,
}

/// Makes models of measurements; the text of an error is shown at the filter.
pub type FilterModels<'a> = dyn Fn(&MeasuredFilter) -> Result<FilterModel, String> + 'a;

/// For texts that have no folder.
pub(crate) fn no_models(_: &MeasuredFilter) -> Result<FilterModel, String> {
    Err("a measured filter is read where the spec is a file; give the fitted filter instead".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Hertz;
    use proptest::prelude::*;

    fn tf(num: &[f64], den: &[f64]) -> FilterSpec {
        FilterSpec::TransferFunction { num: num.to_vec(), den: den.to_vec() }
    }

    #[test]
    fn degrees_ignore_leading_zeros() {
        assert_eq!(tf(&[0.0, 3.0], &[0.0, 0.0, 1.0, 2.0, 1.0]).degrees(), (0, 2));
        let family = |family, order| FilterSpec::Family {
            family,
            order: Some(order),
            passband: Passband::LowPass { cutoff: Hertz(1.0) },
            ripple_db: None,
            attenuation_db: None,
        };
        assert_eq!(family(Family::Elliptic, 4).degrees(), (4, 4));
        assert_eq!(family(Family::Elliptic, 5).degrees(), (4, 5));
        assert_eq!(family(Family::Bessel, 4).degrees(), (0, 4));
        let band = |family| FilterSpec::Family {
            family,
            order: Some(3),
            passband: Passband::BandPass { low: Hertz(1.0), high: Hertz(2.0) },
            ripple_db: None,
            attenuation_db: None,
        };
        assert_eq!(band(Family::Elliptic).degrees(), (5, 6));
        assert_eq!(band(Family::Bessel).degrees(), (3, 6));
    }

    #[test]
    fn a_stage_may_be_proper_but_the_cascade_must_be_strictly_proper() {
        let (proper, pole) = (tf(&[1.0, 3.0], &[1.0, 2.0]), tf(&[1.0], &[1.0, 1.0]));
        let cascade = |stages: &[&FilterSpec]| FilterSpec::Cascade {
            cascade: stages.iter().map(|&stage| stage.clone()).collect(),
        };
        assert_eq!(cascade(&[&proper, &pole]).check(), Ok(()));
        let refused = cascade(&[&proper, &proper]).check().unwrap_err();
        assert!(refused.to_string().contains("with 2 zeros against 2 poles"), "{refused}");
        let improper = tf(&[1.0, 0.0, 0.0], &[1.0, 2.0]);
        assert_eq!(cascade(&[&improper, &pole]).check().unwrap_err().path(), "cascade[0]");
    }

    proptest! {
        /// A common factor of numerator and denominator changes no verdict.
        #[test]
        fn the_size_of_coefficients_does_not_matter(decade in -9i32..10, zeros in 0usize..6, poles in 0usize..6) {
            let size = 10f64.powi(decade);
            let check = |x: f64| tf(&vec![x; zeros + 1], &vec![x; poles + 1]).check();
            prop_assert_eq!(check(size), check(1.0));
            prop_assert_eq!(check(size).is_ok(), zeros < poles);
        }
    }
}
