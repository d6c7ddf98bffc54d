//! Filters as they are written, and the rules for them that need no linear algebra: sizes, finite numbers,
//! family parameters, degrees. [`crate::analog`] checks the poles.

use super::filter_problem::MAX_ORDER;
use super::limits::MAX_ENTRY;
use super::{FilterProblem, Passband};
use crate::messages::Number;
use serde::{Deserialize, Serialize};

/// Least ripple or attenuation in decibels; less is numerically none.
pub const MIN_RIPPLE_DB: f64 = 1e-6;

/// Most ripple or attenuation in decibels: 300 dB is the precision of double arithmetic.
pub const MAX_RIPPLE_DB: f64 = 300.0;

/// Largest coefficient of a polynomial, and largest gain: they have the dimension of a power of a frequency,
/// and enter in 512 bits, so only the gain that they have in fast periods has a range.
const MAX_COEFFICIENT: f64 = f64::MAX;

/// An analog filter as written; stability is checked by [`crate::analog`].
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
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
#[non_exhaustive]
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
    /// Checks all rules that do not depend on the values of the poles.
    ///
    /// # Errors
    /// The first [`FilterProblem`] found.
    pub fn check(&self) -> Result<(), FilterProblem> {
        self.check_size()?;
        let (zeros, poles) = self.degrees();
        if zeros >= poles {
            return Err(FilterProblem::NotStrictlyProper { zeros, poles, remedy: self.direct_term_remedy() });
        }
        Ok(())
    }

    /// As [`FilterSpec::check`], for a filter that may have a direct term.
    ///
    /// # Errors
    /// The first [`FilterProblem`] found.
    pub fn check_proper(&self) -> Result<(), FilterProblem> {
        self.check_size()?;
        let (zeros, poles) = self.degrees();
        if zeros <= poles {
            return Ok(());
        }
        let rule = format!(
            "the filter has {zeros} zeros and {poles} poles, so it grows with frequency; give it at least as many poles as zeros"
        );
        Err(FilterProblem::Rule { key: None, rule })
    }

    /// The entries, and the number of poles.
    fn check_size(&self) -> Result<(), FilterProblem> {
        self.check_parts()?;
        self.check_stages()?;
        let (key, (_, poles)) = (self.order_key(), self.degrees());
        match poles {
            0 => Err(no_poles(key)),
            1..=MAX_ORDER => Ok(()),
            order => Err(order_too_high(key, order)),
        }
    }

    fn check_stages(&self) -> Result<(), FilterProblem> {
        let Self::Cascade { cascade } = self else { return Ok(()) };
        cascade.iter().enumerate().try_for_each(|(index, stage)| {
            check_stage(stage).map_err(|p| FilterProblem::Stage { index, problem: Box::new(p) })
        })
    }

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

    /// The checks on the single entries of the table.
    fn check_parts(&self) -> Result<(), FilterProblem> {
        match self {
            Self::TransferFunction { num, den } => check_polynomials(num, den),
            Self::ZeroPoleGain { zeros, poles, gain } => check_zpk(zeros, poles, *gain),
            Self::StateSpace { a, b, c } => check_matrices(a, b, c),
            Self::Family { family, order, passband, ripple_db, attenuation_db } => {
                check_order(*family, *order, *passband)?;
                passband.check()?;
                check_ripples(*family, *ripple_db, *attenuation_db)
            }
            Self::Cascade { cascade } if cascade.is_empty() => {
                Err(empty("cascade", "list the stages that follow each other"))
            }
            Self::Cascade { .. } => Ok(()),
        }
    }

    fn order_key(&self) -> &'static str {
        match self {
            Self::TransferFunction { .. } => "den",
            Self::ZeroPoleGain { .. } => "poles",
            Self::StateSpace { .. } => "a",
            Self::Family { .. } => "order",
            Self::Cascade { .. } => "cascade",
        }
    }

    fn direct_term_remedy(&self) -> String {
        const SWITCH: &str = "add the pole of the sampling switch: { cascade = [ <this filter>, { family = \"rc\", \
                              cutoff = <bandwidth of the switch in Hz> } ] }";
        match self {
            Self::Family { family, order: Some(order), .. } => {
                let (name, odd) = (family.name(), order + 1);
                format!("an even-order {name} has a direct term; {SWITCH}, or choose the odd order {odd}")
            }
            Self::Cascade { .. } => "add the pole of the sampling switch as one more stage".into(),
            _ => SWITCH.into(),
        }
    }
}

