//! The `[design]` table: defaults, overrides from the command line, and the keys of each method.

use super::error::{KeyProblem, blame};
use super::limits;
use super::word_lengths::{WordLengths, check_fraction_bits};
use super::{FrameLayout, SpecProblem, UncertaintySpec};
use serde::{Deserialize, Serialize, Serializer};

/// How the synthesis filters are designed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[non_exhaustive]
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
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
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
    /// Delay-scheduled taps of the method `fir`, for delays that change while the bank runs: affine
    /// functions of the delays, optimal over the box of the `[uncertainty]` table.
    #[serde(skip_serializing_if = "std::ops::Not::not", serialize_with = "as_affine")]
    pub tracking: bool,
    /// Order reduction, for recursive methods.
    #[serde(flatten)]
    pub reduction: Option<Reduction>,
}

/// The schedule of delay-scheduled taps, in spec files.
pub(super) const AFFINE: &str = "affine";

fn as_affine<S: Serializer>(_: &bool, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(AFFINE)
}

/// A `[design]` table with its defaults filled in.
pub type DesignSpec = DesignTable<Method>;

/// The keys of a `[design]` table that are present, in a file or on the command line.
pub type DesignOverrides = DesignTable<Option<Method>>;

/// By how much the order of a recursive bank is reduced.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Reduction {
    /// To at most this many states, with the least error.
    #[serde(rename = "order")]
    Order(usize),
    /// To the fewest states whose error is within this many decibels of the full bank's.
    #[serde(rename = "reduction_loss_db")]
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
        Key { name: "gamma_margin", methods: &[Fir, Iir], advised: "fir or iir" },
        Key { name: "bits", methods: &[Fir], advised: "fir" },
        Key { name: "fraction_bits", methods: &[Fir], advised: "fir" },
        Key { name: "loss_db", methods: &[Fir], advised: "fir" },
        Key { name: "tracking", methods: &[Fir], advised: "fir" },
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

impl Reduction {
    /// The key in spec files.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Order(_) => "order",
            Self::Loss(_) => "reduction_loss_db",
        }
    }
}

impl<M> DesignTable<M> {
    /// The same keys with another method.
    fn with<N>(self, method: N) -> DesignTable<N> {
        DesignTable {
            method,
            taps: self.taps,
            target_snr_db: self.target_snr_db,
            gamma_margin: self.gamma_margin,
            bits: self.bits,
            fraction_bits: self.fraction_bits,
            loss_db: self.loss_db,
            tracking: self.tracking,
            reduction: self.reduction,
        }
    }

    /// The keys that have a value, the method apart.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        let keys = [
            ("taps", self.taps.is_some()),
            ("target_snr_db", self.target_snr_db.is_some()),
            ("gamma_margin", self.gamma_margin.is_some()),
            ("bits", self.bits.is_some()),
            ("fraction_bits", self.fraction_bits.is_some()),
            ("loss_db", self.loss_db.is_some()),
            ("tracking", self.tracking),
        ];
        keys.into_iter()
            .filter(|(_, given)| *given)
            .map(|(key, _)| key)
            .chain(self.reduction.map(Reduction::key))
    }

    /// Whether it has a value for `key`, which is not the method.
    pub(super) fn gives(&self, key: &str) -> bool {
        self.given().any(|given| given == key)
    }
}

impl DesignSpec {
    /// Whether the filters are FIR, not recursive.
    pub fn is_fir(&self) -> bool {
        let asks_for_taps = self.taps.is_some() || self.target_snr_db.is_some();
        self.method.has_taps() || (self.method.reads("taps") && asks_for_taps)
    }

    /// Whether the taps are integers.
    pub fn has_integers(&self) -> bool {
        self.bits.is_some() || self.loss_db.is_some()
    }

    /// A method, with taps if it makes FIR filters, and no other keys.
    pub fn new(method: Method, taps: Option<usize>) -> Self {
        DesignOverrides { taps, ..Default::default() }.with(method)
    }

