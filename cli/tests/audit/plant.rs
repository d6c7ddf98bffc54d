//! The samples of a bank's converters and of its target for white noise: their cross-correlations as exact
//! quotients.
//!
//! Time in fast periods. Row a samples the output of G_a at the times k M + t_a: phase p of the target at
//! p - m0, channel i at -D_i. For t >= 0 the correlation of G_a at time t with G_b at 0 is the sum over the
//! poles of G_a of r e^{p t}, r = Res G_a(p) G_b(-p). Over the slow periods this is a geometric series, so
//! with d = t_a - t_b and j0 the least j for which j M + d >= 0
//!
//! S_ab(z) = sum over poles p of G_a of r_ab(p) e^{p (j0 M + d)} z^-j0 / (1 - e^{p M} z^-1)
//!         + sum over poles p of G_b of r_ba(p) e^{p ((1 - j0) M - d)} z^(1-j0) / (1 - e^{p M} z).

use super::fronts::Front;
use super::real::{Complex, Real, double, real};
use serde_json::Value;
use std::collections::HashMap;

/// What the channels are off by, in the units of a spec's box.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Errors {
    /// Fast periods.
    pub(crate) delays: Vec<f64>,
    /// Shares.
    pub(crate) gains: Vec<f64>,
    /// Shares.
    pub(crate) cutoffs: Vec<f64>,
}

impl Errors {
    pub(crate) fn none(channels: usize) -> Self {
        Self { delays: vec![0.0; channels], gains: vec![0.0; channels], cutoffs: vec![0.0; channels] }
    }
}

pub(crate) struct Row {
    pub(crate) front: usize,
    pub(crate) time: Real,
    pub(crate) gain: Real,
    /// e^{p t_a} for the poles of every front end, and the reciprocals.
    growth: Vec<Vec<Complex>>,
    decay: Vec<Vec<Complex>>,
}

/// One front end with what all its rows share.
pub(crate) struct Mode {
    pub(crate) front: Front,
    pub(crate) residues: Vec<Complex>,
    /// e^{p M}.
    transitions: Vec<Complex>,
}

/// The front ends, the target first, and the instants of all rows.
pub(crate) struct Plant {
    pub(crate) ratio: usize,
    pub(crate) channels: usize,
    pub(crate) modes: Vec<Mode>,
    pub(crate) rows: Vec<Row>,
    /// Terms of the pairs a <= b, row by row.
    pairs: Vec<Pair>,
}

struct Pair {
    first: i64,
    later: Vec<Complex>,
    earlier: Vec<Complex>,
}

/// Front ends that were read, by their text: finding roots takes longer than all else.
#[derive(Default)]
pub(crate) struct Library(HashMap<String, Front>);

impl Library {
    fn front(&mut self, filter: &Value, h: &Real) -> Front {
        let read = || Front::read(filter, h);
        self.0.entry(format!("{filter} {}", double(h).to_bits())).or_insert_with(read).clone()
    }
}

fn list_of(spec: &Value) -> &Vec<Value> {
    spec["channel"].as_array().expect("channels")
}

impl Plant {
    /// The plant of a spec as a bank file writes it, with its channels off by `errors`.
    pub(crate) fn new(spec: &Value, latency: usize, errors: &Errors, library: &mut Library) -> Self {
        let h = real(spec["fast_period"].as_f64().expect("a fast period"));
        let ratio = spec["ratio"].as_u64().expect("a ratio") as usize;
        let signal = spec.pointer("/signal/filter").map(|filter| library.front(filter, &h));
        let mut keys: Vec<String> = Vec::new();
        let mut modes: Vec<Mode> = Vec::new();
        let mut mode = |filter: &Value, stretch: f64| {
            let key = format!("{filter} {stretch}");
            keys.iter().position(|other| *other == key).unwrap_or_else(|| {
                let own = library.front(filter, &h);
                let own = if stretch == 0.0 { own } else { own.scaled(&(real(1.0) + real(stretch))) };
                let whole = signal.as_ref().map_or(own.clone(), |signal| own.then(signal)).split();
                modes.push(Mode::new(whole, ratio));
                keys.push(key);
                keys.len() - 1
            })
        };
        let target = mode(&spec["target"]["filter"], 0.0);
        let phase = |p| Row::new(target, real(p as f64) - real(latency as f64), real(1.0));
        let mut rows: Vec<Row> = (0..ratio).map(phase).collect();
        for (i, channel) in list_of(spec).iter().enumerate() {
            let delay = real(channel["delay"].as_f64().expect("a delay")) / &h + real(errors.delays[i]);
            let gain = channel.get("gain").map_or(1.0, |gain| gain.as_f64().expect("a gain"));
            let gain = real(gain) * (real(1.0) + real(errors.gains[i]));
            let filter = channel.get("filter").unwrap_or(&spec["target"]["filter"]);
            rows.push(Row::new(mode(filter, errors.cutoffs[i]), -delay, gain));
        }
        for row in &mut rows {
            row.growth = modes.iter().map(|mode| mode.exponentials(&row.time)).collect();
            row.decay = row.growth.iter().map(|list| list.iter().map(Complex::inverse).collect()).collect();
        }
        let mut plant = Self { ratio, channels: rows.len() - ratio, modes, rows, pairs: Vec::new() };
        plant.pairs = plant.all_pairs();
        plant
    }

    /// Number of rows: M phases of the target, then the channels.
    pub(crate) fn order(&self) -> usize {
        self.rows.len()
    }

