//! Figures 4.6 to 4.8: scenes of space without occlusion, ten cameras.

use crate::flat::above;
use crate::page::Verdict;
use crate::theory::flat::Errors;
use crate::theory::spatial::scenes::{Hill, camera_at};
use crate::theory::spatial::{SpatialRig, trial};
use crate::{Curve, Effort, Figure, Outcome, chart, decades, mean, slope, swept};
use hybank_ibr::camera::Camera;
use nalgebra::Vector2;

struct Setup {
    cameras: Vec<Camera>,
    view: Camera,
    focal: f64,
}

impl Setup {
    /// Ten cameras around the virtual one, with pixels of this size in focal lengths.
    fn new(pixel: f64) -> Outcome<Self> {
        let focal = 1.0 / pixel;
        let spread = |k: u32, step: f64| 0.6 * (2.0 * (f64::from(k) * step).fract() - 1.0);
        // Steps of the golden ratio and of its square root fill the square evenly and without symmetry.
        let cameras = (1..=10).map(|k| camera_at(spread(k, 0.618_034), spread(k, 0.786_151), focal));
        let cameras = cameras.collect::<Result<_, _>>()?;
        Ok(Self { cameras, view: camera_at(0.07, -0.05, focal)?, focal })
    }

    fn rig(&self) -> SpatialRig<'_> {
        let half = Vector2::repeat(0.17 * self.focal);
        SpatialRig { scene: &Hill, cameras: &self.cameras, view: &self.view, window: (-half, half) }
    }
}

/// Figure 4.6: pixels of 0.04 to 0.007 focal lengths.
pub(crate) fn pixels(effort: Effort) -> Outcome<Figure> {
    let sizes: &[f64] = effort.of(&[0.04, 0.03, 0.02, 0.014, 0.01, 0.007], &[0.04, 0.028]);
    let (mut measured, mut bounds, mut estimates) = (Vec::new(), Vec::new(), Vec::new());
    for pixel in sizes {
        let setup = Setup::new(*pixel)?;
        let (rig, count) = (setup.rig(), 1.0 / (pixel * pixel));
        measured
            .push((count, mean(effort.of(6, 3), |seed| trial::image_space(&rig, Errors::default(), seed))?));
        bounds.push((count, rig.bound(Errors::default()).total()));
        estimates.push((count, rig.estimate()));
    }
    let falls = slope(&decades(&measured));
    let verdicts = vec![
        Verdict::new(
            "the error decays as lambda^-1",
            format!("slope {falls:.3} over decades"),
            (falls + 1.0).abs() < effort.of(0.06, 0.25),
        ),
        above(&measured, &bounds),
    ];
    let chart = chart(
        "Figure 4.6: error against the number of pixels",
        ["log10 of the pixels per square focal length", "log10 MAE"],
        vec![
            ("measured", decades(&measured)),
            ("estimate", decades(&estimates)),
            ("bound of Theorem 4.3", decades(&bounds)),
        ],
    );
    Ok(Figure { file: "figure-4.6.svg", chart, verdicts })
}

/// Figure 4.7: errors of intensity.
pub(crate) fn texture_errors(effort: Effort) -> Outcome<Figure> {
    let levels: &[f64] = &[0.0, 0.02, 0.05, 0.1];
    let (measured, bounds) = levels_of(levels, |texture| Errors { texture, depth: 0.0 }, effort)?;
    let share = measured[3].1 / 0.1;
    let verdicts = vec![
        Verdict::new(
            "the error grows linearly with E_T",
            format!("{share:.3} E_T; 0.340 E_T for the mean of a triangle"),
            (share - 0.340).abs() < effort.of(0.02, 0.06),
        ),
        above(&measured, &bounds),
    ];
    let chart = chart(
        "Figure 4.7: error against the errors of intensity",
        ["E_T", "MAE"],
        vec![("measured", measured), ("bound of Theorem 4.3", bounds)],
    );
    Ok(Figure { file: "figure-4.7.svg", chart, verdicts })
}

/// Figure 4.8: errors of depth.
pub(crate) fn depth_errors(effort: Effort) -> Outcome<Figure> {
    let levels: &[f64] = &[0.0, 0.05, 0.1, 0.2];
    let (measured, bounds) = levels_of(levels, |depth| Errors { texture: 0.0, depth }, effort)?;
    let verdicts = vec![
        Verdict::new(
            "the error grows with E_D, linearly where E_D outweighs the sampling",
            format!("{:.2} times as large at 0.2 as at 0.1", measured[3].1 / measured[2].1),
            (1.3..2.5).contains(&(measured[3].1 / measured[2].1)),
        ),
        above(&measured, &bounds),
    ];
    let chart = chart(
        "Figure 4.8: error against the errors of depth",
        ["E_D", "MAE"],
        vec![("measured", measured), ("bound of Theorem 4.3", bounds)],
    );
    Ok(Figure { file: "figure-4.8.svg", chart, verdicts })
}

/// Measured errors and bounds at some levels of one kind of error.
fn levels_of(levels: &[f64], errors: impl Fn(f64) -> Errors, effort: Effort) -> Outcome<(Curve, Curve)> {
    let setup = Setup::new(effort.of(0.01, 0.03))?;
    let rig = setup.rig();
    swept(levels, |level| {
        let measured = mean(effort.of(3, 1), |seed| trial::image_space(&rig, errors(level), seed))?;
        Ok((measured, rig.bound(errors(level)).total()))
    })
}
