//! Golden values of the mean-square optimum.
//!
//! Origin: computed apart from this code, from covariances alone: for each phase the normal equations of
//! the samples that the taps reach, with covariances by the matrix exponential. They are the rms of the
//! error per fast sample, signal and noise together, for white noise of unit density at the analog input.

use crate::design::filters::lifted;
use crate::design::problem::Problem;
use crate::design::{Design, LiftedPlant, analyze_mean};
use crate::figures::Figures;
use crate::lti::gramian::h2_norm;
use crate::tests::designed;
use crate::tests::front_ends::specs::{alike, low_pass_at, thesis_filter};
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{
    ChannelSpec, DesignSpec, ErrorPoint, Family, FilterSpec, Method, OneOrEach, Spec, UncertaintySpec,
};
use hybank_core::units::{FastPeriods, Hertz, Seconds};
use hybank_linalg::Complex;
use std::f64::consts::PI;

/// A channel of [`spec`]: delay in fast periods, noise, filter.
struct Converter {
    delay: f64,
    noise: f64,
    filter: FilterSpec,
}

struct Case {
    ratio: usize,
    latency: usize,
    taps: Option<usize>,
    target: FilterSpec,
    converters: Vec<Converter>,
}

impl Case {
    fn spec(&self) -> Spec {
        let channel = |converter: &Converter| ChannelSpec {
            noise: converter.noise,
            ..ChannelSpec::new(Seconds(converter.delay), converter.filter.clone())
        };
        Spec {
            channels: self.converters.iter().map(channel).collect(),
            design: DesignSpec::new(Method::H2, self.taps),
            ..alike(&self.target, self.ratio, self.latency, &[])
        }
    }

    /// Rms of the error and of the noise together.
    fn rms(&self) -> f64 {
        total(&designed(&self.spec()))
    }
}

fn total(design: &Design) -> f64 {
    let mean = analyze_mean(&design.bank).unwrap();
    mean.rms_error.hypot(mean.output_noise)
}

fn thesis(noise: f64, taps: Option<usize>) -> Case {
    let converter = |delay| Converter { delay, noise, filter: thesis_filter() };
    let converters = vec![converter(1.2), converter(0.6)];
    Case { ratio: 2, latency: 10, taps, target: thesis_filter(), converters }
}

fn butterworth(order: usize, cutoff: f64) -> FilterSpec {
    low_pass_at(Family::Butterworth, order, cutoff)
}

/// A converter that samples every `period` fast periods, as virtual channels of the frame of `frame`.
fn virtual_channels(frame: f64, period: f64, converter: &Converter) -> Vec<Converter> {
    let count = (frame / period).round() as usize;
    let of = |j: usize| Converter {
        delay: converter.delay - j as f64 * period,
        filter: converter.filter.clone(),
        ..*converter
    };
    (0..count).map(of).collect()
}

/// All delays and the latency later by the least whole number that makes every delay positive.
fn shifted(mut case: Case) -> Case {
    let least = case.converters.iter().map(|converter| converter.delay).fold(0.0, f64::min);
    let shift = (-least).ceil();
    case.converters.iter_mut().for_each(|converter| converter.delay += shift);
    case.latency += shift as usize;
    case
}

/// The same converters with rates of their own, each with the period of its samples, and a latency without
/// the wait for a frame.
fn own_rates(case: &Case, converters: &[(&Converter, f64)]) -> Spec {
    let channel = |&(converter, period): &(&Converter, f64)| ChannelSpec {
        rate: Some(Hertz(1.0 / period)),
        noise: converter.noise,
        ..ChannelSpec::new(Seconds(converter.delay), converter.filter.clone())
    };
    let spec = Spec { channels: converters.iter().map(channel).collect(), ..case.spec() };
    Spec { latency: Some(case.latency + spec.wait()), ..spec }
}

