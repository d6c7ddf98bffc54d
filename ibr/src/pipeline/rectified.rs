//! A view from a rectified rig: the three stages run row by row, rows in parallel.

use super::nearness::SHARING;
use super::{
    Agreement, RenderError, RenderSettings, Rendering, Report, ViewWeights, check_counts, check_size,
};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::interpolate::rows::{self, RowWork, nearest_depths};
use crate::interpolate::{Cover, HoleCount};
use crate::occlusion::{self, RowScratch};
use crate::propagate::{self, Frame, RectifiedView, RigCamera};
use crate::sample::{Dropped, Sample};
use crate::setting::FINITE;
use rayon::prelude::*;

/// Renders the view from `position` on the line of the cameras.
///
/// All views must have the size of the first, which is also that of the result; the result is RGB if
/// any view is.
///
/// # Errors
/// [`RenderError`], naming view, sizes and numbers.
pub fn render(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    check(views, position)?;
    settings.check()?;
    let colour = views.iter().any(|v| v.image.channels() == 3);
    match colour {
        false => render_with::<1>(views, position, settings),
        true => render_with::<3>(views, position, settings),
    }
}

fn check(views: &[RectifiedView<'_>], position: f64) -> Result<(), RenderError> {
    let first = views.first().ok_or(RenderError::NoViews)?;
    let (width, height) = first.image.size();
    check_counts(views.len(), width * height)?;
    for (view, v) in views.iter().enumerate() {
        check_size(view, "the image", v.image.size(), first.image.size())?;
        check_size(view, "the disparity map", v.map.size(), first.image.size())?;
    }
    let positions = views.iter().map(|v| v.camera).chain([position]);
    positions.into_iter().try_for_each(|position| Ok(FINITE.check("position", position)?))
}

struct Job<'a> {
    views: &'a [RectifiedView<'a>],
    camera: RigCamera,
    view_weights: ViewWeights,
    frame: Frame,
    settings: &'a RenderSettings,
}

fn render_with<const C: usize>(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    let (width, height) = views[0].image.size();
    let agreement = Agreement::of(views);
    let mut view_weights =
        ViewWeights::of(views, &position).nearest(settings.nearest.unwrap_or(SHARING)).with_noise(&agreement);
    let chosen = view_weights.views();
    let settings = &settings.suited_to(&agreement, &view_weights, Measure::Disparity);
    if !settings.keep_exposure {
        view_weights = view_weights.with_gains(&agreement.gains);
    }
    let frame = Frame::whole(width, height, rows::MARGIN, settings.offset);
    let camera = RigCamera::new(views, position);
    let rendering = render_rows::<C>(&Job { views, camera, view_weights, frame, settings })?;
    Ok(Rendering { agreement, views: chosen, ..rendering })
}

