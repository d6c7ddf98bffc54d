//! The figures of a bank in the user's terms, in words.

use super::text::frequency;
use crate::figures::{
    BandSource, FigureBand, Figures, KeyFigures, Setup, Snr, ToneFigure, UsualFigure, UsualWay,
};
use crate::spec::Method;
use crate::units::{Decibels, Hertz};

/// A figure with its name and its meaning.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Fact {
    /// Its name in tables.
    pub name: &'static str,
    /// With its unit.
    pub value: String,
    /// In a sentence.
    pub meaning: String,
}

/// A [`Fact`] of its three texts.
pub(super) fn fact(name: &'static str, value: impl Into<String>, meaning: impl Into<String>) -> Fact {
    Fact { name, value: value.into(), meaning: meaning.into() }
}

const CUTOFFS: &str = "; uncertain cut-offs not counted";

/// Where neither the bank nor the best usual way has an SNR better by this, their images decide.
const NOTICED_GAIN: Decibels = Decibels(1.0);

/// Images that are lower by this are worth a bank: a bit of a converter.
const NOTICED_SFDR: Decibels = Decibels(6.0);

/// Ratios above this are rounding errors of double precision.
const EXACT: Decibels = Decibels(270.0);

/// Signal-to-noise ratio, images, error of gain, and the usual ways. In normalised time frequencies are
/// shares of the output rate.
pub fn figure_facts(figures: &Figures, is_normalised: bool) -> Vec<Fact> {
    let words = FigureTerms { figures, is_normalised };
    let snr = fact("SNR", ratio(figures.snr.total_db), words.snr());
    let rest = [
        words.image(),
        words.tone("gain error", figures.gain_error, "largest error of gain and phase of a tone"),
    ];
    std::iter::once(snr).chain(parts(&figures.snr)).chain(rest).chain(words.comparison()).collect()
}

/// What the SNR counts beside the error from the signal, each part by itself; nothing where that is all.
fn parts(snr: &Snr) -> Option<Fact> {
    let beside = [
        ("bits", snr.bits_db),
        ("noise", snr.noise_db),
        ("jitter", snr.jitter_db),
        ("uncertain delays", snr.delays_db),
        ("uncertain gains", snr.gains_db),
        ("uncertain offsets", snr.offsets_db),
    ];
    let beside: Vec<String> =
        beside.into_iter().filter_map(|(part, db)| Some(format!("{part} {}", ratio(db?)))).collect();
    let parts = || format!("signal {}, {} (each alone)", ratio(snr.signal_db), beside.join(", "));
    (!beside.is_empty()).then(|| fact("parts", "", parts()))
}

/// The signal-to-noise ratio and the largest image.
pub fn key_figures(KeyFigures { snr_db, image_db }: KeyFigures) -> String {
    let image =
        image_db.map_or_else(|| "a tone is lost".to_owned(), |image| format!("image {}", rounded(image)));
    format!("SNR {}, {image}", ratio(snr_db))
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

/// A difference in decibels with its sign; none of a zero.
fn signed(db: Decibels) -> String {
    let text = rounded(db);
    if text.starts_with('-') || text == "0.0 dB" { text } else { format!("+{text}") }
}

/// The way in words. No filter of one channel, however long, is better than what stands for one channel.
fn named(figure: &UsualFigure) -> String {
    match (figure.way, figure.channel) {
        (UsualWay::OneChannel, Some(channel)) => format!("channel {channel} alone at best"),
        (UsualWay::OneChannel, None) => "one channel alone at best".to_owned(),
        (UsualWay::Interleaving, _) => "plain interleaving".to_owned(),
        (UsualWay::OwnCorrection, _) => "each channel corrected by itself with 32 taps".to_owned(),
        (UsualWay::CubicSpline, _) => "a cubic spline".to_owned(),
        (UsualWay::LeastSquares, _) => "least-squares taps of this length".to_owned(),
    }
}

fn with_ratios(figure: &UsualFigure) -> String {
    let sfdr = figure.sfdr_db.map_or_else(String::new, |db| format!(", SFDR {}", ratio(db)));
    format!("{} ({}{sfdr})", named(figure), ratio(figure.snr_db))
}

struct FigureTerms<'a> {
    figures: &'a Figures,
    is_normalised: bool,
}

