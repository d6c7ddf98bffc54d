//! Smooth extension of some pixels over all others: pull and push (S. Gortler et al., *The Lumigraph*,
//! SIGGRAPH 1996).

/// Values of an image and their weights, 0 to 1; a value of weight 0 means nothing.
pub(super) struct Level<const C: usize> {
    pub(super) width: usize,
    pub(super) values: Vec<[f32; C]>,
    pub(super) weights: Vec<f32>,
}

impl<const C: usize> Level<C> {
    /// Gives every pixel a value: its own in the share of its weight, else that of the level of half the
    /// size.
    pub(super) fn extend(&mut self) {
        if self.weights.len() > 1 && self.weights.iter().any(|w| *w < 1.0) {
            let mut coarse = self.halved();
            coarse.extend();
            self.blend(&coarse);
        }
    }

    /// The same at single pixels.
    pub(super) fn extension(&self) -> impl Fn(usize) -> [f32; C] {
        let mut coarse = self.halved();
        coarse.extend();
        move |p| self.filled(p, &coarse)
    }

    fn height(&self) -> usize {
        self.weights.len() / self.width.max(1)
    }

    /// Weighted means of squares of 2 x 2 pixels; a square is as sure as the sum of its weights, up to 1.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height().div_ceil(2));
        let mut half =
            Self { width, values: vec![[0.0; C]; width * height], weights: vec![0.0; width * height] };
        for (p, (value, weight)) in self.values.iter().zip(&self.weights).enumerate() {
            let q = p / self.width / 2 * width + p % self.width / 2;
            half.weights[q] += weight;
            half.values[q].iter_mut().zip(value).for_each(|(sum, v)| *sum += weight * v);
        }
        for (value, weight) in half.values.iter_mut().zip(&mut half.weights).filter(|(_, w)| **w > 0.0) {
            value.iter_mut().for_each(|v| *v /= *weight);
            *weight = weight.min(1.0);
        }
        half
    }

    /// Fills what is missing with the bilinear interpolation of the level of half the size.
    fn blend(&mut self, coarse: &Self) {
        self.values = (0..self.weights.len()).map(|p| self.filled(p, coarse)).collect();
        self.weights.fill(1.0);
    }

    fn filled(&self, p: usize, coarse: &Self) -> [f32; C] {
        let (value, weight) = (self.values[p], self.weights[p]);
        let missing = 1.0 - weight;
        if missing <= 0.0 {
            return value;
        }
        let filling = coarse.between(p % self.width, p / self.width);
        std::array::from_fn(|c| weight * value[c] + missing * filling[c])
    }

    /// The value at a pixel of the level of twice the size: a quarter of a pixel beside the nearest one.
    fn between(&self, x: usize, y: usize) -> [f32; C] {
        let pair = |at: usize, length: usize| {
            let other =
                if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { (at / 2 + 1).min(length - 1) };
            [(at / 2, 0.75), (other, 0.25)]
        };
        let mut sum = [0.0; C];
        for (row, down) in pair(y, self.height()) {
            for (column, across) in pair(x, self.width) {
                let value = &self.values[row * self.width + column];
                sum.iter_mut().zip(value).for_each(|(s, v)| *s += down * across * v);
            }
        }
        sum
    }
}

/// The mean of the nearest pixel and the smooth extension: of a large hole the first keeps what lies beside
/// it, and the second has no streaks.
pub(super) fn mean<const C: usize>(nearest: [f32; C], smooth: [f32; C]) -> [f32; C] {
    std::array::from_fn(|c| (nearest[c] + smooth[c]) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extended(width: usize, known: &[Option<f32>]) -> Vec<f32> {
        let values = known.iter().map(|v| [v.unwrap_or(f32::MAX.sqrt())]).collect();
        let weights = known.iter().map(|v| if v.is_some() { 1.0 } else { 0.0 }).collect();
        let mut level = Level { width, values, weights };
        level.extend();
        level.values.into_iter().map(|[v]| v).collect()
    }

    #[test]
    fn one_value_fills_images_of_all_sizes() {
        for (width, height) in (1..9).flat_map(|w| (1..9).map(move |h| (w, h))) {
            for at in [0, width * height / 2, width * height - 1] {
                let mut known = vec![None; width * height];
                known[at] = Some(7.0);
                let filled = extended(width, &known);
                assert!(filled.iter().all(|v| (v - 7.0).abs() < 1e-5), "{width} {height} {at}: {filled:?}");
            }
        }
    }

    /// Between two sides the values rise, and known ones stay.
    #[test]
    fn holes_are_smooth() {
        let known: Vec<Option<f32>> = (0..32)
            .map(|x| [(0, 10.0), (31, 90.0)].into_iter().find(|(k, _)| *k == x).map(|(_, v)| v))
            .collect();
        let filled = extended(32, &known);
        assert!(filled[0] == 10.0 && filled[31] == 90.0);
        assert!(filled.windows(2).all(|w| w[1] > w[0] - 1.0 && w[1] - w[0] < 16.0), "{filled:?}");
    }
}
