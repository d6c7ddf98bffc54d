//! The report of `hybank design` and `hybank import` on a finished bank, as text and as JSON.

use super::design_studies::{BandHint, WordReport, known, number, order_text, robust_text};
use super::proof_search::{SearchCut, Searched};
use hybank::bank::{Bank, Gamma, SynthesisFilters};
use hybank::design::{
    DesignError, GammaScale, MeanAnalysis, OrderReduction, RobustStudy, Study, analyze_mean,
};
use hybank::figures::Figures;
use hybank::messages::{Quoted, counted};
use hybank::overview::{
    Fact, decibels, figure_facts, frequency, six_digits, understood, uselessness, warnings,
};
use hybank::spec::Method;
use hybank::units::Hertz;
use hybank::verify::Verified;

/// The report; serialised it is that of `--json`.
#[derive(Debug, serde::Serialize)]
pub(super) struct DesignReport<'a> {
    bank: String,
    /// The spec in units of the user.
    understood: String,
    method: Method,
    channels: usize,
    ratio: usize,
    latency: usize,
    latency_chosen: bool,
    taps: Option<usize>,
    taps_chosen: bool,
    states: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reduction: Option<&'a OrderReduction>,
    gamma: &'a Gamma,
    /// For integer taps.
    #[serde(skip_serializing_if = "Option::is_none")]
    words: Option<WordReport<'a>>,
    /// For a spec with `[uncertainty]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    robust: Option<&'a RobustStudy>,
    #[serde(flatten)]
    judged: JudgedBank,
    /// Hertz, at the slow rate to which all frequencies alias.
    peak_hertz: Hertz,
    #[serde(skip)]
    is_normalised: bool,
    seconds: f64,
    #[serde(flatten)]
    proof: ProofReport,
}

/// What is computed of a finished bank for its report.
#[derive(Debug, serde::Serialize)]
pub(super) struct JudgedBank {
    #[serde(flatten)]
    pub(super) mean: MeanAnalysis,
    pub(super) scale: GammaScale,
    pub(super) figures: Figures,
    /// For a spec without a signal.
    #[serde(rename = "with_band", skip_serializing_if = "Option::is_none")]
    pub(super) hint: Option<BandHint>,
}

impl JudgedBank {
    /// Of a bank with its spec.
    pub(super) fn new(bank: &Bank) -> Result<Self, DesignError> {
        let (mean, scale) = (analyze_mean(bank)?, GammaScale::new(bank, &[])?);
        Ok(Self { mean, scale, figures: Figures::new(bank)?, hint: None })
    }

    /// What a user of the bank should know.
    pub(super) fn warnings(&self, bank: &Bank) -> Vec<String> {
        warnings(bank, &self.mean, &self.scale, &self.figures)
    }

    /// Refuses a bank that is of no use.
    pub(super) fn check_useful(&self, bank: &Bank) -> Result<(), String> {
        match uselessness(bank, &self.scale, &self.figures) {
            Some(reason) => {
                Err(format!("the bank would be of no use, so it is not written: {reason}; --force writes it"))
            }
            None => Ok(()),
        }
    }
}

/// The bounds that `hybank verify` will prove for the file.
#[derive(Debug, serde::Serialize)]
struct ProofReport {
    proven: Option<Verified>,
    /// Why there is no proof in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    unproven: Option<String>,
    /// Why the search was cut, if it was.
    #[serde(skip)]
    cut: Option<SearchCut>,
    /// Why the proof does not cover the errors of the spec's `[uncertainty]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    box_unproven: Option<String>,
    #[serde(rename = "proof_seconds")]
    seconds: f64,
}

impl ProofReport {
    fn of(Searched { design, cut }: &Searched) -> Self {
        let gamma = |reason: &DesignError| cut.map_or_else(|| reason.to_string(), SearchCut::of_gamma);
        let of_box = |reason: &DesignError| cut.map_or_else(|| reason.to_string(), SearchCut::of_box);
        Self {
            proven: design.proof.as_ref().ok().copied(),
            unproven: design.proof.as_ref().err().map(gamma),
            cut: *cut,
            box_unproven: design.box_unproven.as_ref().map(of_box),
            seconds: design.proof_time.as_secs_f64(),
        }
    }

    fn of_box(&self) -> Option<&str> {
        self.box_unproven.as_deref()
    }