/// The golden number of virtual channels written by hand and of rates, whose banks have the same taps.
fn check_rates(mut case: Case, converters: &[(&Converter, f64)], golden: f64) {
    let frame = case.ratio as f64;
    case.converters = converters
        .iter()
        .flat_map(|(converter, period)| virtual_channels(frame, *period, converter))
        .collect();
    let own = designed(&own_rates(&case, converters));
    let by_hand = shifted(case);
    check(&by_hand, golden);
    assert!((total(&own) - golden).abs() < 1e-10, "{} instead of {golden}", total(&own));
    let by_hand = designed(&by_hand.spec()).bank;
    assert_eq!((own.bank.latency, own.bank.channel_count()), (by_hand.latency, converters.len()));
    let (SynthesisFilters::Fir(a), SynthesisFilters::Fir(b)) = (&own.bank.filters, &by_hand.filters) else {
        panic!("taps")
    };
    let apart = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(a.len() == b.len() && apart < 1e-9, "{apart}");
}

fn check(case: &Case, golden: f64) {
    let found = case.rms();
    // Ten decimals are printed.
    assert!((found - golden).abs() < 1e-10, "{found:.12} instead of {golden}");
}

#[test]
fn the_thesis_example_with_noise() {
    for (noise, golden) in
        [(0.0, 0.0271078137), (1e-3, 0.0271259258), (1e-2, 0.0288178494), (1e-1, 0.0751746502)]
    {
        check(&thesis(noise, Some(22)), golden);
        // The recursive bank sees all of the past, and 11 frames nearly are all of it.
        let recursive = thesis(noise, None).rms();
        assert!(recursive < golden + 1e-10 && recursive > golden * 0.999, "{noise}: {recursive} {golden}");
    }
}

/// 24 kHz and 16 kHz into 48 kHz.
#[test]
fn two_rates_are_virtual_channels() {
    let goldens = [
        (0.0, [0.0528751882, 0.0470057306, 0.0469987756]),
        (1e-2, [0.0595395839, 0.0550370025, 0.0550324897]),
    ];
    for (noise, row) in goldens {
        for (latency, golden) in [5, 12, 20].into_iter().zip(row) {
            let (a, b) = (butterworth(4, 9.0 / 48.0), butterworth(4, 7.0 / 48.0));
            let first = Converter { delay: 4.3, noise, filter: a.clone() };
            let second = Converter { delay: 4.1, noise, filter: b };
            let case = Case { ratio: 6, latency, taps: Some(48), target: a, converters: Vec::new() };
            check_rates(case, &[(&first, 2.0), (&second, 3.0)], golden);
        }
    }
}

/// 100 Hz and 60 Hz into 300 Hz; then one of 120 Hz with other noise.
#[test]
fn many_virtual_channels() {
    let filter = butterworth(2, 20.0 / 300.0);
    for (periods, noise, golden) in [
        ([3.0, 5.0], [1e-3; 2], 0.0460010907),
        ([3.0, 5.0], [1e-2; 2], 0.0482508302),
        ([2.5, 3.0], [1e-2, 1e-3], 0.0314942102),
    ] {
        let converter =
            |k: usize| Converter { delay: [0.4, 1.7][k], noise: noise[k], filter: filter.clone() };
        let (target, converters) = (filter.clone(), Vec::new());
        let case = Case { ratio: 15, latency: 20, taps: Some(90), target, converters };
        check_rates(case, &[(&converter(0), periods[0]), (&converter(1), periods[1])], golden);
    }
}

/// A Butterworth band-pass from the poles of its low-pass, both cut-offs in hertz.
fn band_pass(order: usize, low: f64, high: f64) -> FilterSpec {
    let (width, square) = (2.0 * PI * (high - low), 4.0 * PI * PI * low * high);
    let pole = |k: usize| Complex::from_polar(1.0, PI * (0.5 + (k as f64 + 0.5) / order as f64));
    let pair = |k: usize| {
        let half = pole(k) * (0.5 * width);
        let root = (half * half - square).sqrt();
        [half + root, half - root]
    };
    FilterSpec::ZeroPoleGain {
        zeros: vec![[0.0, 0.0]; order],
        poles: (0..order).flat_map(pair).map(|p| [p.re, p.im]).collect(),
        gain: width.powi(order as i32),
    }
}

