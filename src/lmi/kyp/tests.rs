use super::*;
use crate::lmi::Stop;
use crate::lmi::sampled;
use crate::lmi::testbank::{self, TestBank};

/// A random-looking FIR problem: plant (a, b), wanted w = cw x + dw u, measured h = ch x + dh u, taps F_j on
/// h[k - j]. Returns the KYP problem and the sampled one on the given grid.
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
        use crate::linalg::{CMat, Complex, solve_c, to_complex};
        let n = self.a.nrows();
        let point = |&omega: &f64| {
            let z = CMat::identity(n, n) * Complex::from_polar(1.0, omega);
            let state = solve_c(&(z - to_complex(&self.a)), &to_complex(&self.b));
            sampled::Point {
                omega,
                w: to_complex(&self.cw) * &state + to_complex(&self.dw),
                h: to_complex(&self.ch) * state + to_complex(&self.dh),
            }
        };
        sampled::Problem::new(grid.iter().map(point).collect(), vec![self.lags; self.cw.nrows()]).unwrap()
    }
}

fn report(name: &str, p: &Problem, s: &Solution, seconds: f64) {
    println!(
        "{name}: {:?} gamma {:.10} lower {:.10} gap {:.1e} steps {} states {} of {} unknowns {} in {seconds:.3} s",
        s.stop,
        s.gamma,
        s.lower,
        (s.gamma - s.lower) / s.gamma,
        s.steps.len(),
        s.coordinates.a.nrows(),
        p.a.nrows(),
        p.unknowns()
    );
}

fn solve(name: &str, p: &Problem) -> Solution {
    let start = std::time::Instant::now();
    let s = minimise(p, &Settings::default()).unwrap();
    report(name, p, &s, start.elapsed().as_secs_f64());
    s
}

#[test]
fn kyp_and_sampled_forms_agree() {
    for (n, m, q, outputs, lags, radius) in [(3, 1, 1, 1, 3, 0.8), (4, 2, 2, 1, 3, 0.9), (4, 1, 3, 2, 4, 0.7), (5, 2, 4, 2, 5, 0.9)] {
        let fir = Fir::new(n, m, q, outputs, lags, radius);
        let s = solve("fir", &fir.kyp());
        let grid: Vec<f64> = (0..2001).map(|l| std::f64::consts::PI * l as f64 / 2000.0).collect();
        let f = sampled::minimise(&fir.sampled(&grid), &sampled::Settings::default()).unwrap();
        println!("sampled {} {}", f.gamma, f.lower.value);
        assert_eq!(s.stop, Stop::Solved);
        assert!(f.lower.value <= s.gamma * (1.0 + 1e-9));
        assert!((f.gamma - s.gamma).abs() < 1e-5 * s.gamma);
    }
}

#[test]
fn the_thesis_bank_is_solved_in_kyp_form() {
    let s = solve("thesis", &Fir::of_bank(&testbank::thesis(), 11).kyp());
    assert_eq!(s.stop, Stop::Solved);
    assert!((s.gamma - 0.03993204).abs() < 2e-8);
    let early = TestBank { latency: 1, ..testbank::thesis() };
    let s = solve("thesis, latency 1, 12 taps", &Fir::of_bank(&early, 6).kyp());
    assert!((s.gamma - 0.069447031).abs() < 2e-8);
}

#[test]
fn certificates() {
    for fir in [Fir::new(4, 2, 2, 1, 3, 0.9), Fir::of_bank(&testbank::thesis(), 11)] {
        let problem = fir.kyp();
        let s = solve("bank", &problem);
        let (c, d) = problem.outputs(&s.x);
        let (a, b, c) = (&s.coordinates.a, &s.coordinates.b, c * &s.coordinates.basis);
        println!("own P: {:?}", prove(a, b, &c, &d, &s.p, s.gamma).map(|c| (c.margin, c.charged)));
        for slack in [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, -1e-3] {
            let gamma = s.gamma * (1.0 + slack);
            println!("{slack}: {:?}", certificate(a, b, &c, &d, gamma).map(|c| (c.margin, c.charged)));
        }
    }
}
