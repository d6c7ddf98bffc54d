//! Linear interpolation between samples (thesis Prop. 3.1).

/// Bounds of the function that is sampled, on the hull of the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Smoothness {
    /// sup |f'|.
    pub(crate) slope: f64,
    /// sup |f''|.
    pub(crate) curvature: f64,
}

/// A position and the value there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Knot {
    /// The position.
    pub(crate) x: f64,
    /// The value.
    pub(crate) value: f64,
}

/// Straight lines from knot to knot.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PiecewiseLinear {
    knots: Vec<Knot>,
}

impl PiecewiseLinear {
    /// From knots in any order; `None` without any.
    pub(crate) fn new(mut knots: Vec<Knot>) -> Option<Self> {
        knots.sort_by(|a, b| a.x.total_cmp(&b.x));
        (!knots.is_empty()).then_some(Self { knots })
    }

    /// The interpolated value; outside the knots the value of the outermost one.
    pub(crate) fn value(&self, x: f64) -> f64 {
        let right = self.knots.partition_point(|s| s.x < x).min(self.knots.len() - 1);
        let (a, b) = (&self.knots[right.saturating_sub(1)], &self.knots[right]);
        let part = if b.x > a.x { ((x - a.x) / (b.x - a.x)).clamp(0.0, 1.0) } else { 0.0 };
        a.value + (b.value - a.value) * part
    }
}
