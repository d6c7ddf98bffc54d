use super::*;
use crate::design::fir_errors::FirErrors;
use crate::design::length::TargetFigure;
use crate::design::root_covariance::RootCovariance;
use crate::lmi::sampled;
use crate::tests::designed;
use hybank_core::spec::{DesignSpec, FilterSpec};

/// The problem of a spec in normalised time with the same filter everywhere.
fn problem(filter: &str, ratio: usize, delays: &[f64]) -> Problem {
    let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
    let text = format!(
        "fast_period = 1.0\nratio = {ratio}\ntarget = {{ filter = {filter} }}\nchannel = [{}]\n",
        channels.join(", ")
    );
    Problem::new(&Spec::from_toml(&text, "spec.toml").unwrap(), 0).unwrap()
}

fn latency(spec: &Spec) -> Result<usize, DesignError> {
    Sizing::of(spec).map(|sizing| sizing.latency)
}

/// The comparison does not go on with a design that was ended early.
#[test]
fn a_choice_ends_with_the_design_that_was_ended() {
    let stop = Stop::default();
    let design = "method = \"fir\", target_snr_db = 40, noise = 1e-2";
    let open = Spec { latency: Some(9), ..spec(design) };
    let follow = |designs| {
        if designs == 0 {
            stop.now()
        }
    };
    let problem = Problem::before_sizing(&open).unwrap();
    let refused = Sizing::new(&open, &problem, SizingControl { observer: &follow, stop: &stop }).unwrap_err();
    assert_eq!(refused, DesignError::Stopped);
}

const THESIS: &str = "{ num = [0.25], den = [1.0, 1.0, 0.25] }";
const STEEP: &str = r#"{ family = "butterworth", order = 6, cutoff = 0.12 }"#;

/// One pole p: the covariance of the output is (p / 2) e^{-p |t|}, and the nearest sample before and after
/// determine the best estimate.
#[test]
fn one_pole_has_closed_forms() {
    /// Of the power of one pole, what aliases beyond eight fast rates that stand for others miss.
    const MISSED: f64 = 5e-3;
    let p = 0.3;
    let problem = problem("{ num = [0.3], den = [1.0, 0.3] }", 4, &[1.5]);
    // Samples at -1.5, -5.5, -9.5.
    let errors = RootCovariance::new(&problem, &[], 3, -30..=6);
    let power = 0.5 * p;
    assert!((errors.power / power - 1.0).abs() < MISSED);
    let apart = |t: f64| power * (1.0 - (-2.0 * p * t).exp());
    for ahead in 0..=6 {
        let exact = apart(ahead as f64 + 1.5);
        assert!((errors.error(3, ahead) - exact).abs() < MISSED * power, "{ahead}");
    }
    for before in 0..20 {
        let exact = apart(before as f64 + 0.5);
        assert!((errors.error(3, -10 - before) - exact).abs() < MISSED * power, "{before}");
    }
    // Between two samples, a and b away.
    for (instant, a, b) in [(-2, 3.5, 0.5), (-4, 1.5, 2.5), (-7, 2.5, 1.5)] {
        let (u, v) = ((-p * a).exp(), (-p * b).exp());
        let exact = power * (1.0 - u * u) * (1.0 - v * v) / (1.0 - u * u * v * v);
        assert!((errors.error(3, instant) - exact).abs() < MISSED * power, "{instant}: {exact}");
    }
}

/// The least squares over the frequencies of the lifted plant are another route to the same errors.
#[test]
fn the_errors_are_those_of_the_least_squares_taps() {
    let cases = [
        (THESIS, 2, vec![1.2, 0.6], 9),
        (STEEP, 4, vec![3.1, 1.9, 1.05, 0.0], 14),
        (STEEP, 3, vec![4.4, 0.3], 7),
    ];
    for (filter, ratio, delays, taps) in cases {
        for noise in [0.0, 1e-4, 0.03] {
            let mut problem = problem(filter, ratio, &delays);
            problem.noise = (0..delays.len()).map(|i| (noise * (1.0 + i as f64)).powi(2)).collect();
            problem.channels[0].gain = -1.5;
            let reach = FirErrors::new(&problem, &[], taps + 2, 0..=taps + 6);
            for latency in 0..=taps + 6 {
                let expected = least_mean_square(&problem, latency, taps).sqrt();
                let found = reach.square(BankSize { taps, latency }).sqrt();
                let close = (found - expected).abs() < 1e-5 * expected + 1e-9;
                assert!(close, "noise {noise}, latency {latency}: {found} {expected}");
            }
        }
    }
}

