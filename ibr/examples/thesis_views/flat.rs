//! Figures 3.5 to 3.7: scenes of the plane without occlusion, ten cameras.

use crate::page::Verdict;
use crate::theory::flat::scenes::{Wave, cameras, virtual_camera};
use crate::theory::flat::{Errors, FlatCamera, FlatRig, UNIFORM_ERROR_SHARE, trial};
use crate::{Curve, Effort, Figure, Outcome, chart, decades, mean, slope, swept};

fn rig(cameras: &[FlatCamera], focal: f64) -> FlatRig<'_> {
    FlatRig { scene: &Wave, cameras, view: virtual_camera(focal), window: (-1.2, 1.2) }
}

/// Figure 3.5: pixels of 2^-5 to 2^-10 focal lengths.
pub(crate) fn pixels(effort: Effort) -> Outcome<Figure> {
    let (mut measured, mut bounds, mut estimates) = (Vec::new(), Vec::new(), Vec::new());
    for exponent in 5..=effort.of(10, 7) {
        let focal = 2.0_f64.powi(exponent);
        let cameras = cameras(10, focal);
        let rig = rig(&cameras, focal);
        // The error of one view scatters more where its pixels are few.
        let draws = (effort.of(4000.0, 1500.0) / focal).ceil().max(effort.of(20.0, 8.0)) as u64;
        measured.push((focal, mean(draws, |seed| trial::image_space(&rig, Errors::default(), seed))?));
        bounds.push((focal, rig.image_space(Errors::default()).total()));
        estimates.push((focal, rig.estimate()));
    }
    let falls = slope(&decades(&measured));
    let ratios: Vec<f64> = bounds.iter().zip(&measured).map(|(b, m)| b.1 / m.1).collect();
    let (least, most) = range(&ratios);
    let verdicts = vec![
        Verdict::new(
            "the error decays as lambda^-2",
            format!("slope {falls:.3} over decades"),
            (falls + 2.0).abs() < effort.of(0.06, 0.15),
        ),
        Verdict::new(
            "the bound of Theorem 3.1 lies above the error",
            format!("{least:.1} to {most:.1} times the error"),
            least > 1.0,
        ),
    ];
    let chart = chart(
        "Figure 3.5: error against the number of pixels",
        ["log10 of the focal length in pixels", "log10 MAE"],
        vec![
            ("measured", decades(&measured)),
            ("estimate, exact moments", decades(&estimates)),
            ("bound of Theorem 3.1", decades(&bounds)),
        ],
    );
    Ok(Figure { file: "figure-3.5.svg", chart, verdicts })
}

/// Figure 3.6: errors of intensity.
pub(crate) fn texture_errors(effort: Effort) -> Outcome<Figure> {
    let focal = effort.of(512.0, 64.0);
    let levels = [0.0, 0.02, 0.04, 0.06, 0.08, 0.1];
    let errors = |texture| Errors { texture, depth: 0.0 };
    let (measured, bounds) = levels_of(focal, &levels, errors, effort)?;
    let share = measured[5].1 / 0.1;
    let verdicts = vec![
        Verdict::new(
            "the error grows linearly with E_T",
            format!("{share:.3} E_T; {UNIFORM_ERROR_SHARE:.4} E_T is derived"),
            (share / UNIFORM_ERROR_SHARE - 1.0).abs() < effort.of(0.05, 0.15),
        ),
        above(&measured, &bounds),
    ];
    let chart = chart(
        "Figure 3.6: error against the errors of intensity",
        ["E_T", "MAE"],
        vec![("measured", measured), ("bound of Theorem 3.1", bounds)],
    );
    Ok(Figure { file: "figure-3.6.svg", chart, verdicts })
}

/// Figure 3.7: errors of depth.
pub(crate) fn depth_errors(effort: Effort) -> Outcome<Figure> {
    let focal = effort.of(512.0, 64.0);
    let levels = [0.0, 0.02, 0.05, 0.1, 0.15, 0.2];
    let errors = |depth| Errors { texture: 0.0, depth };
    let (measured, bounds) = levels_of(focal, &levels, errors, effort)?;
    let (first, last) = (measured[2].1 / 0.05, measured[5].1 / 0.2);
    let verdicts = vec![
        Verdict::new(
            "the error grows linearly with E_D",
            format!("{first:.4} E_D at 0.05, {last:.4} E_D at 0.2"),
            (last / first - 1.0).abs() < effort.of(0.15, 0.4),
        ),
        above(&measured, &bounds),
    ];
    let chart = chart(
        "Figure 3.7: error against the errors of depth",
        ["E_D", "MAE"],
        vec![("measured", measured), ("bound of Theorem 3.1", bounds)],
    );
    Ok(Figure { file: "figure-3.7.svg", chart, verdicts })
}

/// Measured errors and bounds at some levels of one kind of error.
fn levels_of(
    focal: f64,
    levels: &[f64],
    errors: impl Fn(f64) -> Errors,
    effort: Effort,
) -> Outcome<(Curve, Curve)> {
    let cameras = cameras(10, focal);
    let rig = rig(&cameras, focal);
    swept(levels, |level| {
        let measured = mean(effort.of(12, 2), |seed| trial::image_space(&rig, errors(level), seed))?;
        Ok((measured, rig.image_space(errors(level)).total()))
    })
}

/// Whether a bound lies above the measured errors.
pub(crate) fn above(measured: &[(f64, f64)], bounds: &[(f64, f64)]) -> Verdict {
    let ratios: Vec<f64> = bounds.iter().zip(measured).map(|(b, m)| b.1 / m.1).collect();
    let (least, most) = range(&ratios);
    Verdict::new(
        "the bound lies above the error",
        format!("{least:.1} to {most:.1} times the error"),
        least > 1.0,
    )
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, 0.0), |(low, high), v| (low.min(*v), high.max(*v)))
}
