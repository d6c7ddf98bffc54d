//! Records with known figures.

mod complex;

use super::*;
use crate::linalg::Complex;
use crate::random::Random;
use crate::sine_fit::SineFitError;
use std::f64::consts::{PI, TAU};

const RATE: Hertz = Hertz(1e6);

fn tone(count: usize, cycles: f64, amplitude: f64) -> Vec<f64> {
    (0..count).map(|n| amplitude * (TAU * cycles * n as f64 + 0.7).cos()).collect()
}

/// Rounded to `bits` over -1 .. 1.
fn quantised(samples: &[f64], bits: i32) -> Vec<f64> {
    let step = 2f64.powi(1 - bits);
    samples.iter().map(|x| ((x / step - 0.5).round() + 0.5) * step).collect()
}

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance, "{got} instead of {want}");
}

fn caused(measured: &Measurement, cause: Cause) -> &Spur {
    measured.spurs.iter().find(|spur| spur.causes.contains(&cause)).unwrap()
}

#[test]
fn a_tone_off_a_bin_has_the_bits_of_the_coherent_one() {
    // So many that the quantisation errors of two records differ by less than what is tested.
    let count = 16_384;
    // The coherent value from the known tone, without any fit: 1645 cycles, prime to 16384.
    let clean = tone(count, 1645.0 / count as f64, 0.999);
    let error: f64 = clean.iter().zip(quantised(&clean, 12)).map(|(x, q)| (q - x).powi(2)).sum();
    let sinad = 10.0 * (0.5 * 0.999f64.powi(2) / (error / count as f64)).log10();
    let coherent = (sinad - 1.760_913) / 6.020_600;
    for off in [0.0, 0.1, 0.25, 0.5, -0.37] {
        let samples = quantised(&tone(count, (1645.0 + off) / count as f64, 0.999), 12);
        for window in [Window::None, Window::Hann, Window::Bh7] {
            let measured = measure(&samples, RATE, &Settings { window, ..Settings::default() }).unwrap();
            close(measured.enob, coherent, 0.02);
            close(measured.enob_full_scale, measured.enob - 0.999f64.log2(), 1e-4);
        }
    }
    close(coherent, 12.0, 0.02);
}

/// Converters in turn: x[n] = o_m + g_m cos(w (n + d_m) + 0.7), m = n modulo M.
struct Turns {
    offsets: Vec<f64>,
    gains: Vec<f64>,
    skews: Vec<f64>,
}

impl Turns {
    fn random(converters: usize, offset: f64, gain: f64, skew: f64, random: &mut Random) -> Self {
        let mut draw =
            |mean: f64, size: f64| (0..converters).map(|_| mean + size * random.sample()).collect();
        Self { offsets: draw(0.0, offset), gains: draw(1.0, gain), skews: draw(0.0, skew) }
    }

    fn record(&self, count: usize, cycles: f64) -> Vec<f64> {
        let at = |n: usize| {
            let m = n % self.gains.len();
            let t = n as f64 + self.skews[m];
            self.offsets[m] + 0.8 * self.gains[m] * (TAU * cycles * t + 0.7).cos()
        };
        (0..count).map(at).collect()
    }

    /// (1/M) sum over m of x_m e^{-2 pi j k m / M}.
    fn share(&self, k: usize, x: impl Fn(usize) -> Complex<f64>) -> Complex<f64> {
        let of = self.gains.len();
        let turn = |m: usize| Complex::from_polar(1.0, -TAU * (k * m) as f64 / of as f64);
        (0..of).map(|m| x(m) * turn(m)).sum::<Complex<f64>>() / of as f64
    }

    /// All lines beside the tone (cycles, amplitude), and the amplitude of the tone, by the closed forms.
    fn lines(&self, cycles: f64) -> (f64, Vec<(f64, f64)>) {
        let of = self.gains.len();
        let image = |k| {
            0.8 * self.share(k, |m| Complex::from_polar(self.gains[m], TAU * cycles * self.skews[m])).norm()
        };
        let offset = |k: usize| self.share(k, |m| Complex::new(self.offsets[m], 0.0)).norm();
        let place = |x: f64| (x - x.round()).abs();
        let images = (1..of).map(|k| (place(cycles + k as f64 / of as f64), image(k)));
        // A line at half the rate has the power of its square, a sine half of that.
        let twice = |k: usize| if 2 * k == of { 2f64.sqrt() } else { 2.0 };
        let offsets = (1..=of / 2).map(|k| (k as f64 / of as f64, twice(k) * offset(k)));
        (image(0), images.chain(offsets).collect())
    }
}

