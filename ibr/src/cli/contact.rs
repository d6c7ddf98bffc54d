//! Contact sheets: images side by side.

use crate::image::Image;

/// Pixels between the images.
const GAP: usize = 6;

/// Puts images of one size into rows of `columns`, on white.
pub(super) fn sheet(images: &[Image], columns: usize) -> Image {
    let Some(first) = images.first() else { return Image::filled(1, 1, 3, 255.0) };
    let (width, height) = first.size();
    let columns = columns.clamp(1, images.len());
    let rows = images.len().div_ceil(columns);
    let mut sheet = Image::filled(columns * (width + GAP) + GAP, rows * (height + GAP) + GAP, 3, 255.0);
    let stride = sheet.width() * 3;
    for (k, image) in images.iter().enumerate() {
        let image = image.to_rgb();
        let (left, top) = (GAP + k % columns * (width + GAP), GAP + k / columns * (height + GAP));
        for y in 0..image.height().min(height) {
            let row = image.row(y);
            let start = (top + y) * stride + left * 3;
            sheet.data_mut()[start..start + row.len()].copy_from_slice(row);
        }
    }
    sheet
}

/// Mid-grey plus `gain` times the difference of two images of one size.
pub(super) fn difference(a: &Image, b: &Image, gain: f32) -> Image {
    let (a, b) = (a.to_rgb(), b.to_rgb());
    let mut image = a.clone();
    let values = a.data().iter().zip(b.data()).map(|(a, b)| 128.0 + gain * (a - b));
    image.data_mut().iter_mut().zip(values).for_each(|(p, v)| *p = v);
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_stand_in_rows() {
        let images = [10.0, 20.0, 30.0].map(|v| Image::filled(4, 3, 1, v));
        let sheet = sheet(&images, 2);
        assert_eq!(sheet.size(), (2 * 10 + 6, 2 * 9 + 6));
        let at = |x: usize, y: usize| sheet.row(y)[3 * x];
        assert_eq!([at(0, 0), at(6, 6), at(16, 6), at(6, 15), at(16, 15)], [255.0, 10.0, 20.0, 30.0, 255.0]);
    }
}
