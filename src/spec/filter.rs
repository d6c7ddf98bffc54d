//! Rules for a written filter that need no linear algebra: sizes, finite numbers, family parameters,
//! degrees. [`crate::analog`] checks the poles.

use super::filter_problem::MAX_ORDER;
use super::{Family, FilterProblem, FilterSpec, Passband};

/// Least ripple or attenuation in decibels; less is numerically none.
pub const MIN_RIPPLE_DB: f64 = 1e-6;

/// Most ripple or attenuation in decibels: 300 dB is the precision of double arithmetic.
pub const MAX_RIPPLE_DB: f64 = 300.0;

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
        if zeros > poles { Err(FilterProblem::Improper { zeros, poles }) } else { Ok(()) }
    }

    /// The entries, and the number of poles.
    fn check_size(&self) -> Result<(), FilterProblem> {
        self.check_parts()?;
        self.check_stages()?;
        let (key, (_, poles)) = (self.order_key(), self.degrees());
        match poles {
            0 => Err(FilterProblem::NoPoles { key }),
            1..=MAX_ORDER => Ok(()),
            order => Err(FilterProblem::OrderTooHigh { key, order }),
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
                passband.degrees(family_degrees(*family, order.unwrap_or(1)))
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
                Err(FilterProblem::Empty { key: "cascade", remedy: "list the stages that follow each other" })
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

/// Zeros and poles of a family member; the even orders with stop-band ripple have a zero for every pole.
fn family_degrees(family: Family, order: usize) -> (usize, usize) {
    (if family.has_attenuation() { order - order % 2 } else { 0 }, order)
}

/// A stage must be a valid filter by itself, but only the whole cascade has to be strictly proper.
fn check_stage(stage: &FilterSpec) -> Result<(), FilterProblem> {
    if matches!(stage, FilterSpec::Cascade { .. }) {
        return Err(FilterProblem::NestedCascade);
    }
    stage.check_parts()?;
    let (zeros, poles) = stage.degrees();
    if zeros > poles {
        let remedy = "give the stage at least as many poles as zeros".into();
        return Err(FilterProblem::NotStrictlyProper { zeros, poles, remedy });
    }
    Ok(())
}

fn check_finite(key: &'static str, values: impl IntoIterator<Item = f64>) -> Result<(), FilterProblem> {
    match values.into_iter().find(|x| !x.is_finite()) {
        Some(value) => Err(FilterProblem::NotFinite { key, value }),
        None => Ok(()),
    }
}

fn check_polynomials(num: &[f64], den: &[f64]) -> Result<(), FilterProblem> {
    for (key, list) in [("num", num), ("den", den)] {
        if list.is_empty() {
            return Err(FilterProblem::Empty {
                key,
                remedy: "list its coefficients in descending powers of s",
            });
        }
        check_finite(key, list.iter().copied())?;
    }
    if den.iter().all(|&x| x == 0.0) {
        return Err(FilterProblem::ZeroDenominator { count: den.len() });
    }
    if num.iter().all(|&x| x == 0.0) {
        return Err(FilterProblem::Zero { key: "num" });
    }
    Ok(())
}

fn check_zpk(zeros: &[[f64; 2]], poles: &[[f64; 2]], gain: f64) -> Result<(), FilterProblem> {
    check_finite("zeros", zeros.iter().flatten().copied())?;
    check_finite("poles", poles.iter().flatten().copied())?;
    check_finite("gain", [gain])?;
    if gain == 0.0 { Err(FilterProblem::Zero { key: "gain" }) } else { Ok(()) }
}

fn check_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>]) -> Result<(), FilterProblem> {
    let n = a.len();
    if n == 0 {
        return Err(FilterProblem::Empty { key: "a", remedy: "a filter needs at least one state" });
    }
    for (key, matrix, rows, cols) in [("a", a, n, n), ("b", b, n, 1), ("c", c, 1, n)] {
        let odd = matrix.iter().map(Vec::len).find(|&len| len != cols);
        if matrix.len() != rows || odd.is_some() {
            let (found, expected) = (odd.unwrap_or(cols), format!("{rows} x {cols}"));
            return Err(FilterProblem::Shape { key, rows: matrix.len(), cols: found, states: n, expected });
        }
        check_finite(key, matrix.iter().flatten().copied())?;
    }
    for (key, matrix) in [("b", b), ("c", c)] {
        if matrix.iter().flatten().all(|&x| x == 0.0) {
            return Err(FilterProblem::Zero { key });
        }
    }
    Ok(())
}

fn check_order(family: Family, order: Option<usize>, passband: Passband) -> Result<(), FilterProblem> {
    let name = family.name();
    let poles = |order: usize| order.saturating_mul(passband.poles_per_order());
    match (family, order) {
        (Family::Rc, None | Some(1)) => Ok(()),
        (Family::Rc, Some(order)) => {
            let rule = "an rc filter has one pole; remove order, or choose another family".into();
            Err(FilterProblem::ParameterRange { key: "order", value: order as f64, unit: "", rule })
        }
        (_, None) => Err(FilterProblem::MissingParameter {
            family: name,
            key: "order",
            meaning: "the number of poles",
        }),
        (_, Some(0)) => Err(FilterProblem::NoPoles { key: "order" }),
        (_, Some(order)) if poles(order) > MAX_ORDER => {
            Err(FilterProblem::OrderTooHigh { key: "order", order: poles(order) })
        }
        _ => Ok(()),
    }
}

fn check_ripples(family: Family, ripple: Option<f64>, attenuation: Option<f64>) -> Result<(), FilterProblem> {
    let ripple_meaning = "the ripple in the pass band in decibels";
    let attenuation_meaning = "the attenuation in the stop band in decibels";
    check_decibels(family, "ripple_db", ripple, family.has_ripple(), ripple_meaning)?;
    check_decibels(family, "attenuation_db", attenuation, family.has_attenuation(), attenuation_meaning)?;
    match (ripple, attenuation) {
        (Some(ripple), Some(attenuation)) if attenuation <= ripple => {
            let rule = format!("the stop-band attenuation must exceed the pass-band ripple of {ripple} dB");
            Err(FilterProblem::ParameterRange {
                key: "attenuation_db",
                value: attenuation,
                unit: " dB",
                rule,
            })
        }
        _ => Ok(()),
    }
}

fn check_decibels(
    family: Family,
    key: &'static str,
    value: Option<f64>,
    required: bool,
    meaning: &'static str,
) -> Result<(), FilterProblem> {
    let family = family.name();
    match value {
        None if required => Err(FilterProblem::MissingParameter { family, key, meaning }),
        Some(value) if !required => Err(FilterProblem::NeedlessParameter { family, key, value }),
        Some(value) if !(MIN_RIPPLE_DB..=MAX_RIPPLE_DB).contains(&value) => {
            let rule = format!("it must lie between {MIN_RIPPLE_DB:e} and {MAX_RIPPLE_DB} dB");
            Err(FilterProblem::ParameterRange { key, value, unit: " dB", rule })
        }
        _ => Ok(()),
    }
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
