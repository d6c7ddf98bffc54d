//! Misregistration: photographs that do not fit each other because their cameras, or the rows of a rig, are
//! a little off. It is found from what the photographs show of common points, and taken out.

mod poses;
mod rows;

use super::SourceView;
use super::diagnosis::Suspected;
use crate::camera::Camera;
use crate::image::Image;
use crate::pipeline::{DEVIATION_PER_MEDIAN, GREY_LEVELS, median};

/// Displacement in pixels below which nothing is corrected: the fit does not notice it.
const LEAST: f64 = 0.05;

/// What the median difference of the photographs must fall to: else something else than the cameras is
/// wrong.
const BETTER: f64 = 0.98;

/// Points of a photograph that are compared with another one, about.
const POINTS: usize = 6000;

/// Fewest points of a pair.
const FEWEST: usize = 200;

/// Differences count up to so many of their standard deviations.
const DEVIATIONS: f64 = 4.0;

/// Least standard deviation of the differences, in grey levels: that of rounded values.
const ROUNDED: f64 = 0.5;

/// Cameras whose small errors are found from their photographs.
pub trait Registered: Suspected {
    /// Corrects the views; root mean square displacement that was taken out, in pixels.
    fn register(views: &mut [SourceView<Self>]) -> Option<f64>;
}

impl Registered for Camera {
    fn register(views: &mut [SourceView<Self>]) -> Option<f64> {
        let (cameras, moved) = poses::refined(views)?;
        views.iter_mut().zip(cameras).for_each(|(view, camera)| view.camera = camera);
        Some(moved)
    }
}

impl Registered for f64 {
    fn register(views: &mut [SourceView<Self>]) -> Option<f64> {
        rows::level(views)
    }
}

/// Pixels from one compared point to the next.
fn step_of(image: &Image) -> usize {
    ((image.width() * image.height()) as f64 / POINTS as f64).sqrt().ceil().max(1.0) as usize
}

/// A point of a photograph that another one shows.
struct Sighting<const N: usize> {
    /// Its brightness in both.
    values: [f32; 2],
    /// Change of the second brightness by each parameter.
    slopes: [f64; N],
}

/// What one view shows of points of another, if that is enough to tell where it looks: of the points that
/// fall into it at least half must have the depth and the colour that it has there.
struct Shown<const N: usize> {
    sightings: Vec<Sighting<N>>,
    /// Points that fall into the view.
    points: usize,
}

impl<const N: usize> Shown<N> {
    /// Of each point what the view has of it, `None` where it shows another one.
    fn of(found: impl Iterator<Item = Option<Sighting<N>>>) -> Self {
        let (mut sightings, mut points) = (Vec::new(), 0);
        for sighting in found {
            points += 1;
            sightings.extend(sighting);
        }
        Self { sightings, points }
    }

    fn enough(self) -> Option<Vec<Sighting<N>>> {
        let (differences, _) = weighed(&self.sightings);
        let alike = differences.iter().filter(|d| d.abs() <= f64::from(GREY_LEVELS)).count();
        (alike >= FEWEST && 2 * alike >= self.points).then_some(self.sightings)
    }
}

/// Differences of the sightings at one exposure, and their weights.
fn weighed<const N: usize>(sightings: &[Sighting<N>]) -> (Vec<f64>, Vec<f64>) {
    let sum = |k: usize| sightings.iter().map(|s| f64::from(s.values[k])).sum::<f64>();
    let gain = sum(1) / sum(0).max(1.0);
    let differences: Vec<f64> =
        sightings.iter().map(|s| f64::from(s.values[1]) - gain * f64::from(s.values[0])).collect();
    let limit = DEVIATIONS * (DEVIATION_PER_MEDIAN * middle(&differences)).max(ROUNDED);
    let weight = |difference: &f64| (1.0 - (difference / limit).powi(2)).max(0.0).powi(2);
    let weights = differences.iter().map(weight).collect();
    (differences, weights)
}

/// The median of the absolute differences.
fn middle(differences: &[f64]) -> f64 {
    median(&mut differences.iter().map(|d| d.abs()).collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// Slope of a grey image at a position: across and down, per pixel.
fn slope(grey: &Image, x: f64, y: f64) -> [f64; 2] {
    let at = |dx: f64, dy: f64| f64::from(grey.value_at(x + dx, y + dy, 0));
    [(at(1.0, 0.0) - at(-1.0, 0.0)) / 2.0, (at(0.0, 1.0) - at(0.0, -1.0)) / 2.0]
}
