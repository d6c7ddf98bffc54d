//! The filter W of a signal: what the `[signal]` table of a spec says of its spectrum.
//!
//! A band becomes an elliptic filter: flat within 1 dB over the band, and `floor_db` down from the stop edge
//! on. The stop edge lies where the samples cannot tell frequencies apart any more, at most 35 % above the
//! band. This rule was chosen among 44 filters on twelve systems; Butterworth and Chebyshev 2 filters, less
//! ripple and a stop edge at the mirror frequency lost up to 75 dB of SNR. A floor beyond the usual ones has
//! its stop edge nearer and more poles, for banks that the band limits.

use super::families::Selectivity;
use super::{AnalogError, StableFilter};
use hybank_core::spec::{Band, Family, FilterSpec, Passband, SignalSpec, SignalSpectrum, Spec};
use hybank_core::units::Hertz;

/// The shape of W.
struct Settings {
    /// Ripple of W over the band: figures hold for a flat band, and less ripple costs poles.
    ripple_db: f64,
    /// The stop edge of a low-pass W over the end of the band, where the samples resolve so much.
    stop_edge: f64,
    /// The same with a floor beyond [`FLOORS_DB`].
    sharp_edge: f64,
    /// The floor of a sharp W.
    sharp_floor_db: f64,
    /// Distance of the stop edges of a band-pass W from the band, over its width: half of that of a
    /// low-pass on each side.
    skirt: f64,
    /// Bits of converters for which the lowest of [`FLOORS_DB`] is enough.
    bits_of_least_floor: f64,
    /// Decibels of floor per bit beyond: more than the 6 dB by which the noise of the converters falls.
    floor_per_bit_db: f64,
    /// The least floor for which a sharp edge is kept. A band that leaves less room ends at or beyond what
    /// the samples resolve.
    least_floor_db: f64,
}

/// Of every W.
const SETTINGS: Settings = Settings {
    ripple_db: 1.0,
    stop_edge: 1.35,
    sharp_edge: 1.1,
    sharp_floor_db: 120.0,
    skirt: 0.175,
    bits_of_least_floor: 8.0,
    floor_per_bit_db: 10.0,
    least_floor_db: 10.0,
};

/// Most poles of a low-pass W, and of the prototype of a band-pass W. A sharper filter has more states than
/// its floor is worth.
const MOST_POLES: usize = 12;
const MOST_SHARP_POLES: usize = 14;
const MOST_PROTOTYPE_POLES: usize = 8;
/// Floors by the noise of the converters: 10 dB per bit from 8 bits on, and never outside these.
const FLOORS_DB: [f64; 2] = [40.0, 80.0];

/// The written filter W of a signal.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalFilter {
    /// W.
    pub filter: FilterSpec,
    /// How far W is down outside the band, unless the spec gives W itself.
    pub floor_db: Option<f64>,
}

impl SignalFilter {
    /// Of the signal of `spec`; `None` for a spec without.
    pub fn of(spec: &Spec) -> Option<Self> {
        let signal = spec.signal.as_ref()?;
        Some(match &signal.spectrum {
            SignalSpectrum::Filter(filter) => Self { filter: filter.clone(), floor_db: None },
            SignalSpectrum::Band(band) => {
                let floor = Self::asked_floor(spec).unwrap_or(FLOORS_DB[1]);
                Self::of_band(*band, resolved_band(spec), floor)
            }
        })
    }

    /// The floor that the spec asks for, or that the noise of its converters suggests, in decibels; `None`
    /// without a band.
    pub fn asked_floor(spec: &Spec) -> Option<f64> {
        let signal = spec.signal.as_ref()?;
        signal.band().map(|_| signal.floor_db.unwrap_or_else(|| usual_floor(spec)))
    }

    /// The floor of the sharp W of `spec`; `None` where the spec states its own or has no band, and where
    /// the samples leave no room for one beyond the usual floors.
    pub fn sharp_floor(spec: &Spec) -> Option<f64> {
        let signal = spec.signal.as_ref().filter(|signal| signal.floor_db.is_none())?;
        let sharp = Self::of_band(signal.band()?, resolved_band(spec), SETTINGS.sharp_floor_db);
        sharp.floor_db.filter(|floor| *floor > FLOORS_DB[1])
    }

    /// The signal of `spec` with W in place of the band, so that it no longer depends on the rates of the
    /// spec.
    pub fn written_out(spec: &Spec) -> Option<SignalSpec> {
        let (signal, own) = spec.signal.as_ref().zip(Self::of(spec))?;
        Some(SignalSpec { spectrum: SignalSpectrum::Filter(own.filter), floor_db: None, rms: signal.rms })
    }

