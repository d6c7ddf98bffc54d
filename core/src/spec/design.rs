//! The `[design]` table: defaults, overrides from the command line, and the keys of each method.

use super::error::At;
use super::limits;
use super::tables::Pair;
use super::word_lengths::{WordLengths, check_fraction_bits};
use super::{FrameLayout, Refusal, SpecError, SpecProblem, UncertaintySpec};
use serde::{Deserialize, Serialize};

/// How the synthesis filters are designed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Finite impulse responses of given length, least gamma.
    Fir,
    /// State-space filters, least gamma.
    Iir,
    /// State-space filters, or finite impulse responses with `taps`, least mean-square error.
    H2,
    /// Papoulis/Yen interpolation of recurrent nonuniform samples, truncated (for comparison).
    Sinc,
    /// First a fractional-delay filter per channel, then a bank for integer delays (for comparison).
    Separation,
}

/// The keys of a `[design]` table. `M` is the [`Method`], or an option of it where it may be left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignTable<M> {
    /// The method. If it overrides the method of a file, keys of the file that it does not read are dropped.
    pub method: M,
    /// Taps per channel at the fast rate, for FIR methods; `None` lets the designer choose. The method `h2`
    /// makes FIR filters with them and recursive ones without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub taps: Option<usize>,
    /// The SNR in decibels for which the fewest taps are chosen, in place of `taps`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_snr_db: Option<f64>,
    /// The same for the distance of the largest image of a tone in decibels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_sfdr_db: Option<f64>,
    /// Relative excess over the optimal gamma that the designer may spend on a smaller mean-square error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma_margin: Option<f64>,
    /// Bits of the taps, for integer taps; beside `loss_db` the most that may be chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bits: Option<WordLengths>,
    /// Taps are integers times 2^-fraction_bits; `None` lets the designer choose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fraction_bits: Option<i32>,
    /// Integer taps of the fewest bits that lose at most so many decibels of SNR, in place of `bits`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loss_db: Option<f64>,
    /// For recursive methods, at most so many states, with the least error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<usize>,
    /// For recursive methods, the fewest states whose error is within this many decibels of the full bank's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduction_loss_db: Option<f64>,
    /// Noise of the channels that state none. In a spec the channels hold it, and this is `None`.
    #[serde(skip_serializing)]
    pub noise: Option<f64>,
}

/// A `[design]` table with its defaults filled in.
pub type DesignSpec = DesignTable<Method>;

/// The keys of a `[design]` table that are present, in a file or on the command line.
pub type DesignOverrides = DesignTable<Option<Method>>;

/// By how much the order of a recursive bank is reduced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reduction {
    /// To at most this many states, with the least error.
    Order(usize),
    /// To the fewest states whose error is within this many decibels of the full bank's.
    Loss(f64),
}

/// A key that some methods read.
struct Key {
    name: &'static str,
    methods: &'static [Method],
    /// The methods that a message advises.
    advised: &'static str,
}

/// The keys that not every method reads.
const KEYS: [Key; 9] = {
    use Method::{Fir, H2, Iir, Separation, Sinc};
    [
        Key { name: "taps", methods: &[Fir, H2, Sinc, Separation], advised: "fir or h2" },
        Key { name: "target_snr_db", methods: &[Fir, H2], advised: "fir or h2" },
        Key { name: "target_sfdr_db", methods: &[Fir, H2], advised: "fir or h2" },
        Key { name: "gamma_margin", methods: &[Fir, Iir], advised: "fir or iir" },
        Key { name: "bits", methods: &[Fir, H2, Sinc, Separation], advised: "fir or h2" },
        Key { name: "fraction_bits", methods: &[Fir, H2, Sinc, Separation], advised: "fir or h2" },
        Key { name: "loss_db", methods: &[Fir, H2, Sinc, Separation], advised: "fir or h2" },
        Key { name: "order", methods: &[Iir, H2], advised: "iir or h2" },
        Key { name: "reduction_loss_db", methods: &[Iir, H2], advised: "iir or h2" },
    ]
};

impl Method {
    /// Every method, in the order of the documentation.
    pub const ALL: [Self; 5] = [Self::Fir, Self::Iir, Self::H2, Self::Sinc, Self::Separation];

    /// The name in spec files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fir => "fir",
            Self::Iir => "iir",
            Self::H2 => "h2",
            Self::Sinc => "sinc",
            Self::Separation => "separation",
        }
    }

    /// Whether the method makes FIR filters whether `taps` is given or not.
    pub const fn has_taps(self) -> bool {
        matches!(self, Self::Fir | Self::Sinc | Self::Separation)
    }

    /// Whether the method reads a key of the `[design]` table. `h2` reads `taps` and the keys of recursive
    /// filters: it makes FIR filters with `taps` and recursive ones without.
    pub fn reads(self, key: &str) -> bool {
        KEYS.iter().find(|known| known.name == key).is_none_or(|known| known.methods.contains(&self))
    }
}

