//! The figures of a bank in the user's terms, in words.

use super::fact::{Fact, fact};
use super::text::frequency;
use crate::figures::{BandSource, FigureBand, Figures, SimpleFigure, SimpleWay, Snr, ToneFigure};
use crate::units::{Decibels, Hertz};

/// Ratios above this are rounding errors of double precision.
const EXACT: Decibels = Decibels(270.0);

/// Signal-to-noise ratio, images, error of gain, and the simple ways. In normalised time frequencies are
/// shares of the output rate.
pub fn figure_facts(figures: &Figures, is_normalised: bool) -> [Fact; 4] {
    let words = Words { figures, is_normalised };
    [
        fact("SNR", ratio(figures.snr.total_db), words.snr()),
        words.tone("image", figures.image, "largest image of a tone"),
        words.tone("gain error", figures.gain_error, "largest error of gain and phase of a tone"),
        words.comparison(),
    ]
}

/// Decibels with one digit after the point; "exact" where only rounding is left.
fn ratio(db: Decibels) -> String {
    if db > EXACT { "exact".to_owned() } else { rounded(db) }
}

/// A band of frequencies; in normalised time shares of the output rate.
pub fn band(low: Hertz, high: Hertz, is_normalised: bool) -> String {
    let low = if low.0 == 0.0 { "0".to_owned() } else { frequency(low, is_normalised) };
    format!("{low} to {}", frequency(high, is_normalised))
}

/// Decibels with one digit after the point.
pub fn rounded(Decibels(db): Decibels) -> String {
    // Adding zero takes the sign from a zero.
    format!("{:.1} dB", (10.0 * db).round() / 10.0 + 0.0)
}

/// The way in words.
fn named(figure: &SimpleFigure) -> String {
    match (figure.way, figure.channel) {
        (SimpleWay::OneChannel, Some(channel)) => format!("channel {channel} alone"),
        (SimpleWay::OneChannel, None) => "one channel alone".to_owned(),
        (SimpleWay::Interleaving, _) => "plain interleaving".to_owned(),
        (SimpleWay::CubicSpline, _) => "a cubic spline".to_owned(),
    }
}

fn with_ratio(figure: &SimpleFigure) -> String {
    format!("{} ({})", named(figure), ratio(figure.snr_db))
}

struct Words<'a> {
    figures: &'a Figures,
    is_normalised: bool,
}

