//! What a design reports of integer taps, uncertain channels, the order, and a band in the spec.

use hybank::bank::{Bank, FixedPoint};
use hybank::design::quantise::{TapsOfBits, WordStudy};
use hybank::design::{
    Design, DesignError, DesignOptions, OrderErrorPoint, OrderReduction, RobustStudy, Study, design,
};
use hybank::figures::{snr, target_band};
use hybank::messages::counted;
use hybank::overview::{band, decibels_of};
use hybank::spec::{Method, SignalSpec, Spec, WordLengths};
use hybank::units::{Decibels, Hertz};

/// The increase of the error by integer taps.
#[derive(Debug, serde::Serialize)]
pub(super) struct WordReport<'a> {
    bits: &'a WordLengths,
    fraction_bits: i32,
    /// gamma of these integers over that of the real taps, both computed, in decibels.
    loss_db: f64,
    #[serde(flatten)]
    study: &'a WordStudy,
}

impl<'a> WordReport<'a> {
    pub(super) fn of(design: &'a Design) -> Option<Self> {
        let Study::Fir { words: Some(study), .. } = &design.study else { return None };
        let integers = design.bank.fixed_point.as_ref()?;
        let loss_db = study.loss_db(design.bank.gamma.norm?);
        let FixedPoint { bits, fraction_bits, .. } = integers;
        Some(Self { bits, fraction_bits: *fraction_bits, loss_db, study })
    }

    /// What was chosen for a loss, and why.
    pub(super) fn choice_text(&self) -> String {
        let Some(choice) = &self.study.choice else { return String::new() };
        let fewest = self.study.words.iter().position(|word| word.mean_square_loss_db <= choice.allowed_db);
        let fewest = fewest.unwrap_or_default();
        let fewer = fewest.checked_sub(1).map(|fewer| &self.study.words[fewer]);
        let why = match fewer {
            Some(word) => format!("{} lose {:.3} dB", word.bits, word.mean_square_loss_db),
            None => "no tap has fewer bits".to_owned(),
        };
        let of_bits = |TapsOfBits { bits, taps }: &TapsOfBits| format!("{taps} of {bits}");
        let taps: Vec<String> = choice.taps.iter().map(of_bits).collect();
        format!(
            "words      {} times 2^{}, {} left out; taps by their bits: {}, in all {} per channel\n\
             \x20          {:.3} dB of the SNR of the real taps lost, {} allowed, over the whole spectrum of the signal; {why}\n",
            self.bits,
            -self.fraction_bits,
            counted(choice.taps_left_out, "tap"),
            taps.join(", "),
            choice.bits_per_channel,
            choice.snr_loss_db,
            choice.allowed_db,
        )
    }

    pub(super) fn text(&self) -> String {
        let mut text = format!(
            "integers   times 2^{}; gamma is {:.4} dB above that of the real taps, {}\n",
            -self.fraction_bits,
            self.loss_db,
            number(self.study.real_gamma),
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

/// Share by which a robust bank must lower the worst case to be worth its higher error without errors.
const LEAST_ROBUST_GAIN: f64 = 0.01;

/// The bank and the nominal one, without errors and at worst over the spec's uncertainty.
pub(super) fn robust_text(study: &RobustStudy, proven: Option<f64>, unproven: Option<&str>) -> String {
    let RobustStudy { robust, nominal, lower, .. } = study;
    let proven = at_most(proven, unproven);
    let advice = if study.gain() < LEAST_ROBUST_GAIN {
        " only: what helps is to know the channels better; measure them"
    } else {
        ""
    };
    let advice = format!(
        "           the robust design lowers the largest gain found by {:.2} %{advice}\n",
        100.0 * study.gain()
    );
    format!(
        "robust     {} is the largest gain found over the spec's uncertainty ({proven}), {} without errors\n\
         nominal    {} is the largest found, {} without errors, for the bank that takes the errors for zero\n\
         least      {} at worst for all banks of this length (lower bound, computed)\n{advice}",
        number(robust.largest_found),
        number(robust.nominal),
        number(nominal.largest_found),
        number(nominal.nominal),
        number(*lower),
    )
}

/// What is proven of the box, or why nothing is.
fn at_most(proven: Option<f64>, unproven: Option<&str>) -> String {
    match (proven, unproven) {
        (Some(proven), _) => format!("proven: at most {}", number(proven)),
        (None, Some(reason)) => format!("not proven: {reason}"),
        (None, None) => "not proven".to_owned(),
    }
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
        number(reduced.figures.gamma),
        number(full.figures.gamma),
        rounded(reduced.loss_db)
    );
    let row = |point: &OrderErrorPoint| {
        let OrderErrorPoint { order, figures, loss_db } = point;
        let (gamma, rms) = (number(figures.gamma), number(figures.rms_error));
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
pub(super) fn number(gamma: f64) -> String {
    if gamma >= 1e-4 { format!("{gamma:.9}") } else { format!("{gamma:.6e}") }
}

/// The same, of a gamma that may be unknown.
pub(super) fn known(gamma: Option<f64>) -> String {
    gamma.map_or_else(|| "unknown".to_owned(), number)
}

/// No second design is made after one that took longer, in seconds.
const MOST_HINT_SECONDS: f64 = 10.0;
/// Gains below this are not worth a line.
const LEAST_BAND_GAIN: Decibels = Decibels(1.0);

/// The signal-to-noise ratio within the band of the target, of a bank that is designed without a signal and
/// of one that is designed for that band.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub(super) struct BandHint {
    low_hertz: Hertz,
    high_hertz: Hertz,
    snr_db: Decibels,
    instead_of_db: Decibels,
}

impl BandHint {
    /// For a design without a signal that took so many seconds; `None` where a band gains nothing.
    ///
    /// # Errors
    /// [`DesignError`] of the figures; a second design that fails is no hint.
    pub(super) fn new(found: &Design, seconds: f64) -> Result<Option<Self>, DesignError> {
        let Some(spec) = found.bank.sized_spec().filter(|spec| spec.signal.is_none()) else {
            return Ok(None);
        };
        let Some(band) = target_band(&spec)?.filter(|_| seconds < MOST_HINT_SECONDS) else { return Ok(None) };
        let signal = Some(SignalSpec::in_band(band));
        let wanted = Spec { signal, ..spec };
        let Ok(other) = design(&wanted, &DesignOptions::without_proof()) else { return Ok(None) };
        let instead_of_db = snr(&Bank { spec: Some(wanted), ..found.bank.clone() })?.total_db;
        let snr_db = snr(&other.bank)?.total_db;
        Ok((snr_db - instead_of_db >= LEAST_BAND_GAIN).then_some(Self {
            low_hertz: band.low,
            high_hertz: band.high,
            snr_db,
            instead_of_db,
        }))
    }

    /// One line.
    pub(super) fn text(&self, is_normalised: bool) -> String {
        format!(
            "signal     without [signal]; with the band {} the SNR in the band would be {} instead of {}\n",
            band(self.low_hertz, self.high_hertz, is_normalised),
            decibels_of(self.snr_db),
            decibels_of(self.instead_of_db),
        )
    }
}
