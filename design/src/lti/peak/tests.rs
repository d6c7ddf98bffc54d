use super::*;
use hybank_linalg::Mat;

fn siso(a: Mat, b: Vec<f64>, c: Vec<f64>, d: f64) -> StateSpace {
    let n = b.len();
    StateSpace::new(a, Mat::from_vec(n, 1, b), Mat::from_vec(1, n, c), Mat::from_element(1, 1, d))
}

#[test]
fn one_pole_peaks_at_dc_or_nyquist() {
    for pole in [0.0_f64, 0.5, -0.5, 0.999, -0.999999] {
        let peak = hinf_norm(&siso(Mat::from_element(1, 1, pole), vec![1.0], vec![3.0], 0.0)).unwrap();
        let exact = 3.0 / (1.0 - pole.abs());
        assert!((peak.gain - exact).abs() < 1e-9 * exact, "{pole}: {peak:?}");
    }
}

/// Gains within 1e-6 of one another at 0, at pi and at a peak between them that is the highest by a little:
/// what a minimax design looks like. Both real centres of the Cayley transform are all but singular then.
#[test]
fn the_highest_of_nearly_equal_peaks_is_found() {
    // y_n = Chebyshev polynomial of cos w as a delay line: T_4(cos w) = cos 4w has gain 1 at 0, pi/4, pi/2
    // ..; a small cos 2w lifts pi/2 and lowers the rest: 1 - t at 0 and pi, 1 + t at pi/2 for cos 4w - t
    // cos 2w.
    for t in [0.0, 1e-9, 1e-7, 3e-5, 1e-3] {
        let n = 8;
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
        let mut b = vec![0.0; n];
        b[0] = 1.0;
        // e^{-4jw} (cos 4w - t cos 2w) = (1 - t e^{-2jw} - t e^{-6jw} + e^{-8jw}) / 2.
        let mut c = vec![0.0; n];
        (c[1], c[5], c[7]) = (-0.5 * t, -0.5 * t, 0.5);
        let peak = hinf_norm(&siso(a, b, c, 0.5)).unwrap();
        assert!((peak.gain - 1.0 - t).abs() < 2e-9, "{t}: {peak:?}");
    }
}

#[test]
fn a_needle_between_grid_points_is_found() {
    // Poles r e^{+-j w0}, r = 1 - 1e-7: the peak is far narrower than any grid.
    let (r, w0) = (1.0 - 1e-7, 1.2345_f64);
    let a = Mat::from_row_slice(2, 2, &[2.0 * r * w0.cos(), -r * r, 1.0, 0.0]);
    let system = siso(a, vec![1.0, 0.0], vec![1.0, 0.0], 0.0);
    let peak = hinf_norm(&system).unwrap();
    // |1/((1 - p/z)(1 - p*/z))| at w0 is 1/((1-r) |1 - r e^{-2 j w0}|).
    let exact = 1.0 / ((1.0 - r) * (Complex::new(1.0, 0.0) - Complex::from_polar(r, -2.0 * w0)).norm());
    assert!((peak.gain - exact).abs() < 1e-6 * exact, "{peak:?} {exact}");
}

#[test]
fn delay_lines_are_all_pass() {
    for n in 1..12 {
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
        let mut b = vec![0.0; n];
        b[0] = 2.0;
        let mut c = vec![0.0; n];
        c[n - 1] = 1.5;
        let peak = hinf_norm(&siso(a, b, c, 0.0)).unwrap();
        assert!((peak.gain - 3.0).abs() < 1e-12, "{n}: {peak:?}");
    }
}

#[test]
fn the_level_set_beats_a_fine_grid() {
    for seed in 0..8 {
        let n = 4 + seed;
        let raw = Mat::from_fn(n, n, |i, j| ((i * 37 + j * 11 + seed * 101 + 5) as f64).sin());
        let a = &raw * (0.97 / hybank_linalg::spectral_radius(&raw).unwrap());
        let b = Mat::from_fn(n, 3, |i, j| ((i * 3 + j + seed) as f64).cos());
        let c = Mat::from_fn(2, n, |i, j| ((i + j * 5 + seed) as f64).sin());
        let system = StateSpace::new(a, b, c, Mat::from_element(2, 3, 0.1));
        let peak = hinf_norm(&system).unwrap();
        let response = FrequencyResponse::new(&system);
        let grid = (0..=20_000)
            .map(|k| unexplained_gain(&response.at_frequency(PI * f64::from(k) / 20_000.0), 0).unwrap())
            .fold(0.0, f64::max);
        assert!(peak.gain >= grid * (1.0 - 1e-12), "{seed}: {peak:?} {grid}");
        assert!(peak.gain <= grid * (1.0 + 1e-4), "{seed}: {peak:?} {grid}");
    }
}

