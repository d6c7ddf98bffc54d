//! Steep and high-order front ends, low latency, late and crowded channels: what the two designers, which
//! share no solver, say about one another. A state-space bank can do all that an FIR bank can, so its gamma
//! must not be larger; and no lower bound may exceed what any bank of the kind achieves.

use crate::support::design;
use crate::support::specs::{alike, low_pass};
use hybank::design::analyze;
use hybank::spec::{DesignSpec, Family, Method, Spec};

struct Case {
    name: &'static str,
    filter: (Family, usize, f64),
    ratio: usize,
    latency: usize,
    delays: &'static [f64],
    taps: usize,
    /// The IIR optimum may be missed by this much (relative) where double precision ends.
    accuracy: f64,
}

impl Case {
    fn spec(&self, method: Method) -> Spec {
        let (family, order, omega) = self.filter;
        let filter = low_pass(family, order, omega);
        Spec {
            name: self.name.to_owned(),
            design: DesignSpec::new(method, (method == Method::Fir).then_some(self.taps)),
            ..alike(&filter, self.ratio, self.latency, self.delays)
        }
    }

    fn check(&self) {
        let name = self.name;
        let iir = design(&self.spec(Method::Iir)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let fir = design(&self.spec(Method::Fir)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let (iu, il) = (iir.gamma.norm.unwrap(), iir.gamma.lower.unwrap());
        let (fu, fl) = (fir.gamma.norm.unwrap(), fir.gamma.lower.unwrap());
        println!("{name}: iir [{il:.9e}, {iu:.9e}], fir [{fl:.9e}, {fu:.9e}]");
        assert!(il <= iu && fl <= fu, "{name}: an interval is empty");
        assert!(il <= fu * (1.0 + 1e-9), "{name}: the IIR bound {il} denies the FIR bank's {fu}");
        assert!(iu <= fu * (1.0 + self.accuracy), "{name}: IIR {iu} is worse than FIR {fu}");
        for bank in [&iir, &fir] {
            let again = analyze(bank, &[]).unwrap().gamma;
            assert!((again / bank.gamma.norm.unwrap() - 1.0).abs() < 1e-9, "{name}: {again}");
        }
    }
}

#[test]
fn eight_channels_behind_butterworth_6() {
    let delays = &[0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    for (omega, latency) in [(0.8, 20), (1.2, 20), (1.8, 32)] {
        let (name, filter) = ("Butterworth 6, N = M = 8", (Family::Butterworth, 6, omega));
        Case { name, filter, ratio: 8, latency, delays, taps: 48, accuracy: 1e-6 }.check();
    }
}

#[test]
fn four_channels_behind_elliptic_filters() {
    let delays = &[0.31, 1.22, 2.45, 2.9];
    for (order, latency) in [(5, 2), (5, 12), (7, 10)] {
        let (name, filter) = ("elliptic, N = M = 4", (Family::Elliptic, order, 2.4));
        Case { name, filter, ratio: 4, latency, delays, taps: 32, accuracy: 1e-5 }.check();
    }
}

#[test]
fn channels_late_by_whole_slow_periods() {
    for (latency, delays) in [(0, &[1.2, 0.6][..]), (1, &[0.2, 5.1]), (3, &[0.2, 9.1]), (6, &[7.0, 0.0, 3.3])]
    {
        let (name, filter) = ("late channels", (Family::Bessel, 2, 0.9));
        Case { name, filter, ratio: 2, latency, delays, taps: 40, accuracy: 1e-5 }.check();
    }
}

#[test]
fn hardly_any_latency() {
    let delays = &[0.4, 1.7, 2.9, 3.3, 4.8, 5.1, 6.6, 7.2];
    for filter in [(Family::Butterworth, 6, 0.6), (Family::Chebyshev1, 5, 0.57), (Family::Bessel, 6, 0.92)] {
        let name = "low latency, N = M = 8";
        // Beyond Butterworth 6 the weights span all of double precision.
        Case { name, filter, ratio: 8, latency: 4, delays, taps: 64, accuracy: 1e-3 }.check();
    }
}

#[test]
fn crowded_channels() {
    let (name, filter) = ("delays a thousandth apart", (Family::Butterworth, 4, 1.0));
    let delays = &[0.5, 0.501, 0.502];
    Case { name, filter, ratio: 3, latency: 9, delays, taps: 24, accuracy: 1e-4 }.check();
}
