//! The invariants of every bank, read or designed.

use crate::messages::Number;
use crate::spec::{
    At, FrameSample, MAX_CHANNELS, MAX_ENTRY, Refusal, Spec, SpecProblem, check_channel_count,
    check_fast_period, check_fraction_bits, check_gain, check_nonlinearity, check_offset, check_ratio,
    refused, within,
};
use crate::units::Seconds;

use super::{
    Bank, BoxProof, Certificate, FixedPoint, GainWitness, Gamma, NormBound, Proof, StateMatrices,
    SynthesisFilters,
};

/// Largest m0 in a bank file. `fuse` appends as many zeros to a recording; 16 million are 3 minutes at 96
/// kHz.
pub const MAX_BANK_LATENCY: usize = 1 << 24;

/// Relative difference between a number of the bank and the same number in the spec that counts as
/// rounding.
const SPEC_TOLERANCE: f64 = 1e-9;

type Checked = Result<(), Refusal>;

fn out_of_range(path: impl Into<String>, value: f64, unit: &'static str, rule: impl Into<String>) -> Checked {
    Err(Refusal::new(path, SpecProblem::Range { value, unit, rule: rule.into() }))
}

/// A list at `path` has `expected` entries, counted in `unit`.
pub(super) fn check_length(path: &str, found: usize, expected: usize, unit: &str, rule: &str) -> Checked {
    let problem = || refused(path, format!("{found} {unit}, but there must be {expected}: {rule}"));
    if found == expected { Ok(()) } else { Err(problem()) }
}

/// A certified norm is zero or more, and not too large.
fn check_norm(path: &str, gamma: f64) -> Checked {
    let rule = format!("a norm is zero or more, and at most {MAX_ENTRY:e}");
    within(gamma, 0.0..=MAX_ENTRY, "(h = 1)", rule).at(path)
}

impl Bank {
    /// Checks everything that can be checked without linear algebra: numbers finite and in range, lists and
    /// matrices of matching sizes, filters that fit the method, a spec that agrees with the bank.
    ///
    /// This does not check whether a state-space bank is stable; the design modules do.
    ///
    /// # Errors
    /// [`Refusal`] with an empty file name and the JSON place of the first thing that is wrong.
    pub fn check(&self) -> Checked {
        self.check_scalars()?;
        check_delays(&self.delays, self.fast_period)?;
        self.check_samples()?;
        check_converters("gain", &self.gains, self.channel_count(), check_gain)?;
        check_converters("offset", &self.offsets, self.channel_count(), check_offset)?;
        let count = self.nonlinearity.len();
        check_length("channels", count, self.channel_count(), "nonlinearities", "every channel has a list")?;
        for (i, curve) in self.nonlinearity.iter().enumerate() {
            let refused = check_nonlinearity(curve).at("nonlinearity");
            refused.map_err(|error| error.inside(&format!("channels[{i}]")))?;
        }
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
            return Err(self.of_another_method("fixed_point", "state_space", "fixed_point"));
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
                    let rule = format!(
                        "the tap {tap:e} is not {integer} times {:e}, as fixed_point says; take the original, or leave fixed_point out",
                        words.step()
                    );
                    return Err(refused(&path, rule));
                }
            }
        }
        Ok(())
    }

    /// Each converter has a sample in a frame, and a latency covers the wait for the last one.
    fn check_samples(&self) -> Checked {
        let rule = "every channel has a number of samples per frame";
        check_length("channels", self.samples.len(), self.channel_count(), "numbers of samples", rule)?;
        let most = MAX_CHANNELS as f64;
        for (i, &samples) in self.samples.iter().enumerate() {
            let rule = format!("a converter has 1 to {MAX_CHANNELS} samples per frame");
            within(samples as f64, 1.0..=most, "samples", rule).at(&format!("channels[{i}].samples"))?;
        }
        let rule = format!("a frame has at most {MAX_CHANNELS} samples");
        within(self.frame_samples() as f64, 0.0..=most, "samples", rule).at("channels")?;
        let wait = self.wait();
        let rule = format!(
            "the last sample of a frame comes {wait} fast samples after its instant, which the latency includes"
        );
        within(self.latency as f64, wait as f64..=f64::MAX, "fast samples", rule).at("latency")
    }

    /// A part of the bank that its method has not.
    fn of_another_method(&self, path: &str, expected: &str, found: &str) -> Refusal {
        let method = self.method.name();
        let rule =
            format!("a bank of the method {method} holds {expected} and no {found}; change one or the other");
        refused(path, rule)
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
        check_ratio(self.ratio).at("ratio")?;
        let rule = format!("latency must be 0 to {MAX_BANK_LATENCY}");
        within(self.latency as f64, 0.0..=MAX_BANK_LATENCY as f64, "fast samples", rule).at("latency")
    }

    fn check_method(&self) -> Checked {
        let fir = matches!(self.filters, SynthesisFilters::Fir(_));
        let fits = if fir { self.method.reads("taps") } else { !self.method.has_taps() };
        if fits {
            return Ok(());
        }
        let (found, expected) = if fir { ("taps", "state_space") } else { ("state_space", "taps") };
        Err(self.of_another_method("method", expected, found))
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
            agree(&format!("channels[{i}].samples"), own as f64, samples as f64, 0.0)?;
        }
        for (i, (&delay, channel)) in self.delays.iter().zip(&spec.channels).enumerate() {
            let path = |key: &str| format!("spec.channel[{i}].{key}");
            agree(&path("delay"), delay.0, channel.delay.0, self.fast_period.0 + delay.0.abs())?;
            agree(&path("gain"), self.gains[i], channel.gain, channel.gain.abs())?;
            agree(&path("offset"), self.offsets[i], channel.offset, channel.offset.abs())?;
            let (own, other) = (&self.nonlinearity[i], &channel.nonlinearity);
            let rule = "the spec must have the nonlinearity of the bank";
            let (own, other) = (own.values(), other.values());
            check_length(&path("nonlinearity"), own.len(), other.len(), "coefficients", rule)?;
            own.iter().zip(other).try_for_each(|(a, b)| agree(&path("nonlinearity"), *a, *b, b.abs()))?;
        }
        match (&self.fixed_point, &spec.design.bits) {
            // Of a loss they are the most.
            (Some(FixedPoint { bits, .. }), Some(asked))
                if bits != asked && spec.design.loss_db.is_none() =>
            {
                let rule = format!(
                    "the bank's integers have {bits}, its spec asks for {asked}; design the bank again, or set spec to null"
                );
                Err(refused("spec.design.bits", rule))
            }
            _ => Ok(()),
        }
    }
}

fn agree(path: &str, bank: f64, spec: f64, size: f64) -> Checked {
    if (bank - spec).abs() <= SPEC_TOLERANCE * size {
        return Ok(());
    }
    let rule = format!(
        "the bank says {}, its spec says {}; they must agree, design the bank again or set spec to null",
        Number(bank),
        Number(spec)
    );
    Err(refused(path, rule))
}

fn check_delays(delays: &[Seconds], fast_period: Seconds) -> Checked {
    check_channel_count(delays.len()).at("channels")?;
    let most = MAX_BANK_LATENCY as f64;
    match delays
        .iter()
        .position(|delay| delay.in_fast_periods(fast_period).0.abs() > most || delay.0.is_nan())
    {
        Some(i) => {
            let rule = format!("a delay is at most {most} fast periods; check its unit");
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
    let rule = "is not a finite number and has no JSON; the design that made it has failed";
    Err(refused(&path, format!("{value} {rule}")))
}

fn check_block(block: &StateMatrices, ratio: usize, channels: usize) -> Checked {
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