#[test]
fn interleaving_spurs_are_those_of_the_closed_forms() {
    let mut random = Random(14);
    // Offset, gain and skew, separately and together; off a bin.
    let kinds = [(5e-3, 0.0, 0.0), (0.0, 1e-2, 0.0), (0.0, 0.0, 1e-2), (5e-3, 1e-2, 1e-2)];
    for converters in 2..=16 {
        for (offset, gain, skew) in kinds {
            let turns = Turns::random(converters, offset, gain, skew, &mut random);
            let cycles = 0.183_71;
            let samples = turns.record(8192, cycles);
            let settings = Settings { converters, harmonics: 5, ..Settings::default() };
            let measured = measure(&samples, RATE, &settings).unwrap();
            let (carrier, lines) = turns.lines(cycles);
            close(measured.tones[0].amplitude.value / carrier, 1.0, 1e-3);
            let mut total = 0.0;
            for (place, amplitude) in lines {
                total += amplitude * amplitude;
                let found = measured.spurs.iter().find(|spur| (spur.frequency / RATE - place).abs() < 1e-5);
                let got = found.unwrap_or_else(|| panic!("{converters}: no spur at {place}")).level.0;
                let want = 20.0 * (amplitude / carrier).log10();
                assert!(want < -200.0 || (got - want).abs() < 0.1, "{converters} at {place}: {got} {want}");
            }
            let want = 10.0 * (total / (carrier * carrier)).log10();
            close(measured.interleaving.unwrap().0, want, 0.02);
            // Nothing else is there, so SINAD is the same with its sign changed.
            close(measured.sinad.0, -want, 0.02);
            assert!(measured.sfdr_without_interleaving.unwrap().0 > measured.sfdr.0 + 20.0);
        }
    }
}

/// Of two converters the image of fs / 16 is its seventh harmonic.
#[test]
fn interleaving_that_falls_on_a_harmonic_is_named() {
    let turns = Turns { offsets: vec![0.0; 2], gains: vec![1.0, 1.02], skews: vec![0.0; 2] };
    let shared = |cycles| {
        let settings = Settings { converters: 2, harmonics: 7, ..Settings::default() };
        let measured = measure(&turns.record(8192, cycles), RATE, &settings).unwrap();
        let warnings = measured.warnings().into_iter().map(|warning| warning.to_string());
        warnings.filter(|it| it.starts_with("lines of interleaving fall on others")).collect::<Vec<_>>()
    };
    let [warning] = &shared(1.0 / 16.0)[..] else { panic!("no warning") };
    assert!(warning.contains("-40.1 dBc (harmonic, 7 f and gain or skew, 1/2 fs - f)"), "{warning}");
    assert_eq!(shared(0.0637), Vec::<String>::new());
}

/// The leakage of a large tone beside the measured one is not taken for its harmonics.
#[test]
fn a_large_second_tone_is_no_distortion() {
    let mut random = Random(9);
    let cycles = [1000.37 / 48e3, 3.0 * 1000.37 / 48e3, 7321.1 / 48e3];
    let amplitudes = [0.6, 1e-3, 0.3];
    let sample = |n: usize, noise: f64| {
        let wave = |(f, a): (&f64, f64)| a * (TAU * (f * n as f64).fract()).cos();
        cycles.iter().zip(amplitudes).map(wave).sum::<f64>() + 1e-5 * noise
    };
    let samples: Vec<f64> = (0..8192).map(|n| sample(n, random.gaussian())).collect();
    let measured = measure(&samples, RATE, &Settings::default()).unwrap();
    close(measured.thd.0, 20.0 * (1e-3f64 / 0.6).log10(), 0.02);
    close(measured.sfdr.0, 20.0 * 2f64.log10(), 0.01);
    let [first, second, rest @ ..] = &measured.spurs[..] else { panic!("{:?}", measured.spurs) };
    close(first.frequency / RATE, cycles[2], 1e-7);
    close(second.frequency / RATE, cycles[1], 1e-7);
    assert!(rest.iter().all(|spur| spur.level.0 < -100.0), "{rest:?}");
}

