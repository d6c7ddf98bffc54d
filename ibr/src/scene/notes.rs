//! What is said of views that were read: faults of their photographs, and what was changed.

use crate::image::Image;

/// Largest value of 12 bits in 16 on the scale of 255, rounded up.
const TWELVE_BITS: f32 = 16.0;

/// That photographs are as dark as data of 12 bits in files of 16. Those of files of 8 bits have whole
/// numbers.
pub(super) fn of_dark(images: &[&Image]) -> Option<String> {
    let is_dark = |image: &Image| {
        image.data().iter().all(|v| *v < TWELVE_BITS) && image.data().iter().any(|v| v.fract() != 0.0)
    };
    let dark: Vec<String> =
        (1..).zip(images).filter(|(_, i)| is_dark(i)).map(|(k, _)| k.to_string()).collect();
    (!dark.is_empty()).then(|| {
        format!(
            "no value of view {} is above a sixteenth of white; data of 12 bits in files of 16 must be multiplied by 16",
            dark.join(", ")
        )
    })
}

pub(super) fn of_misregistration(pixels: f64) -> String {
    format!(
        "the photographs were {pixels:.2} pixels beside each other; the cameras were corrected by so much"
    )
}

/// Share of outliers from which on a report names them.
const MANY_OUTLIERS: f64 = 0.005;

pub(super) fn of_outliers(shares: &[f64]) -> Option<String> {
    let most = shares.iter().copied().fold(0.0, f64::max);
    (most >= MANY_OUTLIERS).then(|| {
        let percent: Vec<String> = shares.iter().map(|share| format!("{:.1}", 100.0 * share)).collect();
        format!(
            "{} % of the depths of the views contradict their neighbours, and other views do not outvote these; they were replaced",
            percent.join(", ")
        )
    })
}

pub(super) fn of_far(pixels: usize) -> Option<String> {
    (pixels > 0).then(|| format!("{pixels} pixels without depth are taken as far away, like a sky"))
}
