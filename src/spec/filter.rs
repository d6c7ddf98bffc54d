//! Rules for a written filter that need no linear algebra: sizes, finite numbers, family parameters,
//! degrees. Stability and everything else about poles is judged by the analog module.

use super::{Family, FilterSpec};

/// Most poles a filter may have. Front ends have fewer than a dozen; at 32 poles, each of at most 1e9 rad
/// a fast period, products of poles still fit a double.
pub const MAX_ORDER: usize = 32;

/// Least ripple or attenuation in decibels that is told from none.
pub const MIN_RIPPLE_DB: f64 = 1e-6;

/// Most ripple or attenuation in decibels: 300 dB is the precision of double arithmetic.
pub const MAX_RIPPLE_DB: f64 = 300.0;

/// Why a written filter makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterProblem {
    /// A list or matrix has no entries.
    #[error("{key} is empty; {remedy}")]
    Empty {
        /// The key of the list.
        key: &'static str,
        /// What to write instead.
        remedy: &'static str,
    },
    /// A coefficient is NaN or infinite.
    #[error("{key} holds {value}; every coefficient must be a finite number")]
    NotFinite {
        /// The key of the list or number.
        key: &'static str,
        /// The offending value.
        value: f64,
    },
    /// More poles than are carried.
    #[error(
        "the filter has {order} poles, but at most {MAX_ORDER} are supported; leave out stages that do not matter"
    )]
    OrderTooHigh {
        /// The key that sets the number of poles.
        key: &'static str,
        /// Number of poles asked for.
        order: usize,
    },
    /// No pole at all.
    #[error("the filter has no pole, so it passes every frequency; give it at least one")]
    NoPoles {
        /// The key that sets the number of poles.
        key: &'static str,
    },
    /// Every denominator coefficient is zero.
    #[error("den is zero ({count} coefficients, all 0); its highest power of s needs another coefficient")]
    ZeroDenominator {
        /// How many coefficients were given.
        count: usize,
    },
    /// The filter passes nothing.
    #[error(
        "the filter is zero because {key} is; nothing of the signal would be left to sample, give it a gain"
    )]
    Zero {
        /// The key that makes it zero.
        key: &'static str,
    },
    /// As many zeros as poles, or more.
    #[error(
        "the filter is not strictly proper: with {zeros} zeros against {poles} poles it passes arbitrarily high \
         frequencies, and samples of a finite-energy signal are not defined; {remedy}"
    )]
    NotStrictlyProper {
        /// Degree of the numerator.
        zeros: usize,
        /// Degree of the denominator.
        poles: usize,
        /// What to do about it.
        remedy: String,
    },
    /// A matrix of a state-space form that does not fit the others.
    #[error(
        "{key} is {rows} x {cols}, but a filter with one input, one output and {states} states needs {expected}"
    )]
    Shape {
        /// Which matrix.
        key: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns; of the first row that does not fit, if the rows are unequal.
        cols: usize,
        /// Rows of `a`.
        states: usize,
        /// The size that fits.
        expected: String,
    },
    /// A family parameter that is missing.
    #[error("a {family} filter needs {key} ({meaning})")]
    MissingParameter {
        /// Name of the family.
        family: &'static str,
        /// Name of the missing key.
        key: &'static str,
        /// What the key means.
        meaning: &'static str,
    },
    /// A family parameter that has no meaning for the family.
    #[error("{key} = {value} has no meaning for a {family} filter; remove it")]
    NeedlessParameter {
        /// Name of the family.
        family: &'static str,
        /// Name of the key.
        key: &'static str,
        /// The value given.
        value: f64,
    },
    /// A family parameter out of its range.
    #[error("{key} = {value}{unit}: {rule}")]
    ParameterRange {
        /// Name of the key.
        key: &'static str,
        /// The value given.
        value: f64,
        /// Its unit with a leading space, or nothing.
        unit: &'static str,
        /// The rule that it breaks and the way out.
        rule: String,
    },
    /// A cascade inside a cascade.
    #[error("a cascade cannot hold another cascade; list all its stages in one")]
    NestedCascade,
    /// What is wrong with one stage of a cascade.
    #[error("cascade[{index}]: {problem}")]
    Stage {
        /// Which stage, from 0.
        index: usize,
        /// What is wrong with it.
        problem: Box<FilterProblem>,
    },
}

