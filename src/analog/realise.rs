//! From a written filter to a gain and blocks in series, in normalised time.

use crate::linalg::{Complex, Mat, eigenvalues, solve, to_complex};
use crate::spec::{Family, FilterProblem, FilterSpec, Passband};
use crate::units::{RadiansPerFastPeriod, Seconds};

use super::pairing::pair_sections;
use super::rational::Rational;
use super::roots::RootSet;
use super::section::{Realisation, Section};
use super::zpk::{Cutoffs, Zpk};
use super::{AnalogError, MIN_DAMPING_RATIO, families};

/// One block of a series, with one input and one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Block {
    /// One or two poles with at most as many zeros.
    Section(Section),
    /// A polynomial fraction whose computed roots do not reproduce it.
    Rational(Rational),
    /// State equations as the spec gives them.
    State(Realisation),
}

/// A gain and blocks in series.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain {
    pub(super) gain: f64,
    pub(super) blocks: Vec<Block>,
}

impl Block {
    pub(super) fn realise(&self) -> Realisation {
        match self {
            Self::Section(section) => section.realise(),
            Self::Rational(rational) => rational.realise(),
            Self::State(state) => state.clone(),
        }
    }

    pub(super) fn response(&self, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Section(section) => section.response(s),
            Self::Rational(rational) => rational.response(s),
            Self::State(state) => state_response(state, s),
        }
    }

    pub(super) fn poles(&self) -> Result<Vec<Complex<f64>>, AnalogError> {
        match self {
            Self::Section(section) => Ok(section.poles.list()),
            Self::Rational(rational) => rational.poles(),
            Self::State(state) => Ok(eigenvalues(&state.a)?),
        }
    }
}

/// d + c (s - a)^-1 b.
pub(super) fn state_response(state: &Realisation, s: Complex<f64>) -> Complex<f64> {
    let n = state.a.nrows();
    let pencil = crate::linalg::CMat::identity(n, n) * s - to_complex(&state.a);
    let x = solve(&pencil, &to_complex(&state.b));
    (to_complex(&state.c) * x)[(0, 0)] + state.d
}

impl Chain {
    /// Normalises by the fast period `h` a filter whose written form has been checked.
    pub(super) fn new(filter: &FilterSpec, h: Seconds) -> Result<Self, AnalogError> {
        match filter {
            FilterSpec::TransferFunction { num, den } => Self::from_rational(Rational::new(num, den, h)),
            FilterSpec::ZeroPoleGain { zeros, poles, gain } => {
                let complex = |list: &[[f64; 2]]| list.iter().map(|&[re, im]| Complex::new(re, im)).collect();
                Self::from_zpk(&Zpk::new(complex(zeros), complex(poles), *gain).normalised(h), h)
            }
            FilterSpec::StateSpace { a, b, c } => Ok(Self::from_matrices(a, b, c, h)),
            FilterSpec::Family { family, order, passband, ripple_db, attenuation_db } => {
                let order = order.unwrap_or(1);
                let prototype =
                    prototype(*family, order, ripple_db.unwrap_or(0.0), attenuation_db.unwrap_or(0.0))?;
                Self::from_zpk(&moved(&prototype, *passband, h)?, h)
            }
            FilterSpec::Cascade { cascade } => {
                let mut whole = Self { gain: 1.0, blocks: Vec::new() };
                for stage in cascade {
                    let stage = Self::new(stage, h)?;
                    whole.gain *= stage.gain;
                    whole.blocks.extend(stage.blocks);
                }
                Ok(whole)
            }
        }
    }

    /// `h` only serves to give roots in rad/s in errors.
    fn from_zpk(zpk: &Zpk<RadiansPerFastPeriod>, h: Seconds) -> Result<Self, AnalogError> {
        let poles = RootSet::new(&zpk.poles, "pole").map_err(|e| in_written_unit(e, h))?;
        let zeros = RootSet::new(&zpk.zeros, "zero").map_err(|e| in_written_unit(e, h))?;
        let sections = pair_sections(&poles, &zeros);
        let gain = sections.iter().fold(zpk.gain, |gain, section| gain / section.scale());
        Ok(Self { gain, blocks: sections.into_iter().map(Block::Section).collect() })
    }

    fn from_rational(rational: Rational) -> Result<Self, AnalogError> {
        match rational.factored()? {
            Some(zpk) => Self::from_zpk(&zpk, Seconds(1.0)),
            None => Ok(Self { gain: 1.0, blocks: vec![Block::Rational(rational)] }),
        }
    }

    fn from_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>], h: Seconds) -> Self {
        let n = a.len();
        let state = Realisation {
            a: Mat::from_fn(n, n, |i, j| a[i][j] * h.0),
            b: Mat::from_fn(n, 1, |i, _| b[i][0] * h.0),
            c: Mat::from_fn(1, n, |_, j| c[0][j]),
            d: 0.0,
        };
        Self { gain: 1.0, blocks: vec![Block::State(state)] }
    }
}

/// The prototype at its place, refused where the band is too narrow for its poles.
fn moved(
    prototype: &Zpk<Cutoffs>,
    passband: Passband,
    h: Seconds,
) -> Result<Zpk<RadiansPerFastPeriod>, AnalogError> {
    let filter = prototype.moved(passband, h);
    let is_damped = |pole: &Complex<f64>| -pole.re >= MIN_DAMPING_RATIO * pole.norm();
    match passband {
        Passband::BandPass { low, high } if !filter.poles.iter().all(is_damped) => {
            let rule = format!(
                "band = {} Hz wide: a band this narrow puts poles within 1e-9 of the imaginary axis, beyond double \
                 precision; widen the band or lower the order",
                (high - low).0
            );
            Err(FilterProblem::of("band", rule).into())
        }
        _ => Ok(filter),
    }
}

/// The family member with its cutoff at |s| = 1.
fn prototype(
    family: Family,
    order: usize,
    ripple_db: f64,
    attenuation_db: f64,
) -> Result<Zpk<Cutoffs>, AnalogError> {
    let prototype = match family {
        Family::Butterworth => families::butterworth(order),
        Family::Chebyshev1 => families::chebyshev1(order, ripple_db),
        Family::Chebyshev2 => families::chebyshev2(order, attenuation_db),
        Family::Elliptic => families::elliptic(order, ripple_db, attenuation_db),
        Family::Bessel => families::bessel(order)?,
        Family::Rc => families::rc(),
    };
    if prototype.poles.iter().all(|p| -p.re >= MIN_DAMPING_RATIO * p.norm()) {
        return Ok(prototype);
    }
    let rule = format!(
        "order = {order}: with these ripples the transition band is narrower than 1e-9 of the cutoff, beyond double \
         precision; lower the order or set the ripples further apart"
    );
    Err(FilterProblem::of("order", rule).into())
}

/// The roots that `error` names, from rad per fast period to rad/s.
fn in_written_unit(error: AnalogError, h: Seconds) -> AnalogError {
    match error {
        AnalogError::NotConjugate { what, re, im } => {
            AnalogError::NotConjugate { what, re: re / h.0, im: im / h.0 }
        }
        other => other,
    }
}
