//! The `[design]` table: defaults, overrides from the command line, and which key goes with which method.

use super::limits::{check_optimised_taps, check_order, check_reduction_loss, check_slack, check_taps};
use super::{DesignSpec, Method, Reduction, SpecProblem};

/// What the command line says in place of the `[design]` table.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DesignOverrides {
    /// Another method; taps and slack of the file are dropped where it has no use for them.
    pub method: Option<Method>,
    /// Another number of taps.
    pub taps: Option<usize>,
    /// Another slack.
    pub slack: Option<f64>,
    /// Another order, or loss by its reduction.
    pub reduction: Option<Reduction>,
}

/// The `[design]` table as written.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct WrittenDesign {
    pub(super) method: Option<Method>,
    pub(super) taps: Option<usize>,
    pub(super) slack: Option<f64>,
    pub(super) reduction: Option<Reduction>,
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

    /// Whether the method makes FIR filters and therefore reads `taps`.
    pub const fn has_taps(self) -> bool {
        matches!(self, Self::Fir | Self::Sinc | Self::Separation)
    }

    /// Whether the method minimises gamma and therefore reads `slack`.
    pub const fn has_slack(self) -> bool {
        matches!(self, Self::Fir | Self::Iir)
    }

    /// Whether the method makes recursive filters and therefore reads `order` and `reduction_loss_db`.
    pub const fn has_states(self) -> bool {
        matches!(self, Self::Iir | Self::H2)
    }
}

impl Reduction {
    /// The key that says it.
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
    /// A method, with taps if it makes FIR filters, and no other wishes.
    pub const fn new(method: Method, taps: Option<usize>) -> Self {
        Self { method, taps, slack: None, reduction: None }
    }

    /// The same design by another method; taps and slack are dropped where it has no use for them.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method needs taps and there are none, or too many for `channels`.
    pub fn with_method(&self, method: Method, channels: usize) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { method: Some(method), ..Default::default() }, channels)
    }

    /// The same design with another number of taps a channel.
    ///
    /// # Errors
    /// [`SpecProblem`] if the method makes no FIR filters, or the number is out of range.
    pub fn with_taps(&self, taps: usize, channels: usize) -> Result<Self, SpecProblem> {
        self.overridden(DesignOverrides { taps: Some(taps), ..Default::default() }, channels)
    }

    fn overridden(&self, overrides: DesignOverrides, channels: usize) -> Result<Self, SpecProblem> {
        let written = WrittenDesign {
            method: Some(self.method),
            taps: self.taps,
            slack: self.slack,
            reduction: self.reduction,
        };
        let design = written.overridden(overrides).resolved();
        design.check(channels)?;
        Ok(design)
    }

    /// Checks the numbers and that every key goes with the method.
    pub(super) fn check(&self, channels: usize) -> Result<(), SpecProblem> {
        let method = self.method.name();
        if let Some(taps) = self.taps {
            check_taps(taps)?;
            if !self.method.has_taps() {
                return Err(SpecProblem::NeedlessKey { key: "taps", method, remedy: "fir" });
            }
        }
        if let Some(slack) = self.slack {
            check_slack(slack)?;
            if !self.method.has_slack() {
                return Err(SpecProblem::NeedlessKey { key: "slack", method, remedy: "fir or iir" });
            }
        }
        if let Some(reduction) = self.reduction {
            reduction.check()?;
            if !self.method.has_states() {
                return Err(SpecProblem::NeedlessKey { key: reduction.key(), method, remedy: "iir or h2" });
            }
        }
        match (self.method, self.taps) {
            (Method::Fir, None) => Err(SpecProblem::MissingKey {
                key: "taps",
                remedy: "the method fir needs the number of taps a channel at the fast rate, for example taps = 22",
            }),
            (Method::Fir, Some(taps)) => check_optimised_taps(taps, channels),
            _ => Ok(()),
        }
    }
}

impl WrittenDesign {
    /// What the command line says counts; what the file says about the method that it replaces does not.
    pub(super) fn overridden(self, overrides: DesignOverrides) -> Self {
        let kept = |has: fn(Method) -> bool| overrides.method.is_none_or(has);
        Self {
            method: overrides.method.or(self.method),
            taps: overrides.taps.or(self.taps.filter(|_| kept(Method::has_taps))),
            slack: overrides.slack.or(self.slack.filter(|_| kept(Method::has_slack))),
            reduction: overrides.reduction.or(self.reduction.filter(|_| kept(Method::has_states))),
        }
    }

    /// Without a method: FIR if there are taps, else IIR, which needs no size.
    pub(super) fn resolved(self) -> DesignSpec {
        let default = if self.taps.is_some() { Method::Fir } else { Method::Iir };
        let Self { method, taps, slack, reduction } = self;
        DesignSpec { method: method.unwrap_or(default), taps, slack, reduction }
    }
}
