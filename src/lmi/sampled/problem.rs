//! The data of a sampled problem, checked once.

use crate::linalg::{self, CMat, Complex, LinalgError, Mat};
use crate::lmi::SettingError;

/// Real taps: `F_j` is M x N, one matrix for each lag j. Entries beyond a row's own number of lags
/// are zero.
pub type Taps = Vec<Mat>;

/// Why data do not form a sampled problem.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SampledError {
    /// There is no point.
    #[error("a sampled problem needs at least one frequency point, none was given")]
    NoPoints,
    /// Sizes do not fit.
    #[error(
        "{name} is {rows} x {cols} at point {point} but must be {want_rows} x {want_cols}: all points share M, N and q"
    )]
    Size {
        /// Which matrix.
        name: &'static str,
        /// Index of the point, from 0.
        point: usize,
        /// Rows given.
        rows: usize,
        /// Columns given.
        cols: usize,
        /// Rows expected.
        want_rows: usize,
        /// Columns expected.
        want_cols: usize,
    },
    /// A dimension is zero.
    #[error("a sampled problem needs M, N and q of at least 1, got M = {m}, N = {n}, q = {q}")]
    Empty {
        /// Rows of W.
        m: usize,
        /// Rows of H.
        n: usize,
        /// Columns of both.
        q: usize,
    },
    /// A NaN or infinity.
    #[error(
        "{name} at point {point} holds a value that is not finite: check the response it was sampled from"
    )]
    NotFinite {
        /// Which datum.
        name: &'static str,
        /// Index of the point, from 0.
        point: usize,
    },
    /// The list of lags has the wrong length.
    #[error("{given} numbers of lags were given for {rows} rows: give one for each row of W")]
    Lags {
        /// Length of the list.
        given: usize,
        /// Rows of W.
        rows: usize,
    },
    /// Taps handed in do not fit the problem.
    #[error("the taps do not fit the problem: {what}")]
    TapsShape {
        /// What is wrong with them.
        what: String,
    },
    /// Dual matrices or weights handed in do not fit the problem.
    #[error("{given} {name} were given for {points} points: give one for each point")]
    Count {
        /// What was counted.
        name: &'static str,
        /// How many were given.
        given: usize,
        /// How many points there are.
        points: usize,
    },
    /// A weight is negative or not finite, or all are zero.
    #[error(
        "weight {value} at point {point} is not allowed: weights are finite, not negative and not all zero"
    )]
    Weight {
        /// Index of the point, from 0.
        point: usize,
        /// The value.
        value: f64,
    },
    /// The cap lies below the start's own worst-case norm.
    #[error(
        "the cap {cap} is not above the start's worst-case norm {gamma}: start from taps that satisfy it strictly or raise the cap"
    )]
    Cap {
        /// The cap given.
        cap: f64,
        /// Worst-case norm of the taps given.
        gamma: f64,
    },
    /// The list of noise powers has the wrong length.
    #[error("{given} noise powers were given for {channels} channels: give one for each channel")]
    NoiseCount {
        /// How many were given.
        given: usize,
        /// How many channels there are.
        channels: usize,
    },
    /// A noise power is negative or not finite.
    #[error("noise power {value} of channel {channel} is not allowed: powers are finite and not negative")]
    Noise {
        /// Index of the channel, from 0.
        channel: usize,
        /// The value.
        value: f64,
    },
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// A frequency with the responses of the reference and the measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Frequency in radians per lag.
    pub omega: f64,
    /// Response of the reference, M x q.
    pub w: CMat,
    /// Responses of the measurements, N x q.
    pub h: CMat,
}

/// The secondary objective: the weighted mean square of the error, and the power of the noise that the
/// channels themselves add,
///
/// ```text
/// sum_l weights_l ||K_l||_F^2 + sum_i noise_i sum_j |F_j e_i|^2.
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MeanSquareObjective {
    /// One for each point; finite, not negative, not all zero.
    pub weights: Vec<f64>,
    /// Power of the white noise of each channel, N of them; finite, not negative.
    pub noise: Vec<f64>,
}

impl MeanSquareObjective {
    /// Noiseless channels.
    pub fn noiseless(weights: Vec<f64>, channels: usize) -> Self {
        Self { weights, noise: vec![0.0; channels] }
    }
}

/// A sampled worst-case norm problem with consistent sizes and finite data.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    points: Vec<Point>,
    lags: Vec<usize>,
}

impl Problem {
    /// Checks the sizes. `lags[p]` is the number of lags of row p, M of them; 0 fixes the row at zero.
    pub fn new(points: Vec<Point>, lags: Vec<usize>) -> Result<Self, SampledError> {
        let first = points.first().ok_or(SampledError::NoPoints)?;
        let (m, n, q) = (first.w.nrows(), first.h.nrows(), first.w.ncols());
        if m == 0 || n == 0 || q == 0 {
            return Err(SampledError::Empty { m, n, q });
        }
        if lags.len() != m {
            return Err(SampledError::Lags { given: lags.len(), rows: m });
        }
        for (l, point) in points.iter().enumerate() {
            check_size("W", l, &point.w, m, q)?;
            check_size("H", l, &point.h, n, q)?;
            check_finite(l, point)?;
        }
        Ok(Self { points, lags })
    }

    /// The points.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Number of lags of each row.
    pub fn lags(&self) -> &[usize] {
        &self.lags
    }

