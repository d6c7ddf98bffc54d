//! Why views contradict each other: usual mistakes are tried, and the one that makes the views agree is
//! named.

use super::SourceView;
use crate::camera::Camera;
use crate::depth::{DepthMap, Measure};
use crate::pipeline::Agreement;
use crate::propagate::{View, Viewpoint};

/// Share of agreeing points from which on nothing is looked for.
const GOOD: f64 = 0.85;

/// How much more points a mistake that is named explains.
const BETTER: f64 = 0.15;

/// Factors by which depths or disparities are wrong: units and the scales of whole numbers.
const FACTORS: [f64; 12] = [1e3, 1e-3, 1e2, 1e-2, 10.0, 0.1, 256.0, 1.0 / 256.0, 4.0, 0.25, 2.0, 0.5];

/// Views as they would be without a mistake, and the mistake in words.
struct Suspicion<P> {
    views: Vec<SourceView<P>>,
    said: String,
}

/// Cameras whose usual mistakes are known.
pub trait Suspected: Viewpoint {
    /// What else than the numbers of the maps and their order may be wrong.
    fn mistakes(views: &[SourceView<Self>]) -> Vec<(Vec<SourceView<Self>>, String)>;
}

/// What seems to be wrong with views, if they agree better without it.
pub(super) fn diagnosis<P: Suspected>(views: &[SourceView<P>]) -> Option<String> {
    // Views that share no points contradict each other most.
    let now = if views.len() > 1 { agreement(views).unwrap_or(0.0) } else { 1.0 };
    if now >= GOOD {
        return None;
    }
    let tried = suspicions(views).into_iter().filter_map(|s| Some((agreement(&s.views)?, s.said)));
    let (would, said) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (would >= now + BETTER).then(|| {
        let [now, would] = [now, would].map(|share| 100.0 * share);
        format!("{said}: views agree at {now:.0} % of the points as they are, and would at {would:.0} %")
    })
}

/// Mean share of the points at which neighbouring views agree.
fn agreement<P: Viewpoint>(views: &[SourceView<P>]) -> Option<f64> {
    let shown: Vec<View<'_, P>> = views.iter().map(SourceView::view).collect();
    let pairs = Agreement::of(&shown).pairs;
    (!pairs.is_empty()).then(|| pairs.iter().map(|pair| pair.share).sum::<f64>() / pairs.len() as f64)
}

fn suspicions<P: Suspected>(views: &[SourceView<P>]) -> Vec<Suspicion<P>> {
    let mut all: Vec<Suspicion<P>> = FACTORS.iter().map(|factor| scaled(views, *factor)).collect();
    if let [first, second] = views {
        let exchanged = |maps: bool| {
            let (mut a, mut b) = (first.clone(), second.clone());
            match maps {
                true => std::mem::swap(&mut a.map, &mut b.map),
                false => std::mem::swap(&mut a.image, &mut b.image),
            }
            vec![a, b]
        };
        if first.image.size() == second.image.size() {
            all.push(Suspicion { views: exchanged(true), said: "the maps seem to be exchanged".into() });
            all.push(Suspicion {
                views: exchanged(false),
                said: "the photographs seem to be exchanged".into(),
            });
        }
    }
    all.extend(turned(views));
    all.extend(P::mistakes(views).into_iter().map(|(views, said)| Suspicion { views, said }));
    all
}

/// Photographs whose pixels lie as the sensor has them. Those with a map of another shape were refused.
fn turned<P: Viewpoint>(views: &[SourceView<P>]) -> impl Iterator<Item = Suspicion<P>> {
    let is_square = views.iter().all(|view| view.image.width() == view.image.height());
    let turns = [
        (2, "be upside down"),
        (1, "lie on their side and to need a quarter turn to the right"),
        (3, "lie on their side and to need a quarter turn to the left"),
    ];
    let turned = |quarters: usize| {
        views
            .iter()
            .map(move |view| SourceView { image: view.image.turned(quarters), ..view.clone() })
            .collect()
    };
    turns.into_iter().take(if is_square { 3 } else { 1 }).map(move |(quarters, what)| Suspicion {
        views: turned(quarters),
        said: format!(
            "the photographs seem to {what}, as where a program ignores how the camera was held (EXIF)"
        ),
    })
}

fn scaled<P: Viewpoint>(views: &[SourceView<P>], factor: f64) -> Suspicion<P> {
    let with = |view: &SourceView<P>| SourceView {
        map: changed(&view.map, |_, v| v * factor as f32),
        ..view.clone()
    };
    let measure = views.first().map(|view| view.map.measure());
    let what = if measure == Some(Measure::Disparity) { "disparities" } else { "depths" };
    let too = if factor > 1.0 { "small" } else { "large" };
    let said = format!("the {what} seem to be {} times too {too}", factor.max(1.0 / factor).round());
    Suspicion { views: views.iter().map(with).collect(), said }
}

fn changed(map: &DepthMap, value: impl Fn(usize, f32) -> f32) -> DepthMap {
    map.with_values(map.size(), map.data().iter().enumerate().map(|(p, v)| value(p, *v)).collect())
}

impl Suspected for f64 {
    fn mistakes(views: &[SourceView<Self>]) -> Vec<(Vec<SourceView<Self>>, String)> {
        let turned = views.iter().map(|view| SourceView { camera: -view.camera, ..view.clone() });
        vec![(turned.collect(), "the positions seem to be exchanged".into())]
    }
}