impl<M> DesignTable<M> {
    /// The same keys with another method.
    fn with<N>(self, method: N) -> DesignTable<N> {
        DesignTable {
            method,
            taps: self.taps,
            target_snr_db: self.target_snr_db,
            target_sfdr_db: self.target_sfdr_db,
            gamma_margin: self.gamma_margin,
            bits: self.bits,
            fraction_bits: self.fraction_bits,
            loss_db: self.loss_db,
            order: self.order,
            reduction_loss_db: self.reduction_loss_db,
            noise: self.noise,
        }
    }

    /// Whether the number of taps, or what it follows from, is given.
    fn is_sized(&self) -> bool {
        self.taps.is_some() || self.target_snr_db.is_some() || self.target_sfdr_db.is_some()
    }

    /// The order reduction that is asked for.
    pub fn reduction(&self) -> Option<Reduction> {
        self.order.map(Reduction::Order).or(self.reduction_loss_db.map(Reduction::Loss))
    }
}

impl<M: Serialize> DesignTable<M> {
    /// Whether it has a value for `key`, which is neither the method nor the noise.
    pub(super) fn gives(&self, key: &str) -> bool {
        serde_json::to_value(self).is_ok_and(|table| table.get(key).is_some())
    }
}

impl DesignSpec {
    /// Whether the filters are FIR, not recursive.
    pub fn is_fir(&self) -> bool {
        self.method.has_taps() || (self.method.reads("taps") && self.is_sized())
    }

    /// The same with so many taps in place of what their number follows from.
    pub fn with_taps(self, taps: Option<usize>) -> Self {
        Self { taps, target_snr_db: None, target_sfdr_db: None, ..self }
    }

    /// Whether the taps are integers.
    pub fn has_integers(&self) -> bool {
        self.bits.is_some() || self.loss_db.is_some()
    }

    /// A method, with taps if it makes FIR filters, and no other keys.
    pub fn new(method: Method, taps: Option<usize>) -> Self {
        DesignOverrides { taps, ..Default::default() }.with(method)
    }

    /// Whether the design couples all samples of a frame. The taps of the mean-square optimum are
    /// independent for each output sample.
    pub(super) fn is_coupled(&self) -> bool {
        !(self.method == Method::H2 && self.is_fir())
    }

    /// Checks the numbers, and that the method reads every key.
    pub(super) fn check(&self, layout: &FrameLayout) -> Result<(), SpecError> {
        self.check_clashes()?;
        self.check_numbers()?;
        self.check_keys()?;
        match (self.method, self.taps) {
            (Method::Fir, Some(taps)) => limits::check_optimised_taps(taps, layout.count()).at("taps"),
            (Method::H2, Some(taps)) => limits::check_samples_seen(taps, layout).at("taps"),
            _ => Ok(()),
        }
    }

    fn check_numbers(&self) -> Result<(), SpecError> {
        self.taps.map_or(Ok(()), limits::check_taps).at("taps")?;
        self.gamma_margin.map_or(Ok(()), limits::check_gamma_margin).at("gamma_margin")?;
        self.order.map_or(Ok(()), limits::check_order).at("order")?;
        self.reduction_loss_db.map_or(Ok(()), limits::check_reduction_loss).at("reduction_loss_db")?;
        self.fraction_bits.map_or(Ok(()), check_fraction_bits).at("fraction_bits")?;
        self.bits.as_ref().map_or(Ok(()), |bits| bits.check(self.taps)).at("bits")?;
        self.loss_db.map_or(Ok(()), limits::check_word_loss).at("loss_db")?;
        self.target_snr_db.map_or(Ok(()), limits::check_target_snr).at("target_snr_db")?;
        self.target_sfdr_db.map_or(Ok(()), limits::check_target_sfdr).at("target_sfdr_db")
    }

    /// The keys that the method does not read, and those that need another one.
    fn check_keys(&self) -> Result<(), SpecError> {
        let needless = KEYS.iter().find(|key| self.gives(key.name) && !key.methods.contains(&self.method));
        if let Some(&Key { name: key, advised: remedy, .. }) = needless {
            return Err(Refusal::new(
                key,
                SpecProblem::NeedlessKey { key, method: self.method.name(), remedy },
            ));
        }
        if self.fraction_bits.is_some() && self.bits.is_none() {
            let remedy = "fraction_bits sets the binary point of integer taps, whose word length bits gives, for example bits = 16";
            return Err(Refusal::new("fraction_bits", SpecProblem::MissingKey { key: "bits", remedy }));
        }
        Ok(())
    }

