//! hybank's FIR design beside Clarabel, a general interior-point solver for conic problems, on the same
//! plants: `cargo run --release` in this folder (it needs the system's OpenBLAS, on Debian
//! `apt install libopenblas-dev`) prints seconds, gammas and ratios.
//!
//! Clarabel gets what a user of a modelling tool would write down: gamma^2 = t minimal such that at each
//! frequency of a fixed grid
//!
//! ```text
//! [ t I - G   K ]
//! [ K*        I ]  >= 0,    K = W1 - sum_j e^{-i omega j} F_j H1,
//! ```
//!
//! as a real matrix of twice the order. hybank's time is that of the whole design: the exchange of
//! frequencies, the second objective, and the exact norm.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use hybank::design::{DesignError, LiftedPlant, Options, Problem, design};
use hybank::lmi::sampled::Point;
use hybank::spec::Spec;
use nalgebra::{Complex, DMatrix};
use std::error::Error;
use std::f64::consts::{PI, SQRT_2};
use std::time::Instant;

// The system's BLAS and LAPACK, which Clarabel calls for semidefinite cones.
#[link(name = "openblas")]
unsafe extern "C" {}

type CMat = DMatrix<Complex<f64>>;

/// Grid intervals for each slow lag; hybank starts from 3.
const POINTS_PER_LAG: usize = 3;

const THESIS: &str = r#"
fast_period = 1.0
ratio = 2
latency = 10
target.filter = { num = [0.25], den = [1.0, 1.0, 0.25] }
channel = [{ delay = 1.2 }, { delay = 0.6 }]
design = { method = "fir", taps = 22 }
"#;

const FOUR: &str = r#"
fast_period = 1.0
ratio = 4
latency = 12
target.filter = { family = "butterworth", order = 4, cutoff = 0.190985931710274 }
channel = [{ delay = 0.0 }, { delay = 1.3 }, { delay = 2.1 }, { delay = 2.95 }]
design = { method = "fir", taps = 24 }
"#;