    fn text(&self) -> String {
        match (&self.proven, &self.unproven) {
            (Some(Verified { attained, upper, .. }), _) => format!(
                "proven     [{}, {}] in {:.1} ms (see hybank verify)\n",
                number(*attained),
                number(*upper),
                self.seconds * 1e3
            ),
            (_, Some(reason)) => format!("proven     no: {reason}\n"),
            _ => String::new(),
        }
    }
}

impl<'a> DesignReport<'a> {
    /// Of a bank written to `output`, designed in so many seconds.
    pub(super) fn new(output: String, found: &'a Searched, judged: JudgedBank, seconds: f64) -> Self {
        let design = &found.design;
        let bank = &design.bank;
        let (reduction, robust) = match &design.study {
            Study::Fir { robust, .. } => (None, robust.as_ref()),
            Study::Recursive { reduction } => (reduction.as_ref(), None),
        };
        let (taps, states) = match &bank.filters {
            SynthesisFilters::Fir(taps) => (taps.first().map(Vec::len), None),
            SynthesisFilters::StateSpace(block) => (None, Some(block.a.len())),
        };
        Self {
            bank: output,
            understood: bank.sized_spec().as_ref().map(understood).unwrap_or_default(),
            method: bank.method,
            channels: bank.channel_count(),
            ratio: bank.ratio,
            latency: bank.latency,
            latency_chosen: design.sizing.latency_chosen,
            taps,
            taps_chosen: design.sizing.taps_chosen,
            states,
            reduction,
            gamma: &bank.gamma,
            words: WordReport::of(design),
            robust,
            judged,
            peak_hertz: design.peak_frequency.in_hertz(bank.slow_period()),
            is_normalised: bank.is_normalised(),
            seconds,
            proof: ProofReport::of(found),
        }
    }

    /// Five lines, the last of them gamma; all that is known with `verbose`.
    pub(super) fn text(&self, verbose: bool) -> String {
        let terms = [self.heading(), figure_text(&self.judged.figures, self.is_normalised)].concat();
        if !verbose {
            return terms + &self.choice() + &self.hint() + &self.gamma_line();
        }
        let parts = [
            format!("{}\n", self.understood),
            terms,
            self.gamma_text(),
            self.mean_text(),
            self.hint(),
            self.choice(),
            self.words.as_ref().map(WordReport::text).unwrap_or_default(),
            self.reduction.map(|reduction| order_text(reduction, self.method)).unwrap_or_default(),
            self.robust
                .map(|study| robust_text(study, self.gamma.worst_case, self.proof.of_box()))
                .unwrap_or_default(),
            format!("designed in {:.1} ms\n", self.seconds * 1e3),
            self.proof.text(),
        ];
        parts.concat()
    }
}