#[test]
fn causes_are_named() {
    let turns =
        Turns { offsets: vec![0.01, 0.0, 0.0, 0.0], gains: vec![1.0, 1.02, 1.0, 1.0], skews: vec![0.0; 4] };
    let samples: Vec<f64> = turns.record(4096, 0.2).iter().map(|x| x + 0.01 * x * x * x).collect();
    let measured = measure(&samples, RATE, &Settings { converters: 4, ..Settings::default() }).unwrap();
    let causes = |hertz: f64| -> Vec<String> {
        let is_there = |spur: &&Spur| (spur.frequency.0 - hertz).abs() < 100.0 && spur.amplitude > 1e-5;
        let near = measured.spurs.iter().filter(is_there);
        near.flat_map(|spur| &spur.causes).map(Cause::to_string).collect()
    };
    assert_eq!(causes(250e3), ["offset, 1/4 fs"]);
    assert_eq!(causes(500e3), ["offset, 2/4 fs"]);
    assert_eq!(causes(450e3), ["gain or skew, 1/4 fs + f"]);
    assert_eq!(causes(300e3), ["gain or skew, 2/4 fs - f"]);
    assert_eq!(causes(50e3), ["gain or skew, 1/4 fs - f"]);
    // Harmonics 2, 3, 7 and 8 of fs / 5 fall on fs 2/5; all of them are named, folded or not.
    let all = ["harmonic, 2 f", "harmonic, 3 f, folded", "harmonic, 7 f, folded", "harmonic, 8 f, folded"];
    assert_eq!(causes(400e3), all);
    // Harmonics 4, 6 and 9 fall on the tone, 5 and 10 on the constant.
    let hidden: Vec<String> = measured.hidden.iter().map(Cause::to_string).collect();
    assert_eq!(hidden, [4, 5, 6, 9, 10].map(|order| format!("harmonic, {order} f, folded")));
    assert_eq!(Cause::Unknown.to_string(), "unknown");
}

#[test]
fn harmonics_fold_and_add_up() {
    let (cycles, count) = (0.171_3, 6000);
    let amplitudes = [(2, 1e-3), (3, 5e-4), (7, 2e-4)];
    let mut random = Random(2);
    let sigma = 1e-4;
    let mut samples = tone(count, cycles, 0.9);
    for (n, x) in samples.iter_mut().enumerate() {
        *x += 0.05 + sigma * random.gaussian();
        for (order, amplitude) in amplitudes {
            *x += amplitude * (TAU * order as f64 * cycles * n as f64).sin();
        }
    }
    let measured = measure(&samples, RATE, &Settings::default()).unwrap();
    let power: f64 = amplitudes.iter().map(|(_, a)| a * a / (0.9 * 0.9)).sum();
    close(measured.thd.0, 10.0 * power.log10(), 0.05);
    close(measured.snr.0, 10.0 * (0.405 / (sigma * sigma)).log10(), 0.2);
    close(measured.sinad.0, -10.0 * (power + sigma * sigma / 0.405).log10(), 0.05);
    close(measured.sfdr.0, 20.0 * (0.9f64 / 1e-3).log10(), 0.1);
    close(measured.offset.value, 0.05, 5.0 * measured.offset.sigma);
    // 7 x 0.1713 = 1.1991 is seen at 0.1991 of the rate.
    let [seventh, ninth] =
        [7, 9].map(|order| caused(&measured, Cause::Harmonic { order, folded: true, tone: 0 }));
    close(seventh.frequency.0, 199_100.0, 1.0);
    assert!(seventh.above_noise && !ninth.above_noise);
    assert_eq!((measured.interleaving, measured.sfdr_without_interleaving), (None, None));
    // Fewer harmonics, less distortion.
    let second = measure(&samples, RATE, &Settings { harmonics: 2, ..Settings::default() }).unwrap();
    close(second.thd.0, 20.0 * (1e-3f64 / 0.9).log10(), 0.05);
}

#[test]
fn the_noise_density_does_not_depend_on_the_window() {
    let (sigma, full_scale) = (3e-3, 2.5);
    let mut random = Random(8);
    let samples: Vec<f64> = tone(50_000, 0.1234, 2.0).iter().map(|x| x + sigma * random.gaussian()).collect();
    let want = 10.0 * (sigma * sigma / 0.5e6 / (0.5 * full_scale * full_scale)).log10();
    for window in [Window::None, Window::Hann, Window::Bh4, Window::Bh7] {
        let settings = Settings { window, full_scale, rails: (-9.0, 9.0), ..Settings::default() };
        let measured = measure(&samples, RATE, &settings).unwrap();
        close(measured.noise_density.0, want, 0.1);
        close(measured.tones[0].level.0, 20.0 * (2.0f64 / 2.5).log10(), 1e-3);
        close(measured.enob_full_scale - measured.enob, (2.5f64 / 2.0).log2(), 1e-4);
    }
}

