//! Stage one, propagation: every pixel with depth becomes a sample in the virtual image (thesis 2.3.1).

use crate::camera::{Camera, Relative};
use crate::depth::DepthMap;
use crate::image::Image;
use crate::sample::{Dropped, Sample};
use rayon::prelude::*;

/// One view of a rectified rig: the camera centres lie on a line parallel to the image rows.
#[derive(Debug, Clone, Copy)]
pub struct RectifiedView<'a> {
    /// Intensities.
    pub image: &'a Image,
    /// Disparities in pixels for a baseline of one, of the size of the image.
    pub disparity: &'a DepthMap,
    /// Position along the baseline, in units of the baseline.
    pub position: f64,
}

/// One view of a general rig.
#[derive(Debug, Clone, Copy)]
pub struct CalibratedView<'a> {
    /// Intensities.
    pub image: &'a Image,
    /// Depths in the scale of the camera, of the size of the image.
    pub depth: &'a DepthMap,
    /// The camera.
    pub camera: Camera,
}

/// The part of the virtual image plane in which samples are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Width of the virtual image in pixels.
    pub width: usize,
    /// Height of the virtual image in pixels.
    pub height: usize,
    /// Distance outside the outermost pixel centres up to which samples are kept, in pixels.
    pub margin: f64,
    /// Added to the column of every sample: a registration offset of the virtual image, in pixels.
    pub offset: f64,
    /// The rows that are kept, from the first to the second inclusive.
    pub rows: (f64, f64),
}

impl Frame {
    /// A whole virtual image.
    pub fn whole(width: usize, height: usize, margin: f64, offset: f64) -> Self {
        let rows = (-margin, height as f64 - 1.0 + margin);
        Self { width, height, margin, offset, rows }
    }

    /// The part of this frame between two rows.
    pub fn band(&self, top: f64, bottom: f64) -> Self {
        Self { rows: (top.max(self.rows.0), bottom.min(self.rows.1)), ..*self }
    }

    /// Whether a position lies in the frame.
    #[inline]
    pub fn holds(&self, x: f64, y: f64) -> bool {
        self.holds_column(x) && self.holds_row(y)
    }

    #[inline]
    fn holds_column(&self, x: f64) -> bool {
        x >= -self.margin && x <= self.width as f64 - 1.0 + self.margin
    }

    #[inline]
    fn holds_row(&self, y: f64) -> bool {
        y >= self.rows.0 && y <= self.rows.1
    }
}

/// Appends the samples of row `y` of a rectified view, seen from `position` on the line.
///
/// x_v = x + (c - c_v) D, and the depth key is 1 / D. `view` becomes the samples' view index.
pub fn rectified_row<const C: usize>(
    view: &RectifiedView<'_>,
    index: u16,
    y: usize,
    position: f64,
    frame: &Frame,
    samples: &mut Vec<Sample<C>>,
) -> Dropped {
    let mut dropped = Dropped::default();
    let shift = view.position - position;
    let width = view.image.width();
    for (column, &disparity) in view.disparity.row(y).iter().enumerate() {
        if disparity.is_nan() {
            dropped.unknown += 1;
            continue;
        }
        let x = column as f64 + shift * f64::from(disparity) + frame.offset;
        if !frame.holds_column(x) {
            dropped.outside += 1;
            continue;
        }
        let pixel = y * width + column;
        let value = view.image.pixel::<C>(pixel);
        samples.push(Sample {
            x,
            y: y as f64,
            depth: 1.0 / disparity,
            value,
            pixel: pixel as u32,
            view: index,
        });
    }
    dropped
}