impl Suspected for Camera {
    fn mistakes(views: &[SourceView<Self>]) -> Vec<(Vec<SourceView<Self>>, String)> {
        let along_axis = |view: &SourceView<Self>| {
            let (width, centre) = (view.map.width(), view.camera.centre());
            let length = |p: usize| {
                (view.camera.unproject((p % width) as f64, (p / width) as f64, 1.0) - centre).norm() as f32
            };
            SourceView { map: changed(&view.map, |p, v| v / length(p)), ..view.clone() }
        };
        let mut all = vec![(
            views.iter().map(along_axis).collect(),
            "the depths seem to be ray lengths, not depths along the axis".into(),
        )];
        let with = |change: &dyn Fn(&Self) -> Option<Self>| -> Option<Vec<SourceView<Self>>> {
            views
                .iter()
                .map(|view| Some(SourceView { camera: change(&view.camera)?, ..view.clone() }))
                .collect()
        };
        let said = "the cameras seem to map to the world, not from it";
        all.extend(with(&Camera::inverted).map(|views| (views, said.into())));
        for (factor, said) in [(0.5, "twice too long"), (2.0, "half as long as they should be")] {
            let said = format!("the focal lengths seem to be {said}");
            all.extend(with(&|camera: &Self| camera.zoomed(factor)).map(|views| (views, said)));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};

    const SIZE: (usize, usize) = (160, 120);

    fn cameras() -> [Camera; 3] {
        [0.0, 0.6, 1.2].map(|place| {
            let mut matrix = rig_camera(place, SIZE);
            let turn = nalgebra::Rotation3::from_euler_angles(0.02, 0.06 * (place - 0.6), 0.01);
            let m = matrix.fixed_columns::<3>(0) * turn.matrix();
            matrix.fixed_columns_mut::<3>(0).copy_from(&m);
            Camera::metric(matrix, false).unwrap()
        })
    }

    fn views() -> Vec<SourceView<Camera>> {
        let view = |camera: Camera| {
            let (image, map) = SyntheticScene::default().view(&camera, SIZE);
            SourceView { image, map, camera }
        };
        cameras().map(view).to_vec()
    }

    fn named(views: &[SourceView<Camera>]) -> String {
        diagnosis(views).unwrap_or_default()
    }

    #[test]
    fn mistakes_are_named() {
        assert_eq!(named(&views()), "");
        let mut wrong = views();
        wrong.iter_mut().for_each(|view| view.map = changed(&view.map, |_, v| v / 1000.0));
        assert!(named(&wrong).starts_with("the depths seem to be 1000 times too small"), "{}", named(&wrong));
        let mut rays = views();
        for view in &mut rays {
            let centre = view.camera.centre();
            let length = |p: usize| {
                let at = ((p % SIZE.0) as f64, (p / SIZE.0) as f64);
                (view.camera.unproject(at.0, at.1, 1.0) - centre).norm() as f32
            };
            view.map = changed(&view.map, |p, v| v * length(p));
        }
        let said = named(&rays);
        assert!(said.is_empty() || said.contains("ray lengths"), "{said}");
        let mut inverse = views();
        inverse.iter_mut().for_each(|view| view.camera = view.camera.inverted().unwrap());
        assert!(named(&inverse).contains("map to the world"), "{}", named(&inverse));
        let mut turned = views();
        turned.iter_mut().for_each(|view| view.image = view.image.turned(2));
        assert!(named(&turned).contains("upside down"), "{}", named(&turned));
        let mut zoomed = views();
        zoomed.iter_mut().for_each(|view| view.camera = view.camera.zoomed(2.0).unwrap());
        assert!(named(&zoomed).contains("twice too long"), "{}", named(&zoomed));
    }

    #[test]
    fn square_photographs_on_their_side_are_named() {
        let view = |place: f64| {
            let camera = Camera::metric(rig_camera(place, (120, 120)), false).unwrap();
            let (image, map) = SyntheticScene::default().view(&camera, (120, 120));
            SourceView { image, map, camera }
        };
        for (quarters, back) in [(1, "to the left"), (3, "to the right")] {
            let mut views = [0.0, 0.6].map(view);
            views.iter_mut().for_each(|view| view.image = view.image.turned(quarters));
            let said = named(&views);
            assert!(said.contains("on their side") && said.contains(back), "{quarters}: {said}");
        }
    }

    #[test]
    fn exchanged_parts_of_a_rig_are_named() {
        let view = |place: f64| {
            let camera = Camera::metric(rig_camera(place, SIZE), false).unwrap();
            let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
            SourceView { image, map: rig_disparity(&depth, SIZE.0), camera: place }
        };
        let right = || vec![view(0.0), view(1.0)];
        assert_eq!(diagnosis(&right()), None);
        let mut turned = right();
        turned.iter_mut().for_each(|view| view.camera = 1.0 - view.camera);
        assert!(diagnosis(&turned).unwrap().contains("positions seem to be exchanged"));
        let mut coarse = right();
        coarse.iter_mut().for_each(|view| view.map = changed(&view.map, |_, v| 4.0 * v));
        assert!(diagnosis(&coarse).unwrap().starts_with("the disparities seem to be 4 times too large"));
    }
}