fn degree(coefficients: &[f64]) -> usize {
    let leading = coefficients.iter().position(|&x| x != 0.0).unwrap_or(coefficients.len());
    (coefficients.len() - leading).saturating_sub(1)
}

fn no_poles(key: &'static str) -> FilterProblem {
    FilterProblem::of(key, "the filter has no pole, so it passes every frequency; give it at least one")
}

fn order_too_high(key: &'static str, order: usize) -> FilterProblem {
    let rule = format!(
        "the filter has {order} poles, but at most {MAX_ORDER} are supported; leave out stages that matter least"
    );
    FilterProblem::of(key, rule)
}

fn empty(key: &'static str, remedy: &str) -> FilterProblem {
    FilterProblem::of(key, format!("{key} is empty; {remedy}"))
}

/// A filter that is zero because `key` is.
fn check_nonzero(key: &'static str, mut values: impl Iterator<Item = f64>) -> Result<(), FilterProblem> {
    if values.any(|x| x != 0.0) {
        return Ok(());
    }
    let rule =
        format!("the filter is zero because {key} is, so its output carries no signal; make {key} nonzero");
    Err(FilterProblem::of(key, rule))
}

/// A stage must be a valid filter by itself, but only the whole cascade has to be strictly proper.
fn check_stage(stage: &FilterSpec) -> Result<(), FilterProblem> {
    if matches!(stage, FilterSpec::Cascade { .. }) {
        let rule = "a cascade cannot hold another cascade; list all its stages in one";
        return Err(FilterProblem::of("cascade", rule));
    }
    stage.check_parts()?;
    let (zeros, poles) = stage.degrees();
    if zeros > poles {
        let remedy = "give the stage at least as many poles as zeros".into();
        return Err(FilterProblem::NotStrictlyProper { zeros, poles, remedy });
    }
    Ok(())
}

fn check_sizes(
    key: &'static str,
    values: impl IntoIterator<Item = f64>,
    most: f64,
) -> Result<(), FilterProblem> {
    match values.into_iter().find(|x| !(0.0..=most).contains(&x.abs())) {
        Some(value) => Err(FilterProblem::too_large(key, value, most)),
        None => Ok(()),
    }
}

fn check_polynomials(num: &[f64], den: &[f64]) -> Result<(), FilterProblem> {
    for (key, list) in [("num", num), ("den", den)] {
        if list.is_empty() {
            return Err(empty(key, "list its coefficients in descending powers of s"));
        }
        check_sizes(key, list.iter().copied(), MAX_COEFFICIENT)?;
    }
    if den.iter().all(|&x| x == 0.0) {
        let count = den.len();
        let rule = format!(
            "den is zero ({count} coefficients, all 0); its highest power of s needs another coefficient"
        );
        return Err(FilterProblem::of("den", rule));
    }
    check_nonzero("num", num.iter().copied())
}

fn check_zpk(zeros: &[[f64; 2]], poles: &[[f64; 2]], gain: f64) -> Result<(), FilterProblem> {
    check_sizes("zeros", zeros.iter().flatten().copied(), MAX_ENTRY)?;
    check_sizes("poles", poles.iter().flatten().copied(), MAX_ENTRY)?;
    check_sizes("gain", [gain], MAX_COEFFICIENT)?;
    check_nonzero("gain", [gain].into_iter())
}