fn render_rows<const C: usize>(job: &Job<'_>) -> Result<Rendering, RenderError> {
    let Frame { width, height, .. } = job.frame;
    let mut values = vec![0.0; width * height * C];
    let mut mask = vec![Cover::Disocclusion; width * height];
    let mut keys = vec![f32::NAN; width * height];
    let mut samples = vec![0_u16; width * height];
    let mut counts = vec![RowCount::default(); height];
    // Blocks of rows share work memory; their borders do not affect the result.
    let block = height.div_ceil(4 * rayon::current_num_threads()).max(1);
    let outputs = values
        .par_chunks_mut(block * width * C)
        .zip(mask.par_chunks_mut(block * width).zip(keys.par_chunks_mut(block * width)))
        .zip(samples.par_chunks_mut(block * width).zip(counts.par_chunks_mut(block)));
    outputs.enumerate().try_for_each(|(b, ((values, (mask, keys)), (samples, counts)))| {
        let (mut strip, mut fit) = (Strip::<C>::new(job), RowWork::<C>::new(width));
        let masks = mask.chunks_exact_mut(width).zip(keys.chunks_exact_mut(width));
        let tallies = samples.chunks_exact_mut(width).zip(counts);
        let rows = values.chunks_exact_mut(width * C).zip(masks).zip(tallies);
        rows.enumerate().try_for_each(|(k, ((values, (mask, keys)), (samples, count)))| {
            let row = b * block + k;
            *count = strip.survivors_of_row(job, row);
            rows::count(&strip.samples, samples);
            nearest_depths(&strip.samples, keys);
            fit.interpolate(&strip.samples, &job.settings.interpolation, values, mask)
                .map(|_| ())
                .map_err(|source| RenderError::Fit { row, source })
        })
    })?;
    let report = report(job, &counts, &mask)?;
    let filled: Vec<bool> = counts.iter().map(|c| c.used > 0).collect();
    rows::finish::<C>(&filled, &mask, &keys, &job.settings.interpolation, &mut values);
    job.disparities(&mut keys);
    let image = Image::from_values((width, height), C, values);
    let depth = DepthMap::from_known((width, height), keys, Measure::Disparity);
    let (views, agreement) = (Vec::new(), Agreement::default());
    Ok(Rendering { image, mask, depth, counts: samples, views, report, agreement })
}

