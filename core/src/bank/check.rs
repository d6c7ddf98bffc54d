//! The invariants of every bank, read or designed.

use crate::spec::{
    At, FrameSample, MAX_CHANNELS, MAX_ENTRY, MAX_RATIO, Refusal, Spec, SpecProblem, check_fast_period,
    check_fraction_bits, check_gain, check_offset,
};
use crate::units::Seconds;

use super::{
    Bank, BankError, BankProblem, BoxProof, Certificate, FixedPoint, GainWitness, Gamma, NormBound, Proof,
    StateSpace, SynthesisFilters,
};

/// Largest m0 in a bank file. `fuse` appends as many zeros to a recording; 16 million are 3 minutes at 96
/// kHz.
pub const MAX_BANK_LATENCY: usize = 1 << 24;

/// Relative difference between a number of the bank and the same number in the spec that counts as
/// rounding.
const SPEC_TOLERANCE: f64 = 1e-9;

type Checked = Result<(), BankError>;

fn refuse(path: impl Into<String>, problem: impl Into<BankProblem>) -> Checked {
    Err(Refusal::new(path, problem))
}

fn out_of_range(path: impl Into<String>, value: f64, unit: &'static str, rule: impl Into<String>) -> Checked {
    refuse(path, SpecProblem::Range { value, unit, rule: rule.into() })
}

/// A list at `path` has `expected` entries, counted in `unit`.
fn check_length(
    path: impl Into<String>,
    found: usize,
    expected: usize,
    unit: &'static str,
    rule: &'static str,
) -> Checked {
    if found == expected { Ok(()) } else { refuse(path, BankProblem::Length { found, expected, unit, rule }) }
}

/// A certified norm is zero or more, and not too large.
fn check_norm(path: &str, gamma: f64) -> Checked {
    if (0.0..=MAX_ENTRY).contains(&gamma) {
        return Ok(());
    }
    out_of_range(path, gamma, "(h = 1)", format!("a norm is zero or more, and at most {MAX_ENTRY:e}"))
}

impl Bank {
    /// Checks everything that can be checked without linear algebra: numbers finite and in range, lists and
    /// matrices of matching sizes, filters that fit the method, a spec that agrees with the bank.
    ///
    /// This does not check whether a state-space bank is stable; the design modules do.
    ///
    /// # Errors
    /// [`BankError`] with an empty file name and the JSON place of the first thing that is wrong.
    pub fn check(&self) -> Result<(), BankError> {
        self.check_scalars()?;
        check_delays(&self.delays, self.fast_period)?;
        self.check_samples()?;
        check_converters("gain", &self.gains, self.channel_count(), check_gain)?;
        check_converters("offset", &self.offsets, self.channel_count(), check_offset)?;
        check_gamma(&self.gamma)?;
        self.check_method()?;
        match &self.filters {
            SynthesisFilters::Fir(taps) => self.check_taps(taps)?,
            SynthesisFilters::StateSpace(block) => check_block(block, self.ratio, self.frame_samples())?,
        }
        self.fixed_point.as_ref().map_or(Ok(()), |words| self.check_fixed_point(words))?;
        self.check_proof()?;
        self.spec.as_ref().map_or(Ok(()), |spec| self.check_spec(spec))
    }

    /// The taps are the integers, and each integer fits its bits.
    fn check_fixed_point(&self, words: &FixedPoint) -> Checked {
        let SynthesisFilters::Fir(taps) = &self.filters else {
            let (method, expected, found) = (self.method.name(), "state_space", "fixed_point");
            return refuse("fixed_point", BankProblem::Filters { method, expected, found });
        };
        words.bits.check(None).at("fixed_point.bits")?;
        check_fraction_bits(words.fraction_bits).at("fixed_point.fraction_bits")?;
        let check = |found, expected, unit| {
            check_length("fixed_point.integers", found, expected, unit, "there is an integer for each tap")
        };
        check(words.integers.len(), taps.len(), "lists of integers")?;
        for (i, (integers, taps)) in words.integers.iter().zip(taps).enumerate() {
            check(integers.len(), taps.len(), "integers")?;
            for (n, (&integer, &tap)) in integers.iter().zip(taps).enumerate() {
                let (least, most) = words.bits.span(n);
                if !(least..=most).contains(&integer) {
                    let rule = format!("with {} bits it is from {least} to {most}", words.bits.bits(n));
                    let path = format!("fixed_point.integers[{i}][{n}]");
                    return out_of_range(path, integer as f64, "(integer tap)", rule);
                }
                if tap != integer as f64 * words.step() {
                    let path = format!("{}[{n}]", self.taps_path(i));
                    return refuse(path, BankProblem::NotTheInteger { tap, integer, step: words.step() });
                }
            }
        }
        Ok(())
    }

