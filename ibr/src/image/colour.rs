//! CIE Luv, a colour space in which equal distances correspond to about equal perceived differences.

use super::Image;

/// Reference white D65 of sRGB in CIE u'v'.
const WHITE_U: f32 = 0.197_839_8;
const WHITE_V: f32 = 0.468_336_3;

/// L, u, v of one sRGB colour with components in 0..255.
pub fn luv(rgb: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = rgb.map(linear);
    let x = 0.412_453 * r + 0.357_580 * g + 0.180_423 * b;
    let y = 0.212_671 * r + 0.715_160 * g + 0.072_169 * b;
    let z = 0.019_334 * r + 0.119_193 * g + 0.950_227 * b;
    let total = x + 15.0 * y + 3.0 * z;
    if total <= 0.0 {
        return [0.0; 3];
    }
    let lightness = if y > 0.008_856 { 116.0 * y.cbrt() - 16.0 } else { 903.3 * y };
    let u = 13.0 * lightness * (4.0 * x / total - WHITE_U);
    let v = 13.0 * lightness * (9.0 * y / total - WHITE_V);
    [lightness, u, v]
}

/// Undoes the sRGB transfer curve; 0..255 to 0..1.
fn linear(value: f32) -> f32 {
    let v = (value / 255.0).clamp(0.0, 1.0);
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// L, u and v of every pixel as three planes; a grey image has u = v = 0 up to the white point.
pub fn luv_planes(image: &Image) -> [Vec<f32>; 3] {
    let pixels = image.width() * image.height();
    let mut planes: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(pixels));
    for i in 0..pixels {
        let colour = luv(image.pixel::<3>(i));
        planes.iter_mut().zip(colour).for_each(|(plane, v)| plane.push(v));
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Origin: the closed forms of CIE 15 evaluated in double precision.
    #[test]
    fn known_colours() {
        for (rgb, want) in [
            ([255.0, 255.0, 255.0], [100.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([255.0, 0.0, 0.0], [53.24, 175.0, 37.8]),
            ([0.0, 0.0, 255.0], [32.30, -9.4, -130.3]),
            ([119.0, 119.0, 119.0], [50.03, 0.0, 0.0]),
        ] {
            let got = luv(rgb);
            for (g, w) in got.iter().zip(want) {
                assert!((g - w).abs() < 0.15, "{rgb:?}: {got:?} {want:?}");
            }
        }
    }
}
