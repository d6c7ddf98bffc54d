//! What the samples of a rendering say about its error, pixel by pixel: how much each sample counts in the
//! fit that is really used, and how well the samples agree.

use super::evidence_row::RowSurvey;
use super::sure::Limits;
use crate::interpolate::Degree;
use crate::interpolate::rows::RowWork;
use crate::pipeline::{Balance, RenderError, RenderSettings, Rendering, rectified};
use crate::propagate::{Frame, RectifiedView, RigCamera};
use rayon::prelude::*;

/// One pixel of a virtual view. h_s is the influence of sample s on the pixel at x.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Evidence {
    /// sum h_s over the samples; the rest comes from what fills holes.
    pub held: f32,
    /// sum |h_s|.
    pub reach: f32,
    /// sum h_s (x_s - x).
    pub shift: f32,
    /// sum |h_s| (x_s - x)^2.
    pub spread: f32,
    /// sum over the views of (sum of the h_s of the view)^2: 1 for one view, 1/2 for two equal ones.
    pub views: f32,
    /// sum over the views of (sum of the h_s of the view)^2 (distance to the view)^2.
    pub lever: f32,
    /// Change of the pixel when the fit is fitted once more: its bias.
    pub bias: f32,
    /// Difference between what the two most influential views say, NaN where only one says anything.
    pub disagreement: f32,
    /// Influence of samples whose depth or colour is doubtful.
    pub doubtful: f32,
    /// Largest slope of the samples nearby.
    pub steepest: f32,
    /// Largest second difference of the samples nearby.
    pub sharpest: f32,
    /// Largest residual of the samples nearby.
    pub residual: f32,
    /// Largest distance of a view that counts at the pixel.
    pub distance: f32,
}

/// A rendering with the evidence for each of its pixels.
pub struct Survey {
    /// The rendering.
    pub rendering: Rendering,
    /// Row by row.
    pub evidence: Vec<Evidence>,
    /// Depth edges: row by row, the height of the jump beside the pixel, weighted by its distance; 0
    /// elsewhere.
    pub edges: Vec<f32>,
    /// The sure bound of each pixel, in grey levels; empty without limits.
    pub sure: Vec<f32>,
}

/// Renders a view of a rectified rig and collects the evidence; with limits also the sure bound.
///
/// # Errors
/// Those of [`rectified::render`].
pub fn survey(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    limits: Option<&Limits>,
) -> Result<Survey, RenderError> {
    let rendering = rectified::render(views, position, settings)?;
    let balance = Balance::rectified(views, position).with_noise(&rendering.agreement);
    let settings = &settings.suited_to(&rendering.agreement, &balance);
    let colour = rendering.image.channels() == 3;
    let job = Job {
        views,
        camera: RigCamera::new(views, position),
        balance: balance.with_gains(&rendering.agreement.gains),
        settings,
        rendering: &rendering,
        limits,
    };
    let (evidence, edges, sure) = match (settings.interpolation.fit.degree, colour) {
        (Degree::Linear, false) => collect::<2, 1>(&job)?,
        (Degree::Linear, true) => collect::<2, 3>(&job)?,
        (Degree::Cubic, false) => collect::<4, 1>(&job)?,
        (Degree::Cubic, true) => collect::<4, 3>(&job)?,
    };
    Ok(Survey { rendering, evidence, edges, sure })
}

/// What all rows share.
pub(super) struct Job<'a> {
    pub(super) views: &'a [RectifiedView<'a>],
    pub(super) camera: RigCamera,
    pub(super) balance: Balance,
    pub(super) settings: &'a RenderSettings,
    pub(super) rendering: &'a Rendering,
    pub(super) limits: Option<&'a Limits>,
}

impl Job<'_> {
    pub(super) fn distance(&self, view: u16) -> f64 {
        (self.views[usize::from(view)].position - self.camera.position).abs()
    }
}

/// The bound of a pixel that no view sees.
const UNSEEN: f32 = 255.0;

type Collected = (Vec<Evidence>, Vec<f32>, Vec<f32>);

fn collect<const ORDER: usize, const C: usize>(job: &Job<'_>) -> Result<Collected, RenderError> {
    let (width, height) = job.rendering.image.size();
    let frame = Frame::whole(width, height, RowWork::<ORDER, C>::MARGIN, job.settings.offset);
    let mut evidence = vec![Evidence::default(); width * height];
    let mut edges = vec![0.0; width * height];
    let mut sure = vec![UNSEEN; width * height];
    let numbers = edges.par_chunks_mut(width).zip(sure.par_chunks_mut(width));
    evidence.par_chunks_mut(width).zip(numbers).enumerate().try_for_each_init(
        || RowSurvey::<ORDER, C>::new(width),
        |work, (y, (evidence, (edges, sure)))| {
            if work.row(job, &frame, y, evidence)? {
                work.edges(job, y, edges);
                work.sure(job, y, sure);
            }
            Ok::<(), RenderError>(())
        },
    )?;
    if job.limits.is_none() {
        sure.clear();
    }
    Ok((evidence, edges, sure))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;

    fn surveyed(positions: &[f64], at: f64, paint: impl Fn(usize) -> f32) -> Survey {
        let image = Image::new(60, 8, 1, (0..480).map(|i| paint(i % 60)).collect()).unwrap();
        let disparity = DepthMap::new((60, 8), vec![4.0; 480], 1.0, Measure::Disparity).unwrap();
        let view =
            |position: &f64| RectifiedView { image: &image, disparity: &disparity, position: *position };
        let views: Vec<RectifiedView<'_>> = positions.iter().map(view).collect();
        survey(&views, at, &RenderSettings::default(), None).unwrap()
    }

    fn near(value: f32, want: f32) -> bool {
        (value - want).abs() < 0.02
    }

    /// Inside a flat scene the influences add up to one, evenly over the views half-way between them.
    #[test]
    fn influences_are_shares() {
        let two = surveyed(&[0.0, 1.0], 0.5, |_| 90.0);
        let one = surveyed(&[0.0], 0.5, |_| 90.0);
        for (s, views, lever) in [(&two, 0.5, 0.125), (&one, 1.0, 0.25)] {
            let e = s.evidence[4 * 60 + 30];
            assert!(near(e.held, 1.0) && near(e.views, views) && near(e.lever, lever), "{e:?}");
            assert!(near(e.bias, 0.0) && near(e.residual, 0.0) && near(e.shift, 0.0), "{e:?}");
            assert!(e.reach >= e.held && e.spread > 0.1 && near(e.distance, 0.5), "{e:?}");
        }
        assert!(near(two.evidence[270].disagreement, 0.0) && one.evidence[270].disagreement.is_nan());
        assert!(two.edges.iter().all(|e| *e == 0.0));
    }

    /// The bias of a smoothing fit is large where the texture is fine, and slopes are those of the paint.
    #[test]
    fn fine_texture_has_a_bias() {
        let wave = |rate: f32| move |x: usize| 120.0 + 50.0 * (rate * x as f32).sin();
        let mean = |s: &Survey| s.evidence[250..290].iter().map(|e| e.bias).sum::<f32>() / 40.0;
        let (fine, coarse) = (surveyed(&[0.0, 1.0], 0.5, wave(1.8)), surveyed(&[0.0, 1.0], 0.5, wave(0.3)));
        assert!(mean(&fine) > 10.0 * mean(&coarse), "{} {}", mean(&fine), mean(&coarse));
        let steepest = coarse.evidence[270].steepest;
        assert!((10.0..15.1).contains(&steepest), "{steepest}");
    }
}
