//! Nonlinear least squares: the iteration of Gauss and Newton, with one rule for its steps and for its end.
//!
//! ```
//! use hybank_linalg::least_squares::{LeastSquares, NoMinimum, NormalEquations, StepLimits, minimise};
//! /// x^2 = 2, from a start at 1.
//! struct Root(f64);
//! impl LeastSquares for Root {
//!     type Error = NoMinimum;
//!     const MOST_STEPS: usize = 20;
//!     fn equations(&mut self) -> Result<NormalEquations, NoMinimum> {
//!         let mut equations = NormalEquations::new(1);
//!         equations.add(&[2.0 * self.0], 2.0 - self.0 * self.0);
//!         Ok(equations)
//!     }
//!     fn advance(&mut self, step: &[f64]) -> bool {
//!         self.0 += step[0];
//!         self.0 > 0.0
//!     }
//!     fn limits(&self, _: usize, _: f64) -> StepLimits {
//!         StepLimits { largest: 1.0, negligible: 1e-9 }
//!     }
//!     fn error(&self, why: NoMinimum) -> NoMinimum {
//!         why
//!     }
//! }
//! let mut root = Root(1.0);
//! let minimum = minimise(&mut root).unwrap();
//! assert!((root.0 - std::f64::consts::SQRT_2).abs() < 1e-12 && minimum.steps < 8);
//! ```

use crate::{Mat, PositiveFactor, power_of_two};

/// The normal equations of a problem that is linear around the present parameters: J'J, J'r and r'r of rows
/// with the derivatives J and the residuals r. Of a likelihood they are the Fisher information and the
/// score.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// J'J.
    pub gram: Mat,
    /// J'r, a column.
    pub projection: Mat,
    /// r'r.
    pub squares: f64,
    /// Number of rows.
    pub rows: usize,
}

/// Why the iteration ended without a minimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoMinimum {
    /// The rows do not depend on a parameter (from 0).
    WithoutEffect(usize),
    /// Parameters have the same effect.
    Dependent,
    /// The steps did not become negligible, or led away from the start; so many were taken.
    NoConvergence(usize),
}

/// What a step of one parameter may be.
#[derive(Debug, Clone, Copy)]
pub struct StepLimits {
    /// A larger step shortens the step of all parameters to this.
    pub largest: f64,
    /// The iteration ends when no parameter has a larger step.
    pub negligible: f64,
}

/// A problem at its present parameters.
pub trait LeastSquares {
    /// Why there is no solution.
    type Error;
    /// Most steps.
    const MOST_STEPS: usize;
    /// Largest diagonal of the inverse of J'J, scaled to a unit diagonal. Parameters beyond it are
    /// dependent.
    const WORST_CONDITION: f64 = f64::INFINITY;

    /// The normal equations at the present parameters.
    ///
    /// # Errors
    /// Those of the problem.
    fn equations(&mut self) -> Result<NormalEquations, Self::Error>;

    /// Adds a step to the parameters; false if they are too far from the start to be trusted.
    fn advance(&mut self, step: &[f64]) -> bool;

    /// The limits of parameter k. `sigma` is its standard deviation if the residuals have unit variance.
    fn limits(&self, k: usize, sigma: f64) -> StepLimits;

    /// The error that says why there is no minimum.
    fn error(&self, why: NoMinimum) -> Self::Error;
}

/// The end of an iteration.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// The equations from which the last, negligible step was taken.
    pub equations: NormalEquations,
    /// The inverse of their J'J.
    pub inverse: Mat,
    /// Steps taken.
    pub steps: usize,
}

impl NormalEquations {
    /// Without rows.
    pub fn new(parameters: usize) -> Self {
        let (gram, projection) = (Mat::zeros(parameters, parameters), Mat::zeros(parameters, 1));
        Self { gram, projection, squares: 0.0, rows: 0 }
    }

    /// Adds a row.
    pub fn add(&mut self, derivatives: &[f64], residual: f64) {
        for (i, a) in derivatives.iter().enumerate() {
            for (j, b) in derivatives.iter().enumerate() {
                self.gram[(i, j)] += a * b;
            }
            self.projection[(i, 0)] += a * residual;
        }
        self.squares += residual * residual;
        self.rows += 1;
    }

    /// The variance of the residuals, r'r over the degrees of freedom.
    pub fn variance(&self) -> f64 {
        self.squares / self.rows.saturating_sub(self.gram.nrows()).max(1) as f64
    }

    /// (J'J)^-1 J'r, the step to the minimum.
    ///
    /// # Errors
    /// [`NoMinimum`] if a parameter has no effect, or if two have the same.
    pub fn solve(&self) -> Result<Mat, NoMinimum> {
        let (scale, factor) = self.scaled()?;
        Ok(&scale * factor.solve(&(&scale * &self.projection)))
    }