/// By QR on a grid of frequencies that is exact for the periodic part of the error.
fn least_mean_square(problem: &Problem, latency: usize, taps: usize) -> f64 {
    let plant = LiftedPlant::new(&Problem { latency, ..problem.clone() });
    let ratio = problem.ratio;
    let lags: Vec<usize> = (0..ratio).map(|p| taps.saturating_sub(p).div_ceil(ratio)).collect();
    let count = 256;
    let points = (0..=count).map(|k| plant.at(std::f64::consts::PI * k as f64 / count as f64));
    let grid = sampled::SampledProblem::new(points.collect(), lags);
    let weight = |k: usize| if k == 0 || k == count { 0.5 } else { 1.0 } / count as f64;
    let weights: Vec<f64> = (0..=count).map(weight).collect();
    let square = sampled::MeanSquareObjective { weights, noise: problem.noise.clone() };
    let taps = sampled::least_squares(&grid, &square, 1e-13).unwrap();
    grid.mean_square(&taps, &square) / ratio as f64
}

/// A spec without latency of two converters, with the `[design]` of a method.
fn spec(design: &str) -> Spec {
    let text = format!(
        "fast_period = 1.0\nratio = 2\ntarget = {{ filter = {STEEP} }}\n\
         channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ {design} }}\n"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// The whole error of the mean-square optimum of a spec, on another route.
fn whole(spec: &Spec, latency: usize, taps: usize) -> f64 {
    least_mean_square(&Problem::new(spec, latency).unwrap(), latency, taps).sqrt()
}

#[test]
fn the_latency_is_that_of_the_least_error() {
    for design in ["method = \"fir\", taps = 16", "method = \"h2\", taps = 16", "taps = 16, noise = 1e-2"] {
        let spec = spec(design);
        let errors: Vec<f64> = (0..20).map(|latency| whole(&spec, latency, 16)).collect();
        let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
        let chosen = latency(&spec).unwrap();
        assert!(errors[chosen] <= least * (1.0 + 1e-6), "{design}: {chosen} {errors:?}");
    }
}

/// With much noise waiting for later samples brings little.
/// Also where the least error is far below what the rounding of its parts resolves.
#[test]
fn recursive_banks_wait_longer_with_more_bits() {
    let latency = |bits: u32| {
        let text = format!(
            "fast_rate = 48000\nratio = 2\nsignal = {{ band = 18000 }}\n\
             target = {{ filter = {{ family = \"butterworth\", order = 4, cutoff = 14000 }} }}\n\
             channel = [{{ delay = 0, bits = {bits} }}, {{ delay = \"18.75 us\", bits = {bits} }}]\n\
             design = {{ method = \"iir\" }}"
        );
        Sizing::of(&Spec::from_toml(&text, "spec.toml").unwrap()).unwrap().latency
    };
    let all = [12, 16, 20, 24].map(latency);
    assert!(all.is_sorted() && all[0] >= 8 && all[3] > all[1], "{all:?}");
}

#[test]
fn recursive_banks_wait_less_where_there_is_noise() {
    let chosen = |design: &str| latency(&spec(design)).unwrap();
    let (quiet, noisy) = (chosen("method = \"h2\""), chosen("method = \"h2\", noise = 0.03"));
    assert!(quiet > noisy && noisy > 0, "{quiet} {noisy}");
    assert_eq!(chosen("method = \"iir\""), quiet);
}

#[test]
fn as_many_taps_are_chosen_as_the_snr_needs() {
    for (design, snr) in
        [("method = \"fir\", target_snr_db = 50", 50.0), ("target_snr_db = 65, method = \"h2\"", 65.0)]
    {
        let mut open = spec(design);
        open.latency = Some(9);
        let Sizing { taps, .. } = Sizing::of(&open).unwrap();
        let [enough, fewer] = [taps, taps - 1].map(|taps| {
            let problem = Problem::new(&open, 9).unwrap();
            let power = RootCovariance::new(&problem, &[], 1, 0..=0).power;
            10.0 * (power / least_mean_square(&problem, 9, taps)).log10()
        });
        assert!(enough >= snr && fewer < snr, "{taps} taps: {enough} {fewer}");
    }
}

#[test]
fn an_snr_that_is_out_of_reach_is_refused_with_the_best_one() {
    let open = Spec { latency: Some(9), ..spec("target_snr_db = 200, method = \"h2\", noise = 1e-3") };
    let refused = Sizing::of(&open).unwrap_err();
    let DesignError::FigureOutOfReach { figure: TargetFigure::Snr, wanted, best, latency } = refused else {
        panic!("{refused}")
    };
    assert!(wanted == 200.0 && latency == 9 && (30.0..70.0).contains(&best), "{refused}");
}

/// The best SNR of all banks is that of the mean-square optimum. The bank of least gamma was returned
/// without it, whatever its length.
#[test]
fn an_snr_that_banks_of_least_gamma_miss_is_refused_in_words() {
    let open = |snr: f64| {
        let design = format!("method = \"fir\", target_snr_db = {snr:?}, noise = 1e-2");
        Sizing::of(&Spec { latency: Some(9), ..spec(&design) }).unwrap_err()
    };
    let DesignError::FigureOutOfReach { best: most, .. } = open(200.0) else { panic!("200 dB are reached") };
    let refused = open(most - 0.01);
    let DesignError::FigureMissed { wanted, best, .. } = refused else { panic!("{refused}") };
    assert!(best < wanted && best > most - 10.0, "{refused}");
}

/// Where images do not fall below the noise, because the front ends let everything pass.
#[test]
fn taps_that_are_left_open_are_almost_as_good_as_any() {
    for design in ["method = \"fir\"", "method = \"fir\", noise = 1e-5"] {
        let mut open = spec(design);
        open.target = FilterSpec::TransferFunction { num: vec![0.25], den: vec![1.0, 1.0, 0.25] };
        open.channels.iter_mut().for_each(|channel| channel.filter = open.target.clone());
        let Sizing { latency, taps, .. } = Sizing::of(&open).unwrap();
        // Over all latencies: those far from the chosen one are worse.
        let least = |taps: usize, latencies: std::ops::RangeInclusive<usize>| {
            latencies.map(|latency| whole(&open, latency, taps)).fold(f64::INFINITY, f64::min)
        };
        let best = least(120, 55..=60);
        let near = latency.saturating_sub(6)..=latency + 8;
        let (enough, fewer) = (least(taps, near.clone()), least(taps - 1, near));
        assert!(enough <= 1.0105 * best && fewer > 1.0095 * best, "{taps} taps: {enough} {fewer} {best}");
        assert!(whole(&open, latency, taps) <= (1.0 + 1e-6) * enough, "{latency}");
    }
}

/// Two converters with a band, whose images depend on the length.
fn in_band(design: &str) -> Spec {
    let text = format!(
        "fast_period = 1.0\nratio = 2\nsignal = {{ band = 0.4 }}\n\
         target = {{ filter = {{ family = \"butterworth\", order = 2, cutoff = 0.4167 }} }}\n\
         channel = [{{ delay = 1.2 }}, {{ delay = 0.6 }}]\ndesign = {{ method = \"h2\", {design} }}\n"
    );
    Spec::from_toml(&text, "spec.toml").unwrap()
}

/// The figures of the bank itself: its largest image, its SNR, and the noise in it.
fn figures_of(spec: &Spec, taps: usize) -> crate::figures::Figures {
    let mut sized = spec.clone();
    sized.design = sized.design.with_taps(Some(taps));
    let bank = designed(&sized).bank;
    crate::figures::Figures::new(&bank).unwrap()
}

#[test]
fn the_fewest_taps_have_the_images_that_are_asked_for() {
    let spec = in_band("target_sfdr_db = 75");
    let taps = Sizing::of(&spec).unwrap().taps;
    let image = |taps: usize| figures_of(&spec, taps).image.unwrap().db.0;
    assert!(image(taps) <= -75.0 && image(taps - 1) > -75.0, "{taps}: {} {}", image(taps), image(taps - 1));
}

#[test]
fn open_taps_bring_images_below_the_noise() {
    let spec = Spec { design: DesignSpec::new(Method::Fir, None), ..in_band("taps = 1, noise = 1e-4") };
    let taps = Sizing::of(&spec).unwrap().taps;
    let below = |taps: usize| {
        let quiet = in_band(&format!("taps = {taps}"));
        let mut bank = designed(&quiet).bank;
        bank.spec = Some(Spec { channels: spec.channels.clone(), ..quiet });
        let figures = crate::figures::Figures::new(&bank).unwrap();
        -figures.image.unwrap().db.0 - figures.snr.noise_db.unwrap().0
    };
    assert!(below(taps) >= 20.0 && below(taps - 1) < 20.0, "{taps}: {} {}", below(taps), below(taps - 1));
}

/// A wide low-pass beside a resonance with 1 / damping radians: under noise the error falls by little at
/// each doubling of the latency, and by more than 0.1 dB in all.
#[test]
fn a_slow_gain_at_long_latencies_counts() {
    struct Resonance {
        damping: f64,
        gain: f64,
        noise: f64,
    }
    let resonances = [
        Resonance { damping: 0.004, gain: 3.0, noise: 1.0 },
        Resonance { damping: 0.001, gain: 5.0, noise: 0.5 },
        Resonance { damping: 0.002, gain: 3.0, noise: 3.0 },
    ];
    for Resonance { damping, gain, noise } in resonances {
        let (pole, square, width) = (0.5, 0.64, 2.0 * gain * damping);
        // pole / (s + pole) + width s / (s^2 + 2 damping s + square)
        let num = [pole + width, 2.0 * pole * damping + pole * width, pole * square];
        let den = [1.0, 2.0 * damping + pole, square + 2.0 * damping * pole, pole * square];
        let mut problem = problem(&format!("{{ num = {num:?}, den = {den:?} }}"), 1, &[0.3]);
        problem.noise = vec![noise * noise];
        let causal = CausalErrors::new(&problem).unwrap();
        let (chosen, excess) =
            (causal.shortest(), 20.0 * (causal.rms(causal.shortest()) / causal.least()).log10());
        assert!(excess < 0.1025 && causal.longest() > 3 * chosen, "latency {chosen}: {excess} dB");
        // FIR banks of many more frames than the latency are as good.
        let latencies = [0, 1, 3, 20, 50];
        let fir = FirErrors::new(&problem, &[], 400, 0..=50);
        for latency in latencies {
            let [one, other] = [causal.rms(latency), fir.square(BankSize { taps: 400, latency }).sqrt()];
            assert!((one / other - 1.0).abs() < 0.02, "latency {latency}: {one} {other}");
        }
    }
}

/// The errors of causal banks are those of long FIR banks at every latency, for several channels and phases.
#[test]
fn causal_errors_are_those_of_long_histories() {
    for noise in [1e-3, 0.1] {
        let mut problem = problem(STEEP, 3, &[4.4, 0.3]);
        problem.noise = vec![noise * noise, 4.0 * noise * noise];
        let causal = CausalErrors::new(&problem).unwrap();
        let fir = FirErrors::new(&problem, &[], 180, 0..=40);
        for latency in 0..=causal.longest().min(40) {
            let [one, other] = [causal.rms(latency), fir.square(BankSize { taps: 180, latency }).sqrt()];
            assert!((one / other - 1.0).abs() < 1e-3, "noise {noise}, latency {latency}: {one} {other}");
        }
    }
}