    /// The elliptic filter for `band`; `resolved` is f_N, the width of the band that the samples resolve.
    fn of_band(band: Band, resolved: Hertz, floor_db: f64) -> Self {
        let elliptic = |transition: f64, most: usize| {
            let shape = Selectivity { ripple_db: SETTINGS.ripple_db, transition };
            let order = shape.order_for(floor_db).min(most);
            (order, floor_db.min(shape.attenuation_of(order)))
        };
        let (order, floor_db) = if band.is_low_pass() {
            let is_sharp = floor_db > FLOORS_DB[1];
            let (edge, most) = match is_sharp {
                true => (SETTINGS.sharp_edge, MOST_SHARP_POLES),
                false => (SETTINGS.stop_edge, MOST_POLES),
            };
            sharpest(low_pass_transitions(band, resolved, edge), |transition| elliptic(transition, most))
        } else {
            let transitions = band_pass_transitions(band, resolved);
            sharpest(transitions, |transition| elliptic(transition, MOST_PROTOTYPE_POLES))
        };
        let filter = FilterSpec::Family {
            family: Family::Elliptic,
            order: Some(order),
            passband: passband(band),
            ripple_db: Some(SETTINGS.ripple_db),
            attenuation_db: Some(floor_db),
        };
        Self { filter, floor_db: Some(floor_db) }
    }
}

/// W of the signal of `spec`, in normalised time.
///
/// # Errors
/// [`AnalogError`] for a filter that is not stable.
pub fn signal(spec: &Spec) -> Result<Option<StableFilter>, AnalogError> {
    SignalFilter::of(spec).map(|w| StableFilter::new(&w.filter, spec.fast_period)).transpose()
}

/// f_N: half the fast rate, or half the mean rate of all samples where there are fewer of them.
pub fn resolved_band(spec: &Spec) -> Hertz {
    let share = (spec.layout().count() as f64 / spec.ratio as f64).min(1.0);
    Hertz(0.5 * share / spec.fast_period.0)
}

/// The floor that the noise of the converters suggests: what lies below the noise needs no suppression.
fn usual_floor(spec: &Spec) -> f64 {
    let [least, most] = FLOORS_DB;
    let quietest = spec.channels.iter().map(|channel| channel.sample_noise()).fold(f64::INFINITY, f64::min);
    // A converter of b bits has the noise 2^(1 - b) / sqrt(12).
    let bits = 1.0 - (quietest * 12f64.sqrt()).log2();
    (least + SETTINGS.floor_per_bit_db * (bits - SETTINGS.bits_of_least_floor)).clamp(least, most)
}

/// The stop edge over the end of the band: the wanted one, and the one for a band that leaves no room.
fn low_pass_transitions(band: Band, resolved: Hertz, edge: f64) -> [f64; 2] {
    [edge.min(resolved / band.high), edge]
}

/// The frequency of the prototype to which the nearer stop edge belongs: clipped to the zone in which the
/// band lies, and not clipped.
fn band_pass_transitions(band: Band, resolved: Hertz) -> [f64; 2] {
    let Band { low: Hertz(low), high: Hertz(high) } = band;
    let width = high - low;
    let prototype = |edge: f64| ((edge * edge - low * high) / (edge * width)).abs();
    let nearer = |below: f64, above: f64| {
        // At and below zero frequency there is nothing to suppress.
        if below > 0.0 { prototype(below).min(prototype(above)) } else { prototype(above) }
    };
    let (below, above) = (low - SETTINGS.skirt * width, high + SETTINGS.skirt * width);
    let zone = (0.5 * (low + high) / resolved.0).floor();
    let [first, last] = [zone, zone + 1.0].map(|edge| edge * resolved.0);
    let clipped = if first <= low && high <= last { nearer(below.max(first), above.min(last)) } else { 0.0 };
    [clipped, nearer(below, above)]
}

fn passband(Band { low, high }: Band) -> Passband {
    if low.0 == 0.0 { Passband::LowPass { cutoff: high } } else { Passband::BandPass { low, high } }
}

