//! The `[design]` table: defaults, overrides from the command line, and the keys of each method.

use super::limits::{
    check_gamma_margin, check_optimised_taps, check_order, check_reduction_loss, check_taps, check_target_snr,
};
use super::word_lengths::{WordLengths, check_fraction_bits};
use super::{DesignSpec, Method, Reduction, Solver, SpecProblem, Tracking, UncertaintySpec};
use crate::units::Seconds;

/// The keys of a `[design]` table that are present, in a file or on the command line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DesignOverrides {
    /// The method. If it overrides the method of a file, keys of the file that it does not read are dropped.
    pub method: Option<Method>,
    /// Taps per channel.
    pub taps: Option<usize>,
    /// The SNR in decibels for which the taps are chosen.
    pub target_snr_db: Option<f64>,
    /// Relative excess over the optimal gamma.
    pub gamma_margin: Option<f64>,
    /// The optimisation method of FIR designs.
    pub solver: Option<Solver>,
    /// Bits of the taps.
    pub bits: Option<WordLengths>,
    /// Taps are integers times 2^-fraction_bits.
    pub fraction_bits: Option<i32>,
    /// Taps that follow the delays.
    pub tracking: Option<Tracking>,
    /// The order, or the loss by order reduction.
    pub reduction: Option<Reduction>,
}

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

    /// Whether the method reads `taps`; `h2` makes FIR filters with it and recursive ones without.
    pub const fn reads_taps(self) -> bool {
        self.has_taps() || matches!(self, Self::H2)
    }

    /// Whether the number of taps may be chosen for an SNR, so that the method reads `target_snr_db`.
    pub const fn has_target_snr(self) -> bool {
        matches!(self, Self::Fir | Self::H2)
    }

    /// Whether the method minimises gamma and therefore reads `gamma_margin`.
    pub const fn has_gamma_margin(self) -> bool {
        matches!(self, Self::Fir | Self::Iir)
    }

    /// Whether the method is a convex problem with a choice of solvers and therefore reads `solver`.
    pub const fn has_solver(self) -> bool {
        matches!(self, Self::Fir)
    }

    /// Whether the method chooses among integer taps and therefore reads `bits` and `fraction_bits`.
    pub const fn has_bits(self) -> bool {
        matches!(self, Self::Fir)
    }

    /// Whether the method makes taps that follow the delays and therefore reads `tracking`.
    pub const fn has_tracking(self) -> bool {
        matches!(self, Self::Fir)
    }

    /// Whether the method may make recursive filters, for which it reads `order` and `reduction_loss_db`.
    pub const fn has_states(self) -> bool {
        matches!(self, Self::Iir | Self::H2)
    }
}

impl Solver {
    /// Every solver, the default first.
    pub const ALL: [Self; 2] = [Self::Sampled, Self::Kyp];

    /// The name in spec files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sampled => "sampled",
            Self::Kyp => "kyp",
        }
    }
}

impl Tracking {
    /// Every way.
    pub const ALL: [Self; 1] = [Self::Affine];

    /// The name in spec files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Affine => "affine",
        }
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

    fn check(self) -> Result<(), SpecProblem> {
        match self {
            Self::Order(order) => check_order(order),
            Self::Loss(db) => check_reduction_loss(db),
        }
    }
}

impl DesignSpec {
    /// Whether the filters are FIR, not recursive.
    pub const fn is_fir(&self) -> bool {
        let asks_for_taps = self.taps.is_some() || self.target_snr_db.is_some();
        self.method.has_taps() || (self.method.reads_taps() && asks_for_taps)
    }

    /// A method, with taps if it makes FIR filters, and no other keys.
    pub const fn new(method: Method, taps: Option<usize>) -> Self {
        Self {
            method,
            taps,
            target_snr_db: None,
            gamma_margin: None,
            solver: None,
            bits: None,
            fraction_bits: None,
            tracking: None,
            reduction: None,
        }
    }

