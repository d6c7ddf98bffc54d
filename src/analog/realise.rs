//! From a written filter to a gain and blocks in series, in normalised time.

use nalgebra::DMatrix;

use crate::arithmetic::{Ball, Float512, Real};
use crate::linalg::{Complex, eigenvalues, solve, to_complex};
use crate::spec::{FilterSpec, Passband};
use crate::units::Seconds;

use super::AnalogError;
use super::families::{self, Member};
use super::pairing::pair_sections;
use super::polynomial::enclosed_roots;
use super::roots::{Factors, RootSet};
use super::section::{Realisation, Section};

/// One block of a series, with one input and one output.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Block<T> {
    /// One or two poles with at most as many zeros.
    Section(Section<T>),
    /// State equations as the spec gives them.
    State(Realisation<T>),
}

/// A gain and blocks in series.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chain<T> {
    pub(super) gain: T,
    pub(super) blocks: Vec<Block<T>>,
}

/// A number in which written filters are realised: `f64` for the design, a ball for the proof.
pub(super) trait Written: Real {
    /// Zeros, poles and gain of `num(s) / den(s)`.
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError>;

    /// Zeros, poles and gain of a member of a family, in normalised time.
    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError>;
}

impl Written for Ball<Float512> {
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError> {
        let [num, den] = [num, den].map(without_leading_zeros);
        let (zeros, poles) = (enclosed_roots(num, "num")?, enclosed_roots(den, "den")?);
        Ok(Factors { zeros, poles, gain: Self::from(num[0]) / Self::from(den[0]) })
    }

    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError> {
        families::placed(member, passband, h)
    }
}

impl Written for f64 {
    fn quotient(num: &[f64], den: &[f64]) -> Result<Factors<Self>, AnalogError> {
        Ok(Ball::quotient(num, den)?.rounded())
    }

    fn family(member: &Member, passband: Passband, h: Seconds) -> Result<Factors<Self>, AnalogError> {
        Ok(families::placed(member, passband, h)?.rounded())
    }
}

fn without_leading_zeros(values: &[f64]) -> &[f64] {
    let start = values.iter().position(|&x| x != 0.0).unwrap_or(values.len());
    &values[start..]
}

impl<T: Written> Block<T> {
    pub(super) fn realise(&self) -> Realisation<T> {
        match self {
            Self::Section(section) => section.realise(),
            Self::State(state) => state.clone(),
        }
    }
}

impl Block<f64> {
    pub(super) fn response(&self, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Section(section) => section.response(s),
            Self::State(state) => state_response(state, s),
        }
    }

    pub(super) fn poles(&self) -> Result<Vec<Complex<f64>>, AnalogError> {
        match self {
            Self::Section(section) => Ok(section.poles.list()),
            Self::State(state) => Ok(eigenvalues(&state.a)?),
        }
    }
}

/// d + c (s - a)^-1 b.
pub(super) fn state_response(state: &Realisation<f64>, s: Complex<f64>) -> Complex<f64> {
    let n = state.a.nrows();
    let pencil = crate::linalg::CMat::identity(n, n) * s - to_complex(&state.a);
    let x = solve(&pencil, &to_complex(&state.b));
    (to_complex(&state.c) * x)[(0, 0)] + state.d
}

impl<T: Written> Chain<T> {
    /// Normalises by the fast period `h` a filter whose written form has been checked.
    pub(super) fn new(filter: &FilterSpec, h: Seconds) -> Result<Self, AnalogError> {
        let period = T::from(h.0);
        match filter {
            FilterSpec::TransferFunction { num, den } => {
                Ok(Self::of_sections(T::quotient(num, den)?.stretched(period)))
            }
            FilterSpec::ZeroPoleGain { zeros, poles, gain } => {
                let complex = |list: &[[f64; 2]]| -> Vec<Complex<f64>> {
                    list.iter().map(|&[re, im]| Complex::new(re, im)).collect()
                };
                let (zeros, poles) =
                    (RootSet::new(&complex(zeros), "zero")?, RootSet::new(&complex(poles), "pole")?);
                Ok(Self::of_sections(Factors { zeros, poles, gain: T::from(*gain) }.stretched(period)))
            }
            FilterSpec::StateSpace { a, b, c } => Ok(Self::of_matrices(a, b, c, period)),
            FilterSpec::Family { family, order, passband, ripple_db, attenuation_db } => {
                let member = Member {
                    family: *family,
                    order: order.unwrap_or(1),
                    ripple_db: ripple_db.unwrap_or(0.0),
                    attenuation_db: attenuation_db.unwrap_or(0.0),
                };
                Ok(Self::of_sections(T::family(&member, *passband, h)?))
            }
            FilterSpec::Cascade { cascade } => {
                let mut whole = Self { gain: T::from(1.0), blocks: Vec::new() };
                for stage in cascade {
                    let stage = Self::new(stage, h)?;
                    whole.gain = whole.gain * stage.gain;
                    whole.blocks.extend(stage.blocks);
                }
                Ok(whole)
            }
        }
    }

    fn of_sections(factors: Factors<T>) -> Self {
        let sections = pair_sections(&factors.poles, &factors.zeros);
        let gain = sections.iter().fold(factors.gain, |gain, section| section.unscaled(gain));
        Self { gain, blocks: sections.into_iter().map(Block::Section).collect() }
    }

    fn of_matrices(a: &[Vec<f64>], b: &[Vec<f64>], c: &[Vec<f64>], h: T) -> Self {
        let n = a.len();
        let state = Realisation {
            a: DMatrix::from_fn(n, n, |i, j| T::from(a[i][j]) * h),
            b: DMatrix::from_fn(n, 1, |i, _| T::from(b[i][0]) * h),
            c: DMatrix::from_fn(1, n, |_, j| T::from(c[0][j])),
            d: T::from(0.0),
        };
        Self { gain: T::from(1.0), blocks: vec![Block::State(state)] }
    }

    /// The blocks in series. The gain is applied at the output, so that states keep their size.
    pub(super) fn realise(&self) -> Realisation<T> {
        self.blocks
            .iter()
            .fold(Realisation::wire(), |whole, block| whole.then(&block.realise()))
            .amplified(self.gain)
    }
}