impl FilterProblem {
    /// The key of the filter table that the problem is about, where there is one.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            Self::Empty { key, .. }
            | Self::NotFinite { key, .. }
            | Self::OrderTooHigh { key, .. }
            | Self::NoPoles { key }
            | Self::Zero { key }
            | Self::Shape { key, .. }
            | Self::NeedlessParameter { key, .. }
            | Self::ParameterRange { key, .. } => Some(key),
            Self::ZeroDenominator { .. } => Some("den"),
            Self::NestedCascade | Self::Stage { .. } => Some("cascade"),
            Self::NotStrictlyProper { .. } | Self::MissingParameter { .. } => None,
        }
    }
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
    /// Checks everything about the written filter that does not depend on where its poles lie.
    ///
    /// # Errors
    /// The first [`FilterProblem`] found.
    pub fn check(&self) -> Result<(), FilterProblem> {
        self.check_parts()?;
        if let Self::Cascade { cascade } = self {
            for (index, stage) in cascade.iter().enumerate() {
                check_stage(stage).map_err(|p| FilterProblem::Stage { index, problem: Box::new(p) })?;
            }
        }
        let (zeros, poles) = self.degrees();
        let key = self.order_key();
        if poles == 0 {
            return Err(FilterProblem::NoPoles { key });
        }
        if poles > MAX_ORDER {
            return Err(FilterProblem::OrderTooHigh { key, order: poles });
        }
        if zeros >= poles {
            return Err(FilterProblem::NotStrictlyProper { zeros, poles, remedy: self.direct_term_remedy() });
        }
        Ok(())
    }

    /// Degrees of numerator and denominator as written (leading zeros of polynomials do not count; a
    /// state-space form without direct term counts one zero less than poles).
    pub fn degrees(&self) -> (usize, usize) {
        match self {
            Self::TransferFunction { num, den } => (degree(num), degree(den)),
            Self::ZeroPoleGain { zeros, poles, .. } => (zeros.len(), poles.len()),
            Self::StateSpace { a, .. } => (a.len().saturating_sub(1), a.len()),
            Self::Family { family, order, .. } => family_degrees(*family, order.unwrap_or(1)),
            Self::Cascade { cascade } => {
                cascade.iter().map(Self::degrees).fold((0, 0), |sum, d| (sum.0 + d.0, sum.1 + d.1))
            }
        }
    }

    /// The checks on the single entries of the table.
    fn check_parts(&self) -> Result<(), FilterProblem> {
        match self {
            Self::TransferFunction { num, den } => check_polynomials(num, den),
            Self::ZeroPoleGain { zeros, poles, gain } => check_zpk(zeros, poles, *gain),
            Self::StateSpace { a, b, c } => check_matrices(a, b, c),
            Self::Family { family, order, cutoff, ripple_db, attenuation_db } => {
                check_order(*family, *order)?;
                check_cutoff(*cutoff)?;
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

/// A stage must make sense alone, but only the whole cascade has to be strictly proper.
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

fn check_order(family: Family, order: Option<usize>) -> Result<(), FilterProblem> {
    let name = family.name();
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
        (_, Some(order)) if order > MAX_ORDER => Err(FilterProblem::OrderTooHigh { key: "order", order }),
        _ => Ok(()),
    }
}

fn check_cutoff(cutoff: f64) -> Result<(), FilterProblem> {
    check_finite("cutoff", [cutoff])?;
    if cutoff > 0.0 {
        return Ok(());
    }
    let rule = "the cutoff must be a positive frequency in hertz".into();
    Err(FilterProblem::ParameterRange { key: "cutoff", value: cutoff, unit: " Hz", rule })
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
    wanted: bool,
    meaning: &'static str,
) -> Result<(), FilterProblem> {
    let family = family.name();
    match value {
        None if wanted => Err(FilterProblem::MissingParameter { family, key, meaning }),
        Some(value) if !wanted => Err(FilterProblem::NeedlessParameter { family, key, value }),
        Some(value) if !(MIN_RIPPLE_DB..=MAX_RIPPLE_DB).contains(&value) => {
            let rule = format!("it must lie between {MIN_RIPPLE_DB:e} and {MAX_RIPPLE_DB} dB");
            Err(FilterProblem::ParameterRange { key, value, unit: " dB", rule })
        }
        _ => Ok(()),
    }
}