    /// Each converter has a sample in a frame, and a latency covers the wait for the last one.
    fn check_samples(&self) -> Checked {
        let rule = "every channel has a number of samples per frame";
        check_length("channels", self.samples.len(), self.channel_count(), "numbers of samples", rule)?;
        if let Some(i) = self.samples.iter().position(|&samples| !(1..=MAX_CHANNELS).contains(&samples)) {
            let rule = format!("a converter has 1 to {MAX_CHANNELS} samples per frame");
            return out_of_range(format!("channels[{i}].samples"), self.samples[i] as f64, "samples", rule);
        }
        let count = self.frame_samples();
        if count > MAX_CHANNELS {
            let rule = format!("a frame has at most {MAX_CHANNELS} samples");
            return out_of_range("channels", count as f64, "samples", rule);
        }
        if self.latency < self.wait() {
            let rule = format!(
                "the last sample of a frame comes {} fast samples after the first, which the latency includes",
                self.wait()
            );
            return out_of_range("latency", self.latency as f64, "fast samples", rule);
        }
        Ok(())
    }

    /// The place of the taps of sample `i` of a frame.
    fn taps_path(&self, i: usize) -> String {
        match self.layout().iter().nth(i) {
            Some(FrameSample { converter, number }) if self.samples[converter] > 1 => {
                format!("channels[{converter}].taps[{number}]")
            }
            Some(FrameSample { converter, .. }) => format!("channels[{converter}].taps"),
            None => format!("channels[{i}].taps"),
        }
    }

    fn check_taps(&self, taps: &[Vec<f64>]) -> Checked {
        let rule = "every channel has a filter";
        check_length("channels", taps.len(), self.frame_samples(), "tap lists", rule)?;
        let expected = taps[0].len();
        if expected == 0 {
            return out_of_range(self.taps_path(0), 0.0, "taps", "a filter has at least one tap");
        }
        for (i, list) in taps.iter().enumerate() {
            let path = self.taps_path(i);
            let rule = "all filters are as long as the first one; append zeros to the shorter ones";
            check_length(&path, list.len(), expected, "taps", rule)?;
            check_sizes(&path, list)?;
        }
        Ok(())
    }

    fn check_proof(&self) -> Checked {
        let Some(Proof { upper, worst_case }) = &self.proof else { return Ok(()) };
        check_certificate(upper)?;
        check_witness("proof.upper.peak", &upper.peak, self.ratio)?;
        worst_case.as_ref().map_or(Ok(()), check_box_proof)
    }

    fn check_scalars(&self) -> Checked {
        check_fast_period(self.fast_period).at("fast_period")?;
        if !(1..=MAX_RATIO).contains(&self.ratio) {
            let rule =
                format!("ratio counts the fast samples for each slow one and must be 1 to {MAX_RATIO}");
            return out_of_range("ratio", self.ratio as f64, "fast samples", rule);
        }
        if self.latency > MAX_BANK_LATENCY {
            let rule = format!("latency must be 0 to {MAX_BANK_LATENCY}");
            return out_of_range("latency", self.latency as f64, "fast samples", rule);
        }
        Ok(())
    }

    fn check_method(&self) -> Checked {
        let fir = matches!(self.filters, SynthesisFilters::Fir(_));
        let fits = if fir { self.method.reads("taps") } else { !self.method.has_taps() };
        if fits {
            return Ok(());
        }
        let (found, expected) = if fir { ("taps", "state_space") } else { ("state_space", "taps") };
        refuse("method", BankProblem::Filters { method: self.method.name(), expected, found })
    }