    /// The same design by another method; keys that it does not read are dropped.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method needs taps and there are none, or too many for frames of this `layout`.
    pub fn with_method(&self, method: Method, layout: &FrameLayout) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { method: Some(method), ..Default::default() }, layout)
    }

    /// The same design with another number of taps per channel, in place of a wanted SNR too.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method makes no FIR filters, or the number is out of range.
    pub fn with_taps(&self, taps: usize, layout: &FrameLayout) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { taps: Some(taps), ..Default::default() }, layout)
    }

    fn overridden(&self, overrides: DesignOverrides, layout: &FrameLayout) -> Result<Self, SpecProblem> {
        let design = overrides.over(self.clone().with(Some(self.method))).resolved();
        design.check(layout)?;
        Ok(design)
    }

    /// Whether the design couples all samples of a frame. The taps of the mean-square optimum are
    /// independent for each output sample.
    pub(super) fn is_coupled(&self) -> bool {
        !(self.method == Method::H2 && self.is_fir())
    }

    /// Checks the numbers, and that the method reads every key.
    pub(super) fn check(&self, layout: &FrameLayout) -> Result<(), KeyProblem> {
        self.check_keys()?;
        blame("taps", self.taps.map_or(Ok(()), limits::check_taps))?;
        blame("gamma_margin", self.gamma_margin.map_or(Ok(()), limits::check_gamma_margin))?;
        match self.reduction {
            Some(Reduction::Order(order)) => blame("order", limits::check_order(order))?,
            Some(Reduction::Loss(db)) => blame("reduction_loss_db", limits::check_reduction_loss(db))?,
            None => {}
        }
        blame("fraction_bits", self.fraction_bits.map_or(Ok(()), check_fraction_bits))?;
        blame("bits", self.bits.as_ref().map_or(Ok(()), |bits| bits.check(self.taps)))?;
        blame("loss_db", self.loss_db.map_or(Ok(()), limits::check_word_loss))?;
        if self.fraction_bits.is_some() && self.bits.is_none() {
            let remedy = "fraction_bits sets the binary point of integer taps, whose word length bits gives, for example bits = 16";
            return blame("fraction_bits", Err(SpecProblem::MissingKey { key: "bits", remedy }));
        }
        blame("target_snr_db", self.target_snr_db.map_or(Ok(()), limits::check_target_snr))?;
        // Delay-scheduled taps are functions of all delays but one.
        let functions = if self.tracking { layout.samples().len() } else { 1 };
        match (self.method, self.taps) {
            (Method::Fir, Some(taps)) => {
                blame("taps", limits::check_optimised_taps(taps, layout.count().saturating_mul(functions)))
            }
            _ => Ok(()),
        }
    }

    fn check_keys(&self) -> Result<(), KeyProblem> {
        if let Some((key, problem)) = self.clash() {
            return blame(key, Err(problem));
        }
        match KEYS.iter().find(|key| self.gives(key.name) && !key.methods.contains(&self.method)) {
            Some(&Key { name: key, advised: remedy, .. }) => {
                blame(key, Err(SpecProblem::NeedlessKey { key, method: self.method.name(), remedy }))
            }
            None => Ok(()),
        }
    }

    /// A key that excludes another one, whatever their values are.
    fn clash(&self) -> Option<(&'static str, SpecProblem)> {
        let conflict =
            |first, second, remedy| Some((second, SpecProblem::Conflict { first, second, remedy }));
        match self.reduction {
            _ if self.has_integers() && self.tracking => conflict(
                if self.bits.is_some() { "bits" } else { "loss_db" },
                "tracking",
                "delay-scheduled taps are no integers; leave out one of the two",
            ),
            _ if self.loss_db.is_some() && self.fraction_bits.is_some() => conflict(
                "loss_db",
                "fraction_bits",
                "the loss decides the step of the taps; leave out one of the two",
            ),
            _ if self.taps.is_some() && self.target_snr_db.is_some() => {
                conflict("taps", "target_snr_db", "the SNR decides how many taps there are, keep one of them")
            }
            Some(reduction) if self.method == Method::H2 && self.is_fir() => {
                let (key, method, remedy) = (reduction.key(), "h2 with taps", "h2 without taps");
                Some((key, SpecProblem::NeedlessKey { key, method, remedy }))
            }
            _ => None,
        }
    }

    /// Checks what depends on the errors of the channels.
    pub(super) fn check_beside(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), KeyProblem> {
        let conflict = |first, remedy| Err(SpecProblem::Conflict { first, second: "[uncertainty]", remedy });
        if let (Some(reduction), Method::H2) = (self.reduction, self.method)
            && uncertainty.is_some_and(|table| table.has_delays_or_gains(channels))
        {
            let remedy = "h2 averages over uncertain delays and gains with FIR filters, which have no order; leave out one of the two";
            return blame(reduction.key(), conflict(reduction.key(), remedy));
        }
        let remedy = match uncertainty {
            _ if !self.tracking => return Ok(()),
            Some(table) if table.has_delays(channels) => return Ok(()),
            None => "tracking needs to know how far the delays may move: give [uncertainty] delay",
            Some(_) => {
                "no delay moves: the delay of the reference is the origin, and [uncertainty] delay is 0 for all others; \
                 give a delay above 0 for a channel that is not the reference, or leave tracking out"
            }
        };
        blame("tracking", Err(SpecProblem::MissingKey { key: "delay", remedy }))
    }
}

impl DesignOverrides {
    /// Values of the command line take precedence. Keys of the file that a new method does not read are
    /// dropped; taps too if the new method is recursive without them.
    pub(super) fn over(self, file: Self) -> Self {
        let new = self.method.filter(|method| file.method != Some(*method));
        let keeps = |key: &str| new.is_none_or(|method| method.reads(key));
        let keeps_taps = new.is_none_or(Method::has_taps);
        Self {
            method: self.method.or(file.method),
            // Each stands in place of the other.
            taps: self.taps.or(file.taps.filter(|_| keeps_taps && self.target_snr_db.is_none())),
            target_snr_db: self
                .target_snr_db
                .or(file.target_snr_db.filter(|_| keeps("target_snr_db") && self.taps.is_none())),
            gamma_margin: self.gamma_margin.or(file.gamma_margin.filter(|_| keeps("gamma_margin"))),
            bits: self.bits.or(file.bits.filter(|_| keeps("bits"))),
            fraction_bits: self.fraction_bits.or(file.fraction_bits.filter(|_| keeps("fraction_bits"))),
            loss_db: self.loss_db.or(file.loss_db.filter(|_| keeps("loss_db"))),
            tracking: self.tracking || file.tracking && keeps("tracking"),
            reduction: self.reduction.or(file.reduction.filter(|_| keeps("order"))),
        }
    }

    /// The default method is FIR if taps or an SNR are given, else IIR, which needs no size.
    pub(super) fn resolved(self) -> DesignSpec {
        let is_sized = self.taps.is_some() || self.target_snr_db.is_some();
        let method = self.method.unwrap_or(if is_sized { Method::Fir } else { Method::Iir });
        self.with(method)
    }
}
