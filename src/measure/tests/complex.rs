//! Complex records.

use super::*;

/// c + a e^{j w (n + d)}, of which the imaginary part has the gain g and the quadrature error p; noise in
/// each part.
struct Mixer {
    offset: Complex<f64>,
    gain: f64,
    phase: f64,
    noise: f64,
}

const IDEAL: Mixer = Mixer { offset: Complex::new(0.0, 0.0), gain: 1.0, phase: 0.0, noise: 0.0 };

impl Mixer {
    fn record(&self, count: usize, tone: impl Fn(usize) -> Complex<f64>) -> [Vec<f64>; 2] {
        let mut random = Random(7);
        let mut noise = |x: f64| x + self.noise * random.gaussian();
        let (sin, cos) = self.phase.sin_cos();
        let part = |n: usize| {
            let z = tone(n);
            (z.re + self.offset.re, self.gain * (z.im * cos + z.re * sin) + self.offset.im)
        };
        let (xs, ys) = (0..count).map(part).map(|(x, y)| (noise(x), noise(y))).unzip();
        [xs, ys]
    }
}

fn exponential(amplitude: f64, cycles: f64) -> impl Fn(usize) -> Complex<f64> {
    move |n| Complex::from_polar(amplitude, TAU * cycles * n as f64 + 0.7)
}

fn figures([real, imaginary]: &[Vec<f64>; 2], settings: &Settings) -> Measurement {
    measure_complex(real, imaginary, RATE, settings).unwrap()
}

fn spur(measured: &Measurement, cycles: f64) -> &Spur {
    let found = measured.spurs.iter().find(|spur| (spur.frequency / RATE - cycles).abs() < 1e-6);
    found.unwrap_or_else(|| panic!("no spur at {cycles}"))
}

/// Two converters of 12 bits in quadrature have the bits of one.
#[test]
fn equal_parts_have_the_figures_of_one_converter() {
    for cycles in [0.183_71, -0.4021] {
        let parts = IDEAL.record(8192, exponential(0.999, cycles)).map(|part| quantised(&part, 12));
        let measured = figures(&parts, &Settings::default());
        close(measured.tones[0].frequency.value / RATE, cycles, 1e-8);
        assert_eq!(measured.tones[0].alias, measured.tones[0].frequency.value);
        close(measured.enob, 12.0, 0.03);
        let alone = measure(&parts[0], RATE, &Settings::default()).unwrap();
        close(measured.sinad.0, alone.sinad.0, 0.3);
        // The noise of both parts lies in a band that is twice as wide.
        close(measured.noise_density.0, alone.noise_density.0 - 3.01, 0.5);
        close(measured.level_of_full_scale(), -20.0 * (1.0f64 / 0.999).log10(), 1e-3);
    }
}

impl Measurement {
    fn level_of_full_scale(&self) -> f64 {
        self.tones[0].level.0
    }
}

#[test]
fn imbalance_is_found_and_its_image_is_the_closed_form() {
    for (cycles, gain, phase) in
        [(0.21, 1.02, 0.01), (-0.33, 0.97, -0.03), (0.07, 1.0, 1e-3), (-0.11, 1.001, 0.0)]
    {
        let mixer = Mixer { offset: Complex::new(0.01, -0.02), gain, phase, noise: 1e-5 };
        let measured = figures(&mixer.record(10_000, exponential(0.5, cycles)), &Settings::default());
        let Quadrature { offset, imbalances } = measured.quadrature.clone().unwrap();
        close(measured.offset.value, 0.01, 5.0 * measured.offset.sigma);
        close(offset.value, -0.02, 5.0 * offset.sigma);
        close(imbalances[0].gain.value, gain, 5.0 * imbalances[0].gain.sigma);
        close(imbalances[0].phase.value.0, phase, 5.0 * imbalances[0].phase.sigma.0);
        let part = |sign: f64| 1.0 + sign * 2.0 * gain * phase.cos() + gain * gain;
        let rejection = 10.0 * (part(1.0) / part(-1.0)).log10();
        close(imbalances[0].image_rejection.0, rejection, 0.02);
        let image = spur(&measured, -cycles);
        close(image.level.0, -rejection, 0.02);
        assert_eq!(image.causes, [Cause::Image { order: 1, tone: 0 }]);
        // Nothing but the image and the noise is there.
        close(measured.sinad.0, rejection, 0.05);
        assert!(measured.snr.0 > 85.0 && measured.sfdr.0 > 0.99 * rejection);
    }
}

/// Distortion of the complex envelope gives harmonics on one side, distortion of one part on both.
#[test]
fn harmonics_have_a_side() {
    let (cycles, size) = (-0.123_4, 1e-3);
    let with_harmonic = |n| exponential(0.5, cycles)(n) + exponential(size, 3.0 * cycles)(n);
    let measured = figures(&Mixer { noise: 1e-6, ..IDEAL }.record(8192, with_harmonic), &Settings::default());
    let level = 20.0 * (size / 0.5).log10();
    close(measured.thd.0, level, 0.02);
    let place = 3.0 * cycles - (3.0 * cycles).round();
    assert_eq!(spur(&measured, place).causes, [Cause::Harmonic { order: 3, folded: false, tone: 0 }]);
    close(spur(&measured, place).level.0, level, 0.02);
    assert_eq!(spur(&measured, -place).causes, [Cause::Image { order: 3, tone: 0 }]);
    assert!(!spur(&measured, -place).above_noise);
    let folded = spur(&measured, 5.0 * cycles + 1.0);
    assert_eq!(folded.causes, [Cause::Harmonic { order: 5, folded: true, tone: 0 }]);
}