/// 8 channels.
fn eight(taps: usize) -> String {
    let delays = [0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    format!(
        "fast_period = 1.0\nratio = 8\nlatency = 12\n\
         target.filter = {{ family = \"butterworth\", order = 4, cutoff = 0.286478897565412 }}\n\
         channel = [{}]\ndesign = {{ method = \"fir\", taps = {taps} }}\n",
        channels.join(", ")
    )
}

/// A conic problem under construction: the columns of A and b, cone after cone.
struct Cones {
    columns: Vec<Vec<(usize, f64)>>,
    right: Vec<f64>,
    orders: Vec<usize>,
}

impl Cones {
    /// Requires `constant + sum_k x_k part_k >= 0` for Hermitian matrices; `parts` names the unknowns that
    /// occur.
    fn require(&mut self, constant: &CMat, parts: &[(usize, CMat)]) {
        let first = self.right.len();
        self.right.extend(real_triangle(constant));
        for (unknown, part) in parts {
            let entries = real_triangle(part).into_iter().enumerate().filter(|(_, value)| *value != 0.0);
            self.columns[*unknown].extend(entries.map(|(row, value)| (first + row, -value)));
        }
        self.orders.push(2 * constant.nrows());
    }

    fn matrix(&self) -> CscMatrix<f64> {
        let mut starts = vec![0];
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for column in &self.columns {
            rows.extend(column.iter().map(|&(row, _)| row));
            values.extend(column.iter().map(|&(_, value)| value));
            starts.push(rows.len());
        }
        CscMatrix::new(self.right.len(), self.columns.len(), starts, rows, values)
    }
}

/// The upper triangle, by columns, of [[Re, -Im], [Im, Re]], off-diagonals times the root of 2.
fn real_triangle(z: &CMat) -> Vec<f64> {
    let n = z.nrows();
    let entry = |i: usize, j: usize| match (i < n, j < n) {
        (true, true) => z[(i, j)].re,
        (true, false) => -z[(i, j - n)].im,
        (false, true) => z[(i - n, j)].im,
        (false, false) => z[(i - n, j - n)].re,
    };
    let place = |j: usize| (0..=j).map(move |i| entry(i, j) * if i == j { 1.0 } else { SQRT_2 });
    (0..2 * n).flat_map(place).collect()
}

/// One LMI a frequency; unknown 0 is t, the taps f_i[n] follow.
fn cones(plant: &LiftedPlant, taps: usize) -> Result<Cones, DesignError> {
    let (channels, ratio) = (plant.channels(), plant.ratio());
    let intervals = POINTS_PER_LAG * taps.div_ceil(ratio).max(8);
    let mut cones =
        Cones { columns: vec![Vec::new(); 1 + channels * taps], right: Vec::new(), orders: Vec::new() };
    for k in 0..=intervals {
        let omega = PI * k as f64 / intervals as f64;
        let Point { h, w, .. } = plant.at(omega);
        let rest = w.columns(channels, w.ncols() - channels).into_owned();
        let order = ratio + channels;
        let mut constant = CMat::identity(order, order);
        constant.view_mut((0, 0), (ratio, ratio)).copy_from(&-(&rest * rest.adjoint()));
        let explained = w.columns(0, channels).into_owned();
        constant.view_mut((0, ratio), (ratio, channels)).copy_from(&explained);
        constant.view_mut((ratio, 0), (channels, ratio)).copy_from(&explained.adjoint());
        let mut parts = vec![(0, CMat::zeros(order, order))];
        (0..ratio).for_each(|p| parts[0].1[(p, p)] = Complex::new(1.0, 0.0));
        for i in 0..channels {
            for n in 0..taps {
                let turn = Complex::from_polar(1.0, -omega * (n / ratio) as f64);
                let mut part = CMat::zeros(order, order);
                for c in 0..channels {
                    let value = -turn * h[(i, c)];
                    part[(n % ratio, ratio + c)] = value;
                    part[(ratio + c, n % ratio)] = value.conj();
                }
                parts.push((1 + i * taps + n, part));
            }
        }
        cones.require(&constant, &parts);
    }
    Ok(cones)
}

/// The least gamma on the grid, and seconds.
fn clarabel(spec: &Spec) -> Result<(f64, f64), Box<dyn Error>> {
    let latency = spec.latency.ok_or("the spec gives no latency")?;
    let taps = spec.design.taps.ok_or("the spec gives no taps")?;
    let plant = LiftedPlant::new(&Problem::new(spec, latency)?);
    let cones = cones(&plant, taps)?;
    let a = cones.matrix();
    let unknowns = a.n;
    let mut cost = vec![0.0; unknowns];
    cost[0] = 1.0;
    let kinds: Vec<_> = cones.orders.iter().map(|&order| SupportedConeT::PSDTriangleConeT(order)).collect();
    let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
    let begin = Instant::now();
    let mut solver = DefaultSolver::new(
        &CscMatrix::zeros((unknowns, unknowns)),
        &cost,
        &a,
        &cones.right,
        &kinds,
        settings,
    )?;
    solver.solve();
    let seconds = begin.elapsed().as_secs_f64();
    println!("  Clarabel: {:?}, {} iterations", solver.solution.status, solver.solution.iterations);
    Ok((solver.solution.obj_val.max(0.0).sqrt(), seconds))
}

/// The exact gamma, and seconds: the least of three whole designs.
fn hybank(spec: &Spec) -> Result<(f64, f64), Box<dyn Error>> {
    let (mut gamma, mut seconds) = (f64::NAN, f64::INFINITY);
    for _ in 0..3 {
        let begin = Instant::now();
        let found =
            design(spec, &Options::without_proof())?.bank.gamma.upper.ok_or("the design has no norm")?;
        (gamma, seconds) = (found, seconds.min(begin.elapsed().as_secs_f64()));
    }
    Ok((gamma, seconds))
}

fn main() -> Result<(), Box<dyn Error>> {
    let cases = [
        ("thesis example, 22 taps (44 unknowns)", THESIS.to_owned()),
        ("4 channels, Butterworth 4, 24 taps (96 unknowns)", FOUR.to_owned()),
        ("8 channels, Butterworth 4, 32 taps (256 unknowns)", eight(32)),
    ];
    for (name, text) in cases {
        println!("{name}");
        let spec = Spec::from_toml(&text, name)?;
        let ((ours, own), (theirs, general)) = (hybank(&spec)?, clarabel(&spec)?);
        println!("  hybank   {own:9.4} s, gamma {ours:.9} (exact, all frequencies)");
        println!(
            "  Clarabel {general:9.4} s, gamma {theirs:.9} (on the grid), {:.0} times as long",
            general / own
        );
    }
    Ok(())
}
