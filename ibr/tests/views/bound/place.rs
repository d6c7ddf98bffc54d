//! The ranking of sets of views by their predicted errors, against the errors of the rendered views.

use super::*;
use hybank_ibr::analysis::Choice;
use hybank_ibr::pipeline::rectified;

/// Rank correlation (Spearman).
fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (ranks(a), ranks(b));
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let covariance: f64 = a.iter().zip(&b).map(|(x, y)| (x - middle) * (y - middle)).sum();
    covariance / a.iter().map(|x| (x - middle) * (x - middle)).sum::<f64>()
}

/// What was found of the choice of `count` out of the places of a scene.
struct Found {
    rank: f64,
    /// The error of the choice over the least of all sets, and the mean of all over the least.
    loss: f64,
    mean_loss: f64,
}

/// Predicts and renders every set of `count` views; the last view of the rig is the virtual one.
fn examined(rig: &Rig, count: usize) -> Found {
    let places = rig.images.len() - 1;
    let (camera, truth) = (rig.positions[places], &rig.images[places]);
    let all: Vec<usize> = (0..places).collect();
    let settings = RenderSettings::default();
    let predictor = Predictor::new(&rig.views(&all), &settings).unwrap();
    let views = predictor.views();
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let estimate = |chosen: &[usize]| {
        let some: Vec<_> = chosen.iter().map(|i| views[*i]).collect();
        predictor.estimate_from(&some, &camera, truth.size())
    };
    let error = |chosen: &[usize]| {
        mean(errors(&rectified::render(&rig.views(chosen), camera, &settings).unwrap().image, truth))
    };
    let choice = Choice::least(
        places,
        count,
        |chosen| {
            predicted.push(estimate(chosen)?);
            measured.push(error(chosen));
            Ok::<f64, hybank_ibr::pipeline::RenderError>(predicted[predicted.len() - 1])
        },
        &|_| (),
    );
    let choice = choice.unwrap().unwrap();
    let least = measured.iter().copied().fold(f64::MAX, f64::min);
    assert!(choice.is_exhaustive && choice.tried == measured.len());
    Found {
        rank: spearman(&predicted, &measured),
        loss: error(&choice.views) / least,
        mean_loss: mean(measured.iter().copied()) / least,
    }
}

/// Three of eight random places, with noise of one and a half grey levels and disparities in steps of a
/// quarter of a pixel; all 56 sets of two scenes, or of ten with `HYBANK_SLOW=1`. In the second scene noise
/// is most of the error, so the sets are nearly alike and hard to rank.
#[test]
fn predicted_and_true_errors_rank_sets_of_views_alike() {
    let scenes = if trials::is_slow("rankings of sets of views in ten scenes") { 10 } else { 2 };
    let mut all = Vec::new();
    for seed in 0..scenes {
        let mut random = Random(seed + 1);
        let mut positions: Vec<f64> = (0..8).map(|_| 4.0 * random.part() - 1.5).collect();
        positions.push(0.5);
        let rig = degraded(&synthetic(&SyntheticScene::varied(seed), &positions, (160, 120)), 1.5, 0.25);
        let found = examined(&rig, 3);
        println!(
            "scene {seed}: rank correlation {:.3}, error of the choice / least {:.3}, of the mean set {:.3}",
            found.rank, found.loss, found.mean_loss
        );
        all.push(found);
    }
    let rank = mean(all.iter().map(|found| found.rank));
    println!("rank correlation {rank:.3} in the mean");
    // 0.75 in the first two scenes, and 0.67 in ten, in one of which the ranks hardly agree (0.21).
    assert!(rank > if scenes > 2 { 0.6 } else { 0.7 }, "{rank}");
    let loss = all.iter().map(|found| found.loss).fold(1.0, f64::max);
    assert!(loss < 1.05, "{loss}");
}
