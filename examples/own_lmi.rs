//! The general LMI solver on a problem of one's own: a Lyapunov function with the fastest provable decay that a switched
//! system x+ = A_1 x or A_2 x, whichever it likes, allows; and an infeasible problem with its certificate.
//!
//! `cargo run --release --example own_lmi`

use hybank::linalg::Mat;
use hybank::lmi::general::{Coefficient, Outcome, Problem, Settings, minimise};
use std::error::Error;

/// The unit matrices of the symmetric 2 x 2 ones: P = p0 E0 + p1 E1 + p2 E2.
fn basis() -> [Mat; 3] {
    [
        Mat::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]),
        Mat::from_row_slice(2, 2, &[0.0, 1.0, 1.0, 0.0]),
        Mat::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 1.0]),
    ]
}

/// minimise trace P subject to P >= I and rate^2 P - A' P A >= 0 for both A.
fn lyapunov(modes: &[Mat; 2], rate: f64) -> Result<Problem, Box<dyn Error>> {
    let mut problem = Problem::new(vec![1.0, 0.0, 1.0])?;
    let minus_identity = Coefficient::Dense(-Mat::identity(2, 2));
    let plain = basis().into_iter().map(Coefficient::Dense).enumerate().collect();
    problem = problem.matrix_inequality(2, minus_identity, plain)?;
    for a in modes {
        let decay = |e: Mat| Coefficient::Dense(&e * (rate * rate) - a.transpose() * &e * a);
        let terms = basis().into_iter().map(decay).enumerate().collect();
        problem = problem.matrix_inequality(2, Coefficient::zero(), terms)?;
    }
    Ok(problem)
}

fn main() -> Result<(), Box<dyn Error>> {
    let modes = [
        Mat::from_row_slice(2, 2, &[0.6, 0.5, -0.2, 0.7]),
        Mat::from_row_slice(2, 2, &[0.7, -0.3, 0.4, 0.5]),
    ];
    // Feasibility is monotone in the rate: bisect, and let every answer prove itself.
    let (mut impossible, mut possible) = (0.0, 1.0);
    for _ in 0..20 {
        let rate = 0.5 * (impossible + possible);
        let solution = minimise(&lyapunov(&modes, rate)?, &Settings::default())?;
        match solution.outcome {
            Outcome::Solved | Outcome::SolvedInaccurate => possible = rate,
            Outcome::PrimalInfeasible { .. } => impossible = rate,
            // At the threshold rounding decides nothing; the bracket so far stands.
            _ => break,
        }
    }
    println!("a quadratic function decays by {possible:.4} a step or faster; none by {impossible:.4}");
    assert!(possible - impossible < 1e-2);

    let solution = minimise(&lyapunov(&modes, possible * 1.001)?, &Settings::default())?;
    let [p0, p1, p2] = [solution.x[0], solution.x[1], solution.x[2]];
    println!("P = [{p0:.4} {p1:.4}; {p1:.4} {p2:.4}], {} iterations", solution.iterations);
    println!("trace P = {:.6}, dual bound {:.6}", solution.objective, solution.dual_objective);

    let solution = minimise(&lyapunov(&modes, impossible * 0.999)?, &Settings::default())?;
    println!(
        "below the threshold: {}",
        if matches!(solution.outcome, Outcome::PrimalInfeasible { .. }) {
            "infeasible, with a certificate"
        } else {
            "not decided"
        }
    );
    Ok(())
}