#[test]
fn windows_have_their_known_bandwidths_and_side_lobes() {
    // Harris (1978), table I; Albrecht (2001).
    for (window, bandwidth, side_lobes) in [
        (Window::None, 1.0, -13.0),
        (Window::Hann, 1.5, -31.0),
        (Window::Bh4, 2.0, -92.0),
        (Window::Bh7, 2.63, -180.0),
    ] {
        close(window.noise_bandwidth(), bandwidth, 0.01);
        let samples = tone(4096, 500.0 / 4096.0, 0.7);
        let spectrum = RecordSpectrum::new(&samples, RATE, window);
        close(spectrum.amplitudes[500], 0.7, 1e-12);
        close(spectrum.frequency(500).0, 500.0 * RATE.0 / 4096.0, 1e-6);
        close(spectrum.mean_square(0, 2049), 0.245, 1e-9);
        // Half a bin off, beyond the main lobe.
        let leaking = RecordSpectrum::new(&tone(4096, 500.5 / 4096.0, 0.7), RATE, window);
        let beyond = window.coefficients().len() + 1;
        let lobes = leaking.amplitudes[500 + beyond..700].iter().fold(0.0, |most: f64, a| most.max(*a));
        let level = 20.0 * (lobes / 0.7).log10();
        assert!(level < side_lobes + 1.0, "{window:?}: {level}");
    }
}

#[test]
fn tones_that_are_given_are_measured_in_their_zone() {
    let samples = tone(5000, 0.2341, 0.5);
    let settings = Settings { tones: vec![RATE * 1.2342], ..Settings::default() };
    let measured = measure(&samples, RATE, &settings).unwrap();
    close(measured.tones[0].frequency.value.0, 1_234_100.0, 1e-4);
    close(measured.tones[0].alias.0, 234_100.0, 1e-4);
    let settings = Settings { tones: vec![RATE * 0.765], ..Settings::default() };
    close(measure(&samples, RATE, &settings).unwrap().tones[0].frequency.value.0, 765_900.0, 1e-4);
}

#[test]
fn two_tones_and_their_products() {
    let count = 8000;
    let mut samples: Vec<f64> =
        tone(count, 0.1013, 0.4).iter().zip(tone(count, 0.1197, 0.4)).map(|(x, y)| x + y).collect();
    // 2 f1 - f2 at 0.0829.
    samples.iter_mut().enumerate().for_each(|(n, x)| *x += 2e-4 * (TAU * 0.0829 * n as f64).cos());
    let settings = Settings { tones: vec![RATE * 0.1013, RATE * 0.1197], ..Settings::default() };
    let measured = measure(&samples, RATE, &settings).unwrap();
    let product = Cause::Intermodulation { a: 2, first: 1, b: -1, second: 2 };
    close(caused(&measured, product).level.0, 20.0 * (2e-4f64 / 0.4).log10(), 0.01);
    assert_eq!(product.to_string(), "intermodulation, 2 f1 -1 f2");
    close(measured.sinad.0, 10.0 * (2.0 * 0.16f64 / 4e-8).log10(), 0.01);
}

#[test]
fn an_unknown_line_is_found() {
    let mut samples = quantised(&tone(10_000, 0.2117, 0.9), 16);
    samples.iter_mut().enumerate().for_each(|(n, x)| *x += 3e-4 * (TAU * 0.066_6 * n as f64).cos());
    let measured = measure(&samples, RATE, &Settings::default()).unwrap();
    let spur = &measured.spurs[0];
    assert_eq!((spur.causes.as_slice(), spur.above_noise), ([Cause::Unknown].as_slice(), true));
    close(spur.frequency.0, 66_600.0, 0.1);
    close(measured.sfdr.0, 20.0 * (0.9f64 / 3e-4).log10(), 0.01);
}