/// The closed forms of the module without absolute values: A G_k at f + k fs / M, O_k at k fs / M.
#[test]
fn interleaving_spurs_of_complex_records_are_those_of_the_closed_forms() {
    let mut random = Random(14);
    for converters in 2..=5 {
        let turns = Turns::random(converters, 5e-3, 1e-2, 1e-2, &mut random);
        let cycles = -0.183_71;
        let at = |n: usize| {
            let m = n % converters;
            Complex::new(turns.offsets[m], 0.0)
                + Complex::from_polar(0.8 * turns.gains[m], TAU * cycles * (n as f64 + turns.skews[m]) + 0.7)
        };
        let settings = Settings { converters, harmonics: 5, ..Settings::default() };
        let measured = figures(&IDEAL.record(8192, at), &settings);
        let turned = |m: usize| Complex::from_polar(turns.gains[m], TAU * cycles * turns.skews[m]);
        let carrier = 0.8 * turns.share(0, turned).norm();
        let wrapped = |x: f64| if (x - x.round() + 0.5).abs() < 1e-9 { 0.5 } else { x - x.round() };
        for k in 1..converters {
            let share = k as f64 / converters as f64;
            let gain = 0.8 * turns.share(k, turned).norm();
            let offset = turns.share(k, |m| Complex::new(turns.offsets[m], 0.0)).norm();
            for (place, amplitude) in [(cycles + share, gain), (share, offset)] {
                let found = spur(&measured, wrapped(place));
                close(found.level.0, 20.0 * (amplitude / carrier).log10(), 0.1);
                assert!(found.causes.iter().all(|cause| cause.is_interleaving()), "{found:?}");
            }
        }
        close(measured.sinad.0, -measured.interleaving.unwrap().0, 0.02);
        assert!(measured.sfdr_without_interleaving.unwrap().0 > measured.sfdr.0 + 20.0);
    }
}

#[test]
fn a_tone_has_the_sign_that_is_asked_for() {
    let mixer = Mixer { gain: 1.1, ..IDEAL };
    let parts = mixer.record(4096, exponential(0.5, 0.2));
    for (given, seen) in [(0.2, 0.2), (-0.2, -0.2), (1.2, 0.2), (-0.8, 0.2), (0.8, -0.2)] {
        let settings = Settings { tones: vec![RATE * (given + 1e-5)], ..Settings::default() };
        let tone = figures(&parts, &settings).tones[0];
        close(tone.frequency.value / RATE, given, 1e-9);
        close(tone.alias / RATE, seen, 1e-9);
        let amplitude = if seen > 0.0 { 0.525 } else { 0.025 };
        close(tone.amplitude.value, amplitude, 1e-9);
    }
    // Each would be the image of the other.
    let settings = Settings { tones: vec![RATE * 0.2, RATE * -0.2], ..Settings::default() };
    let refused = measure_complex(&parts[0], &parts[1], RATE, &settings);
    assert!(matches!(refused, Err(MeasureError::Fit(SineFitError::TonesCoincide { .. }))), "{refused:?}");
    let settings = Settings { tones: vec![RATE * -0.2], ..Settings::default() };
    assert!(matches!(measure(&parts[0], RATE, &settings), Err(MeasureError::Setting { .. })));
    assert!(measure_complex(&parts[0], &parts[1][1..], RATE, &Settings::default()).is_err());
}

/// A sample without one of its parts is left out whole.
#[test]
fn missing_parts_do_not_matter() {
    let mixer = Mixer { noise: 1e-4, ..IDEAL };
    let [mut real, mut imaginary] = mixer.record(4096, exponential(0.5, -0.31));
    (100..300).step_by(7).for_each(|n| real[n] = f64::NAN);
    (900..1000).step_by(3).for_each(|n| imaginary[n] = f64::INFINITY);
    let measured = figures(&[real, imaginary], &Settings::default());
    assert_eq!(measured.left_out, 29 + 34);
    close(measured.tones[0].amplitude.value, 0.5, 5.0 * measured.tones[0].amplitude.sigma);
    close(measured.snr.0, 10.0 * (0.125f64 / 1e-8).log10(), 0.3);
}

/// A bin is the amplitude of the exponential there, and the powers of all bins are that of the record.
#[test]
fn bins_of_complex_spectra_have_their_sign() {
    for count in [16, 17, 1000, 1001] {
        for k in [-7, -1, 1, 3, 7] {
            let cycles = f64::from(k) / count as f64;
            let [real, imaginary] = IDEAL.record(count, exponential(0.3, cycles));
            let spectrum = RecordSpectrum::complex(&real, &imaginary, RATE, Window::None);
            assert_eq!(spectrum.amplitudes.len(), count);
            let largest =
                (0..count).max_by(|&a, &b| spectrum.amplitudes[a].total_cmp(&spectrum.amplitudes[b]));
            close(spectrum.frequency(largest.unwrap()) / RATE, cycles, 1e-12);
            close(spectrum.amplitudes[largest.unwrap()], 0.3, 1e-12);
            close(spectrum.mean_square(0, count), 0.045, 1e-12);
        }
    }
}
