//! The cubic spline through all slow samples as a linear periodic system, without simulation.

use crate::design::Problem;
use hybank_linalg::{CMat, Complex};

/// Knots closer than this, in fast periods, become one with the mean of their samples: the slope between two
/// would be their noise over their distance.
const LEAST_DISTANCE: f64 = 1e-6;

/// The spline of the knots of a problem, which repeat with the slow period.
pub(super) struct Spline {
    period: f64,
    channels: usize,
    /// In increasing order.
    knots: Vec<SplineKnot>,
    /// One for each output phase.
    outputs: Vec<SplineOutput>,
}

/// An instant at which samples are taken in every slow period.
struct SplineKnot {
    /// Fast periods, from 0 to below M.
    time: f64,
    samples: Vec<KnotSample>,
}

/// The sample of a channel, of the frame that is `lag` frames before that of the knot.
struct KnotSample {
    channel: usize,
    lag: f64,
}

/// An output phase: the spline at `time` from 0 to below M, `lag` frames before the frame of the output.
struct SplineOutput {
    time: f64,
    lag: f64,
}

impl Spline {
    pub(super) fn new(problem: &Problem) -> Self {
        let period = problem.ratio as f64;
        let mut taken: Vec<(f64, KnotSample)> = problem
            .channels
            .iter()
            .enumerate()
            .map(|(channel, of)| {
                let (lag, phase) = of.delay.negative().in_slow_period(problem.ratio);
                (phase.in_fast_periods().0, KnotSample { channel, lag })
            })
            .collect();
        taken.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut knots: Vec<SplineKnot> = Vec::new();
        for (time, sample) in taken {
            match knots.last_mut() {
                Some(knot) if time - knot.time < LEAST_DISTANCE => knot.samples.push(sample),
                _ => knots.push(SplineKnot { time, samples: vec![sample] }),
            }
        }
        let output = |p: usize| {
            let instant = p as f64 - problem.latency as f64;
            let frames = (instant / period).floor();
            SplineOutput { time: instant - frames * period, lag: -frames }
        };
        let outputs = (0..problem.ratio).map(output).collect();
        Self { period, channels: problem.channels.len(), knots, outputs }
    }

    /// F at the angle theta, M x N.
    pub(super) fn at(&self, theta: f64) -> CMat {
        let values = self.values(theta);
        let moments = hybank_linalg::solve(&self.moment_matrix(theta), &(self.slope_matrix(theta) * &values));
        let mut filters = CMat::zeros(self.outputs.len(), self.channels);
        for (p, output) in self.outputs.iter().enumerate() {
            let row = self.piece(output.time, theta, &values, &moments);
            filters.set_row(p, &(row * Complex::from_polar(1.0, -theta * output.lag)));
        }
        filters
    }

    /// The values at the knots, one column per channel.
    fn values(&self, theta: f64) -> CMat {
        let mut values = CMat::zeros(self.knots.len(), self.channels);
        for (i, knot) in self.knots.iter().enumerate() {
            let share = 1.0 / knot.samples.len() as f64;
            for sample in &knot.samples {
                values[(i, sample.channel)] = Complex::from_polar(share, -theta * sample.lag);
            }
        }
        values
    }

    /// h_i, from knot i to the next one.
    fn width(&self, i: usize) -> f64 {
        let next = self.knots.get(i + 1).map_or(self.knots[0].time + self.period, |knot| knot.time);
        next - self.knots[i].time
    }

    /// The knot after knot i and the factor of a quantity there: e^{j theta} where the next frame begins.
    fn next(&self, i: usize, theta: f64) -> (usize, Complex<f64>) {
        if i + 1 < self.knots.len() { (i + 1, Complex::ONE) } else { (0, Complex::from_polar(1.0, theta)) }
    }

    /// A of A m = R v, the continuity of the first derivative at every knot:
    ///
    /// ```text
    /// h_{i-1}/6 m_{i-1} + (h_{i-1} + h_i)/3 m_i + h_i/6 m_{i+1}
    ///     = (v_{i+1} - v_i)/h_i - (v_i - v_{i-1})/h_{i-1}
    /// ```
    ///
    /// It is diagonally dominant, so it has an inverse.
    fn moment_matrix(&self, theta: f64) -> CMat {
        self.by_interval(theta, |h| (h / 3.0, h / 6.0))
    }

    /// R of A m = R v.
    fn slope_matrix(&self, theta: f64) -> CMat {
        self.by_interval(theta, |h| (-1.0 / h, 1.0 / h))
    }

    /// The sum over the intervals of what each gives to its two knots: `own` and `other` of its width.
    fn by_interval(&self, theta: f64, parts: impl Fn(f64) -> (f64, f64)) -> CMat {
        let count = self.knots.len();
        let mut matrix = CMat::zeros(count, count);
        for i in 0..count {
            let (own, other) = parts(self.width(i));
            let (next, phasor) = self.next(i, theta);
            matrix[(i, i)] += Complex::from(own);
            matrix[(next, next)] += Complex::from(own);
            matrix[(i, next)] += phasor * other;
            matrix[(next, i)] += phasor.conj() * other;
        }
        matrix
    }

    /// The cubic at `time` as a row over the channels.
    fn piece(
        &self,
        time: f64,
        theta: f64,
        values: &CMat,
        moments: &CMat,
    ) -> nalgebra::RowDVector<Complex<f64>> {
        let last = self.knots.len() - 1;
        let (i, phasor, start) = match self.knots.iter().rposition(|knot| knot.time <= time) {
            Some(i) => (i, Complex::ONE, self.knots[i].time),
            None => (last, Complex::from_polar(1.0, -theta), self.knots[last].time - self.period),
        };
        let (next, ahead) = self.next(i, theta);
        let h = self.width(i);
        let (below, above) = (time - start, start + h - time);
        let cubic = |d: f64| Complex::from((d * d * d / h - h * d) / 6.0);
        let row = values.row(i) * Complex::from(above / h)
            + values.row(next) * (ahead * (below / h))
            + moments.row(i) * cubic(above)
            + moments.row(next) * (ahead * cubic(below));
        row * phasor
    }
}
