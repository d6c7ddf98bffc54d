//! The rules for what a filter is written with: sizes, finite numbers, family parameters.

use super::error::{At, refused};
use super::filter::{MAX_COEFFICIENT, MAX_RIPPLE_DB, MIN_RIPPLE_DB};
use super::limits::{MAX_ENTRY, within};
use super::{Family, FilterSpec, Passband, SpecError};
use crate::messages::Number;

/// Most poles of a filter. Real front ends have fewer than a dozen. The product of 32 poles, each of at
/// most 1e9 rad per fast period, still fits a double.
pub const MAX_ORDER: usize = 32;

impl FilterSpec {
    /// Checks all rules that do not depend on the values of the poles.
    ///
    /// # Errors
    /// [`SpecError`] with the key of the filter's table.
    pub fn check(&self) -> Result<(), SpecError> {
        self.check_size()?;
        let (zeros, poles) = self.degrees();
        if zeros >= poles {
            return Err(not_strictly_proper(zeros, poles, &self.direct_term_remedy()));
        }
        Ok(())
    }

    /// As [`FilterSpec::check`], for a filter that may have a direct term.
    ///
    /// # Errors
    /// [`SpecError`] with the key of the filter's table.
    pub fn check_proper(&self) -> Result<(), SpecError> {
        self.check_size()?;
        let (zeros, poles) = self.degrees();
        if zeros <= poles {
            return Ok(());
        }
        let rule = format!(
            "the filter has {zeros} zeros and {poles} poles, so it grows with frequency; give it at least as many poles as zeros"
        );
        Err(refused("", rule))
    }

    /// The entries, and the number of poles.
    fn check_size(&self) -> Result<(), SpecError> {
        self.check_parts()?;
        self.check_stages()?;
        let (key, (_, poles)) = (self.order_key(), self.degrees());
        match poles {
            0 => Err(no_poles(key)),
            1..=MAX_ORDER => Ok(()),
            order => Err(order_too_high(key, order)),
        }
    }

    fn check_stages(&self) -> Result<(), SpecError> {
        let Self::Cascade { cascade } = self else { return Ok(()) };
        cascade.iter().enumerate().try_for_each(|(index, stage)| {
            check_stage(stage).map_err(|error| error.inside(&format!("cascade[{index}]")))
        })
    }

    /// The checks on the single entries of the table.
    fn check_parts(&self) -> Result<(), SpecError> {
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

fn not_strictly_proper(zeros: usize, poles: usize, remedy: &str) -> SpecError {
    let rule = format!(
        "the filter is not strictly proper: with {zeros} zeros against {poles} poles it passes arbitrarily high \
         frequencies, and samples of a finite-energy signal are not defined; {remedy}"
    );
    refused("", rule)
}

fn no_poles(key: &'static str) -> SpecError {
    refused(key, "the filter has no pole, so it passes every frequency; give it at least one")
}

fn order_too_high(key: &'static str, order: usize) -> SpecError {
    let rule = format!(
        "the filter has {order} poles, but at most {MAX_ORDER} are supported; leave out stages that matter least"
    );
    refused(key, rule)
}

fn empty(key: &'static str, remedy: &str) -> SpecError {
    refused(key, format!("{key} is empty; {remedy}"))
}

/// A filter that is zero because `key` is.
fn check_nonzero(key: &'static str, mut values: impl Iterator<Item = f64>) -> Result<(), SpecError> {
    if values.any(|x| x != 0.0) {
        return Ok(());
    }
    let rule =
        format!("the filter is zero because {key} is, so its output carries no signal; make {key} nonzero");
    Err(refused(key, rule))
}

/// A stage must be a valid filter by itself, but only the whole cascade has to be strictly proper.
fn check_stage(stage: &FilterSpec) -> Result<(), SpecError> {
    if matches!(stage, FilterSpec::Cascade { .. }) {
        let rule = "a cascade cannot hold another cascade; list all its stages in one";
        return Err(refused("cascade", rule));
    }
    stage.check_parts()?;
    let (zeros, poles) = stage.degrees();
    if zeros > poles {
        return Err(not_strictly_proper(zeros, poles, "give the stage at least as many poles as zeros"));
    }
    Ok(())
}

fn check_sizes(key: &'static str, values: impl IntoIterator<Item = f64>, most: f64) -> Result<(), SpecError> {
    let rule = "it must be a finite number; check its unit";
    values.into_iter().try_for_each(|value| within(value, -most..=most, "(coefficient)", rule)).at(key)
}

fn check_polynomials(num: &[f64], den: &[f64]) -> Result<(), SpecError> {
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
        return Err(refused("den", rule));
    }
    check_nonzero("num", num.iter().copied())
}

fn check_zpk(zeros: &[[f64; 2]], poles: &[[f64; 2]], gain: f64) -> Result<(), SpecError> {
    check_sizes("zeros", zeros.iter().flatten().copied(), MAX_ENTRY)?;
    check_sizes("poles", poles.iter().flatten().copied(), MAX_ENTRY)?;
    check_sizes("gain", [gain], MAX_COEFFICIENT)?;
    check_nonzero("gain", [gain].into_iter())
}

fn check_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>]) -> Result<(), SpecError> {
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
            return Err(refused(key, rule));
        }
        check_sizes(key, matrix.iter().flatten().copied(), MAX_ENTRY)?;
    }
    check_nonzero("b", b.iter().flatten().copied())?;
    check_nonzero("c", c.iter().flatten().copied())
}

fn check_order(family: Family, order: Option<usize>, passband: Passband) -> Result<(), SpecError> {
    let poles = |order: usize| order.saturating_mul(passband.poles_per_order());
    match (family, order) {
        (Family::Rc, None | Some(1)) => Ok(()),
        (Family::Rc, Some(order)) => {
            let rule = "an rc filter has one pole; remove order, or choose another family";
            Err(refused("order", format!("order = {order}: {rule}")))
        }
        (_, None) => Err(missing(family, "order", "the number of poles")),
        (_, Some(0)) => Err(no_poles("order")),
        (_, Some(order)) if poles(order) > MAX_ORDER => Err(order_too_high("order", poles(order))),
        _ => Ok(()),
    }
}

fn missing(family: Family, key: &str, meaning: &str) -> SpecError {
    let rule = format!("a {} filter needs {key} ({meaning})", family.name());
    refused("", rule)
}

fn check_ripples(family: Family, ripple: Option<f64>, attenuation: Option<f64>) -> Result<(), SpecError> {
    check_decibels(family, "ripple_db", ripple)?;
    check_decibels(family, "attenuation_db", attenuation)?;
    match (ripple, attenuation) {
        (Some(ripple), Some(attenuation)) if attenuation <= ripple => {
            let rule = format!(
                "attenuation_db = {} dB: the stop-band attenuation must exceed the pass-band ripple of {} dB",
                Number(attenuation),
                Number(ripple)
            );
            Err(refused("attenuation_db", rule))
        }
        _ => Ok(()),
    }
}

/// The ripple or the attenuation of a family.
fn check_decibels(family: Family, key: &'static str, value: Option<f64>) -> Result<(), SpecError> {
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
    Err(refused(key, rule))
}
