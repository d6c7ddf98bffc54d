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
    delays: Vec<f64>,
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
            ..alike(&filter, self.ratio, self.latency, &self.delays)
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
    let delays = vec![0.0, 1.224, 1.703, 3.193, 4.178, 4.981, 5.882, 6.867];
    for (omega, latency) in [(0.8, 20), (1.2, 20), (1.8, 32)] {
        let case = Case {
            name: "Butterworth 6, N = M = 8",
            filter: (Family::Butterworth, 6, omega),
            ratio: 8,
            latency,
            delays: delays.clone(),
            taps: 48,
            accuracy: 1e-6,
        };
        case.check();
    }
}

#[test]
fn four_channels_behind_elliptic_filters() {
    for (order, latency) in [(5, 2), (5, 12), (7, 10)] {
        let case = Case {
            name: "elliptic, N = M = 4",
            filter: (Family::Elliptic, order, 2.4),
            ratio: 4,
            latency,
            delays: vec![0.31, 1.22, 2.45, 2.9],
            taps: 32,
            accuracy: 1e-5,
        };
        case.check();
    }
}

#[test]
fn channels_late_by_whole_slow_periods() {
    for (latency, delays) in
        [(0, vec![1.2, 0.6]), (1, vec![0.2, 5.1]), (3, vec![0.2, 9.1]), (6, vec![7.0, 0.0, 3.3])]
    {
        let case = Case {
            name: "late channels",
            filter: (Family::Bessel, 2, 0.9),
            ratio: 2,
            latency,
            delays,
            taps: 40,
            accuracy: 1e-5,
        };
        case.check();
    }
}

#[test]
fn hardly_any_latency() {
    for (kind, order, omega) in
        [(Family::Butterworth, 6, 0.6), (Family::Chebyshev1, 5, 0.57), (Family::Bessel, 6, 0.92)]
    {
        let case = Case {
            name: "low latency, N = M = 8",
            filter: (kind, order, omega),
            ratio: 8,
            latency: 4,
            delays: vec![0.4, 1.7, 2.9, 3.3, 4.8, 5.1, 6.6, 7.2],
            taps: 64,
            // Beyond Butterworth 6 the weights span all of double precision.
            accuracy: 1e-3,
        };
        case.check();
    }
}

#[test]
fn crowded_channels() {
    let case = Case {
        name: "delays a thousandth apart",
        filter: (Family::Butterworth, 4, 1.0),
        ratio: 3,
        latency: 9,
        delays: vec![0.5, 0.501, 0.502],
        taps: 24,
        accuracy: 1e-4,
    };
    case.check();
}