    fn all_pairs(&self) -> Vec<Pair> {
        // r_ab(p) of two front ends.
        let strengths: Vec<Vec<Vec<Complex>>> =
            self.modes.iter().map(|a| self.modes.iter().map(|b| a.strengths(b)).collect()).collect();
        let period = real(self.ratio as f64);
        // r e^{p (t_a - t_b + n M)} for the poles of the front end of `a`.
        let terms = |a: &Row, b: &Row, n: i64| -> Vec<Complex> {
            let (mode, gain) = (a.front, &a.gain * &b.gain);
            let of = |k: usize| {
                let moved = &a.growth[mode][k] * &b.decay[mode][k];
                let later = &moved * &self.modes[mode].transitions[k].power(n);
                (&strengths[mode][b.front][k] * &later).times(&gain)
            };
            (0..self.modes[mode].transitions.len()).map(of).collect()
        };
        let pair = |a: &Row, b: &Row| {
            let first = double(&((&b.time - &a.time) / &period).ceil()) as i64;
            Pair { first, later: terms(a, b, first), earlier: terms(b, a, 1 - first) }
        };
        let rows = &self.rows;
        (0..rows.len())
            .flat_map(|a| (a..rows.len()).map(move |b| (a, b)))
            .map(|(a, b)| pair(&rows[a], &rows[b]))
            .collect()
    }

    /// The Gram matrix S(z) on the unit circle, row by row; Hermitian.
    pub(crate) fn gram(&self, z: &Complex) -> Vec<Vec<Complex>> {
        let one = Complex::one();
        let series = |z: &Complex| -> Vec<Vec<Complex>> {
            let of = |mode: &Mode| mode.transitions.iter().map(|e| (&one - &(e * z)).inverse()).collect();
            self.modes.iter().map(of).collect()
        };
        let (forward, backward) = (series(&z.conj()), series(z));
        let mut powers: HashMap<i64, Complex> = HashMap::new();
        let n = self.order();
        let mut gram = vec![vec![Complex::zero(); n]; n];
        let mut pairs = self.pairs.iter();
        for a in 0..n {
            for b in a..n {
                let pair = pairs.next().expect("a pair");
                let dot = |terms: &[Complex], series: &[Complex]| {
                    terms.iter().zip(series).fold(Complex::zero(), |sum, (x, y)| &sum + &(x * y))
                };
                let mut power = |n: i64| powers.entry(n).or_insert_with(|| z.power(n)).clone();
                let later = &dot(&pair.later, &forward[self.rows[a].front]) * &power(-pair.first);
                let earlier = &dot(&pair.earlier, &backward[self.rows[b].front]) * &power(1 - pair.first);
                gram[a][b] = &later + &earlier;
                gram[b][a] = gram[a][b].conj();
            }
        }
        gram
    }

    /// Resonances as (frequency, width) in radians per slow period.
    pub(crate) fn resonances(&self) -> Vec<(f64, f64)> {
        let poles = self.modes.iter().flat_map(|mode| &mode.front.poles);
        let m = self.ratio as f64;
        poles.map(|p| ((double(&p.im) * m).abs(), -double(&p.re) * m)).collect()
    }

    /// The correlation of row `a` with row `b` as a sum of r e^{p t}, (r, p), for t from `distance` on;
    /// rounded.
    pub(crate) fn correlation(&self, a: usize, b: usize) -> Correlation {
        let (a, b) = (&self.rows[a], &self.rows[b]);
        let mode = &self.modes[a.front];
        let gain = &a.gain * &b.gain;
        let strengths = mode.strengths(&self.modes[b.front]).into_iter().map(|r| r.times(&gain).rounded());
        let terms = strengths.zip(mode.front.poles.iter().map(Complex::rounded)).collect();
        Correlation { distance: double(&(&a.time - &b.time)), terms }
    }

    /// The response of row `a` to e^{j nu t}, for brute force.
    pub(crate) fn response(&self, a: usize, nu: &Real) -> Complex {
        let row = &self.rows[a];
        let phase = Complex::imaginary(nu * &row.time).exp();
        (&self.modes[row.front].front.at(&Complex::imaginary(nu.clone())) * &phase).times(&row.gain)
    }
}

/// A correlation in doubles, for what needs no digits that cancel.
pub(crate) struct Correlation {
    /// By how much the first row is later, in fast periods.
    pub(crate) distance: f64,
    terms: Vec<(nalgebra::Complex<f64>, nalgebra::Complex<f64>)>,
}

impl Correlation {
    /// With the first row later by `time`, zero or more, in all.
    pub(crate) fn at(&self, time: f64) -> f64 {
        self.terms.iter().map(|(r, p)| (r * (p * time).exp()).re).sum()
    }
}

impl Row {
    fn new(front: usize, time: Real, gain: Real) -> Self {
        Self { front, time, gain, growth: Vec::new(), decay: Vec::new() }
    }
}

impl Mode {
    fn new(front: Front, ratio: usize) -> Self {
        let residues = front.residues();
        let period = real(ratio as f64);
        let mut mode = Self { front, residues, transitions: Vec::new() };
        mode.transitions = mode.exponentials(&period);
        mode
    }

    /// e^{p t}.
    pub(crate) fn exponentials(&self, time: &Real) -> Vec<Complex> {
        self.front.poles.iter().map(|p| p.times(time).exp()).collect()
    }

    /// r(p) = Res G(p) G'(-p).
    pub(crate) fn strengths(&self, other: &Self) -> Vec<Complex> {
        let of = |(residue, pole): (&Complex, &Complex)| residue * &other.front.at(&-pole);
        self.residues.iter().zip(&self.front.poles).map(of).collect()
    }
}