    /// Largest number of lags of any row.
    pub fn max_lags(&self) -> usize {
        self.lags.iter().copied().max().unwrap_or(0)
    }

    /// M, the rows of `W_l` and of the taps.
    pub fn rows(&self) -> usize {
        self.points[0].w.nrows()
    }

    /// N, the rows of `H_l` and the columns of the taps.
    pub fn channels(&self) -> usize {
        self.points[0].h.nrows()
    }

    /// q, the columns of `W_l` and `H_l`.
    pub fn inputs(&self) -> usize {
        self.points[0].w.ncols()
    }

    /// Taps that are all zero.
    pub fn zero_taps(&self) -> Taps {
        vec![Mat::zeros(self.rows(), self.channels()); self.max_lags()]
    }

    /// The same problem with more points.
    pub fn with_points(&self, more: impl IntoIterator<Item = Point>) -> Result<Self, SampledError> {
        Self::new(self.points.iter().cloned().chain(more).collect(), self.lags.clone())
    }

    /// `K_l = W_l - sum_j e^{-i omega_l j} F_j H_l`.
    pub fn error_at(&self, l: usize, taps: &Taps) -> CMat {
        let point = &self.points[l];
        &point.w - response(taps, point.omega, self.rows(), self.channels()) * &point.h
    }

    /// Largest `sigma_max(K_l)` over the points, and the index of the point where it is attained.
    pub fn worst(&self, taps: &Taps) -> Result<(f64, usize), SampledError> {
        let mut worst = (0.0, 0);
        for l in 0..self.points.len() {
            let sigma = linalg::largest_singular_value(&self.error_at(l, taps))?;
            if sigma > worst.0 {
                worst = (sigma, l);
            }
        }
        Ok(worst)
    }

    /// Value of the secondary objective: see [`MeanSquareObjective`].
    pub fn mean_square(&self, taps: &Taps, square: &MeanSquareObjective) -> f64 {
        let error = |l: usize| self.error_at(l, taps).iter().map(|z| z.norm_sqr()).sum::<f64>();
        let errors: f64 = square.weights.iter().enumerate().map(|(l, w)| w * error(l)).sum();
        let noise =
            |f: &Mat| f.column_iter().zip(&square.noise).map(|(c, n)| n * c.norm_squared()).sum::<f64>();
        errors + taps.iter().map(noise).sum::<f64>()
    }

    /// Refuses taps of the wrong size or with entries beyond a row's number of lags.
    pub fn check_taps(&self, taps: &Taps) -> Result<(), SampledError> {
        let (m, n) = (self.rows(), self.channels());
        if let Some(f) = taps.iter().find(|f| f.shape() != (m, n)) {
            let what = format!("a lag is {} x {} instead of {m} x {n}", f.nrows(), f.ncols());
            return Err(SampledError::TapsShape { what });
        }
        for (j, f) in taps.iter().enumerate() {
            for p in (0..m).filter(|&p| j >= self.lags[p]) {
                if f.row(p).iter().any(|x| *x != 0.0) {
                    let what = format!("row {p} is not zero at lag {j}, beyond its {} lags", self.lags[p]);
                    return Err(SampledError::TapsShape { what });
                }
            }
        }
        Ok(())
    }

    pub(crate) fn check_objective(&self, square: &MeanSquareObjective) -> Result<(), SampledError> {
        if square.noise.len() != self.channels() {
            let (given, channels) = (square.noise.len(), self.channels());
            return Err(SampledError::NoiseCount { given, channels });
        }
        if let Some(channel) = square.noise.iter().position(|n| !(n.is_finite() && *n >= 0.0)) {
            return Err(SampledError::Noise { channel, value: square.noise[channel] });
        }
        let weights = &square.weights;
        if weights.len() != self.points.len() {
            let points = self.points.len();
            return Err(SampledError::Count { name: "weights", given: weights.len(), points });
        }
        if let Some(point) = weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            return Err(SampledError::Weight { point, value: weights[point] });
        }
        if weights.iter().all(|w| *w == 0.0) {
            return Err(SampledError::Weight { point: 0, value: 0.0 });
        }
        Ok(())
    }
}

/// `F(omega) = sum_j e^{-i omega j} F_j`.
pub(crate) fn response(taps: &Taps, omega: f64, m: usize, n: usize) -> CMat {
    let mut f = CMat::zeros(m, n);
    for (j, fj) in taps.iter().enumerate() {
        let phase = Complex::from_polar(1.0, -omega * j as f64);
        f.zip_apply(fj, |z, x| *z += phase * x);
    }
    f
}

fn check_size(name: &'static str, l: usize, a: &CMat, rows: usize, cols: usize) -> Result<(), SampledError> {
    if a.shape() == (rows, cols) {
        return Ok(());
    }
    Err(SampledError::Size {
        name,
        point: l,
        rows: a.nrows(),
        cols: a.ncols(),
        want_rows: rows,
        want_cols: cols,
    })
}

fn check_finite(l: usize, point: &Point) -> Result<(), SampledError> {
    let finite = |a: &CMat| a.iter().all(|z| z.re.is_finite() && z.im.is_finite());
    let name = match (point.omega.is_finite(), finite(&point.w), finite(&point.h)) {
        (false, _, _) => "omega",
        (_, false, _) => "W",
        (_, _, false) => "H",
        _ => return Ok(()),
    };
    Err(SampledError::NotFinite { name, point: l })
}