fn check_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>]) -> Result<(), FilterProblem> {
    let n = a.len();
    if n == 0 {
        return Err(empty("a", "a filter needs at least one state"));
    }
    for (key, matrix, rows, cols) in [("a", a, n, n), ("b", b, n, 1), ("c", c, 1, n)] {
        let odd = matrix.iter().map(Vec::len).find(|&len| len != cols);
        if matrix.len() != rows || odd.is_some() {
            let (found_rows, found_cols) = (matrix.len(), odd.unwrap_or(cols));
            let rule = format!(
                "{key} is {found_rows} x {found_cols}, but a filter with one input, one output and {n} states needs {rows} x {cols}"
            );
            return Err(FilterProblem::of(key, rule));
        }
        check_sizes(key, matrix.iter().flatten().copied(), MAX_ENTRY)?;
    }
    check_nonzero("b", b.iter().flatten().copied())?;
    check_nonzero("c", c.iter().flatten().copied())
}

fn check_order(family: Family, order: Option<usize>, passband: Passband) -> Result<(), FilterProblem> {
    let poles = |order: usize| order.saturating_mul(passband.poles_per_order());
    match (family, order) {
        (Family::Rc, None | Some(1)) => Ok(()),
        (Family::Rc, Some(order)) => {
            let rule = "an rc filter has one pole; remove order, or choose another family";
            Err(FilterProblem::of("order", format!("order = {order}: {rule}")))
        }
        (_, None) => Err(missing(family, "order", "the number of poles")),
        (_, Some(0)) => Err(no_poles("order")),
        (_, Some(order)) if poles(order) > MAX_ORDER => Err(order_too_high("order", poles(order))),
        _ => Ok(()),
    }
}

fn missing(family: Family, key: &str, meaning: &str) -> FilterProblem {
    let rule = format!("a {} filter needs {key} ({meaning})", family.name());
    FilterProblem::Rule { key: None, rule }
}

fn check_ripples(family: Family, ripple: Option<f64>, attenuation: Option<f64>) -> Result<(), FilterProblem> {
    check_decibels(family, "ripple_db", ripple)?;
    check_decibels(family, "attenuation_db", attenuation)?;
    match (ripple, attenuation) {
        (Some(ripple), Some(attenuation)) if attenuation <= ripple => {
            let rule = format!(
                "attenuation_db = {} dB: the stop-band attenuation must exceed the pass-band ripple of {} dB",
                Number(attenuation),
                Number(ripple)
            );
            Err(FilterProblem::of("attenuation_db", rule))
        }
        _ => Ok(()),
    }
}

/// The ripple or the attenuation of a family.
fn check_decibels(family: Family, key: &'static str, value: Option<f64>) -> Result<(), FilterProblem> {
    let (is_read, meaning) = match key {
        "ripple_db" => (family.has_ripple(), "the ripple in the pass band in decibels"),
        _ => (family.has_attenuation(), "the attenuation in the stop band in decibels"),
    };
    let rule = match value {
        None if is_read => return Err(missing(family, key, meaning)),
        Some(value) if !is_read => {
            format!("{key} = {} has no meaning for a {} filter; remove it", Number(value), family.name())
        }
        Some(value) if !(MIN_RIPPLE_DB..=MAX_RIPPLE_DB).contains(&value) => {
            format!(
                "{key} = {} dB: it must lie between {MIN_RIPPLE_DB:e} and {MAX_RIPPLE_DB} dB",
                Number(value)
            )
        }
        _ => return Ok(()),
    };
    Err(FilterProblem::of(key, rule))
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
        assert!(matches!(
            cascade(&[&proper, &proper]).check(),
            Err(FilterProblem::NotStrictlyProper { zeros: 2, poles: 2, .. })
        ));
        let improper = tf(&[1.0, 0.0, 0.0], &[1.0, 2.0]);
        assert!(matches!(cascade(&[&improper, &pole]).check(), Err(FilterProblem::Stage { index: 0, .. })));
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