    /// Keys that exclude each other, whatever their values are.
    fn check_clashes(&self) -> Result<(), SpecError> {
        let pairs = [
            Pair {
                first: "order",
                second: "reduction_loss_db",
                remedy: "each determines the other, keep one of them",
            },
            Pair {
                first: "loss_db",
                second: "fraction_bits",
                remedy: "the loss decides the step of the taps; leave out one of the two",
            },
            Pair {
                first: "taps",
                second: "target_snr_db",
                remedy: "the SNR decides how many taps there are, keep one of them",
            },
            Pair {
                first: "taps",
                second: "target_sfdr_db",
                remedy: "the SFDR decides how many taps there are, keep one of them",
            },
            Pair {
                first: "target_snr_db",
                second: "target_sfdr_db",
                remedy: "each decides how many taps there are, keep one of them",
            },
        ];
        pairs.into_iter().try_for_each(|pair| {
            let given = |key| self.gives(key).then_some(());
            pair.only(given(pair.first), given(pair.second)).map(drop)
        })?;
        let reduced = ["order", "reduction_loss_db"].into_iter().find(|key| self.gives(key));
        match reduced {
            Some(key) if self.method == Method::H2 && self.is_fir() => {
                let (method, remedy) = ("h2 with taps", "h2 without taps");
                Err(Refusal::new(key, SpecProblem::NeedlessKey { key, method, remedy }))
            }
            _ => Ok(()),
        }
    }

    /// Checks what depends on the errors of the channels.
    pub(super) fn check_beside(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), SpecError> {
        let averages =
            self.method == Method::H2 && uncertainty.is_some_and(|table| table.has_delays_or_gains(channels));
        if let Some(first) =
            ["order", "reduction_loss_db"].into_iter().find(|key| averages && self.gives(key))
        {
            let remedy = "h2 averages over uncertain delays and gains with FIR filters, which have no order; leave out one of the two";
            let second = "[uncertainty]";
            return Err(Refusal::new(first, SpecProblem::Conflict { first, second, remedy }));
        }
        let is_recursive = !averages && !self.is_fir();
        match ["bits", "loss_db"].into_iter().find(|key| is_recursive && self.gives(key)) {
            Some(key) => {
                let (method, remedy) = ("h2 without taps", "h2 with taps");
                Err(Refusal::new(key, SpecProblem::NeedlessKey { key, method, remedy }))
            }
            None => Ok(()),
        }
    }
}

impl DesignOverrides {
    /// Values of the command line take precedence. Keys of the file that a new method does not read are
    /// dropped; taps and their bits too if the new method is recursive without taps.
    pub(super) fn over(self, file: Self) -> Self {
        let new = self.method.filter(|method| file.method != Some(*method));
        let keeps = |key: &str| new.is_none_or(|method| method.reads(key));
        let keeps_taps = new.is_none_or(Method::has_taps);
        let is_sized = self.is_sized();
        let keeps_size = |key: &str| keeps(key) && !is_sized;
        let keeps_words = |key: &str| keeps(key) && (keeps_taps || is_sized);
        Self {
            method: self.method.or(file.method),
            // Each stands in place of the other.
            taps: self.taps.or(file.taps.filter(|_| keeps_taps && !is_sized)),
            target_snr_db: self.target_snr_db.or(file.target_snr_db.filter(|_| keeps_size("target_snr_db"))),
            target_sfdr_db: self
                .target_sfdr_db
                .or(file.target_sfdr_db.filter(|_| keeps_size("target_sfdr_db"))),
            gamma_margin: self.gamma_margin.or(file.gamma_margin.filter(|_| keeps("gamma_margin"))),
            bits: self.bits.or(file.bits.filter(|_| keeps_words("bits"))),
            fraction_bits: self.fraction_bits.or(file.fraction_bits.filter(|_| keeps_words("fraction_bits"))),
            loss_db: self.loss_db.or(file.loss_db.filter(|_| keeps_words("loss_db"))),
            order: self.order.or(file.order.filter(|_| keeps("order") && self.reduction_loss_db.is_none())),
            reduction_loss_db: self
                .reduction_loss_db
                .or(file.reduction_loss_db.filter(|_| keeps("order") && self.order.is_none())),
            noise: self.noise.or(file.noise),
        }
    }

    /// An error of a spec with these keys in place of its own: theirs, if one of them is the cause.
    pub(super) fn blamed(&self, error: SpecError) -> SpecError {
        let Some(key) = error.path().strip_prefix("design.").map(str::to_owned) else { return error };
        let other_length = matches!(error.problem(), SpecProblem::Range { unit: "entries", .. });
        let cause = if other_length && !self.gives(&key) { "taps" } else { &key };
        if self.gives(cause) { error.of_override(cause) } else { error }
    }

    /// The default method is FIR if taps or a figure are given, else IIR, which needs no size.
    pub(super) fn resolved(self) -> DesignSpec {
        let method = self.method.unwrap_or(if self.is_sized() { Method::Fir } else { Method::Iir });
        Self { noise: None, ..self }.with(method)
    }
}