#[test]
fn undersampling_of_an_intermediate_frequency() {
    let filter = band_pass(3, 62.0 / 80.0, 78.0 / 80.0);
    for (noise, golden) in [(0.0, 0.0141802688), (1e-3, 0.0142127481)] {
        let converter = |delay| Converter { delay, noise, filter: filter.clone() };
        let converters = vec![converter(1.03), converter(0.0)];
        check(&Case { ratio: 2, latency: 24, taps: Some(64), target: filter.clone(), converters }, golden);
    }
}

/// Banks for a band, against `numpy.linalg.lstsq` on the rows `sqrt(w) Phi_i e^{2 pi j f t}` of 300
/// Gauss-Legendre nodes over the band, in double precision: SNR for a flat spectrum there, and the largest
/// image.
#[test]
fn banks_for_a_band_are_those_of_least_squares() {
    let two_for_two = "ratio = 2\nchannel = [{ delay = 1.0062 }, { delay = 0.25 }]\n";
    let four =
        "ratio = 4\nchannel = [{ delay = 3.0062 }, { delay = 1.9955 }, { delay = 1.0038 }, { delay = 0 }]\n";
    let apart = "ratio = 2\nchannel = [{ delay = 1.2 }, { delay = 0.6 }]\n";
    for (converters, order, cutoff, band, sizes, snr, image) in [
        (two_for_two, 4, 0.45, 0.45, "latency = 32\ndesign.taps = 64", 114.386, 92.384),
        (four, 4, 0.45, 0.45, "latency = 25\ndesign.taps = 48", 123.110, 101.257),
        (apart, 2, 0.4167, 0.41666666, "latency = 24\ndesign.taps = 48", 129.179, 110.834),
    ] {
        let text = format!(
            "fast_rate = 1.0\n{converters}{sizes}\ndesign.method = \"h2\"\nsignal.band = {band}\n\
             target.filter = {{ family = \"butterworth\", order = {order}, cutoff = {cutoff} }}\n"
        );
        let spec = Spec::from_toml(&text, "spec.toml").unwrap();
        let figures = Figures::new(&designed(&spec).bank).unwrap();
        let [found, spur] = [figures.snr.total_db.0, -figures.image.unwrap().db.0];
        let off = [found - snr, spur - image];
        assert!(off.iter().all(|off| off.abs() < 0.1), "{found} {spur} instead of {snr} {image}");
    }
}

/// No change of a tap lowers the error: with gains, noise of one channel only, a repeated channel, fewer
/// taps than phases, and channels that are older by whole periods.
#[test]
fn no_other_taps_are_better() {
    let filter = butterworth(3, 0.2);
    let converter = |delay, noise| Converter { delay, noise, filter: filter.clone() };
    for taps in [1, 2, 5, 9] {
        let converters =
            vec![converter(0.3, 0.0), converter(0.3, 0.02), converter(7.3, 0.01), converter(1.9, 0.0)];
        let case = Case { ratio: 3, latency: 4, taps: Some(taps), target: filter.clone(), converters };
        let mut spec = case.spec();
        (spec.channels[1].gain, spec.channels[3].gain) = (-1.7, 1e-3);
        let designed = designed(&spec);
        let least = total(&designed);
        let SynthesisFilters::Fir(best) = &designed.bank.filters else { panic!("taps") };
        for (i, n) in (0..4).flat_map(|i| (0..taps).map(move |n| (i, n))) {
            for change in [-1e-3, 1e-3] {
                let mut bank = designed.bank.clone();
                let mut changed = best.clone();
                changed[i][n] += change / spec.channels[i].gain;
                bank.filters = SynthesisFilters::Fir(changed);
                let mean = analyze_mean(&bank).unwrap();
                let other = mean.rms_error.hypot(mean.output_noise);
                assert!(other >= least * (1.0 - 1e-13), "{taps} taps, {i} {n}: {other} {least}");
            }
        }
    }
}