    fn check_spec(&self, spec: &Spec) -> Checked {
        spec.check().map_err(|error| error.inside("spec"))?;
        agree("spec.fast_period", self.fast_period.0, spec.fast_period.0, self.fast_period.0)?;
        agree("spec.ratio", self.ratio as f64, spec.ratio as f64, 0.0)?;
        if let Some(latency) = spec.latency {
            agree("spec.latency", self.latency as f64, latency as f64, 0.0)?;
        }
        let rule = "the spec must describe every channel of the bank";
        check_length("spec.channel", spec.channels.len(), self.channel_count(), "channels", rule)?;
        for (i, (&own, &samples)) in self.samples.iter().zip(spec.layout().samples()).enumerate() {
            agree(format!("channels[{i}].samples"), own as f64, samples as f64, 0.0)?;
        }
        for (i, (&delay, channel)) in self.delays.iter().zip(&spec.channels).enumerate() {
            let path = |key: &str| format!("spec.channel[{i}].{key}");
            agree(path("delay"), delay.0, channel.delay.0, (self.fast_period + delay).0)?;
            agree(path("gain"), self.gains[i], channel.gain, channel.gain.abs())?;
            agree(path("offset"), self.offsets[i], channel.offset, channel.offset.abs())?;
        }
        match (&self.fixed_point, &spec.design.bits) {
            // Of a loss they are the most.
            (Some(FixedPoint { bits, .. }), Some(asked))
                if bits != asked && spec.design.loss_db.is_none() =>
            {
                refuse(
                    "spec.design.bits",
                    BankProblem::WordsDiffer { bank: bits.clone(), spec: asked.clone() },
                )
            }
            _ => Ok(()),
        }
    }
}

fn agree(path: impl Into<String>, bank: f64, spec: f64, size: f64) -> Checked {
    if (bank - spec).abs() <= SPEC_TOLERANCE * size {
        return Ok(());
    }
    refuse(path, BankProblem::SpecDiffers { bank, spec })
}

fn check_delays(delays: &[Seconds], fast_period: Seconds) -> Checked {
    if !(1..=MAX_CHANNELS).contains(&delays.len()) {
        let rule = format!("a bank has 1 to {MAX_CHANNELS} channels");
        return out_of_range("channels", delays.len() as f64, "channels", rule);
    }
    let most = MAX_BANK_LATENCY as f64;
    match delays.iter().position(|delay| !(0.0..=most).contains(&delay.in_fast_periods(fast_period).0)) {
        Some(i) => {
            let rule = format!("a delay is zero or more, and at most {most} fast periods; check its unit");
            out_of_range(format!("channels[{i}].delay"), delays[i].0, "s", rule)
        }
        None => Ok(()),
    }
}

/// One number for each converter, by the rule for specs.
fn check_converters(
    key: &str,
    values: &[f64],
    channels: usize,
    check: fn(f64) -> Result<(), SpecProblem>,
) -> Checked {
    let rule = "every channel has a gain and an offset";
    check_length("channels", values.len(), channels, "gains or offsets", rule)?;
    for (i, &value) in values.iter().enumerate() {
        check(value).at(key).map_err(|error| error.inside(&format!("channels[{i}]")))?;
    }
    Ok(())
}

fn check_gamma(gamma: &Gamma) -> Checked {
    let bounds = [("lower", gamma.lower), ("noncausal", gamma.noncausal)];
    let norms = [("norm", gamma.norm), ("upper", gamma.upper), ("worst_case", gamma.worst_case)];
    for (key, value) in norms.into_iter().chain(bounds) {
        if let Some(value) = value.filter(|x| !(0.0..=MAX_ENTRY).contains(x)) {
            let rule =
                format!("a norm is zero or more, and at most {MAX_ENTRY:e}; null says that it is not known");
            return out_of_range(format!("gamma.{key}"), value, "(h = 1)", rule);
        }
    }
    let Some(upper) = gamma.upper else { return Ok(()) };
    for (key, value) in bounds {
        if let Some(value) = value.filter(|&x| x > upper) {
            let rule = format!("a lower bound is at most gamma.upper, {upper}");
            return out_of_range(format!("gamma.{key}"), value, "(h = 1)", rule);
        }
    }
    Ok(())
}

