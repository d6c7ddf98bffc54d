use super::*;
use crate::linalg::Mat;
use crate::lmi::sampled;
use crate::lmi::testbank::{self, TestBank};
use crate::lmi::{LmiError, Outcome, Settings};
use crate::lti::StateSpace;
use crate::lti::peak::hinf_norm;

/// A random-looking FIR problem: plant (a, b), reference w = cw x + dw u, measurement h = ch x + dh u, taps
/// F_j on h[k - j]. Returns the KYP problem and the sampled one on the given grid.
struct Fir {
    a: Mat,
    b: Mat,
    cw: Mat,
    dw: Mat,
    ch: Mat,
    dh: Mat,
    lags: usize,
}

fn wavy(rows: usize, cols: usize, seed: f64) -> Mat {
    Mat::from_fn(rows, cols, |i, j| (seed + 1.7 * i as f64 + 2.9 * (j * (i + 1)) as f64).sin())
}

impl Fir {
    fn new(n: usize, m: usize, q: usize, outputs: usize, lags: usize, radius: f64) -> Self {
        let a = wavy(n, n, 0.3);
        let a = &a * (radius / crate::linalg::spectral_radius(&a).unwrap());
        let (b, cw, dw) = (wavy(n, q, 1.1), wavy(m, n, 2.3), wavy(m, q, 0.9) * 0.3);
        Self { a, b, cw, dw, ch: wavy(outputs, n, 3.7), dh: wavy(outputs, q, 5.1) * 0.2, lags }
    }

    fn of_bank(bank: &TestBank, lags: usize) -> Self {
        let [a, b, cw, dw, ch, dh] = bank.blocked();
        Self { a, b, cw, dw, ch, dh, lags }
    }

    fn kyp(&self) -> Problem {
        let (n, q, outputs, m) = (self.a.nrows(), self.b.ncols(), self.ch.nrows(), self.cw.nrows());
        let order = n + outputs * (self.lags - 1);
        let mut a = Mat::zeros(order, order);
        let mut b = Mat::zeros(order, q);
        a.view_mut((0, 0), (n, n)).copy_from(&self.a);
        b.view_mut((0, 0), (n, q)).copy_from(&self.b);
        if self.lags > 1 {
            a.view_mut((n, 0), (outputs, n)).copy_from(&self.ch);
            b.view_mut((n, 0), (outputs, q)).copy_from(&self.dh);
        }
        for i in outputs..order - n {
            a[(n + i, n + i - outputs)] = 1.0;
        }
        let mut c = Mat::zeros(m, order);
        c.view_mut((0, 0), (m, n)).copy_from(&self.cw);
        let mut terms = Vec::new();
        for j in 0..self.lags {
            for p in 0..m {
                for i in 0..outputs {
                    let (mut ck, mut dk) = (Mat::zeros(m, order), Mat::zeros(m, q));
                    if j == 0 {
                        ck.view_mut((p, 0), (1, n)).copy_from(&-self.ch.row(i));
                        dk.row_mut(p).copy_from(&-self.dh.row(i));
                    } else {
                        ck[(p, n + outputs * (j - 1) + i)] = -1.0;
                    }
                    terms.push((ck, dk));
                }
            }
        }
        Problem::new(a, b, c, self.dw.clone(), terms).unwrap()
    }

    fn sampled(&self, grid: &[f64]) -> sampled::Problem {
        use crate::linalg::{CMat, Complex, solve, to_complex};
        let n = self.a.nrows();
        let point = |&omega: &f64| {
            let z = CMat::identity(n, n) * Complex::from_polar(1.0, omega);
            let state = solve(&(z - to_complex(&self.a)), &to_complex(&self.b));
            sampled::Point {
                omega,
                w: to_complex(&self.cw) * &state + to_complex(&self.dw),
                h: to_complex(&self.ch) * state + to_complex(&self.dh),
            }
        };
        sampled::Problem::new(grid.iter().map(point).collect(), vec![self.lags; self.cw.nrows()]).unwrap()
    }
}

/// `(C(x), D(x))`.
fn outputs(problem: &Problem, x: &[f64]) -> (Mat, Mat) {
    let (mut c, mut d) = (problem.c.clone(), problem.d.clone());
    for ((ck, dk), x) in problem.terms.iter().zip(x) {
        c += ck * *x;
        d += dk * *x;
    }
    (c, d)
}

fn report(name: &str, p: &Problem, s: &Solution, seconds: f64) {
    println!(
        "{name}: {:?} gamma {:.10} lower {:.10} gap {:.1e} steps {} states {} of {} unknowns {} in {seconds:.3} s",
        s.outcome,
        s.gamma,
        s.lower,
        (s.gamma - s.lower) / s.gamma,
        s.iterations,
        s.coordinates.a.nrows(),
        p.a.nrows(),
        p.terms.len()
    );
}

