//! Windows: sums of cosines.

use std::f64::consts::TAU;

/// A window w(n) = sum over k of (-1)^k a_k cos(2 pi k n / N).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Window {
    /// All ones. A tone off a bin leaks into all others.
    None,
    /// Two terms; side lobes fall by 18 dB per octave.
    Hann,
    /// Four-term Blackman-Harris (Harris, 1978); side lobes at -92 dB.
    Bh4,
    /// Seven-term Blackman-Harris (Albrecht, 2001); side lobes at -180 dB.
    #[default]
    Bh7,
}

impl Window {
    /// a_0, a_1, ..
    pub fn coefficients(self) -> &'static [f64] {
        match self {
            Self::None => &[1.0],
            Self::Hann => &[0.5, 0.5],
            Self::Bh4 => &[0.358_75, 0.488_29, 0.141_28, 0.011_68],
            Self::Bh7 => &[
                0.271_051_400_693_42,
                0.433_297_939_234_48,
                0.218_122_999_543_11,
                0.065_925_446_388_03,
                0.010_811_742_098_37,
                0.000_776_584_825_22,
                0.000_013_887_217_35,
            ],
        }
    }

    /// The equivalent noise bandwidth in bins, N sum w^2 / (sum w)^2 = (a_0^2 + sum of a_k^2 / 2) / a_0^2.
    pub fn noise_bandwidth(self) -> f64 {
        let a = self.coefficients();
        1.0 + a[1..].iter().map(|a| 0.5 * a * a).sum::<f64>() / (a[0] * a[0])
    }

    /// `samples` times the window.
    pub(super) fn apply(self, samples: &[f64]) -> Vec<f64> {
        let step = TAU / samples.len() as f64;
        let a = self.coefficients();
        // Clenshaw's recurrence with x = -cos: one cosine per sample, whatever the number of terms.
        let value = |n: usize| {
            let x = -(step * n as f64).cos();
            let (b1, b2) = a[1..].iter().rev().fold((0.0, 0.0), |(b1, b2), a| (a + 2.0 * x * b1 - b2, b1));
            a[0] + x * b1 - b2
        };
        match self {
            Self::None => samples.to_vec(),
            _ => samples.iter().enumerate().map(|(n, x)| x * value(n)).collect(),
        }
    }
}