impl Job<'_> {
    fn disparities(&self, keys: &mut [f32]) {
        let offset = self.camera.disparity_offset;
        keys.iter_mut().for_each(|k| *k = (1.0 / f64::from(*k) - offset) as f32);
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct RowCount {
    propagated: usize,
    used: usize,
    dropped: Dropped,
}

/// The report on all rows.
///
/// # Errors
/// [`RenderError::NoOverlap`].
fn report(job: &Job<'_>, counts: &[RowCount], mask: &[Cover]) -> Result<Report, RenderError> {
    let mut report = Report { holes: HoleCount::of(mask), ..Report::default() };
    for c in counts {
        report.propagated += c.propagated;
        report.used += c.used;
        report.dropped += c.dropped;
    }
    report.occluded = report.propagated - report.used;
    let (pixels, dropped) = (job.views.len() * job.frame.width * job.frame.height, report.dropped);
    if report.used > 0 { Ok(report) } else { Err(RenderError::NoOverlap { pixels, dropped }) }
}

struct Strip<const C: usize> {
    samples: Vec<Sample<C>>,
    scratch: RowScratch<C>,
}

impl<const C: usize> Strip<C> {
    fn new(job: &Job<'_>) -> Self {
        let used = (0..job.views.len()).filter(|view| job.view_weights.uses(*view)).count();
        let samples = Vec::with_capacity(job.frame.width * used);
        Self { samples, scratch: RowScratch::default() }
    }

    /// The first two stages for one row: propagates samples and removes hidden ones.
    fn survivors_of_row(&mut self, job: &Job<'_>, y: usize) -> RowCount {
        let mut count = RowCount::default();
        self.samples.clear();
        for (index, view) in job.views.iter().enumerate().filter(|(i, _)| job.view_weights.uses(*i)) {
            let index = index as u16;
            count.dropped +=
                propagate::rectified_row(view, index, y, &job.camera, &job.frame, &mut self.samples);
        }
        count.propagated = self.samples.len();
        occlusion::remove_in_row(&mut self.samples, job.settings.depth_test(), &mut self.scratch);
        count.used = self.samples.len();
        job.view_weights.apply(&mut self.samples);
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(width: usize, height: usize, channels: usize) -> (Image, DepthMap) {
        let value = |i: usize| 120.0 + 80.0 * ((i / channels % width) as f32 * 0.4).sin() + (i % 7) as f32;
        let image =
            Image::new(width, height, channels, (0..width * height * channels).map(value).collect()).unwrap();
        let disparity = |i: usize| match i % width {
            x if x > width / 3 && x < width / 2 => 9.0,
            2 => 0.0,
            _ => 3.0 + (i / width) as f32 * 0.1,
        };
        let data = (0..width * height).map(disparity).collect();
        (image, DepthMap::new((width, height), data, 1.0, Measure::Disparity).unwrap())
    }

    fn views<'a>(parts: &'a [(Image, DepthMap)]) -> Vec<RectifiedView<'a>> {
        let view = |(i, (image, disparity)): (usize, &'a (Image, DepthMap))| RectifiedView {
            image,
            map: disparity,
            camera: i as f64,
        };
        parts.iter().enumerate().map(view).collect()
    }

    #[test]
    fn the_report_counts_every_pixel() {
        let parts = [scene(40, 9, 3), scene(40, 9, 3)];
        let report = render(&views(&parts), 0.4, &RenderSettings::default()).unwrap().report;
        assert_eq!(report.propagated + report.dropped.total(), 2 * 40 * 9);
        assert_eq!(report.propagated, report.occluded + report.used);
        assert!(report.occluded > 0 && report.dropped.unknown == 18 && report.holes.total() > 0);
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let parts = [scene(64, 33, 3), scene(64, 33, 3)];
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&views(&parts), 0.3, &RenderSettings::default()).unwrap())
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(5));
    }

    #[test]
    fn the_position_of_a_camera_gives_nearly_its_image() {
        let mut parts = [scene(48, 6, 1)];
        parts[0].1 = DepthMap::new((48, 6), vec![4.0; 288], 1.0, Measure::Disparity).unwrap();
        let mut settings = RenderSettings { keep_smoothing: true, ..RenderSettings::default() };
        settings.interpolation.fit.lambda = 0.0;
        settings.interpolation.fit.tau = 1e-9;
        let got = render(&views(&parts), 0.0, &settings).unwrap();
        let worst =
            got.image.data().iter().zip(parts[0].0.data()).fold(0.0, |w: f32, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-2, "{worst}");
        assert_eq!(got.coverage(), 1.0);
        assert!(got.depth.data().iter().all(|d| (d - 4.0).abs() < 1e-5));
    }

    /// Pixels have the disparity of the nearest visible sample, and none in holes.
    #[test]
    fn the_virtual_view_has_disparities() {
        let parts = [scene(48, 9, 1)];
        let got = render(&views(&parts), 0.0, &RenderSettings::default()).unwrap();
        for (p, d) in got.depth.data().iter().enumerate() {
            assert_eq!(d.is_nan(), got.mask[p] != Cover::Seen, "{p}");
            let own = parts[0].1.data()[p];
            assert!(d.is_nan() || own.is_nan() || (d - own).abs() < 1.0, "{p}: {d} {own}");
        }
    }

    #[test]
    fn wrong_input_is_named() {
        let (image, disparity) = scene(8, 8, 1);
        let small = Image::filled(7, 8, 1, 0.0);
        let view = |image, position| RectifiedView { image, map: &disparity, camera: position };
        let settings = RenderSettings::default();
        assert_eq!(render(&[], 0.0, &settings), Err(RenderError::NoViews));
        let sizes = render(&[view(&image, 0.0), view(&small, 1.0)], 0.5, &settings).unwrap_err();
        assert_eq!(sizes.to_string(), "view 1: the image has 7 x 8 pixels instead of 8 x 8");
        let nowhere = render(&[view(&image, f64::NAN)], 0.5, &settings).unwrap_err();
        assert_eq!(nowhere.to_string(), "position is NaN: it must be a finite number");
        let far = render(&[view(&image, 0.0)], 500.0, &settings).unwrap_err();
        assert!(matches!(far, RenderError::NoOverlap { pixels: 64, .. }), "{far}");
        let mut settings = settings;
        settings.interpolation.depth_test.relative = 0.0;
        let none = render(&[view(&image, 0.0)], 0.5, &settings).unwrap_err().to_string();
        assert_eq!(
            none,
            "sum of relative and absolute depth difference is 0: it must be a positive finite number"
        );
    }
}