fn solve(name: &str, p: &Problem) -> Solution {
    let start = std::time::Instant::now();
    let s = minimise(p, &Settings::KYP).unwrap();
    report(name, p, &s, start.elapsed().as_secs_f64());
    s
}

#[test]
fn kyp_and_sampled_forms_agree() {
    for (n, m, q, outputs, lags, radius) in
        [(3, 1, 1, 1, 3, 0.8), (4, 2, 2, 1, 3, 0.9), (4, 1, 3, 2, 4, 0.7), (5, 2, 4, 2, 5, 0.9)]
    {
        let fir = Fir::new(n, m, q, outputs, lags, radius);
        let s = solve("fir", &fir.kyp());
        let grid: Vec<f64> = (0..2001).map(|l| std::f64::consts::PI * l as f64 / 2000.0).collect();
        let f = sampled::minimise(&fir.sampled(&grid), &Settings::SAMPLED).unwrap();
        println!("sampled {} {}", f.gamma, f.lower.value);
        assert_eq!(s.outcome, Outcome::Solved);
        assert!(f.lower.value <= s.gamma * (1.0 + 1e-9));
        assert!((f.gamma - s.gamma).abs() < 1e-5 * s.gamma);
    }
}

#[test]
fn the_thesis_bank_is_solved_in_kyp_form() {
    let s = solve("thesis", &Fir::of_bank(&testbank::thesis(), 11).kyp());
    assert_eq!(s.outcome, Outcome::Solved);
    assert!((s.gamma - 0.03993204).abs() < 2e-8);
    let early = TestBank { latency: 1, ..testbank::thesis() };
    let s = solve("thesis, latency 1, 12 taps", &Fir::of_bank(&early, 6).kyp());
    assert!((s.gamma - 0.069447031).abs() < 2e-8);
}

/// `C(x) (zI - A)^-1 B + D(x)` of a solution, and its norm by level sets.
fn norm(problem: &Problem, x: &[f64]) -> f64 {
    let (c, d) = outputs(problem, x);
    hinf_norm(&StateSpace::new(problem.a.clone(), problem.b.clone(), c, d).unwrap()).unwrap().gain
}

/// `[P - A'PA, -A'PB, C'; -B'PA, gamma I - B'PB, D'; C, D, gamma I]`, written out as one congruence.
fn lmi(problem: &Problem, s: &Solution) -> Mat {
    let (c, d) = outputs(problem, &s.x);
    let (a, b, c) = (&s.coordinates.a, &s.coordinates.b, c * &s.coordinates.basis);
    let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
    let next = Mat::from_fn(n, n + m, |i, j| if j < n { a[(i, j)] } else { b[(i, j - n)] });
    let output = Mat::from_fn(p, n + m, |i, j| if j < n { c[(i, j)] } else { d[(i, j - n)] });
    let mut all = Mat::identity(n + m + p, n + m + p) * s.gamma;
    all.view_mut((0, 0), (n, n)).copy_from(&s.p);
    let mut corner = all.view_mut((0, 0), (n + m, n + m));
    corner -= next.transpose() * &s.p * &next;
    all.view_mut((n + m, 0), (p, n + m)).copy_from(&output);
    all.view_mut((0, n + m), (n + m, p)).copy_from(&output.transpose());
    all
}

/// The primal matrix is positive definite and the norm of the unknowns found lies between the two bounds.
#[test]
fn the_lmi_holds_and_the_norm_lies_between_the_bounds() {
    for fir in [Fir::new(4, 2, 2, 1, 3, 0.9), Fir::of_bank(&testbank::thesis(), 11)] {
        let problem = fir.kyp();
        let s = solve("bank", &problem);
        let least = crate::linalg::hermitian_eigenvalues(&lmi(&problem, &s)).unwrap()[0];
        assert!(least > -1e-12 * s.gamma, "{least}");
        let norm = norm(&problem, &s.x);
        assert!(s.lower <= norm * (1.0 + 1e-9) && norm <= s.gamma * (1.0 + 1e-9), "{} {norm}", s.gamma);
    }
}