    /// The same design by another method; keys that it does not read are dropped.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method needs taps and there are none, or too many for `channels`.
    pub fn with_method(&self, method: Method, channels: usize) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { method: Some(method), ..Default::default() }, channels)
    }

    /// The same design with another number of taps per channel, in place of a wanted SNR too.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method makes no FIR filters, or the number is out of range.
    pub fn with_taps(&self, taps: usize, channels: usize) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { taps: Some(taps), ..Default::default() }, channels)
    }

    fn overridden(&self, overrides: DesignOverrides, channels: usize) -> Result<Self, SpecProblem> {
        let Self {
            method,
            taps,
            target_snr_db,
            gamma_margin,
            solver,
            bits,
            fraction_bits,
            tracking,
            reduction,
        } = self.clone();
        let written = DesignOverrides {
            method: Some(method),
            taps,
            target_snr_db,
            gamma_margin,
            solver,
            bits,
            fraction_bits,
            tracking,
            reduction,
        };
        let design = overrides.over(written).resolved();
        design.check(channels)?;
        Ok(design)
    }

    /// Checks the numbers, and that the method reads every key.
    pub(super) fn check(&self, channels: usize) -> Result<(), SpecProblem> {
        self.check_by_key(channels).map_err(|KeyProblem { problem, .. }| problem)
    }

    /// As [`Self::check`], with the key whose value is wrong.
    pub(super) fn check_by_key(&self, channels: usize) -> Result<(), KeyProblem> {
        self.check_keys()?;
        blame("taps", self.taps.map_or(Ok(()), check_taps))?;
        blame("gamma_margin", self.gamma_margin.map_or(Ok(()), check_gamma_margin))?;
        if let Some(reduction) = self.reduction {
            blame(reduction.key(), reduction.check())?;
        }
        blame("fraction_bits", self.fraction_bits.map_or(Ok(()), check_fraction_bits))?;
        blame("bits", self.bits.as_ref().map_or(Ok(()), |bits| bits.check(self.taps)))?;
        if let (Some(_), None) = (self.fraction_bits, &self.bits) {
            let remedy = "fraction_bits sets the binary point of integer taps, whose word length bits gives, for example bits = 16";
            return blame("fraction_bits", Err(SpecProblem::MissingKey { key: "bits", remedy }));
        }
        blame("target_snr_db", self.target_snr_db.map_or(Ok(()), check_target_snr))?;
        match (self.method, self.taps) {
            (Method::Fir, Some(taps)) => blame("taps", self.check_unknowns(taps, channels)),
            _ => Ok(()),
        }
    }

    /// Each tap is a function of all delays but one if the taps follow them.
    fn check_unknowns(&self, taps: usize, channels: usize) -> Result<(), SpecProblem> {
        let functions = if self.tracking.is_some() { channels } else { 1 };
        check_optimised_taps(taps, channels.saturating_mul(functions))
    }

    /// Checks what depends on the errors of the channels.
    pub(super) fn check_beside(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), KeyProblem> {
        blame("solver", self.check_robust_solver(uncertainty, channels))?;
        self.check_averaging(uncertainty, channels)?;
        blame("tracking", self.check_tracking(uncertainty, channels))
    }

    /// Robust banks are an exchange of frequencies.
    fn check_robust_solver(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), SpecProblem> {
        match self.solver {
            Some(Solver::Kyp) if uncertainty.is_some_and(|table| table.is_a_box(channels)) => {
                let remedy = "a bank for uncertain channels is designed by solver = \"sampled\"; leave out one of the two";
                Err(SpecProblem::Conflict { first: "solver = \"kyp\"", second: "[uncertainty]", remedy })
            }
            _ => Ok(()),
        }
    }

    /// Only filters of finite length average over errors exactly.
    fn check_averaging(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), KeyProblem> {
        let Some(reduction) = self.reduction.filter(|_| self.method == Method::H2) else { return Ok(()) };
        let is_uncertain = |table: &UncertaintySpec| {
            table.delays(channels).iter().any(|delay| *delay > Seconds(0.0))
                || table.gains(channels).iter().any(|gain| *gain > 0.0)
        };
        if !uncertainty.is_some_and(is_uncertain) {
            return Ok(());
        }
        let remedy = "h2 averages over uncertain delays and gains with FIR filters, which have no order; leave out one of the two";
        blame(
            reduction.key(),
            Err(SpecProblem::Conflict { first: reduction.key(), second: "[uncertainty]", remedy }),
        )
    }

    /// Taps can only follow delays that are uncertain.
    fn check_tracking(
        &self,
        uncertainty: Option<&UncertaintySpec>,
        channels: usize,
    ) -> Result<(), SpecProblem> {
        let is_uncertain = |table: &UncertaintySpec| table.delays(channels).iter().any(|d| *d > Seconds(0.0));
        if self.tracking.is_none() || uncertainty.is_some_and(is_uncertain) {
            return Ok(());
        }
        let remedy = match uncertainty {
            None => "tracking needs to know how far the delays may move: give [uncertainty] delay",
            Some(_) => {
                "no delay moves: the delay of the reference is the origin, and [uncertainty] delay is 0 for all others; \
                 give a delay above 0 for a channel that is not the reference, or leave tracking out"
            }
        };
        Err(SpecProblem::MissingKey { key: "delay", remedy })
    }

    fn check_keys(&self) -> Result<(), KeyProblem> {
        let keys = [
            ("taps", self.taps.is_some(), self.method.reads_taps(), "fir or h2"),
            ("target_snr_db", self.target_snr_db.is_some(), self.method.has_target_snr(), "fir or h2"),
            ("gamma_margin", self.gamma_margin.is_some(), self.method.has_gamma_margin(), "fir or iir"),
            ("solver", self.solver.is_some(), self.method.has_solver(), "fir"),
            ("bits", self.bits.is_some(), self.method.has_bits(), "fir"),
            ("fraction_bits", self.fraction_bits.is_some(), self.method.has_bits(), "fir"),
            ("tracking", self.tracking.is_some(), self.method.has_tracking(), "fir"),
            (
                self.reduction.map_or("order", Reduction::key),
                self.reduction.is_some(),
                self.method.has_states(),
                "iir or h2",
            ),
        ];
        if let (Some(Solver::Kyp), Some(_)) = (self.solver, self.gamma_margin) {
            let (method, remedy) = ("fir with solver = \"kyp\"", "fir with solver = \"sampled\"");
            return blame(
                "gamma_margin",
                Err(SpecProblem::NeedlessKey { key: "gamma_margin", method, remedy }),
            );
        }
        if let (Some(Solver::Kyp), Some(_)) = (self.solver, self.tracking) {
            let (method, remedy) = ("fir with solver = \"kyp\"", "fir with solver = \"sampled\"");
            return blame("tracking", Err(SpecProblem::NeedlessKey { key: "tracking", method, remedy }));
        }
        if let (Some(_), Some(_)) = (&self.bits, self.tracking) {
            let remedy = "taps that follow the delays are no integers; leave out one of the two";
            return blame(
                "tracking",
                Err(SpecProblem::Conflict { first: "bits", second: "tracking", remedy }),
            );
        }
        if let (Some(_), Some(_)) = (self.taps, self.target_snr_db) {
            let remedy = "the SNR decides how many taps there are, keep one of them";
            return blame(
                "target_snr_db",
                Err(SpecProblem::Conflict { first: "taps", second: "target_snr_db", remedy }),
            );
        }
        if let (Some(reduction), true, Method::H2) = (self.reduction, self.is_fir(), self.method) {
            let (method, remedy) = ("h2 with taps", "h2 without taps");
            return blame(
                reduction.key(),
                Err(SpecProblem::NeedlessKey { key: reduction.key(), method, remedy }),
            );
        }
        match keys.into_iter().find(|&(_, given, read, _)| given && !read) {
            Some((key, _, _, remedy)) => {
                blame(key, Err(SpecProblem::NeedlessKey { key, method: self.method.name(), remedy }))
            }
            None => Ok(()),
        }
    }
}

