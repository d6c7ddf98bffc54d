//! Descent of a function that is smooth almost everywhere: quasi-Newton steps (BFGS) with a weak Wolfe line
//! search, which also works where the minimum is a kink (Lewis and Overton, "Nonsmooth optimization via
//! quasi-Newton methods", Math. Programming 141, 2013).

use crate::linalg::Mat;

/// A step must achieve this fraction of the decrease that the slope predicts ...
const ARMIJO_DECREASE: f64 = 1e-4;
/// ... and must reduce the slope to this fraction.
const WOLFE_CURVATURE: f64 = 0.5;
/// Halvings and doublings of a step.
const LINE_LIMIT: usize = 24;
/// Length of the first step relative to the norm of the start.
const FIRST_STEP: f64 = 0.05;
/// A descent has converged if it gains less than this (relative) in [`PATIENCE`] steps.
const CONVERGED_GAIN: f64 = 1e-4;
const PATIENCE: usize = 6;

/// A point with value and gradient there.
#[derive(Debug, Clone)]
pub(super) struct Evaluated {
    pub(super) x: Mat,
    pub(super) value: f64,
    pub(super) gradient: Mat,
}

/// Descends from `start` until it converges or has evaluated `f` `budget` times. `f` returns value and
/// gradient, or `None` outside its domain. The result is never above the start.
pub(super) fn descend(
    f: &mut dyn FnMut(&Mat) -> Option<(f64, Mat)>,
    start: Evaluated,
    budget: usize,
) -> Evaluated {
    let n = start.x.nrows();
    let mut inverse_hessian = Mat::identity(n, n) * (FIRST_STEP * start.x.norm() / start.gradient.norm());
    let mut first = true;
    let mut left = budget;
    let mut history = vec![start.value];
    let mut now = start;
    while left > 0 && now.gradient.norm() > 0.0 && inverse_hessian.iter().all(|x| x.is_finite()) {
        let direction = -(&inverse_hessian * &now.gradient);
        let Some(next) = line_search(f, &now, &direction, &mut left) else { break };
        let (s, y) = (&next.x - &now.x, &next.gradient - &now.gradient);
        let sy = s.dot(&y);
        if sy > 0.0 {
            if first {
                inverse_hessian = Mat::identity(n, n) * (sy / y.norm_squared());
                first = false;
            }
            update(&mut inverse_hessian, &s, &y, sy);
        }
        now = next;
        history.push(now.value);
        let past = history.len().checked_sub(1 + PATIENCE).map(|k| history[k]);
        if past.is_some_and(|past| now.value > past * (1.0 - CONVERGED_GAIN)) {
            break;
        }
    }
    now
}

/// H <- (I - s y'/sy) H (I - y s'/sy) + s s'/sy.
fn update(h: &mut Mat, s: &Mat, y: &Mat, sy: f64) {
    let hy = &*h * y;
    let scale = (1.0 + y.dot(&hy) / sy) / sy;
    *h += s * s.transpose() * scale - (&hy * s.transpose() + s * hy.transpose()) / sy;
}

/// A step with enough decrease, and if possible with a reduced slope, by bisection and doubling.
fn line_search(
    f: &mut dyn FnMut(&Mat) -> Option<(f64, Mat)>,
    from: &Evaluated,
    direction: &Mat,
    left: &mut usize,
) -> Option<Evaluated> {
    let slope = from.gradient.dot(direction);
    if slope >= 0.0 || slope.is_nan() {
        return None;
    }
    let (mut low, mut high, mut t) = (0.0, f64::INFINITY, 1.0);
    let mut found = None;
    for _ in 0..LINE_LIMIT {
        if *left == 0 {
            break;
        }
        *left -= 1;
        let x = &from.x + direction * t;
        let tried = f(&x).filter(|(value, _)| *value <= from.value + ARMIJO_DECREASE * t * slope);
        match tried {
            None => high = t,
            Some((value, gradient)) => {
                let flat = gradient.dot(direction) >= WOLFE_CURVATURE * slope;
                found = Some(Evaluated { x, value, gradient });
                if flat {
                    break;
                }
                low = t;
            }
        }
        t = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * low };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(f: &mut dyn FnMut(&Mat) -> Option<(f64, Mat)>, x: &[f64], budget: usize) -> Evaluated {
        let x = Mat::from_column_slice(x.len(), 1, x);
        let (value, gradient) = f(&x).unwrap();
        descend(f, Evaluated { x, value, gradient }, budget)
    }

    #[test]
    fn a_smooth_valley_is_followed() {
        // Rosenbrock's function plus one, so that relative gains mean something.
        let mut f = |x: &Mat| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            let gradient = Mat::from_column_slice(2, 1, &[-2.0 * a - 400.0 * x[0] * b, 200.0 * b]);
            Some((1.0 + a * a + 100.0 * b * b, gradient))
        };
        let end = from(&mut f, &[-1.2, 1.0], 500);
        assert!(end.value - 1.0 < 1e-4, "{end:?}");
    }

    #[test]
    fn a_kink_is_found() {
        // max(|x - y|, |x + 2 y - 3|) + 1: the minimum 1 lies at (1, 1) where four pieces meet.
        let mut f = |x: &Mat| {
            let (a, b) = (x[0] - x[1], x[0] + 2.0 * x[1] - 3.0);
            let g =
                if a.abs() > b.abs() { [a.signum(), -a.signum()] } else { [b.signum(), 2.0 * b.signum()] };
            Some((1.0 + a.abs().max(b.abs()), Mat::from_column_slice(2, 1, &g)))
        };
        let end = from(&mut f, &[5.0, -3.0], 500);
        assert!(end.value - 1.0 < 1e-3, "{end:?}");
    }

    #[test]
    fn the_edge_of_the_domain_is_not_left() {
        // x -> 1/x on (0, 1): the infimum lies on the edge.
        let mut f = |x: &Mat| {
            (x[0] > 0.0 && x[0] < 1.0).then(|| (1.0 / x[0], Mat::from_element(1, 1, -1.0 / (x[0] * x[0]))))
        };
        let end = from(&mut f, &[0.3], 300);
        assert!(end.x[0] < 1.0 && end.value < 1.001, "{end:?}");
    }

    #[test]
    fn the_budget_is_kept() {
        let mut asked = 0;
        let mut f = |x: &Mat| {
            asked += 1;
            Some((x.norm_squared() + 1.0, x * 2.0))
        };
        from(&mut f, &[1e3, 1.0, -7.0], 3);
        assert!(asked <= 4, "{asked}");
    }
}
