//! The lines that theory expects: their causes, their frequencies, and which of them coincide.

use crate::sine_fit::{Sense, alias};
use std::fmt;

/// The cause of a spur. Tones count from 1; 0 stands for the only tone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Cause {
    /// Unequal offsets of `of` converters in turn: a line at k fs / of.
    Offset {
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
    },
    /// Unequal gains or sampling instants of `of` converters in turn: a line at |k fs / of + f| or
    /// |k fs / of - f|, in complex records without the bars. One tone does not tell gain from skew.
    GainOrSkew {
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
        /// True for the sum, false for the difference.
        is_sum: bool,
        /// The tone.
        tone: usize,
    },
    /// A harmonic of a tone.
    Harmonic {
        /// Multiple of the tone's frequency.
        order: usize,
        /// True if the harmonic lies above half the rate and is seen at its alias.
        folded: bool,
        /// The tone.
        tone: usize,
    },
    /// Unequal nonlinearity of `of` converters in turn: a line at a harmonic displaced by k fs / of.
    HarmonicImage {
        /// Multiple of the tone's frequency.
        order: usize,
        /// k.
        k: usize,
        /// Converters in turn.
        of: usize,
    },
    /// Parts of a complex record that are not in quadrature or not of one gain: a line at minus the
    /// frequency of a tone or of its harmonic.
    Image {
        /// Multiple of the tone's frequency; 1 for the tone.
        order: usize,
        /// The tone.
        tone: usize,
    },
    /// A product of two tones, at |a f1 + b f2|; in complex records at a f1 + b f2.
    Intermodulation {
        /// a.
        a: i32,
        /// The first tone.
        first: usize,
        /// b.
        b: i32,
        /// The second tone.
        second: usize,
    },
    /// None of the others.
    Unknown,
    /// No line: the largest bin of what is left, where no line is as large.
    Noise,
}

impl Cause {
    /// True for what would be absent if all converters were equal.
    pub fn is_interleaving(self) -> bool {
        matches!(self, Self::Offset { .. } | Self::GainOrSkew { .. } | Self::HarmonicImage { .. })
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |tone: usize| if tone == 0 { "f".to_owned() } else { format!("f{tone}") };
        match *self {
            Self::Offset { k, of } => write!(f, "offset, {k}/{of} fs"),
            Self::GainOrSkew { k, of, is_sum, tone } => {
                write!(f, "gain or skew, {k}/{of} fs {} {}", if is_sum { '+' } else { '-' }, name(tone))
            }
            Self::Harmonic { order, folded, tone } => {
                write!(f, "harmonic, {order} {}{}", name(tone), if folded { ", folded" } else { "" })
            }
            Self::HarmonicImage { order, k, of } => write!(f, "harmonic {order} displaced by {k}/{of} fs"),
            Self::Image { order: 1, tone } => write!(f, "image, -{}", name(tone)),
            Self::Image { order, tone } => write!(f, "image of a harmonic, -{order} {}", name(tone)),
            Self::Intermodulation { a, first, b, second } => {
                write!(f, "intermodulation, {a} {} {b:+} {}", name(first), name(second))
            }
            Self::Unknown => write!(f, "unknown"),
            Self::Noise => write!(f, "largest bin of the noise, which decides SFDR"),
        }
    }
}

/// A line at which at least one spur is expected.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ExpectedLine {
    /// Cycles per sample, 0 to 1/2.
    pub(super) cycles: f64,
    /// The spurs there.
    forward: Vec<Cause>,
    /// In complex records those at the negative frequency.
    backward: Vec<Cause>,
}

impl ExpectedLine {
    pub(super) fn causes(&self, direction: Sense) -> &[Cause] {
        if direction == Sense::Forward { &self.forward } else { &self.backward }
    }
}

/// The expected lines of a record.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Expected {
    pub(super) lines: Vec<ExpectedLine>,
    /// The line at exactly half the rate, where there is no phase: offsets, if there is an even number of
    /// converters.
    pub(super) half_rate: Option<Cause>,
    /// Spurs that coincide with a tone, with the constant or with half the rate.
    pub(super) hidden: Vec<Cause>,
}

/// Which lines are expected.
pub(super) struct Pattern<'a> {
    /// Frequencies of the tones in cycles per sample; those of a complex record may be negative.
    pub(super) tones: &'a [f64],
    /// Complex records tell a frequency from its negative, and hold an image there of whatever they hold.
    pub(super) is_complex: bool,
    /// Converters in turn; 1 for none.
    pub(super) converters: usize,
    /// Highest order of harmonics.
    pub(super) harmonics: usize,
    /// Lines closer than this are one (cycles per sample).
    pub(super) resolution: f64,
}

impl Expected {
    /// All lines of a pattern. Where lines coincide, harmonics come first, then offsets, then images.
    pub(super) fn of(pattern: &Pattern<'_>) -> Self {
        let mut expected = Self::default();
        expected.add_harmonics(pattern);
        expected.add_intermodulation(pattern);
        expected.add_offsets(pattern);
        for (tone, f) in pattern.tones.iter().enumerate() {
            let seen = pattern.seen(*f);
            for k in 1..pattern.converters {
                let of = pattern.converters;
                let causes = pattern.displaced(seen, k, pattern.number(tone));
                expected.add(pattern, seen + k as f64 / of as f64, causes);
            }
        }
        expected
    }