/// Finite numbers of a size for which the filters are tested.
fn check_sizes(path: &str, values: &[f64]) -> Checked {
    let Some(j) = values.iter().position(|x| !(0.0..=MAX_ENTRY).contains(&x.abs())) else { return Ok(()) };
    let (path, value) = (format!("{path}[{j}]"), values[j]);
    if value.is_finite() {
        let rule = format!("coefficients are at most {MAX_ENTRY:e} in size; scale the filters");
        return out_of_range(path, value, "(coefficient)", rule);
    }
    refuse(path, BankProblem::NotFinite { value })
}

fn check_block(block: &StateSpace, ratio: usize, channels: usize) -> Checked {
    let n = block.a.len();
    check_matrix("state_space.a", &block.a, n, n, "a is n x n, n the number of states")?;
    check_matrix("state_space.b", &block.b, n, channels, "b is n x N, N the number of channels")?;
    check_matrix("state_space.c", &block.c, ratio, n, "c is M x n, M the ratio")?;
    check_matrix("state_space.d", &block.d, ratio, channels, "d is M x N, ratio by number of channels")
}

fn check_matrix(
    path: &str,
    rows: &[Vec<f64>],
    expected: usize,
    columns: usize,
    rule: &'static str,
) -> Checked {
    check_length(path, rows.len(), expected, "rows", rule)?;
    for (i, row) in rows.iter().enumerate() {
        let path = format!("{path}[{i}]");
        check_length(&path, row.len(), columns, "columns", rule)?;
        check_sizes(&path, row)?;
    }
    Ok(())
}

fn check_certificate(certificate: &Certificate) -> Checked {
    check_norm("proof.upper.gamma", certificate.gamma)?;
    check_triangle("proof.upper.factor", &certificate.factor)?;
    if certificate.correction.is_empty() {
        return Ok(());
    }
    let (rows, rule) = (certificate.factor.len(), "the correction has as many rows as the factor");
    check_length("proof.upper.correction", certificate.correction.len(), rows, "rows", rule)?;
    check_triangle("proof.upper.correction", &certificate.correction)
}

fn check_box_proof(proof: &BoxProof) -> Checked {
    check_sizes("proof.worst_case.scales", &proof.scales)?;
    for (key, NormBound { norm, factor }) in [("filters", &proof.filters), ("slopes", &proof.slopes)] {
        let path = format!("proof.worst_case.{key}");
        check_norm(&format!("{path}.norm"), *norm)?;
        check_triangle(&format!("{path}.factor"), factor)?;
    }
    Ok(())
}

fn check_triangle(path: &str, rows: &[Vec<f64>]) -> Checked {
    for (i, row) in rows.iter().enumerate() {
        let path = format!("{path}[{i}]");
        let rule = "the matrix is lower triangular, each row one longer";
        check_length(&path, row.len(), i + 1, "columns", rule)?;
        check_sizes(&path, row)?;
    }
    Ok(())
}

fn check_witness(path: &str, witness: &GainWitness, reference: usize) -> Checked {
    check_sizes(&format!("{path}.half"), &witness.half)?;
    if witness.half == [0.0; 2] {
        let rule = "half is about cos(w/2), sin(w/2); both cannot be zero";
        return out_of_range(format!("{path}.half"), 0.0, "", rule);
    }
    let path = format!("{path}.reference");
    let rule = "a witness has one weight for each reference sample of a slow period";
    check_length(&path, witness.reference.len(), reference, "weights", rule)?;
    for (i, pair) in witness.reference.iter().enumerate() {
        check_sizes(&format!("{path}[{i}]"), pair)?;
    }
    if witness.reference.iter().flatten().all(|&x| x == 0.0) {
        return out_of_range(path, 0.0, "", "a witness of weight zero shows nothing");
    }
    Ok(())
}