#[test]
fn missing_and_clipped_samples_are_counted() {
    let mut samples: Vec<f64> = tone(3000, 0.0731, 1.2).iter().map(|x| x.clamp(-1.0, 1.0)).collect();
    let clipped = samples.iter().filter(|x| x.abs() >= 1.0).count();
    let measured = measure(&samples, RATE, &Settings::default()).unwrap();
    assert!(clipped > 500);
    assert_eq!((measured.clipped, measured.left_out), (clipped, 0));
    let mut whole = tone(3000, 0.0731, 0.8);
    whole[17] = f64::NAN;
    samples[18] = f64::INFINITY;
    let measured = measure(&whole, RATE, &Settings::default()).unwrap();
    assert_eq!((measured.clipped, measured.left_out), (0, 1));
    assert!(measured.sinad.0 > 200.0);
    // The spectrum has the tone in the gap, so no floor rises.
    assert!(measured.spectrum.amplitudes[2 * 731..].iter().all(|a| *a < 1e-8));
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let samples = tone(100, 0.2, 1.0);
    let with = |settings: Settings| measure(&samples, RATE, &settings).unwrap_err();
    for converters in [0, 1025] {
        let refused = with(Settings { converters, ..Settings::default() });
        assert!(matches!(refused, MeasureError::Setting { .. }), "{refused}");
    }
    for full_scale in [0.0, -1.0, f64::NAN] {
        let refused = with(Settings { full_scale, ..Settings::default() });
        assert!(matches!(refused, MeasureError::Setting { .. }), "{refused}");
    }
    let refused = with(Settings { converters: 16, ..Settings::default() });
    assert!(matches!(refused, MeasureError::TooShort { samples: 100, .. }), "{refused}");
    let refused = with(Settings { tones: vec![RATE * 0.4], ..Settings::default() });
    assert!(matches!(refused, MeasureError::Fit(SineFitError::NoTone { near: Some(_), .. })), "{refused}");
    for empty in [vec![], vec![1.0; 50], vec![f64::NAN; 50]] {
        assert!(matches!(measure(&empty, RATE, &Settings::default()), Err(MeasureError::Fit(_))));
    }
}

/// Rounding of a periodic tone leaves small lines. One of them is no tone that the fit could find.
#[test]
fn a_tone_that_is_not_there_is_answered_by_the_lines() {
    let rate = Hertz(48e3);
    let samples = quantised(&tone(48_000, 3.1 / 48.0, 0.5), 12);
    let refused = measure(&samples, rate, &Settings { tones: vec![Hertz(2.2e3)], ..Settings::default() });
    let Err(MeasureError::Fit(SineFitError::NoTone { near: Some(near), lines })) = refused else {
        panic!("{refused:?}");
    };
    assert!((near.0 - 2.2e3).abs() < 50.0 && (lines[0].0 - 3.1e3).abs() < 1e-3, "{near} {lines:?}");
}

/// A sum of tones below 0.45 of the rate, delayed by any number of samples.
fn waveform(count: usize, delay: f64) -> Vec<f64> {
    let tones = [(0.0123, 0.5), (0.0876, 0.3), (0.2219, 0.2), (0.3571, 0.1), (0.449, 0.05)];
    let at = |n: usize| {
        let t = n as f64 - delay;
        // A slow beat makes the waveform aperiodic in the record.
        tones.iter().enumerate().map(|(i, (f, a))| a * (TAU * f * t + i as f64).cos()).sum::<f64>()
            * (1.0 + 0.5 * (PI * t / count as f64).sin())
    };
    (0..count).map(at).collect()
}

#[test]
fn lag_gain_and_error_against_a_reference() {
    let mut random = Random(21);
    let sigma = 1e-3;
    for (delay, gain) in [(0.0, 1.0), (7.0, 0.5), (-3.4, -0.8), (1234.321, 1.1), (0.49, 2.0)] {
        let clean: Vec<f64> = waveform(6000, 0.0);
        // The beat belongs to the waveform, so it is delayed as well.
        let record: Vec<f64> =
            waveform(6000, delay).iter().map(|x| gain * x + 0.25 + sigma * random.gaussian()).collect();
        let compared = compare(&record, &clean, RATE, Window::Hann).unwrap();
        close(compared.lag_samples.value, delay, 5.0 * compared.lag_samples.sigma);
        close(compared.gain.value, gain, 5.0 * compared.gain.sigma);
        close(compared.offset.value, 0.25, 5.0 * compared.offset.sigma);
        close(compared.lag.0, delay / RATE.0, 1e-8);
        close(compared.error_rms / sigma, 1.0, 0.05);
        let bands: f64 = compared.error_bands.iter().map(|band| band.rms * band.rms).sum();
        close(bands / (sigma * sigma), 1.0, 0.1);
        assert!(compared.lag_samples.sigma < 1e-3 && compared.compared > 4000);
    }
}