impl Words<'_> {
    fn hertz(&self, hertz: Hertz) -> String {
        frequency(hertz, self.is_normalised)
    }

    fn band(&self) -> String {
        let FigureBand { low_hertz, high_hertz, .. } = self.figures.band;
        band(low_hertz, high_hertz, self.is_normalised)
    }

    fn snr(&self) -> String {
        let Figures { snr, snr_16_bits_db, band: FigureBand { source, .. }, any_input, .. } = self.figures;
        let Snr { signal_db, noise_db, delays_db, .. } = *snr;
        let input = match (source, any_input) {
            (BandSource::Signal, _) => format!("for white noise in {}", self.band()),
            (BandSource::Target, Some(_)) => "for the spectrum of the spec's signal".to_owned(),
            (BandSource::Target, None) => {
                "for white noise at all frequencies: the spec does not say where the signal lies".to_owned()
            }
        };
        let parts: Vec<String> = [
            ("the signal", noise_db.or(delays_db).map(|_| signal_db)),
            ("the converters' noise", noise_db),
            ("uncertain delays", delays_db),
        ]
        .into_iter()
        .filter_map(|(part, db)| db.map(|db| format!("{part} {}", ratio(db))))
        .collect();
        let parts = if parts.is_empty() { String::new() } else { format!("; from {}", parts.join(", ")) };
        let bits =
            snr_16_bits_db.map_or_else(String::new, |db| format!("; {} with 16-bit converters", rounded(db)));
        format!("{input}{parts}{bits}")
    }

    fn tone(&self, name: &'static str, figure: Option<ToneFigure>, what: &str) -> Fact {
        let Some(ToneFigure { db, hertz }) = figure else {
            return fact(name, "none", format!("some tone in {} does not come through at all", self.band()));
        };
        let value = if -db.0 > EXACT.0 { "none".to_owned() } else { rounded(db) };
        let left_out = if self.figures.target_vanishes {
            "; the target is zero at some frequency there, which is left out"
        } else {
            ""
        };
        fact(name, value, format!("{what} in {}, at {}{left_out}", self.band(), self.hertz(hertz)))
    }

    /// The bank beside the best simple way, and the other ways.
    fn comparison(&self) -> Fact {
        let Some((best, others)) = self.figures.simple.split_first() else {
            return fact("compared", "unknown", "");
        };
        let Some(gain) = self.figures.gain_over_simple() else { return fact("compared", "unknown", "") };
        let verdict = if self.figures.is_worthwhile() {
            format!("over {}", with_ratio(best))
        } else {
            format!(
                "this bank does not pay beside {}; use that, or {}",
                with_ratio(best),
                self.remedy(best.way)
            )
        };
        let rest: Vec<String> = others.iter().map(with_ratio).collect();
        let bits = self.figures.snr_16_bits_db.map_or("", |_| "; all with 16-bit converters");
        fact("compared", format!("{:+.1} dB", gain.0), format!("{verdict}; {}{bits}", rest.join(", ")))
    }

    /// What may make the bank better than a simple way.
    fn remedy(&self, best: SimpleWay) -> &'static str {
        let knows_signal = self.figures.any_input.is_some();
        match best {
            _ if !knows_signal => "say in [signal] where the signal lies",
            SimpleWay::OneChannel => "state the `noise` of the converters and design with the method h2",
            SimpleWay::Interleaving | SimpleWay::CubicSpline => "give the bank more latency and taps",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snr(total: f64) -> Snr {
        Snr { total_db: Decibels(total), signal_db: Decibels(total), noise_db: None, delays_db: None }
    }

    fn figures(total: f64, spline: f64) -> Figures {
        let simple = |way, channel, total| SimpleFigure { way, channel, snr_db: Decibels(total) };
        Figures {
            band: FigureBand { low_hertz: Hertz(0.0), high_hertz: Hertz(9e3), source: BandSource::Signal },
            snr: snr(total),
            snr_16_bits_db: Some(Decibels(total.min(89.04))),
            image: Some(ToneFigure { db: Decibels(-98.76), hertz: Hertz(8.5e3) }),
            gain_error: Some(ToneFigure { db: Decibels(f64::NEG_INFINITY), hertz: Hertz(0.0) }),
            target_vanishes: false,
            simple: vec![
                simple(SimpleWay::CubicSpline, None, spline),
                simple(SimpleWay::OneChannel, Some(2), 20.0),
            ],
            any_input: Some(0.9),
        }
    }

    fn lines(figures: &Figures) -> Vec<String> {
        let line = |Fact { name, value, meaning }: Fact| format!("{name}: {value}, {meaning}");
        figure_facts(figures, false).map(line).into()
    }

    #[test]
    fn figures_are_sentences_with_units() {
        assert_eq!(
            lines(&figures(132.94, 48.0)),
            [
                "SNR: 132.9 dB, for white noise in 0 to 9 kHz; 89.0 dB with 16-bit converters",
                "image: -98.8 dB, largest image of a tone in 0 to 9 kHz, at 8.5 kHz",
                "gain error: none, largest error of gain and phase of a tone in 0 to 9 kHz, at 0 Hz",
                "compared: +41.0 dB, over a cubic spline (48.0 dB); channel 2 alone \
                 (20.0 dB); all with 16-bit converters",
            ]
        );
    }

    #[test]
    fn a_bank_that_does_not_pay_says_so() {
        for (own, best, value) in [(42.7, 48.0, "-5.3 dB"), (48.9, 48.0, "+0.9 dB"), (80.0, 89.04, "-9.0 dB")]
        {
            let line = lines(&figures(own, best)).pop().unwrap();
            let verdict = format!("compared: {value}, this bank does not pay beside a cubic spline");
            assert!(line.starts_with(&verdict), "{line}");
            assert!(line.contains("; use that, or give the bank more latency and taps;"), "{line}");
            let unknown = Figures { any_input: None, ..figures(own, best) };
            let line = lines(&unknown).pop().unwrap();
            assert!(line.contains("; use that, or say in [signal] where the signal lies;"), "{line}");
        }
    }

    #[test]
    fn parts_are_named_and_missing_tones_are_said() {
        let mut figures = figures(60.0, 48.0);
        figures.snr = Snr { noise_db: Some(Decibels(61.0)), delays_db: Some(Decibels(70.0)), ..figures.snr };
        figures.snr_16_bits_db = None;
        figures.image = None;
        figures.target_vanishes = true;
        let lines = lines(&figures);
        let parts = "; from the signal 60.0 dB, the converters' noise 61.0 dB, uncertain delays 70.0 dB";
        assert!(lines[0].ends_with(parts), "{}", lines[0]);
        assert_eq!(lines[1], "image: none, some tone in 0 to 9 kHz does not come through at all");
        assert!(lines[2].ends_with("left out"), "{}", lines[2]);
        assert!(lines[3].ends_with("alone (20.0 dB)"), "{}", lines[3]);
    }
}
