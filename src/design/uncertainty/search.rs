//! The search for the worst errors in a box: norms at vertices, in double precision.

use super::super::DesignError;
use super::super::plant::LiftedPlant;
use super::super::problem::Problem;
use super::derivatives::delay_derivatives;
use super::sides::{Side, point_at, sides};
use crate::bank::Bank;
use crate::lti::peak::Peak;
use crate::units::RadiansPerSlowPeriod;
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Taps};

/// Vertices are all tried up to this number; beyond it one is improved by single changes.
const MAX_VERTICES: usize = 32;
/// Rounds of single changes.
const ROUNDS: usize = 2;

/// The problem of `bank` with the errors of `point`.
pub(super) fn moved(bank: &Bank, point: &ErrorPoint) -> Result<Problem, DesignError> {
    Problem::with_errors(bank.spec.as_ref().ok_or(DesignError::NoSpec)?, bank.latency, point)
}

/// The norm of `bank` with the errors of `point`, and the frequency of its peak, with fixed or with
/// delay-scheduled taps.
///
/// # Errors
/// As [`super::super::analyze`].
pub fn norm_at(
    bank: &Bank,
    point: &ErrorPoint,
    taps: Taps,
) -> Result<(f64, RadiansPerSlowPeriod), DesignError> {
    let peak = LiftedPlant::new(&moved(bank, point)?)?.bank_norm(&taps.filters(bank, point))?;
    Ok((peak.gain, RadiansPerSlowPeriod(peak.frequency)))
}

/// Points of the box that may be the worst ones, with their peak frequencies; the centre among them.
pub(super) fn candidates(
    bank: &Bank,
    errors: &ErrorBox,
    taps: Taps,
) -> Result<Vec<(ErrorPoint, RadiansPerSlowPeriod)>, DesignError> {
    let search = Search { bank, errors, taps, sides: sides(errors) };
    let centre = ErrorPoint::none(bank.channel_count());
    let nominal = search.norm(&centre)?;
    let count = search.sides.len();
    let (point, peak) = if count < usize::BITS as usize && 1usize << count <= MAX_VERTICES {
        search.best_of_all()?
    } else {
        search.improved()?
    };
    let at = |peak: Peak| RadiansPerSlowPeriod(peak.frequency);
    Ok(vec![(point, at(peak)), (centre, at(nominal))])
}

struct Search<'a> {
    bank: &'a Bank,
    errors: &'a ErrorBox,
    taps: Taps,
    sides: Vec<Side>,
}

impl Search<'_> {
    fn norm(&self, point: &ErrorPoint) -> Result<Peak, DesignError> {
        LiftedPlant::new(&moved(self.bank, point)?)?.bank_norm(&self.taps.filters(self.bank, point))
    }

    /// The vertex with these signs.
    fn vertex(&self, up: &[bool]) -> ErrorPoint {
        let shares: Vec<f64> = up.iter().map(|&up| if up { 1.0 } else { -1.0 }).collect();
        point_at(self.errors, &self.sides, &shares)
    }

    fn best_of_all(&self) -> Result<(ErrorPoint, Peak), DesignError> {
        let judged = |signs: usize| {
            let up: Vec<bool> = (0..self.sides.len()).map(|bit| signs >> bit & 1 == 1).collect();
            let point = self.vertex(&up);
            let peak = self.norm(&point)?;
            Ok::<_, DesignError>((point, peak))
        };
        let mut worst = judged(0)?;
        for signs in 1..1usize << self.sides.len() {
            let other = judged(signs)?;
            if other.1.gain > worst.1.gain {
                worst = other;
            }
        }
        Ok(worst)
    }

    /// From the signs of the derivatives, one change at a time.
    fn improved(&self) -> Result<(ErrorPoint, Peak), DesignError> {
        let slopes = delay_derivatives(self.bank)?.per_fast_period;
        let sign = |side: &Side| match *side {
            Side::Delay(i) => slopes[i] >= 0.0,
            Side::Gain(..) | Side::Cutoff(..) => true,
        };
        let mut up: Vec<bool> = self.sides.iter().map(sign).collect();
        let mut peak = self.norm(&self.vertex(&up))?;
        for _ in 0..ROUNDS {
            for side in 0..up.len() {
                up[side] = !up[side];
                let other = self.norm(&self.vertex(&up))?;
                if other.gain > peak.gain { peak = other } else { up[side] = !up[side] }
            }
        }
        Ok((self.vertex(&up), peak))
    }
}