/// A signal of period 960 explains a record at every 960 samples, and the first third of the record is
/// noisy: the longer lags leave out more of it, but the samples they share are explained no better.
#[test]
fn the_shortest_of_many_lags_is_taken() {
    let mut random = Random(23);
    let tones = [(17.0, 0.5), (53.0, 0.3), (211.0, 0.1)];
    let at = |t: f64| tones.iter().map(|(k, a)| a * (TAU * k / 960.0 * t + k).cos()).sum::<f64>();
    let clean: Vec<f64> = (0..24_000).map(|n| at(f64::from(n))).collect();
    for late in [-12.0, 7.3] {
        let noise = |n: i32| if n < 8000 { 1e-3 } else { 1e-5 };
        let record: Vec<f64> =
            (0..24_000).map(|n| at(f64::from(n) - late) + noise(n) * random.gaussian()).collect();
        let found = compare(&record, &clean, RATE, Window::Bh7).unwrap();
        close(found.lag_samples.value, late, 1e-3);
    }
}

#[test]
fn unsettled_ends_are_left_out_of_the_figures_and_named() {
    let clean = waveform(12_000, 0.0);
    let mut record: Vec<f64> = clean.iter().enumerate().map(|(n, x)| x + 1e-5 * (n as f64).sin()).collect();
    let settled = compare(&record, &clean, RATE, Window::Bh7).unwrap();
    assert_eq!(settled.unsettled_ends, None);
    record[..300].iter_mut().for_each(|x| *x = 0.0);
    record[11_800..].iter_mut().for_each(|x| *x *= 0.9);
    let found = compare(&record, &clean, RATE, Window::Bh7).unwrap();
    // 128 samples are never compared; of what is left 172 are wrong at the beginning.
    let ends = found.unsettled_ends.unwrap();
    assert!((172..=344).contains(&ends.samples) && ends.raise.0 > 10.0, "{ends:?}");
    assert_eq!(found.compared, 12_000 - 256 - 2 * ends.samples);
    for (snr, settled) in [(found.snr, settled.snr), (found.snr_unaligned, settled.snr_unaligned)] {
        close(snr.0, settled.0, 0.5);
    }
}

#[test]
fn equal_recordings_have_no_error_and_a_fault_is_located() {
    let clean = waveform(3000, 0.0);
    let same = compare(&clean, &clean, RATE, Window::Bh7).unwrap();
    assert_eq!((same.lag_samples.value, same.largest_error), (0.0, 0.0));
    close(same.gain.value, 1.0, 1e-14);
    let mut faulty = clean.clone();
    faulty[1717] += 0.5;
    let compared = compare(&faulty, &clean, RATE, Window::Bh7).unwrap();
    assert_eq!(compared.largest_error_at, 1717);
    close(compared.largest_error, 0.5, 0.01);
    // Interpolation is good to -100 dB and better.
    let late = compare(&waveform(3000, 0.37), &clean, RATE, Window::Bh7).unwrap();
    close(late.lag_samples.value, 0.37, 1e-6);
    assert!(late.snr.0 > 100.0, "{}", late.snr);
}

#[test]
fn recordings_that_cannot_be_compared_are_refused() {
    let clean = waveform(1000, 0.0);
    let refused = compare(&clean[..200], &clean, RATE, Window::None);
    assert!(refused.is_ok(), "{refused:?}");
    let refused = compare(&clean[..200], &clean[..200], RATE, Window::None);
    assert!(matches!(refused, Err(MeasureError::Overlap { .. })), "{refused:?}");
    for constant in [vec![], vec![0.5; 1000], vec![f64::NAN; 1000]] {
        assert!(matches!(
            compare(&clean, &constant, RATE, Window::None),
            Err(MeasureError::Constant { which: "reference" })
        ));
        assert!(matches!(
            compare(&constant, &clean, RATE, Window::None),
            Err(MeasureError::Constant { which: "record" })
        ));
    }
}

