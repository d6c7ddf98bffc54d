//! Which views are near to a point of the virtual view: by the angle between the rays, and by resolution
//! (Buehler et al., Unstructured Lumigraph Rendering, SIGGRAPH 2001).

use crate::camera::Camera;
use nalgebra::Vector3;

/// Views that share in a point; the weights of the others fall to nothing.
pub(crate) const SHARING: usize = 4;

/// Views of a rendering at least, if there are so many: those beyond [`SHARING`] show what hides from these.
pub(crate) const AT_HAND: usize = 8;

/// Angle in radians that is as bad as a resolution lower by a factor of e.
const COARSENESS: f64 = 0.2;

/// Angles below this one are alike: far below the angle of a pixel.
pub(super) const SAME: f64 = 1e-5;

/// Points along the width and the height of the virtual view for which views are chosen.
const GRID: [usize; 2] = [6, 4];

/// A camera with the size of its image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) camera: Camera,
    pub(crate) size: (usize, usize),
}

impl Placed {
    fn shows(&self, point: &Vector3<f64>) -> bool {
        let (x, y, depth) = self.camera.project(point);
        let inside = |at: f64, side: usize| at > -0.5 && at < side as f64 - 0.5;
        depth > 0.0 && inside(x, self.size.0) && inside(y, self.size.1)
    }
}

/// Centre and focal length of a camera.
#[derive(Debug, Clone, Copy)]
struct Eye {
    centre: Vector3<f64>,
    focal: f64,
}

impl Eye {
    fn of(camera: &Camera) -> Self {
        Self { centre: camera.centre(), focal: camera.determinant().abs().sqrt() }
    }
}

/// Views around a virtual camera.
#[derive(Debug, Clone)]
pub(crate) struct Nearness {
    target: Eye,
    views: Vec<Eye>,
}

impl Nearness {
    pub(crate) fn new(views: impl Iterator<Item = Camera>, target: &Camera) -> Self {
        Self { target: Eye::of(target), views: views.map(|camera| Eye::of(&camera)).collect() }
    }

    /// How many views there are.
    pub(crate) fn count(&self) -> usize {
        self.views.len()
    }

    /// Distance of a view from the virtual camera for a point: the angle between the rays, and more where
    /// the view is coarser.
    #[inline]
    pub(crate) fn distance(&self, view: usize, point: &Vector3<f64>) -> f64 {
        let Eye { centre, focal } = self.views[view];
        let (here, there) = (self.target.centre - point, centre - point);
        // Squares: every sample asks for this, and each root takes as long as ten products.
        let (near, far) = (here.norm_squared(), there.norm_squared());
        let coarser = self.target.focal * self.target.focal * far / (focal * focal * near);
        let coarseness = if coarser > 1.0 { COARSENESS / 2.0 * coarser.ln() } else { 0.0 };
        SAME + angle(here.dot(&there) / (near * far).sqrt()) + coarseness
    }
}

/// The angle of a cosine, too small by two thousandths at a right angle. Every sample asks for one per view,
/// and the function of the library takes a twentieth of a film.
#[inline]
fn angle(cosine: f64) -> f64 {
    // The sine of half the angle, squared, and the series of its inverse.
    let square = (0.5 * (1.0 - cosine)).clamp(0.0, 1.0);
    let series = 1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0)));
    2.0 * square.sqrt() * series
}