/// A problem of a table, and the key that causes it.
#[derive(Debug)]
pub(super) struct KeyProblem {
    pub(super) key: &'static str,
    pub(super) problem: SpecProblem,
}

fn blame(key: &'static str, checked: Result<(), SpecProblem>) -> Result<(), KeyProblem> {
    checked.map_err(|problem| KeyProblem { key, problem })
}

impl DesignOverrides {
    /// Whether it has a value for `key`.
    pub(super) fn gives(&self, key: &str) -> bool {
        match key {
            "method" => self.method.is_some(),
            "taps" => self.taps.is_some(),
            "target_snr_db" => self.target_snr_db.is_some(),
            "gamma_margin" => self.gamma_margin.is_some(),
            "solver" => self.solver.is_some(),
            "bits" => self.bits.is_some(),
            "fraction_bits" => self.fraction_bits.is_some(),
            "tracking" => self.tracking.is_some(),
            _ => self.reduction.is_some_and(|reduction| reduction.key() == key),
        }
    }

    /// Values of the command line take precedence. Keys of the file that a new method does not read are
    /// dropped; taps too if the new method is recursive without them.
    pub(super) fn over(self, file: Self) -> Self {
        let replaced = self.method.filter(|method| file.method != Some(*method));
        let kept = |has: fn(Method) -> bool| replaced.is_none_or(has);
        Self {
            method: self.method.or(file.method),
            // Each stands in place of the other.
            taps: self.taps.or(file.taps.filter(|_| kept(Method::has_taps) && self.target_snr_db.is_none())),
            target_snr_db: self
                .target_snr_db
                .or(file.target_snr_db.filter(|_| kept(Method::has_target_snr) && self.taps.is_none())),
            gamma_margin: self.gamma_margin.or(file.gamma_margin.filter(|_| kept(Method::has_gamma_margin))),
            solver: self.solver.or(file.solver.filter(|_| kept(Method::has_solver))),
            bits: self.bits.or(file.bits.filter(|_| kept(Method::has_bits))),
            fraction_bits: self.fraction_bits.or(file.fraction_bits.filter(|_| kept(Method::has_bits))),
            tracking: self.tracking.or(file.tracking.filter(|_| kept(Method::has_tracking))),
            reduction: self.reduction.or(file.reduction.filter(|_| kept(Method::has_states))),
        }
    }

    /// The default method is FIR if taps or an SNR are given, else IIR, which needs no size.
    pub(super) fn resolved(self) -> DesignSpec {
        let Self {
            method,
            taps,
            target_snr_db,
            gamma_margin,
            solver,
            bits,
            fraction_bits,
            tracking,
            reduction,
        } = self;
        let is_sized = taps.is_some() || target_snr_db.is_some();
        DesignSpec {
            method: method.unwrap_or(if is_sized { Method::Fir } else { Method::Iir }),
            taps,
            target_snr_db,
            gamma_margin,
            solver,
            bits,
            fraction_bits,
            tracking,
            reduction,
        }
    }
}