#[test]
fn a_measurement_that_is_a_copy_explains_everything() {
    let a = Mat::from_row_slice(2, 2, &[0.5, 0.3, -0.3, 0.5]);
    let c = Mat::from_row_slice(2, 2, &[1.0, 0.5, 2.0, 1.0]);
    let system = StateSpace::new(a, Mat::identity(2, 2), c, Mat::zeros(2, 2));
    assert!(unexplained_peak(&system, 1).unwrap().gain < 1e-14);
}

#[test]
fn unstable_systems_are_refused() {
    let system = siso(Mat::from_element(1, 1, 1.0), vec![1.0], vec![1.0], 0.0);
    assert!(matches!(hinf_norm(&system), Err(LtiError::Unstable { .. })));
}

/// Rounding as large as evaluations of delicate error systems show, and three first points whose parabola
/// has its vertex all but in the middle one, though the top is elsewhere.
#[test]
fn refinement_reaches_the_peak_whatever_the_first_points() {
    let no_states = (Mat::zeros(0, 0), Mat::zeros(0, 1), Mat::zeros(1, 0), Mat::zeros(1, 1));
    let empty = StateSpace::new(no_states.0, no_states.1, no_states.2, no_states.3);
    for seed in 0..4000u32 {
        let die = |k: u32| (f64::from((seed * 16 + k) * (k + 1)) * 0.618_033_988_749_894_9).fract();
        let (width, middle) = (10f64.powf(-4.0 * die(0) - 0.5), 1.0 + die(1));
        let (skew, sharp) = (0.1 * (die(2) - 0.5), 10f64.powf(-6.0 * die(3)));
        let vertex = 0.1 * 10f64.powf(-10.0 * die(4)) * (die(5) - 0.5);
        // In x = (w - middle) / width the parabola through -1, 0 and 1 has its vertex at `vertex`.
        let slope = skew + 2.0 * vertex;
        let gain = |x: f64| 1.0 - sharp * (x * x + skew * x * x * x - slope * x);
        let evaluations = std::cell::Cell::new(0);
        let response = |w: f64| {
            evaluations.set(evaluations.get() + 1);
            let rounding = 3e-12 * ((w * 1e15).rem_euclid(7.0) / 3.5 - 1.0);
            CMat::from_element(1, 1, Complex::new(gain((w - middle) / width) + rounding, 0.0))
        };
        let search = PeakSearch::new(&empty, 0, &response, Vec::new());
        let look = |x: f64| search.at(middle + x * width).unwrap();
        let top = refine(|w| search.at(w), [look(-1.0), look(0.0), look(1.0)], SETTINGS.flat_gain).unwrap();
        let exact = gain(slope / (1.0 + (1.0 + 3.0 * skew * slope).sqrt()));
        assert!((top.gain - exact).abs() < 1e-11, "{seed}: {top:?} {exact}");
        assert!(evaluations.get() <= 20, "{seed}: {} evaluations", evaluations.get());
    }
}

/// A peak that is 1e6 times as high as the gain beside it, and the same with other units of input and
/// output: the accuracy is that of the closed form, and the digits are the same.
#[test]
fn accuracy_is_relative_to_the_peak_whatever_the_units() {
    let (r, w0) = (1.0 - 1e-6, 0.7654_f64);
    let a = Mat::from_row_slice(2, 2, &[2.0 * r * w0.cos(), -r * r, 1.0, 0.0]);
    // |1/((1 - p/z)(1 - p*/z))|^2 is largest where cos w = (1 + r^2) cos w0 / (2 r), and there
    // 1 / ((1 - r^2) sin w0).
    let exact = 1.0 / ((1.0 - r * r) * w0.sin());
    let mut gains = Vec::new();
    for (input, output) in [(1.0, 1.0), (1e-9, 1.0), (1e9, 1e-9), (1e9, 1e9), (1e-9, 1e-9)] {
        let system = siso(
            a.clone(),
            vec![input, 0.0],
            vec![2.0 * r * w0.cos() * output, -r * r * output],
            input * output,
        );
        gains.push(hinf_norm(&system).unwrap().gain / (input * output));
    }
    for gain in &gains {
        assert!((gain / exact - 1.0).abs() < SETTINGS.accuracy, "{gain} {exact}");
        assert!((gain / gains[0] - 1.0).abs() < 10.0 * SETTINGS.flat_gain, "{gains:?}");
    }
}