/// The views, by number, from which a virtual view is rendered whose surfaces lie at about these depths: for
/// each of some of its points the nearest that show it, and more up to [`AT_HAND`]; the `most` nearest if
/// that is given. Those that are nearest to the centre where none shows anything.
pub(crate) fn choose(views: &[Placed], target: &Placed, depths: &[f64], most: Option<usize>) -> Vec<usize> {
    let nearness = Nearness::new(views.iter().map(|view| view.camera), &target.camera);
    // Of each view the sum of its parts in the points, and whether it is one of those that share in a point.
    let mut found = vec![(0.0, false); views.len()];
    for point in points(target, depths) {
        let shows = |view: &usize| views[*view].shows(&point);
        let mut order: Vec<(f64, usize)> =
            (0..views.len()).filter(shows).map(|view| (nearness.distance(view, &point), view)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (rank, (_, view)) in order.into_iter().enumerate() {
            found[view].0 += 0.5_f64.powi(rank.min(1000) as i32);
            found[view].1 |= rank < SHARING;
        }
    }
    let away = |view: usize| (views[view].camera.centre() - target.camera.centre()).norm();
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by(|a, b| found[*b].0.total_cmp(&found[*a].0).then(away(*a).total_cmp(&away(*b))));
    let is_chosen = |(rank, view): &(usize, usize)| match most {
        Some(most) => *rank < most,
        None => *rank < AT_HAND || found[*view].1,
    };
    let mut chosen: Vec<usize> =
        order.into_iter().enumerate().filter(is_chosen).map(|(_, view)| view).collect();
    chosen.sort_unstable();
    chosen
}

/// Points that the virtual view shows if its surfaces lie at these depths.
fn points(target: &Placed, depths: &[f64]) -> Vec<Vector3<f64>> {
    let at = |k: usize, count: usize, side: usize| (k as f64 + 0.5) / count as f64 * side as f64 - 0.5;
    let of_depth = |depth: &f64| {
        let point = |k: usize| {
            let (x, y) = (at(k % GRID[0], GRID[0], target.size.0), at(k / GRID[0], GRID[1], target.size.1));
            target.camera.unproject(x, y, *depth)
        };
        (0..GRID[0] * GRID[1]).map(point).collect::<Vec<_>>()
    };
    depths.iter().flat_map(of_depth).filter(|point| point.iter().all(|v| v.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Matrix3x4, Rotation3};

    const SIZE: (usize, usize) = (80, 60);

    /// A camera that looks along z after a turn about the vertical axis.
    fn placed(centre: [f64; 3], turn: f64, focal: f64) -> Placed {
        let k = Matrix3::new(focal, 0.0, 39.5, 0.0, focal, 29.5, 0.0, 0.0, 1.0);
        let r = Rotation3::from_euler_angles(0.0, turn, 0.0);
        let mut pose = Matrix3x4::zeros();
        pose.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        pose.set_column(3, &-(r * Vector3::from(centre)));
        Placed { camera: Camera::metric(k * pose, false).unwrap(), size: SIZE }
    }

    /// Of many views along a line those around the virtual camera; one that looks away is never taken.
    #[test]
    fn the_views_around_are_chosen() {
        let mut views: Vec<Placed> =
            (0..40).map(|k| placed([f64::from(k) * 0.1, 0.0, 0.0], 0.0, 80.0)).collect();
        views.push(placed([2.0, 0.0, 0.0], 3.0, 80.0));
        let target = placed([2.04, 0.0, 0.0], 0.0, 80.0);
        assert_eq!(choose(&views, &target, &[4.0], Some(2)), [20, 21]);
        let usual = choose(&views, &target, &[3.0, 6.0], None);
        assert_eq!(usual, (17..25).collect::<Vec<_>>());
    }

    /// The right border is shown by one far view only: it is taken beside those that show the middle.
    #[test]
    fn a_view_that_alone_shows_a_part_is_chosen() {
        let mut views: Vec<Placed> =
            (0..30).map(|k| placed([-1.0 - 0.01 * f64::from(k), 0.0, 0.0], 0.0, 80.0)).collect();
        views.push(placed([9.0, 0.0, 0.0], 0.0, 80.0));
        let chosen = choose(&views, &placed([0.0; 3], 0.0, 24.0), &[6.0], None);
        assert!(chosen.contains(&30) && chosen.len() < 20, "{chosen:?}");
    }

    #[test]
    fn angles_are_those_of_cosines() {
        for degrees in 0..=180 {
            let want = f64::from(degrees).to_radians();
            let most = if degrees <= 60 { 1e-3 * want } else { 0.2 * want };
            assert!((angle(want.cos()) - want).abs() <= most + 1e-7, "{degrees}");
        }
    }

    #[test]
    fn coarse_views_are_farther() {
        let nearness = Nearness::new(
            [placed([0.3, 0.0, 0.0], 0.0, 80.0), placed([0.3, 0.0, 0.0], 0.0, 20.0)].iter().map(|v| v.camera),
            &placed([0.0; 3], 0.0, 80.0).camera,
        );
        let point = Vector3::new(0.0, 0.0, 5.0);
        assert!((nearness.distance(0, &point) - (0.3_f64 / 5.0).atan()).abs() < 1e-3);
        assert!(nearness.distance(1, &point) > nearness.distance(0, &point) + 0.25);
    }
}
