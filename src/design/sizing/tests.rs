use super::*;
use crate::design::history_errors::{HistoryErrors, best_taps};
use crate::design::least_errors::shortest;
use crate::lmi::sampled;
use crate::spec::DesignSpec;

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
    let refused = Sizing::new(&open, &problem, Comparison { observer: &follow, stop: &stop }).unwrap_err();
    assert_eq!(refused, DesignError::Stopped);
}

const THESIS: &str = "{ num = [0.25], den = [1.0, 1.0, 0.25] }";
const STEEP: &str = r#"{ family = "butterworth", order = 6, cutoff = 0.12 }"#;

/// One pole p: the covariance of the output is (p / 2) e^{-p |t|}, and the nearest sample before and after
/// determine the best estimate.
#[test]
fn one_pole_has_closed_forms() {
    let p = 0.3;
    let problem = problem("{ num = [0.3], den = [1.0, 0.3] }", 4, &[1.5]);
    // Samples at -1.5, -5.5, -9.5.
    let errors = HistoryErrors::new(&problem, 3, -30..=6).unwrap();
    let power = 0.5 * p;
    assert!((errors.power / power - 1.0).abs() < 1e-12);
    let apart = |t: f64| power * (1.0 - (-2.0 * p * t).exp());
    for ahead in 0..=6 {
        let exact = apart(ahead as f64 + 1.5);
        assert!((errors.at(ahead) / exact - 1.0).abs() < 1e-5, "{ahead}");
    }
    for before in 0..20 {
        let exact = apart(before as f64 + 0.5);
        assert!((errors.at(-10 - before) / exact - 1.0).abs() < 1e-5, "{before}");
    }
    // Between two samples, a and b away.
    for (instant, a, b) in [(-2, 3.5, 0.5), (-4, 1.5, 2.5), (-7, 2.5, 1.5)] {
        let (u, v) = ((-p * a).exp(), (-p * b).exp());
        let exact = power * (1.0 - u * u) * (1.0 - v * v) / (1.0 - u * u * v * v);
        assert!((errors.at(instant) / exact - 1.0).abs() < 1e-5, "{instant}: {exact}");
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
            let reach = LeastErrors::new(&problem, taps, 0..=taps + 6).unwrap();
            for latency in 0..=taps + 6 {
                let expected = least_mean_square(&problem, latency, taps).sqrt();
                let found = reach.rms(latency);
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
    let grid = sampled::Problem::new(points.collect(), lags);
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

/// The whole error of the mean-square optimum of a spec, in double precision and without a smoother.
fn whole(spec: &Spec, latency: usize, taps: usize) -> f64 {
    least_mean_square(&Problem::new(&with_usual_noise(spec), latency).unwrap(), latency, taps).sqrt()
}

#[test]
fn the_latency_is_the_shortest_within_a_tenth_of_a_decibel() {
    for design in ["method = \"fir\", taps = 16", "method = \"h2\", taps = 16", "taps = 16, noise = 1e-2"] {
        let spec = spec(design);
        let errors: Vec<f64> = (0..20).map(|latency| whole(&spec, latency, 16)).collect();
        let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
        let chosen = latency(&spec).unwrap();
        assert!(errors[chosen] < 1.0117 * least, "{design}: {chosen} {errors:?}");
        assert!(
            errors[..chosen].iter().all(|error| *error > 1.0115 * least),
            "{design}: {chosen} {errors:?}"
        );
    }
}

/// With much noise waiting for later samples brings little.
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
        let found = |taps: usize| {
            let problem = Problem::new(&open, 9).unwrap();
            let power = HistoryErrors::new(&problem, 1, 0..=0).unwrap().power;
            10.0 * (power / least_mean_square(&problem, 9, taps)).log10()
        };
        assert!(
            found(taps) >= snr && found(taps - 1) < snr,
            "{taps} taps: {} {}",
            found(taps),
            found(taps - 1)
        );
    }
}

#[test]
fn an_snr_that_is_out_of_reach_is_refused_with_the_best_one() {
    let open = Spec { latency: Some(9), ..spec("target_snr_db = 200, method = \"h2\", noise = 1e-3") };
    let refused = Sizing::of(&open).unwrap_err();
    let DesignError::SnrOutOfReach { wanted, best, latency } = refused else { panic!("{refused}") };
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
    let DesignError::SnrOutOfReach { best: most, .. } = open(200.0) else { panic!("200 dB are reached") };
    let refused = open(most - 0.01);
    let DesignError::SnrMissed { wanted, best, .. } = refused else { panic!("{refused}") };
    assert!(best < wanted && best > most - 10.0, "{refused}");
}

#[test]
fn taps_that_are_left_open_are_almost_as_good_as_any() {
    for (design, channels) in [("method = \"fir\"", 1), ("method = \"fir\", noise = 1e-3", 2)] {
        let mut open = spec(design);
        open.channels.truncate(channels);
        let Sizing { latency, taps, .. } = Sizing::of(&open).unwrap();
        // Over all latencies: those far from the chosen one are worse.
        let least = |taps: usize, latencies: std::ops::RangeInclusive<usize>| {
            latencies.map(|latency| whole(&open, latency, taps)).fold(f64::INFINITY, f64::min)
        };
        let best = least(120, 55..=60);
        let near = latency.saturating_sub(6)..=latency + 8;
        let (enough, fewer) = (least(taps, near.clone()), least(taps - 1, near));
        assert!(enough <= 1.0105 * best && fewer > 1.0095 * best, "{taps} taps: {enough} {fewer} {best}");
        assert!(whole(&open, latency, taps) <= 1.0117 * enough, "{latency}");
    }
}

/// The latencies of banks for a signal in a band, against the whole errors of banks of 48 taps at every
/// latency as the lifted plant has them.
#[test]
fn signals_in_a_band_get_the_latency_that_their_samples_need() {
    struct System {
        latency: usize,
        ratio: usize,
        band: f64,
        filter: &'static str,
        delays: &'static [f64],
    }
    let (fourth, second) = (
        "family = \"butterworth\", order = 4, cutoff = 0.1875",
        "family = \"butterworth\", order = 2, cutoff = 0.4167",
    );
    let systems = [
        System { latency: 12, ratio: 2, band: 1.0 / 6.0, filter: fourth, delays: &[1.2, 0.6] },
        System { latency: 22, ratio: 2, band: 0.4167, filter: second, delays: &[1.2, 0.6] },
        System { latency: 19, ratio: 4, band: 0.375, filter: second, delays: &[2.7, 1.9, 1.1, 0.2] },
        System {
            latency: 7,
            ratio: 2,
            band: 0.425,
            filter: "family = \"rc\", cutoff = 0.6",
            delays: &[1.3, 0.8, 0.1],
        },
    ];
    for System { latency: expected, ratio, band, filter, delays } in systems {
        let channels: Vec<String> = delays.iter().map(|delay| format!("{{ delay = {delay} }}")).collect();
        let text = format!(
            "fast_period = 1.0\nratio = {ratio}\nsignal = {{ band = {band} }}\n\
             target = {{ filter = {{ {filter} }} }}\nchannel = [{}]\ndesign = {{ method = \"h2\", taps = 48 }}\n",
            channels.join(", ")
        );
        let spec = Spec::from_toml(&text, "spec.toml").unwrap();
        let error = |latency: usize| {
            let problem = Problem::new(&with_usual_noise(&spec), latency).unwrap();
            let plant = LiftedPlant::new(&problem);
            let instants = -(latency as i64)..=ratio as i64 - 1 - latency as i64;
            let best = best_taps(&problem, 48 / ratio, instants).unwrap();
            let tap = |i: usize, n: usize| best[n % ratio][i][n / ratio];
            let taps = (0..delays.len()).map(|i| (0..48).map(|n| tap(i, n)).collect()).collect();
            whole_error(&plant, &SynthesisFilters::Fir(taps)).unwrap()
        };
        let errors: Vec<f64> = (0..32).map(error).collect();
        assert_eq!((shortest(&errors), latency(&spec)), (expected, Ok(expected)), "{band}: {errors:?}");
        // A gamma method takes the same one.
        let fir = Spec { design: DesignSpec::new(Method::Fir, Some(48)), ..spec };
        assert_eq!(latency(&fir), Ok(expected));
    }
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
        let chosen = LeastErrors::causal(&problem).unwrap().shortest();
        let all = LeastErrors::new(&problem, 3600, 0..=512).unwrap();
        let excess = 20.0 * (all.rms(chosen) / all.least()).log10();
        assert!(excess < 0.1025, "latency {chosen}: {excess} dB, {} is enough", all.shortest());
    }
}
