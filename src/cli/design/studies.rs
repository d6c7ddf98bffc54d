//! What a design reports of integer taps, uncertain channels, and the order.

use crate::design::quantise::WordStudy;
use crate::design::{Design, OrderErrorPoint, OrderReduction, RobustStudy, TrackingStudy};
use crate::spec::Method;

/// The increase of the error by integer taps.
#[derive(Debug, serde::Serialize)]
pub(super) struct Words<'a> {
    fraction_bits: i32,
    /// gamma of these integers over that of the real taps, both computed, in decibels.
    loss_db: f64,
    #[serde(flatten)]
    study: &'a WordStudy,
}

impl<'a> Words<'a> {
    pub(super) fn of(design: &'a Design) -> Option<Self> {
        let (integers, study) = design.bank.fixed_point.as_ref().zip(design.words.as_ref())?;
        let loss_db = study.loss_db(design.bank.gamma.norm?);
        Some(Self { fraction_bits: integers.fraction_bits, loss_db, study })
    }

    pub(super) fn text(&self) -> String {
        let mut text = format!(
            "integers   times 2^{}; gamma is {:.4} dB above that of the real taps, {}\n",
            -self.fraction_bits,
            self.loss_db,
            number(Some(self.study.real_gamma)),
        );
        for word in &self.study.words {
            text += &format!(
                "           {:>12} times 2^{}: {:.4} dB of gamma lost, {:.2} dB of mean square (each tap rounded: {:.4} dB of gamma)\n",
                word.bits.to_string(),
                -word.fraction_bits,
                word.loss_db,
                word.mean_square_loss_db,
                word.rounded_loss_db,
            );
        }
        text
    }
}

/// A robust bank pays if it lowers the worst case by this share.
const WORTHWHILE: f64 = 0.01;

/// The bank and the nominal one, without errors and at worst over the spec's uncertainty.
pub(super) fn robust_text(study: &RobustStudy, proven: Option<f64>) -> String {
    let RobustStudy { robust, nominal, lower, .. } = study;
    let proven = at_most(proven);
    let gain = 100.0 * study.gain();
    let advice = if study.gain() < WORTHWHILE {
        format!(
            "           the robust design lowers the worst case by {gain:.2} % only: what helps is to know the channels better; \
             measure them\n"
        )
    } else {
        format!("           the robust design lowers the worst case by {gain:.2} %\n")
    };
    format!(
        "robust     {} at worst over the spec's uncertainty ({proven}), {} without errors\n\
         nominal    {} at worst, {} without errors, for the bank that takes the errors for zero\n\
         least      {} at worst for all banks of this length (lower bound, computed)\n{advice}",
        number(Some(robust.worst)),
        number(Some(robust.nominal)),
        number(Some(nominal.worst)),
        number(Some(nominal.nominal)),
        number(Some(*lower)),
    )
}

/// Taps that follow the delays, and taps that stay, over the spec's uncertainty.
pub(super) fn tracking_text(study: &TrackingStudy, proven: Option<f64>) -> String {
    let TrackingStudy { tracked, fixed, redesigned, ratio, least_ratio, .. } = study;
    let [worst, of_fixed, redesigned_worst] =
        [tracked.worst, fixed.worst, *redesigned].map(|value| number(Some(value)));
    let percent = |ratio: f64| 100.0 * (ratio - 1.0);
    format!(
        "tracked    {worst} at worst over the spec's uncertainty ({}), {} without errors\n\
         redesigned {redesigned_worst} for the delays where that is worst: {:.3} % less\n\
         \x20          at all delays at most {:.3} % above what is within reach there; no affine taps: below {:.3} %\n\
         fixed      {of_fixed} at worst, for the best taps that stay as they are\n",
        at_most(proven),
        number(Some(tracked.nominal)),
        100.0 * study.excess(),
        percent(*ratio),
        percent(*least_ratio),
    )
}

fn at_most(proven: Option<f64>) -> String {
    proven.map_or("not proven".to_owned(), |proven| format!("proven: at most {}", number(Some(proven))))
}

/// Maximum number of rows of the table of orders; the report of `--json` has all of them.
const TABLE_ROWS: usize = 32;

/// Full and reduced order, and the error for each number of states.
pub(super) fn order_text(reduction: &OrderReduction, method: Method) -> String {
    let OrderReduction { full, reduced, orders } = reduction;
    let lost = if method == Method::H2 { "of H2 error" } else { "of gamma" };
    let mut text = format!(
        "order      {} of {} states: gamma {} instead of {}, {:.4} dB {lost} lost\n",
        reduced.order,
        full.order,
        number(Some(reduced.figures.gamma)),
        number(Some(full.figures.gamma)),
        rounded(reduced.loss_db)
    );
    let row = |point: &OrderErrorPoint| {
        let OrderErrorPoint { order, figures, loss_db } = point;
        let (gamma, rms) = (number(Some(figures.gamma)), number(Some(figures.rms_error)));
        format!("{order:>10} {gamma:>14} {rms:>14} {:>10.4} dB\n", rounded(*loss_db))
    };
    if orders.len() <= TABLE_ROWS {
        text += &format!("{:>10} {:>14} {:>14} {:>13}\n", "states", "gamma", "H2 error", "loss");
        text.extend(orders.iter().map(row));
    }
    text
}

/// To the four decimals that are shown, so that no zero has a sign.
fn rounded(db: f64) -> f64 {
    (db * 1e4).round() / 1e4 + 0.0
}

/// A gamma in nine digits.
pub(super) fn number(value: Option<f64>) -> String {
    value.map_or_else(
        || "unknown".to_owned(),
        |v| if v >= 1e-4 { format!("{v:.9}") } else { format!("{v:.6e}") },
    )
}