impl FigureTerms<'_> {
    fn hertz(&self, hertz: Hertz) -> String {
        frequency(hertz, self.is_normalised)
    }

    fn band(&self) -> String {
        let FigureBand { low_hertz, high_hertz, .. } = self.figures.band;
        band(low_hertz, high_hertz, self.is_normalised)
    }

    fn snr(&self) -> String {
        let Figures { snr_16_bits_db, band: FigureBand { source, .. }, any_input, setup, .. } = self.figures;
        let input = match (source, any_input) {
            (BandSource::Signal, _) => format!("for white noise in {}", self.band()),
            (BandSource::Target, Some(_)) => "for the spectrum of the spec's signal".to_owned(),
            (BandSource::Target, None) => {
                "for white noise at all frequencies: the spec does not say where the signal lies".to_owned()
            }
        };
        let bits =
            snr_16_bits_db.map_or_else(String::new, |db| format!("; {} with 16-bit converters", rounded(db)));
        let cutoffs = if setup.has_uncertain_cutoffs { CUTOFFS } else { "" };
        format!("{input}{bits}{cutoffs}")
    }

    /// What of the spec's uncertainty is in the figures of a tone, and what is not.
    fn uncertainty_of_tones(&self) -> String {
        let Snr { delays_db, gains_db, offsets_db, .. } = self.figures.snr;
        let counted = delays_db.or(gains_db).map(|_| "; rms over uncertain delays and gains");
        let offsets = offsets_db.map(|_| "; uncertain offsets not counted");
        let cutoffs = self.figures.setup.has_uncertain_cutoffs.then_some(CUTOFFS);
        [counted, offsets, cutoffs].into_iter().flatten().collect()
    }

    fn image(&self) -> Fact {
        match (self.figures.image, self.figures.setup) {
            (Some(_), Setup { ratio: 1, channels: 1, .. }) => {
                fact("SFDR", "none", "one channel at the output rate has no images")
            }
            (Some(_), Setup { ratio: 1, .. }) => {
                fact("SFDR", "none", "channels at the output rate have no images")
            }
            (figure, _) => {
                let fact = self.tone("SFDR", figure, "to the largest image of a tone");
                Fact { meaning: fact.meaning + &self.at_worst(), ..fact }
            }
        }
    }

    /// The SFDR at worst over the box of the spec's `[uncertainty]`.
    fn at_worst(&self) -> String {
        let worst = |ToneFigure { db, hertz }| {
            format!("; at worst over the box of [uncertainty] {}, at {}", rounded(-db), self.hertz(hertz))
        };
        self.figures.image_at_worst.map_or_else(String::new, worst)
    }

    fn tone(&self, name: &'static str, figure: Option<ToneFigure>, what: &str) -> Fact {
        let Some(ToneFigure { db, hertz }) = figure else {
            return fact(name, "none", format!("some tone in {} does not come through at all", self.band()));
        };
        let left_out = if self.figures.target_vanishes {
            "; the target is zero at some frequency there, which is left out"
        } else {
            ""
        };
        if -db.0 > EXACT.0 {
            let meaning = format!("below the rounding of double precision in {}{left_out}", self.band());
            return fact(name, "none", meaning);
        }
        let (band, uncertainty) = (self.band(), self.uncertainty_of_tones());
        let shown = if name == "SFDR" { -db } else { db };
        fact(
            name,
            rounded(shown),
            format!("{what} in {band}, at {}{uncertainty}{left_out}", self.hertz(hertz)),
        )
    }

    /// The bank beside the best usual way, then the other ways.
    fn comparison(&self) -> Vec<Fact> {
        let Figures { usual_ways, snr_16_bits_db, .. } = self.figures;
        let (Some((best, others)), Some(gain)) =
            (usual_ways.split_first(), self.figures.gain_over_usual_ways())
        else {
            return vec![fact("compared", "unknown", "")];
        };
        let bits = snr_16_bits_db.map_or("", |_| "; all with 16-bit converters");
        let compared = fact("compared", signed(gain), self.verdict(best, gain) + bits);
        let others: Vec<String> = others.iter().map(with_ratios).collect();
        let others = (!others.is_empty()).then(|| fact("others", "", others.join(", ")));
        std::iter::once(compared).chain(others).collect()
    }

    fn verdict(&self, best: &UsualFigure, gain: Decibels) -> String {
        let way = with_ratios(best);
        if self.figures.is_worthwhile() {
            return format!("over {way}");
        }
        match self.gain_of_sfdr(best) {
            Some(more) if gain >= -NOTICED_GAIN && more >= NOTICED_SFDR => format!(
                "against {way}: the noise decides the SNR, and the SFDR is better by {}",
                rounded(more)
            ),
            _ => format!("against {way}: this bank does not pay; {}", self.advice(best)),
        }
    }

    fn gain_of_sfdr(&self, best: &UsualFigure) -> Option<Decibels> {
        Some(-self.figures.image?.db - best.sfdr_db?)
    }

    /// What to do where the bank does not pay.
    fn advice(&self, best: &UsualFigure) -> String {
        let place = match self.figures.band.source {
            BandSource::Signal => "band",
            BandSource::Target => "signal",
        };
        let why = match (best.way, self.figures.snr_16_bits_db) {
            (UsualWay::OneChannel, Some(_)) => format!(
                "with 16-bit converters (assumed) one channel with a filter of any length would do as well for this \
                 {place}; "
            ),
            _ => String::new(),
        };
        format!("{why}use that, or {}", self.remedy(best.way))
    }

    /// What may make the bank better than a usual way, and is not done yet.
    fn remedy(&self, best: UsualWay) -> &'static str {
        let Figures { any_input, snr_16_bits_db, setup, .. } = self.figures;
        let noise_is_stated = snr_16_bits_db.is_none();
        match (best, noise_is_stated, setup.method) {
            _ if any_input.is_none() => "say in [signal] where the signal lies",
            (UsualWay::OneChannel, false, Method::H2) => "state the `noise` of the converters",
            (UsualWay::OneChannel, false, _) => {
                "state the `noise` of the converters and design with the method h2"
            }
            (UsualWay::OneChannel, true, method) if method != Method::H2 => "design with the method h2",
            _ if setup.is_recursive => "give the bank more latency",
            _ => "give the bank more latency and taps",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snr(total: f64) -> Snr {
        Snr { total_db: Decibels(total), signal_db: Decibels(total), ..Snr::default() }
    }

    fn figures(total: f64, spline: f64) -> Figures {
        let usual =
            |way, channel, total, sfdr_db| UsualFigure { way, channel, snr_db: Decibels(total), sfdr_db };
        Figures {
            band: FigureBand { low_hertz: Hertz(0.0), high_hertz: Hertz(9e3), source: BandSource::Signal },
            snr: snr(total),
            snr_16_bits_db: Some(Decibels(total.min(89.04))),
            image: Some(ToneFigure { db: Decibels(-98.76), hertz: Hertz(8.5e3) }),
            image_at_worst: None,
            gain_error: Some(ToneFigure { db: Decibels(f64::NEG_INFINITY), hertz: Hertz(0.0) }),
            target_vanishes: false,
            usual_ways: vec![
                usual(UsualWay::CubicSpline, None, spline, Some(Decibels(45.0))),
                usual(UsualWay::OneChannel, Some(2), 20.0, None),
            ],
            any_input: Some(0.9),
            setup: Setup {
                method: Method::Fir,
                is_recursive: false,
                ratio: 2,
                channels: 2,
                has_uncertain_cutoffs: false,
            },
        }
    }

    #[test]
    fn an_snr_of_several_parts_names_them() {
        let snr = Snr { bits_db: Some(Decibels(72.04)), delays_db: Some(Decibels(80.0)), ..snr(98.0) };
        let all = lines(&Figures { snr, ..figures(98.0, 48.0) });
        let want = "parts: , signal 98.0 dB, bits 72.0 dB, uncertain delays 80.0 dB (each alone)";
        assert_eq!((all.len(), &*all[1]), (6, want));
    }

    fn lines(figures: &Figures) -> Vec<String> {
        let line = |Fact { name, value, meaning }: Fact| format!("{name}: {value}, {meaning}");
        figure_facts(figures, false).into_iter().map(line).collect()
    }

    fn compared(figures: &Figures) -> String {
        lines(figures).into_iter().find(|line| line.starts_with("compared")).unwrap()
    }

    #[test]
    fn figures_are_sentences_with_units() {
        assert_eq!(
            lines(&figures(132.94, 48.0)),
            [
                "SNR: 132.9 dB, for white noise in 0 to 9 kHz; 89.0 dB with 16-bit converters",
                "SFDR: 98.8 dB, to the largest image of a tone in 0 to 9 kHz, at 8.5 kHz",
                "gain error: none, below the rounding of double precision in 0 to 9 kHz",
                "compared: +41.0 dB, over a cubic spline (48.0 dB, SFDR 45.0 dB); all with 16-bit converters",
                "others: , channel 2 alone at best (20.0 dB)",
            ]
        );
    }

    #[test]
    fn a_bank_that_does_not_pay_says_so() {
        for (own, best, value) in [
            (42.7, 48.0, "-5.3 dB"),
            (48.9, 48.0, "+0.9 dB"),
            (80.0, 89.04, "-9.0 dB"),
            (47.98, 48.0, "0.0 dB"),
        ] {
            let image = Some(ToneFigure { db: Decibels(-50.9), hertz: Hertz(8.5e3) });
            let figures = Figures { image, ..figures(own, best) };
            let line = compared(&figures);
            let verdict = format!(
                "compared: {value}, against a cubic spline ({best:.1} dB, SFDR 45.0 dB): this bank does not pay;"
            );
            assert!(line.starts_with(&verdict), "{line}");
            assert!(line.contains(" use that, or give the bank more latency and taps;"), "{line}");
            let line = compared(&Figures { any_input: None, ..figures });
            assert!(line.contains(" use that, or say in [signal] where the signal lies;"), "{line}");
        }
    }

    /// Noise may hide in the SNR what a bank gains in images, and no gain in images makes up for an SNR.
    #[test]
    fn a_bank_of_better_images_pays() {
        let against = "against a cubic spline (48.0 dB, SFDR 45.0 dB): ";
        let images =
            "the noise decides the SNR, and the SFDR is better by 53.8 dB; all with 16-bit converters";
        for (own, value) in [(48.9, "+0.9 dB"), (47.0, "-1.0 dB")] {
            assert_eq!(compared(&figures(own, 48.0)), format!("compared: {value}, {against}{images}"));
        }
        let line = compared(&figures(46.9, 48.0));
        assert!(line.starts_with(&format!("compared: -1.1 dB, {against}this bank does not pay")), "{line}");
    }

    /// One channel is better by 2 dB: with every method, and noise that is stated or not.
    #[test]
    fn no_advice_is_what_was_done_already() {
        let assumed = "with 16-bit converters (assumed) one channel with a filter of any length would do as well for \
                       this band; use that, or state the `noise` of the converters";
        for (method, is_recursive, noise_is_stated, advice) in [
            (Method::Fir, false, false, format!("{assumed} and design with the method h2")),
            (Method::H2, true, false, assumed.to_owned()),
            (Method::Fir, false, true, "use that, or design with the method h2".to_owned()),
            (Method::H2, true, true, "use that, or give the bank more latency".to_owned()),
            (Method::H2, false, true, "use that, or give the bank more latency and taps".to_owned()),
        ] {
            let mut figures = figures(68.3, 40.0);
            figures.usual_ways.swap(0, 1);
            figures.usual_ways[0].snr_db = Decibels(70.3);
            figures.setup = Setup { method, is_recursive, ..figures.setup };
            figures.snr_16_bits_db = figures.snr_16_bits_db.filter(|_| !noise_is_stated);
            let start =
                "compared: -2.0 dB, against channel 2 alone at best (70.3 dB): this bank does not pay; ";
            let bits = if noise_is_stated { "" } else { "; all with 16-bit converters" };
            assert_eq!(compared(&figures), format!("{start}{advice}{bits}"));
            assert_eq!(lines(&figures).pop().unwrap(), "others: , a cubic spline (40.0 dB, SFDR 45.0 dB)");
        }
        let mut figures = figures(42.7, 48.0);
        figures.setup.is_recursive = true;
        let line = compared(&figures);
        assert!(line.contains(" use that, or give the bank more latency;"), "{line}");
    }
}
