//! What improvements are said to gain, against what they turn out to gain.

use super::*;
use hybank_ibr::analysis::Advice;
use hybank_ibr::analysis::Predictor;
use hybank_ibr::pipeline::rectified;

fn measured(rig: &Rig, which: &[usize], truth: &Image) -> f64 {
    let image = rectified::render(&rig.views(which), 0.5, &RenderSettings::default()).unwrap().image;
    mean(errors(&image, truth))
}

/// A third camera where the advice puts it, and disparities with half the rounding step: the estimate with
/// the gain taken off is the measured error within a quarter.
#[test]
fn gains_are_found_again() {
    let exact = synthetic(&[0.0, 1.0, 0.5, 0.25, 0.75]);
    for (noise, step) in [(3.0, 0.25), (1.5, 1.0)] {
        let rig = degraded(&exact, noise, step);
        let views = rig.views(&[0, 1]);
        let predictor = Predictor::new(&views, &RenderSettings::default()).unwrap();
        let now = predictor.at(&0.5, views[0].image.size()).unwrap();
        let advice = Advice::on(&predictor, &0.5, views[0].image.size(), &now).unwrap();
        let (truth, before) = (&rig.images[2], now.totals().estimate);
        let view = advice.view.clone().unwrap();
        let third = rig.positions.iter().position(|p| *p == view.place[0]).unwrap();
        let with_view = measured(&rig, &[0, 1, third], truth);
        let finer = degraded(&exact, noise, step / 2.0);
        let with_bit = measured(&finer, &[0, 1], &finer.images[2]);
        let bit = advice.depth_bit.unwrap();
        println!(
            "noise {noise}, step {step}: estimate {before:.2}, measured {:.2}; third view at {:?}: {:.2}, {with_view:.2}; \
             a bit of depth: {:.2}, {with_bit:.2}; {:?} halved {:.2}",
            measured(&rig, &[0, 1], truth),
            view.place,
            before - view.falls,
            before - bit,
            advice.cause,
            advice.halved
        );
        assert!(((before - view.falls) / with_view - 1.0).abs() < 0.25, "{advice:?}");
        assert!(((before - bit) / with_bit - 1.0).abs() < 0.25, "{advice:?}");
        assert!((advice.halved - now.causes[advice.cause as usize] / 2.0).abs() < 1e-12);
    }
}