/// The mean square of error and noise of a bank whose delays are off by so much, by its error system.
fn square_at(design: &Design, errors: [f64; 2]) -> f64 {
    let point = ErrorPoint::of_delays(errors.map(FastPeriods).to_vec());
    let problem = Problem::of_bank(&design.bank).unwrap().perturbed(&point);
    let plant = LiftedPlant::new(&problem).with_noise();
    let filters = lifted(&design.bank.filters, 2);
    h2_norm(&plant.error_system(&filters)).unwrap().powi(2) / 2.0
}

/// The mean over Gaussian errors of the second delay, by Gauss-Legendre rules of four points between the
/// kinks: wherever a sample coincides with another instant, at multiples of 0.2.
fn mean_over_second_delay(design: &Design, deviation: f64) -> f64 {
    let (step, nodes) =
        (0.2, [(0.339981043584856, 0.652145154862546), (0.861136311594053, 0.347854845137454)]);
    let count = (8.0 * deviation / step).ceil() as i32;
    let (mut sum, mut weights) = (0.0, 0.0);
    for k in -count..count {
        for (node, weight) in nodes.iter().flat_map(|&(x, w)| [(x, w), (-x, w)]) {
            let x = step * (f64::from(k) + 0.5 + 0.5 * node);
            let weight = weight * (-0.5 * (x / deviation).powi(2)).exp();
            sum += weight * square_at(design, [0.0, x]);
            weights += weight;
        }
    }
    (sum / weights).sqrt()
}

/// The thesis example with Gaussian errors of the delays, by half-widths of 95 % intervals.
fn uncertain(noise: f64, deviations: [f64; 2]) -> Design {
    let mut spec = thesis(noise, Some(22)).spec();
    let halves = deviations.map(|deviation| Seconds(1.959963984540054 * deviation));
    spec.uncertainty = Some(UncertaintySpec {
        delay: Some(OneOrEach::Each(halves.to_vec())),
        reference: Some(0),
        ..UncertaintySpec::default()
    });
    designed(&spec)
}

/// Origin as above, with cross-spectra times the characteristic functions.
#[test]
fn uncertain_delays_are_averaged_over() {
    for (deviation, golden) in [(0.5, 0.0432626514), (3.0, 0.0498582889)] {
        let design = uncertain(1e-3, [0.0, deviation]);
        let found = mean_over_second_delay(&design, deviation);
        assert!((found - golden).abs() < 2e-10, "{deviation}: {found} {golden}");
        // One channel alone leaves 0.04988204, and the bank for exact delays far more.
        let nominal = designed(&thesis(1e-3, Some(22)).spec());
        let careless = mean_over_second_delay(&nominal, deviation);
        assert!(found < 0.04988204 && careless > 0.0574, "{found} {careless}");
    }
    // Both: the Gauss rule of five points in each delay.
    let design = uncertain(1e-2, [0.05, 0.05]);
    let nodes = [
        (0.0, 8.0 / 15.0),
        (1.355626179974266, 0.2220759220056126),
        (2.856970013872806, 0.01125741132772069),
    ];
    let signed = |(x, w): (f64, f64)| if x == 0.0 { vec![(x, w)] } else { vec![(x, w), (-x, w)] };
    let nodes: Vec<(f64, f64)> = nodes.into_iter().flat_map(signed).collect();
    let mut sum = 0.0;
    for (first, second) in nodes.iter().flat_map(|a| nodes.iter().map(move |b| (a, b))) {
        sum += first.1 * second.1 * square_at(&design, [0.05 * first.0, 0.05 * second.0]);
    }
    assert!((sum.sqrt() - 0.0297463283).abs() < 2e-10, "{}", sum.sqrt());
}

/// Without taps a mean-square design over uncertain delays is FIR all the same, and says so.
#[test]
fn uncertain_delays_make_h2_fir() {
    let mut spec = thesis(1e-3, None).spec();
    spec.uncertainty =
        Some(UncertaintySpec { delay: Some(OneOrEach::Same(Seconds(0.1))), ..UncertaintySpec::default() });
    let design = designed(&spec);
    assert!(design.sizing.taps_chosen && matches!(design.bank.filters, SynthesisFilters::Fir(_)));
    spec.design.order = Some(3);
    assert!(spec.check().is_err());
}