    fn add_harmonics(&mut self, pattern: &Pattern<'_>) {
        for (tone, f) in pattern.tones.iter().enumerate() {
            let f = if pattern.is_complex { *f } else { f.abs() };
            for order in 2..=pattern.harmonics {
                let (cycles, tone) = (order as f64 * f, pattern.number(tone));
                let cause = Cause::Harmonic { order, folded: cycles.abs() > 0.5, tone };
                self.add(pattern, cycles, [cause, Cause::Image { order, tone }]);
            }
        }
    }

    fn add_intermodulation(&mut self, pattern: &Pattern<'_>) {
        for (j, g) in pattern.tones.iter().enumerate() {
            for (i, f) in pattern.tones[..j].iter().enumerate() {
                for (a, b) in [(1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (-1, 2)] {
                    let cause = |a, b| Cause::Intermodulation { a, first: i + 1, b, second: j + 1 };
                    let cycles = f64::from(a) * f + f64::from(b) * g;
                    self.add(pattern, cycles, [cause(a, b), cause(-a, -b)]);
                }
            }
        }
    }

    fn add_offsets(&mut self, pattern: &Pattern<'_>) {
        let of = pattern.converters;
        // No sine can be fitted there, so that it is never found among the unexpected lines.
        self.half_rate = Some(Cause::Unknown);
        for k in 1..=of / 2 {
            let cause = Cause::Offset { k, of };
            if 2 * k == of {
                self.half_rate = Some(cause);
            } else {
                self.add(pattern, k as f64 / of as f64, [cause, Cause::Offset { k: of - k, of }]);
            }
        }
    }

    /// Adds a line at the alias of `cycles`, or to the one that is there: its cause, and that of its image.
    fn add(&mut self, pattern: &Pattern<'_>, cycles: f64, [cause, image]: [Cause; 2]) {
        let folded = alias(cycles);
        let is_near = |other: f64| (folded - other).abs() < pattern.resolution;
        if is_near(0.0) || is_near(0.5) || pattern.tones.iter().any(|f| is_near(alias(*f))) {
            return self.hidden.push(cause);
        }
        let at = self.lines.iter().position(|line| is_near(line.cycles)).unwrap_or_else(|| {
            self.lines.push(ExpectedLine { cycles: folded, ..ExpectedLine::default() });
            self.lines.len() - 1
        });
        let is_backward = pattern.is_complex && cycles - cycles.round() < 0.0;
        let ExpectedLine { forward, backward, .. } = &mut self.lines[at];
        let (own, other) = if is_backward { (backward, forward) } else { (forward, backward) };
        own.push(cause);
        if pattern.is_complex {
            other.push(image);
        }
    }

    /// True for a frequency within the resolution of a tone or of an expected line.
    pub(super) fn holds(&self, pattern: &Pattern<'_>, cycles: f64) -> bool {
        let tones = pattern.tones.iter().map(|f| alias(*f));
        let mut all = self.lines.iter().map(|line| line.cycles).chain(tones);
        all.any(|other| (cycles - other).abs() < pattern.resolution)
    }
}

impl Pattern<'_> {
    /// What messages call a tone: 0 for the only one.
    pub(super) fn number(&self, tone: usize) -> usize {
        if self.tones.len() == 1 { 0 } else { tone + 1 }
    }

    /// Where the record shows a frequency, in cycles per sample.
    pub(super) fn seen(&self, cycles: f64) -> f64 {
        if self.is_complex { cycles - cycles.round() } else { alias(cycles) }
    }

    /// The causes of the line at seen + k / of and of its image.
    fn displaced(&self, seen: f64, k: usize, tone: usize) -> [Cause; 2] {
        let of = self.converters;
        if !self.is_complex {
            return [image(seen, k, of, tone); 2];
        }
        let cause = |k, is_sum| Cause::GainOrSkew { k, of, is_sum, tone };
        [cause(k, true), cause(of - k, false)]
    }
}

/// The name of the line at the alias of f + k / of, for f in 0 ..= 1/2: 0 < f + k / of < 3/2.
fn image(f: f64, k: usize, of: usize, tone: usize) -> Cause {
    let is_sum = f + k as f64 / of as f64 <= 0.5;
    Cause::GainOrSkew { k: if is_sum { k } else { of - k }, of, is_sum, tone }
}

/// The cause of a line that was found at `cycles` beside the expected ones. What the fit of a line leaves,
/// because it is not steady, is unknown.
pub(super) fn unexpected(pattern: &Pattern<'_>, expected: &Expected, cycles: f64) -> Cause {
    let of = pattern.converters;
    let [f] = pattern.tones else { return Cause::Unknown };
    if expected.holds(pattern, alias(cycles)) {
        return Cause::Unknown;
    }
    for order in 2..=pattern.harmonics {
        for k in 1..of {
            let displaced = pattern.seen(order as f64 * f + k as f64 / of as f64);
            if (displaced - cycles).abs() < pattern.resolution {
                return Cause::HarmonicImage { order, k, of };
            }
        }
    }
    Cause::Unknown
}