#[test]
fn ends_that_have_not_settled_are_found() {
    let tone: Vec<f64> = (0..8192).map(|n| 0.9 * (0.7317 * n as f64).sin()).collect();
    let mut random = Random(5);
    let noisy: Vec<f64> = tone.iter().map(|x| x + 1e-4 * random.gaussian()).collect();
    let measured = |samples: &[f64]| measure(samples, RATE, &Settings::default()).unwrap();
    assert_eq!(measured(&noisy).unsettled_ends, None);
    // A filter with a memory of some ten samples had no input before the first one.
    let mut late = noisy.clone();
    late.iter_mut().enumerate().take(200).for_each(|(n, x)| *x *= 1.0 - (-(n as f64) / 10.0).exp());
    let found = measured(&late);
    let ends = found.unsettled_ends.unwrap();
    assert!((64..=256).contains(&ends.samples) && ends.raise.0 > 20.0, "{ends:?}");
    let rest = measured(&late[ends.samples..late.len() - ends.samples]);
    assert!(rest.unsettled_ends.is_none());
    assert!(rest.snr.0 > found.snr.0 + ends.raise.0 - 1.0, "{} {} {ends:?}", rest.snr, found.snr);
    // Their leakage is no spur.
    assert_eq!((found.sfdr, &found.spurs), (rest.sfdr, &rest.spurs));
    // Noise that grows all along, and a loud middle, are no ends.
    let grown: Vec<f64> =
        tone.iter().zip(&noisy).enumerate().map(|(n, (x, y))| x + (y - x) * n as f64 / 100.0).collect();
    assert_eq!(measured(&grown).unsettled_ends, None);
}

/// Whatever decides SFDR is the first of the spurs, a line or the largest bin.
#[test]
fn what_decides_sfdr_is_among_the_spurs() {
    let mut random = Random(6);
    for (spur, noise) in [(1e-3, 1e-5), (0.0, 1e-2), (1e-4, 1e-3)] {
        let wave = |n: usize| (0.7317 * n as f64).sin() + spur * (1.9 * n as f64).sin();
        let samples: Vec<f64> = (0..4096).map(|n| 0.9 * wave(n) + noise * random.gaussian()).collect();
        for window in [Window::None, Window::Bh7] {
            let found = measure(&samples, RATE, &Settings { window, ..Settings::default() }).unwrap();
            close(-found.spurs[0].level.0, found.sfdr.0, 1e-12);
        }
    }
}

/// What a curve of each converter makes of a tone is taken out, and noise has none.
#[test]
fn a_static_nonlinearity_is_told_from_noise() {
    let mut random = Random(7);
    let bent = |curves: [f64; 2], random: &mut Random| -> Vec<f64> {
        let one = |n: usize, random: &mut Random| {
            let x = 0.9 * (0.7317 * n as f64).sin();
            x + curves[n % 2] * (4.0 * x.powi(3) - 3.0 * x) + 1e-5 * random.gaussian()
        };
        (0..16_384).map(|n| one(n, random)).collect()
    };
    let settings = Settings { converters: 2, ..Settings::default() };
    let found = measure(&bent([1e-3, -5e-4], &mut random), RATE, &settings).unwrap();
    assert!(found.thd_straightened.is_some_and(|thd| thd.0 < found.thd.0 - 20.0), "{:?}", found.thd);
    let found = measure(&bent([0.0, 0.0], &mut random), RATE, &settings).unwrap();
    assert_eq!(found.thd_straightened, None);
}

/// Two tones of which one is measured are named, and an error of a converter is none.
#[test]
fn other_tones_are_named() {
    let measured = |level: f64, tones: &[Hertz]| {
        let sample = |n: usize| 0.4 * (0.7317 * n as f64).sin() + 0.4 * level * (1.91 * n as f64).sin();
        let samples: Vec<f64> = (0..8192).map(sample).collect();
        let settings = Settings { tones: tones.to_vec(), ..Settings::default() };
        measure(&samples, RATE, &settings).unwrap().warnings()
    };
    let other = RATE * (1.91 / TAU);
    let named = measured(0.9, &[]);
    let [MeasureWarning::OtherTones(list)] = &named[..] else { panic!("{named:?}") };
    assert!((list[0] - other).0.abs() < 1e3, "{named:?}");
    assert_eq!(measured(0.05, &[]), []);
    assert_eq!(measured(0.9, &[RATE * (0.7317 / TAU), other]), []);
}