impl DesignReport<'_> {
    /// The sizes of the bank.
    fn heading(&self) -> String {
        let chosen = if self.latency_chosen { " (chosen; set `latency` to change it)" } else { "" };
        format!(
            "{}: {}, {}, ratio {}, {}, latency {}{chosen}\n",
            Quoted(&self.bank),
            self.method.name(),
            counted(self.channels, "channel"),
            self.ratio,
            self.size(),
            self.latency,
        )
    }

    /// How integer taps were chosen for a loss.
    fn choice(&self) -> String {
        self.words.as_ref().map(WordReport::choice_text).unwrap_or_default()
    }

    fn hint(&self) -> String {
        self.judged.hint.map_or_else(String::new, |hint| hint.text(self.is_normalised))
    }

    /// The worst case in one line, proven or not.
    fn gamma_line(&self) -> String {
        let proof = match (&self.proof.proven, self.proof.cut) {
            (Some(proven), _) => format!("proven: at most {}", number(proven.upper)),
            (None, Some(cut)) => format!("computed, {}", cut.of_gamma()),
            (None, None) => "computed, not proven; --verbose says why".to_owned(),
        };
        let input =
            if self.judged.figures.any_input.is_some() { "the signal's source w" } else { "the input" };
        format!(
            "gamma      {} (worst-case gain from {input} to the error; {proof}{})\n",
            known(self.gamma.norm),
            self.above_lower()
        )
    }

    /// How far gamma is above the computed lower bound.
    fn above_lower(&self) -> String {
        match (self.gamma.norm, self.gamma.lower) {
            (Some(norm), Some(lower)) if lower > 0.0 => {
                format!("; gamma / lower: {}", six_digits(norm / lower))
            }
            _ => String::new(),
        }
    }

    fn size(&self) -> String {
        match (self.taps, self.states) {
            (Some(taps), _) if self.taps_chosen => {
                format!("{} per channel (chosen; set `taps` to change it)", counted(taps, "tap"))
            }
            (Some(taps), _) => format!("{} per channel", counted(taps, "tap")),
            (_, Some(states)) => counted(states, "state"),
            _ => String::new(),
        }
    }

    /// The worst case, with its scale and the bounds of other banks.
    fn gamma_text(&self) -> String {
        let Gamma { norm, lower, noncausal, .. } = *self.gamma;
        format!(
            "gamma      {} (computed norm of this bank; worst at {} modulo the slow rate)\n\
             {}{}lower      {} ({}{})\n\
             noncausal  {} ({})\n",
            known(norm),
            frequency(self.peak_hertz, self.is_normalised),
            self.scale_text(),
            any_input(self.judged.figures.any_input),
            known(lower),
            self.lower_meaning(),
            self.above_lower(),
            known(noncausal),
            if noncausal.is_none() { UNRESOLVED } else { "computed lower bound for any latency" },
        )
    }

    fn lower_meaning(&self) -> String {
        let banks = match (self.method, self.taps) {
            _ if self.gamma.lower.is_none() => return UNRESOLVED.to_owned(),
            (Method::Fir, _) => "FIR banks of this length",
            (Method::Iir, _) => "causal banks of this latency",
            (_, Some(_)) => "FIR banks of this length; this method does not aim at gamma",
            (_, None) => "causal banks of this latency; this method does not aim at gamma",
        };
        format!("computed lower bound for {banks}")
    }

    /// What is to be expected of signals and noise that are not the worst ones.
    fn mean_text(&self) -> String {
        let MeanAnalysis { rms_error, noise_gain, output_noise, .. } = self.judged.mean;
        let signal = match self.judged.figures.any_input {
            Some(_) => {
                "the whole spectrum that the bank is designed for, the floor outside the band included"
            }
            None => "a signal with the target's spectrum",
        };
        format!(
            "H2 error   {} (rms, for white noise of unit density at the analog input)\n\
             SNR        {} for {signal}\n\
             noise gain {} ({})\n",
            number(rms_error),
            decibels(self.judged.scale.rms_reference, rms_error),
            six_digits(noise_gain),
            if output_noise == 0.0 {
                "the spec gives the converters no noise".to_owned()
            } else {
                format!("converters' noise at the output: {output_noise:.3e} of full scale")
            },
        )
    }

    /// gamma beside that of the simplest banks.
    fn scale_text(&self) -> String {
        let Some(gamma) = self.gamma.norm else { return String::new() };
        let GammaScale { zero_output, interleaving, .. } = self.judged.scale;
        let zero = against(gamma, zero_output, "zero output");
        format!("           {zero}, {}\n", against(gamma, interleaving, "plain interleaving"))
    }
}

/// gamma for inputs of any frequency, where the bank is made for a signal.
fn any_input(gamma: Option<f64>) -> String {
    gamma.map_or_else(String::new, |gamma| {
        format!("any input  {} (gamma without the signal)\n", six_digits(gamma))
    })
}

/// gamma beside that of another bank.
pub(super) fn against(gamma: f64, other: f64, what: &str) -> String {
    if other == 0.0 {
        return format!("{what} makes no error at all");
    }
    format!("{} against {what} ({})", decibels(gamma, other), six_digits(other))
}

/// The figures in the user's terms, one line each.
pub(super) fn figure_text(figures: &Figures, is_normalised: bool) -> String {
    let line = |Fact { name, value, meaning }: Fact| {
        let colon = if value == "none" { ":" } else { "" };
        let texts = [value + colon, meaning].into_iter().filter(|text| !text.is_empty());
        format!("{name:<10} {}\n", texts.collect::<Vec<_>>().join(" "))
    };
    figure_facts(figures, is_normalised).into_iter().map(line).collect()
}

/// Why no bound is stated.
const UNRESOLVED: &str = "two delays differ by less than double precision resolves";
