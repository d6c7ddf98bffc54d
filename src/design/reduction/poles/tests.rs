use super::*;
use crate::design::Problem;
use crate::design::equivalence::BlockedPlant;
use crate::spec::Spec;

fn plant() -> BlockedPlant {
    let text = "fast_period = 1.0\nratio = 2\nlatency = 10\n\
        target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n\
        channel = [{ delay = 1.2 }, { delay = 0.6 }]\ndesign = { method = \"iir\" }";
    BlockedPlant::new(&Problem::new(&Spec::from_toml(text, "spec.toml").unwrap(), 10).unwrap())
}

/// Both slopes against differences.
#[test]
fn slopes_are_those_of_the_error() {
    let plant = plant();
    let samples = Samples::new(&plant).unwrap();
    for ticks in [0, 1] {
        let start = Dynamics {
            ticks,
            a: Mat::from_row_slice(2, 2, &[0.3, 0.2, -0.1, 0.1]),
            b: Mat::from_row_slice(2, 2, &[1.0, -0.5, 0.25, 0.75]),
        };
        let x = packed(&start.a, &start.b);
        for slope in [worst_case_slope, mean_square_slope] {
            let (_, gradient) = slope(&samples, &start).unwrap();
            for k in 0..x.len() {
                let step = 1e-4;
                let at = |sign: f64| {
                    let mut moved = x.clone();
                    moved[k] += sign * step;
                    slope(&samples, &unpacked(&start, &moved)).unwrap().0
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let gap = (difference - gradient[k]).abs();
                assert!(gap < 1e-3 * gradient.norm(), "{ticks}, {k}: {difference} {}", gradient[k]);
            }
        }
    }
}