/// The first of `transitions` that leaves a floor.
fn sharpest(transitions: [f64; 2], elliptic: impl Fn(f64) -> (usize, f64)) -> (usize, f64) {
    let [wanted, wide] = transitions;
    let kept =
        (wanted > 1.0).then(|| elliptic(wanted)).filter(|(_, floor)| *floor >= SETTINGS.least_floor_db);
    kept.unwrap_or_else(|| elliptic(wide))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybank_core::units::{RadiansPerFastPeriod, Seconds};
    use std::f64::consts::TAU;

    fn written(band: [f64; 2], resolved: f64, floor: f64) -> (usize, f64) {
        let band = Band { low: Hertz(band[0]), high: Hertz(band[1]) };
        match SignalFilter::of_band(band, Hertz(resolved), floor) {
            SignalFilter { filter: FilterSpec::Family { order: Some(order), .. }, floor_db: Some(floor) } => {
                (order, floor)
            }
            other => panic!("{other:?}"),
        }
    }

    /// The orders that scipy's `ellipord` gives: scipy.signal.ellipord(1, min(1.35, f_N / f_b), 1, floor,
    /// analog=True).
    #[test]
    fn orders_are_those_of_the_degree_equation() {
        let orders = [
            (1.0 / 6.0, 0.5, 8),
            (0.4167, 0.5, 9),
            (0.46, 0.5, 11),
            (0.1, 0.5, 8),
            (0.375, 0.5, 8),
            (0.4, 0.5, 9),
            (0.2625, 0.375, 8),
            (0.425, 0.5, 9),
            (0.2, 1.0 / 3.0, 8),
        ];
        for (edge, resolved, order) in orders {
            assert_eq!(written([0.0, edge], resolved, 80.0), (order, 80.0), "{edge} of {resolved}");
        }
        // ellipord(1, 1.1, 1, 120, analog=True) is 15, one more than the most; 105 dB take 13.
        let (order, floor) = written([0.0, 0.1], 0.5, 120.0);
        assert!(order == 14 && (110.0..120.0).contains(&floor), "{order} {floor}");
        assert_eq!(written([0.0, 0.1], 0.5, 105.0), (13, 105.0));
    }

    /// The floor holds from the stop edge on, and the ripple up to the band's end.
    #[test]
    fn the_filter_keeps_band_and_floor() {
        for (edge, resolved, floor) in
            [(0.1, 0.5, 80.0), (0.46, 0.5, 60.0), (0.49, 0.5, 80.0), (0.499, 0.5, 40.0)]
        {
            let band = Band::up_to(Hertz(edge));
            let w = SignalFilter::of_band(band, Hertz(resolved), floor);
            let reached = w.floor_db.unwrap();
            let filter = StableFilter::new(&w.filter, Seconds(1.0)).unwrap();
            let gain_db = |f: f64| 20.0 * filter.response(RadiansPerFastPeriod(TAU * f)).norm().log10();
            let stop = (1.35 * edge).min(resolved);
            for k in 0..=1000 {
                let x = f64::from(k) / 1000.0;
                let inside = gain_db(x * edge);
                assert!((-1.0 - 1e-6..=1e-6).contains(&inside), "{edge}: {inside}");
                let outside = gain_db(stop * (1.0 + 20.0 * x * x));
                assert!(outside <= -reached + 1e-6, "{edge}: {outside} above {reached} at {x}");
            }
            assert!(reached == floor || filter.order() == 12, "{edge}: {reached}");
        }
    }

    /// The same for bands above 0, in whatever zone, and for one that would reach below 0.
    #[test]
    fn a_band_pass_keeps_band_and_floor() {
        for ([low, high], resolved, floor) in [
            ([0.79, 0.96], 0.5, 80.0),
            ([0.12, 0.2], 0.5, 60.0),
            ([0.01, 0.4], 0.5, 80.0),
            ([3.1, 3.2], 0.5, 70.0),
        ] {
            let w =
                SignalFilter::of_band(Band { low: Hertz(low), high: Hertz(high) }, Hertz(resolved), floor);
            let reached = w.floor_db.unwrap();
            let filter = StableFilter::new(&w.filter, Seconds(1.0)).unwrap();
            let gain_db = |f: f64| 20.0 * filter.response(RadiansPerFastPeriod(TAU * f)).norm().log10();
            let skirt = 0.175 * (high - low);
            for k in 0..=1000 {
                let x = f64::from(k) / 1000.0;
                let inside = gain_db(low + x * (high - low));
                assert!((-1.0 - 1e-6..=1e-6).contains(&inside), "{low}: {inside}");
                let outside =
                    gain_db((high + skirt) * (1.0 + 20.0 * x * x)).max(gain_db((low - skirt).max(0.0) * x));
                assert!(outside <= -reached + 1e-6, "{low}: {outside} above {reached} at {x}");
            }
            assert!(reached == floor || filter.order() == 16, "{low}: {reached}");
        }
    }

    /// A band that ends where the samples end keeps a floor: its edge lies beyond.
    #[test]
    fn a_band_without_room_has_a_wide_edge() {
        assert_eq!(written([0.0, 0.5], 0.5, 80.0), (8, 80.0));
        assert_eq!(written([0.0, 0.7], 0.5, 80.0), (8, 80.0));
        let (order, floor) = written([0.0, 0.49999], 0.5, 80.0);
        assert!(order == 12 && (10.0..80.0).contains(&floor), "{order} {floor}");
    }

    #[test]
    fn noisy_converters_need_less_floor() {
        let spec = |noise: f64| {
            let text = format!(
                "fast_rate = 1.0\nratio = 2\ntarget = {{ filter = {{ family = \"rc\", cutoff = 0.6 }} }}\n\
                 signal = {{ band = 0.1 }}\nchannel = [{{ delay = 0, noise = {noise:e} }}, {{ delay = 1 }}]"
            );
            let mut spec = Spec::from_toml(&text, "spec.toml").unwrap();
            spec.channels[1].noise = noise;
            usual_floor(&spec)
        };
        let bits = |b: i32| 2f64.powi(1 - b) / 12f64.sqrt();
        assert_eq!(spec(0.0), 80.0);
        assert!((spec(bits(10)) - 60.0).abs() < 1e-9);
        assert_eq!([spec(bits(6)), spec(bits(16))], [40.0, 80.0]);
    }
}
