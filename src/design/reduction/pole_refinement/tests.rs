use super::*;
use crate::design::Problem;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::spec::Spec;

fn plant() -> LiftedPlant {
    let text = "fast_period = 1.0\nratio = 2\nlatency = 10\n\
        target = { filter = { num = [0.25], den = [1.0, 1.0, 0.25] } }\n\
        channel = [{ delay = 1.2 }, { delay = 0.6 }]\ndesign = { method = \"iir\" }";
    LiftedPlant::new(&Problem::new(&Spec::from_toml(text, "spec.toml").unwrap(), 10).unwrap())
}

/// Both gradients against differences.
#[test]
fn gradients_are_those_of_the_error() {
    let plant = plant();
    let never = Stop::default();
    let samples = PlantSamples::new(&plant, &never).unwrap();
    for lags in [0, 1] {
        let start = Dynamics {
            lags,
            a: Mat::from_row_slice(2, 2, &[0.3, 0.2, -0.1, 0.1]),
            b: Mat::from_row_slice(2, 2, &[1.0, -0.5, 0.25, 0.75]),
        };
        let x = packed(&start.a, &start.b);
        for error_and_gradient in [worst_case_gradient, mean_square_gradient] {
            let (_, gradient) = error_and_gradient(&samples, &start).unwrap();
            for k in 0..x.len() {
                let step = 1e-4;
                let at = |sign: f64| {
                    let mut moved = x.clone();
                    moved[k] += sign * step;
                    error_and_gradient(&samples, &unpacked(&start, &moved)).unwrap().0
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step);
                let gap = (difference - gradient[k]).abs();
                assert!(gap < 1e-3 * gradient.norm(), "{lags}, {k}: {difference} {}", gradient[k]);
            }
        }
    }
}
