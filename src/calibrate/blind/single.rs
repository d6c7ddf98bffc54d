//! How well orders of the channels explain bands that hold one alias, whichever alias that is.
//!
//! The spectral matrix of such a band is `l u u*` and noise. Capture i is channel o(i) in the order o. An
//! alias of the signal then shows as the column `c_o(i) e^{-j W (D_o(i) - D_i) / M}`, because the phases
//! that were removed from the matrix are those of the given order. It explains `l |u* c|^2 / |c|^2` of the
//! power. The factors of i and of o(i) part, so an order costs one product per channel, band and alias.

use super::spectra::SpectralBand;
use crate::calibrate::model::{ChannelModel, ChannelValues};
use crate::linalg::{CMat, Complex, svd};

/// Most products in the comparison of all orders: half a second.
const MOST_PRODUCTS: usize = 200_000_000;
/// Bands that are compared in any case.
const LEAST_BANDS: usize = 8;

/// A band with one alias.
pub(in crate::calibrate) struct SingleBand {
    /// Of all channels.
    power: f64,
    /// l, of the alias.
    strength: f64,
    /// The conjugate of u_i e^{-j W D_i / M}.
    source: Vec<Complex<f64>>,
    /// c_i e^{-j W D_i / M} / |c| for each alias that it might be.
    columns: Vec<Vec<Complex<f64>>>,
}

/// The number of bands that may be compared where one takes so many products.
pub(super) fn bands_within(products: usize) -> usize {
    (MOST_PRODUCTS / products.max(1)).max(LEAST_BANDS)
}

impl SingleBand {
    /// `band` as one of the `aliases` at `point`; `None` where the matrix has no decomposition.
    pub(super) fn new(
        model: &ChannelModel,
        point: &ChannelValues,
        band: &SpectralBand,
        aliases: impl Iterator<Item = i32>,
    ) -> Option<Self> {
        let matrix = svd(&band.matrix).ok()?;
        let phase = |i: usize| Complex::from_polar(1.0, -band.w * model.delays[i] / model.ratio as f64);
        let turned = |column: &CMat| -> Vec<Complex<f64>> {
            let unit = column.norm();
            (0..column.nrows()).map(|i| column[(i, 0)] * phase(i) / unit).collect()
        };
        let source = turned(&matrix.u.columns(0, 1).into_owned()).iter().map(Complex::conj).collect();
        let columns = aliases.map(|alias| turned(&model.steering(point, band.w, &[alias]))).collect();
        let strength = band.count as f64 * matrix.s.first()?;
        Some(Self { power: band.power(), strength, source, columns })
    }

    /// The power that the best alias leaves if capture i is channel `order[i]`, and one is inverted.
    fn unexplained(&self, order: &[usize], inverted: Option<usize>) -> f64 {
        let explained = |column: &Vec<Complex<f64>>| {
            let along: Complex<f64> = self.source.iter().zip(order).map(|(u, &i)| u * column[i]).sum();
            let other_sign = inverted.map_or(Complex::default(), |i| self.source[i] * column[order[i]]);
            (along - 2.0 * other_sign).norm_sqr()
        };
        let best = self.columns.iter().map(explained).fold(0.0, f64::max);
        self.power - self.strength * best
    }
}

/// The share of the power that one alias per band leaves unexplained if capture i is channel `order[i]`,
/// with the nominal values and whichever alias fits a band best, and one capture may be inverted. NaN
/// without bands.
pub(in crate::calibrate) fn unexplained_in_order(
    bands: &[SingleBand],
    order: &[usize],
    inverted: Option<usize>,
) -> f64 {
    let left: f64 = bands.iter().map(|band| band.unexplained(order, inverted)).sum();
    left / bands.iter().map(|band| band.power).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::FittedValues;
    use crate::spec::Spec;

    fn model() -> ChannelModel {
        let text = "fast_period = 1.0\nratio = 4\nlatency = 8\n\
                    channel = [{ delay = 0.3 }, { delay = 1.2, gain = 1.1 }, { delay = 2.9 }]\n\
                    target = { filter = { family = \"butterworth\", order = 3, cutoff = 0.3 } }";
        ChannelModel::new(&Spec::from_toml(text, "spec.toml").unwrap()).unwrap()
    }

    /// By the definition: the column of the channels in the order, less the phases that were removed.
    #[test]
    fn an_order_leaves_what_the_projection_onto_its_column_leaves() {
        let model = model();
        let point = ChannelValues::nominal(&model, FittedValues::default(), 0);
        let (w, order) = (0.7, [2, 0, 1]);
        let u = CMat::from_fn(3, 1, |i, _| Complex::new(1.0 + i as f64, 0.3 - i as f64));
        let band = SpectralBand { w, count: 5, matrix: &u * u.adjoint() };
        let delays = &model.delays;
        let left = |alias: i32, inverted: Option<usize>| {
            let column = model.steering(&point, w, &[alias]);
            band.unexplained(&CMat::from_fn(3, 1, |i, _| {
                let removed = w * (delays[order[i]] - delays[i]) / 4.0;
                let sign = if inverted == Some(i) { -1.0 } else { 1.0 };
                column[(order[i], 0)] * Complex::from_polar(sign, -removed)
            }))
        };
        for inverted in [None, Some(1)] {
            let expected = (-4..=4).map(|alias| left(alias, inverted)).fold(f64::INFINITY, f64::min);
            let found = SingleBand::new(&model, &point, &band, -4..=4).unwrap().unexplained(&order, inverted);
            assert!((found - expected).abs() < 1e-12 * band.power(), "{found} {expected}");
        }
    }

    /// 32 channels at ratio 32 have 559 orders, 65 aliases and up to 128 bands: 149 million products.
    #[test]
    fn the_work_of_a_warning_is_bounded() {
        let orders = 32 * 31 / 2 + 2 * 32 - 1;
        for ratio in [2, 32, 128] {
            let products = orders * (2 * ratio + 1) * 32;
            assert!(products * bands_within(products) <= MOST_PRODUCTS, "{ratio}");
        }
        assert_eq!(bands_within(usize::MAX), LEAST_BANDS);
    }
}