    /// (J'J)^-1, the covariance of the parameters for residuals of unit variance.
    ///
    /// # Errors
    /// [`NoMinimum`] if a parameter has no effect, or if the inverse for a unit diagonal has a diagonal
    /// above `worst`.
    pub fn inverse(&self, worst: f64) -> Result<Mat, NoMinimum> {
        let (scale, factor) = self.scaled()?;
        let inverse = &scale * factor.solve(&scale);
        let mut of_unit_diagonal = (0..inverse.nrows()).map(|k| inverse[(k, k)] * self.gram[(k, k)]);
        let is_sound = of_unit_diagonal.all(|x| x < worst);
        is_sound.then_some(inverse).ok_or(NoMinimum::Dependent)
    }

    /// Scales S of the parameters, whose units differ, that bring the diagonal of J'J near 1, and the factor
    /// of S J'J S. They are powers of two, so they change no digit.
    fn scaled(&self) -> Result<(Mat, PositiveFactor), NoMinimum> {
        let diagonal = self.gram.diagonal();
        if let Some(k) = diagonal.iter().position(|x| !(*x > 0.0 && x.is_finite())) {
            return Err(NoMinimum::WithoutEffect(k));
        }
        if diagonal.is_empty() {
            return Err(NoMinimum::Dependent);
        }
        let scale = Mat::from_diagonal(&diagonal.map(|x| power_of_two(x.sqrt().recip())));
        let factor =
            PositiveFactor::new(&(&scale * &self.gram * &scale)).map_err(|_| NoMinimum::Dependent)?;
        Ok((scale, factor))
    }
}

/// Takes steps until all of them are negligible.
///
/// # Errors
/// Those of the problem.
pub fn minimise<P: LeastSquares>(problem: &mut P) -> Result<Minimum, P::Error> {
    for steps in 1..=P::MOST_STEPS {
        let equations = problem.equations()?;
        let inverse = equations.inverse(P::WORST_CONDITION).map_err(|why| problem.error(why))?;
        let step = equations.solve().map_err(|why| problem.error(why))?;
        let (mut factor, mut is_settled) = (1.0f64, true);
        for (k, x) in step.iter().enumerate() {
            let StepLimits { largest, negligible } = problem.limits(k, inverse[(k, k)].sqrt());
            factor = factor.min(largest / x.abs());
            is_settled &= x.abs() <= negligible;
        }
        let step: Vec<f64> = step.iter().map(|x| factor * x).collect();
        if !problem.advance(&step) {
            return Err(problem.error(NoMinimum::NoConvergence(steps)));
        }
        if is_settled {
            return Ok(Minimum { equations, inverse, steps });
        }
    }
    Err(problem.error(NoMinimum::NoConvergence(P::MOST_STEPS)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = a e^{b t}, from a start far enough for steps to be cut.
    struct Decay {
        values: [f64; 2],
        samples: Vec<(f64, f64)>,
    }

    impl LeastSquares for Decay {
        type Error = NoMinimum;
        const MOST_STEPS: usize = 50;

        fn equations(&mut self) -> Result<NormalEquations, NoMinimum> {
            let ([a, b], mut equations) = (self.values, NormalEquations::new(2));
            for &(t, y) in &self.samples {
                let e = (b * t).exp();
                equations.add(&[e, a * t * e], y - a * e);
            }
            Ok(equations)
        }

        fn advance(&mut self, step: &[f64]) -> bool {
            self.values.iter_mut().zip(step).for_each(|(x, dx)| *x += dx);
            self.values[1].abs() < 10.0
        }

        fn limits(&self, k: usize, _: f64) -> StepLimits {
            StepLimits { largest: if k == 1 { 0.3 } else { f64::INFINITY }, negligible: 1e-12 }
        }

        fn error(&self, why: NoMinimum) -> NoMinimum {
            why
        }
    }

    fn fitted(values: [f64; 2], times: usize) -> Result<[f64; 2], NoMinimum> {
        let at = |k: usize| (k as f64, 2.0 * (-0.5 * k as f64).exp());
        let mut problem = Decay { values, samples: (0..times).map(at).collect() };
        minimise(&mut problem).map(|_| problem.values)
    }

    #[test]
    fn an_exponential_is_found_and_what_has_no_effect_is_refused() {
        let found = fitted([1.0, 0.4], 8).unwrap();
        assert!((found[0] - 2.0).abs() < 1e-11 && (found[1] + 0.5).abs() < 1e-11, "{found:?}");
        assert_eq!(fitted([0.0, -0.4], 8), Err(NoMinimum::WithoutEffect(1)));
        assert_eq!(fitted([1.0, -0.4], 1), Err(NoMinimum::WithoutEffect(1)));
    }

    #[test]
    fn parameters_of_the_same_effect_have_no_inverse() {
        let mut equations = NormalEquations::new(2);
        equations.add(&[2.0, 1.0], 1.0);
        assert_eq!(equations.inverse(1e10), Err(NoMinimum::Dependent));
        equations.gram = Mat::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 1e-12]);
        let inverse = equations.inverse(1e10).unwrap();
        assert_eq!((inverse[(0, 0)], inverse[(1, 1)]), (0.25, 1e12));
    }
}