/// A constant has no states, a problem without unknowns no choice, a reachable target no error.
#[test]
fn degenerate_problems_are_right() {
    let none = Problem::new(
        Mat::zeros(0, 0),
        Mat::zeros(0, 2),
        Mat::zeros(1, 0),
        Mat::from_row_slice(1, 2, &[3.0, 4.0]),
        vec![],
    );
    let s = solve("constant", &none.unwrap());
    assert!((s.gamma - 5.0).abs() < 1e-6 && s.lower > 5.0 - 1e-6, "{s:?}");
    let one = |v: f64| Mat::from_element(1, 1, v);
    let fixed = Problem::new(one(0.5), one(1.0), one(1.0), one(0.0), vec![]).unwrap();
    let s = solve("no unknowns", &fixed);
    assert!((s.gamma - 2.0).abs() < 1e-6, "{s:?}");
    let twice = vec![(one(1.0), one(0.0)), (one(1.0), one(0.0)), (one(0.0), one(0.0))];
    let reachable = Problem::new(one(0.5), one(1.0), one(-7.0), one(0.0), twice).unwrap();
    let s = solve("reachable", &reachable);
    assert!(s.outcome == Outcome::Solved && s.gamma < 1e-12);
    assert!((s.x[0] - 3.5).abs() < 1e-12 && (s.x[1] - 3.5).abs() < 1e-12 && s.x[2] == 0.0, "{:?}", s.x);
}

/// Uncontrollable and badly scaled states change nothing.
#[test]
fn units_and_uncontrollable_states_do_not_matter() {
    let fir = Fir::new(3, 1, 1, 1, 3, 0.8);
    let plain = fir.kyp();
    let gamma = solve("plain", &plain).gamma;
    let n = plain.a.nrows();
    let units: Vec<f64> = (0..n).map(|i| 10f64.powi(6 * (i as i32 % 3 - 1))).collect();
    let mut a = Mat::zeros(n + 1, n + 1);
    let grow = |m: &Mat, rows: usize, cols: usize| m.clone().resize(rows, cols, 0.0);
    a.view_mut((0, 0), (n, n)).copy_from(&Mat::from_fn(n, n, |i, j| units[i] * plain.a[(i, j)] / units[j]));
    a[(n, n)] = 0.99;
    a[(0, n)] = 3.0;
    let b = grow(&Mat::from_fn(n, 1, |i, _| units[i] * plain.b[i]), n + 1, 1);
    let c = |c: &Mat| grow(&Mat::from_fn(1, n, |_, j| c[j] / units[j]), 1, n + 1);
    let terms = plain.terms.iter().map(|(ck, dk)| (c(ck), dk.clone())).collect();
    let scaled = Problem::new(a, b, c(&plain.c), plain.d.clone(), terms).unwrap();
    let s = solve("scaled", &scaled);
    assert_eq!(s.coordinates.a.nrows(), n);
    assert!((s.gamma - gamma).abs() < 1e-6 * gamma, "{} {gamma}", s.gamma);
}

#[test]
fn what_is_no_problem_is_refused() {
    let one = |v: f64| Mat::from_element(1, 1, v);
    let zero = one(0.0);
    let try_a = |a: Mat| Problem::new(a, one(1.0), one(1.0), zero.clone(), vec![]);
    assert!(matches!(try_a(one(1.0)), Err(LmiError::Unstable { .. })));
    assert!(matches!(try_a(one(f64::NAN)), Err(LmiError::NotFinite { .. })));
    assert!(matches!(try_a(Mat::zeros(1, 2)), Err(LmiError::Size { .. })));
    let settings = Settings { tol_rank: 2.0, ..Settings::KYP };
    let refused = minimise(&try_a(one(0.5)).unwrap(), &settings);
    assert!(matches!(refused, Err(LmiError::Setting { name: "tol_rank", .. })));
    let term = vec![(Mat::zeros(2, 1), zero.clone())];
    let bad = Problem::new(one(0.5), one(1.0), one(1.0), zero.clone(), term);
    assert!(matches!(bad, Err(LmiError::Size { given: (2, 1), wanted: (1, 1), .. })));
}

#[test]
fn an_exhausted_iteration_limit_keeps_valid_bounds() {
    let problem = Fir::new(4, 2, 2, 1, 3, 0.9).kyp();
    let full = minimise(&problem, &Settings::KYP).unwrap();
    for max_iterations in 0..8 {
        let s = minimise(&problem, &Settings { max_iterations, ..Settings::KYP }).unwrap();
        assert!(s.outcome == Outcome::IterationLimit || s.outcome == Outcome::SolvedInaccurate);
        assert!(s.lower <= full.gamma && s.gamma >= full.lower && s.iterations == max_iterations);
        assert!(norm(&problem, &s.x) <= s.gamma * (1.0 + 1e-9));
    }
}

/// n = 80 states with 448 unknowns and n = 160 with 1088; run with --ignored --release.
#[test]
#[ignore = "minutes long; a measurement"]
fn large_problems_are_feasible() {
    for lags in [7, 17] {
        let problem = Fir::new(32, 8, 16, 8, lags, 0.9).kyp();
        let s = solve("large", &problem);
        assert!(matches!(s.outcome, Outcome::Solved | Outcome::SolvedInaccurate));
    }
}