/// All samples of a rectified rig, row by row and view by view within a row.
pub fn rectified<const C: usize>(
    views: &[RectifiedView<'_>],
    position: f64,
    frame: &Frame,
) -> (Vec<Sample<C>>, Dropped) {
    let mut samples = Vec::with_capacity(views.len() * frame.width * frame.height);
    let mut dropped = Dropped::default();
    for y in 0..frame.height {
        for (index, view) in views.iter().enumerate() {
            dropped += rectified_row(view, index as u16, y, position, frame, &mut samples);
        }
    }
    (samples, dropped)
}

/// The outcome for one pixel.
enum Fate {
    Sample(f64, f64, f64),
    Unknown,
    Behind,
    Outside,
}

/// Propagates one pixel of a calibrated view.
#[inline]
fn fate(map: &Relative, x: f64, y: f64, depth: f32, frame: &Frame) -> Fate {
    if depth.is_nan() {
        return Fate::Unknown;
    }
    let (u, v, d) = map.map(x, y, f64::from(depth));
    let u = u + frame.offset;
    // NaN: outside the domain of the lens model, or 0 * d of an infinite depth.
    if d <= 0.0 || u.is_infinite() || v.is_infinite() {
        Fate::Behind
    } else if frame.holds_column(u) && frame.holds_row(v) {
        Fate::Sample(u, v, d)
    } else {
        Fate::Outside
    }
}

/// The number of samples of [`calibrated`], and the pixels that it drops.
pub fn survey(views: &[CalibratedView<'_>], camera: &Camera, frame: &Frame) -> (usize, Dropped) {
    let (mut samples, mut dropped) = (0, Dropped::default());
    for view in views {
        let map = view.camera.relative_to(camera);
        let rows = 0..view.image.height();
        let counts: Vec<_> = rows.into_par_iter().map(|y| count_row(view, &map, y, frame)).collect();
        counts.iter().for_each(|c| (samples, _) = (samples + c.0, dropped += c.1));
    }
    (samples, dropped)
}

/// All samples of calibrated views, view by view and row by row (eq. 2.2 and 2.3).
///
/// Runs in parallel over the rows. A first pass counts; a second pass writes every row at its offset, so
/// that the list is allocated once and does not depend on the number of threads.
pub fn calibrated<const C: usize>(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    frame: &Frame,
) -> (Vec<Sample<C>>, Dropped) {
    let rows: Vec<(usize, usize)> =
        views.iter().enumerate().flat_map(|(i, v)| (0..v.image.height()).map(move |y| (i, y))).collect();
    let maps: Vec<Relative> = views.iter().map(|v| v.camera.relative_to(camera)).collect();
    let counts: Vec<(usize, Dropped)> =
        rows.par_iter().map(|&(i, y)| count_row(&views[i], &maps[i], y, frame)).collect();
    let mut samples = vec![Sample::BLANK; counts.iter().map(|c| c.0).sum()];
    let mut slices = Vec::with_capacity(rows.len());
    let mut rest = samples.as_mut_slice();
    for (count, _) in &counts {
        let (head, tail) = rest.split_at_mut(*count);
        slices.push(head);
        rest = tail;
    }
    rows.par_iter().zip(slices).for_each(|(&(i, y), slice)| {
        write_row(&views[i], i as u16, &maps[i], y, frame, slice);
    });
    let mut dropped = Dropped::default();
    counts.iter().for_each(|c| dropped += c.1);
    (samples, dropped)
}

fn count_row(view: &CalibratedView<'_>, map: &Relative, y: usize, frame: &Frame) -> (usize, Dropped) {
    let (mut count, mut dropped) = (0, Dropped::default());
    for (x, &depth) in view.depth.row(y).iter().enumerate() {
        match fate(map, x as f64, y as f64, depth, frame) {
            Fate::Sample(..) => count += 1,
            Fate::Unknown => dropped.unknown += 1,
            Fate::Behind => dropped.behind += 1,
            Fate::Outside => dropped.outside += 1,
        }
    }
    (count, dropped)
}

fn write_row<const C: usize>(
    view: &CalibratedView<'_>,
    index: u16,
    map: &Relative,
    y: usize,
    frame: &Frame,
    samples: &mut [Sample<C>],
) {
    let first = y * view.image.width();
    let known = view.depth.row(y).iter().enumerate().filter_map(|(x, &depth)| {
        match fate(map, x as f64, y as f64, depth, frame) {
            Fate::Sample(u, v, d) => Some((first + x, u, v, d as f32)),
            _ => None,
        }
    });
    for (sample, (pixel, x, y, depth)) in samples.iter_mut().zip(known) {
        *sample =
            Sample { x, y, depth, value: view.image.pixel::<C>(pixel), pixel: pixel as u32, view: index };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Measure;
    use nalgebra::Matrix3x4;

    fn ramp(width: usize, height: usize) -> Image {
        Image::new(width, height, 1, (0..width * height).map(|i| i as f32).collect()).unwrap()
    }

    #[test]
    fn a_rectified_row_moves_by_its_disparity() {
        let image = ramp(4, 2);
        let data = vec![1.0, 1.0, 1.0, 1.0, 2.0, f32::NAN, 8.0, 4.0];
        let disparity = DepthMap::new((4, 2), data, 1.0, Measure::Disparity).unwrap();
        let frame = Frame::whole(4, 2, 1.0, 0.25);
        let view = RectifiedView { image: &image, disparity: &disparity, position: 0.0 };
        let mut samples: Vec<Sample<1>> = Vec::new();
        let dropped = rectified_row(&view, 3, 1, 0.5, &frame, &mut samples);
        assert_eq!(dropped, Dropped { unknown: 1, behind: 0, outside: 1 });
        let positions: Vec<(f64, f32, u32)> = samples.iter().map(|s| (s.x, s.depth, s.pixel)).collect();
        assert_eq!(positions, [(-0.75, 0.5, 4), (1.25, 0.25, 7)]);
        assert!(samples.iter().all(|s| s.view == 3 && s.y == 1.0 && s.value[0] == s.pixel as f32));
        let (all, _) = rectified::<1>(&[view], 0.5, &frame);
        let row: Vec<_> = all[4..].iter().map(|s| Sample { view: 3, ..*s }).collect();
        assert_eq!(row, samples);
    }

    /// A rectified rig written as 3 x 4 cameras gives the same samples, up to the scale of depth.
    #[test]
    fn both_geometries_agree_on_a_rig() {
        let (width, height, focal) = (9, 3, 20.0);
        let image = ramp(width, height);
        let disparity: Vec<f32> = (0..27).map(|i| 1.0 + (i % 5) as f32).collect();
        let depth: Vec<f32> = disparity.iter().map(|d| focal as f32 / d).collect();
        let disparity = DepthMap::new((width, height), disparity, 1.0, Measure::Disparity).unwrap();
        let depth = DepthMap::new((width, height), depth, 1.0, Measure::Depth).unwrap();
        let camera = |c: f64| {
            let m = Matrix3x4::new(focal, 0.0, 4.0, -focal * c, 0.0, focal, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
            Camera::metric(m, false).unwrap()
        };
        let frame = Frame::whole(width, height, 0.5, 0.0);
        let rig = RectifiedView { image: &image, disparity: &disparity, position: 1.0 };
        let free = CalibratedView { image: &image, depth: &depth, camera: camera(1.0) };
        let (a, dropped_a) = rectified::<1>(&[rig], 0.4, &frame);
        let (b, dropped_b) = calibrated::<1>(&[free], &camera(0.4), &frame);
        assert_eq!(dropped_a, dropped_b);
        assert!(dropped_a.outside > 0 && a.len() == b.len());
        for (p, q) in a.iter().zip(&b) {
            assert!((p.x - q.x).abs() < 1e-5 && (p.y - q.y).abs() < 1e-9 && p.pixel == q.pixel);
            assert!((p.depth * focal as f32 / q.depth - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn points_behind_the_virtual_camera_are_counted() {
        let image = ramp(3, 1);
        let depth = DepthMap::new((3, 1), vec![1.0, 5.0, f32::NAN], 1.0, Measure::Depth).unwrap();
        let camera = |z: f64| {
            let m = Matrix3x4::new(1.0, 0.0, 1.0, -z, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -z);
            Camera::metric(m, false).unwrap()
        };
        let view = CalibratedView { image: &image, depth: &depth, camera: camera(0.0) };
        let frame = Frame::whole(3, 1, 2.0, 0.0);
        let (samples, dropped) = calibrated::<1>(&[view], &camera(2.0), &frame);
        assert_eq!((samples.len(), dropped.behind, dropped.unknown), (1, 1, 1));
    }
}
