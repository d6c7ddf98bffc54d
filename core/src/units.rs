//! Physical quantities as types: time and frequency in each unit that hybank computes in, and decibels.
//!
//! With the fast period h (seconds) and the ratio M the units are related by
//!
//! ```text
//! time                t' = t / h             seconds          <-> fast periods
//! frequency           f' = f h               hertz            <-> cycles per fast period
//! angular frequency   w  = 2 pi f            hertz             -> rad/s
//!                     w' = w h               rad/s            <-> rad per fast period
//!                     W  = M w' = M h w      rad per slow period
//! ```
//!
//! Specs, banks and reports hold the units on the left, the designer and the simulator those on the right.
//! Each type holds one `f64` in its own unit. Any value is legal; ranges are checked where values are read.
//! A conversion rounds once per multiplication or division in its equation, and overflows or underflows as
//! f64 does.
//!
//! Sums, differences and multiples keep the unit, and the quotient of two values of one unit is a plain
//! number. Every change of unit is a named conversion:
//!
//! ```
//! use hybank_core::units::{Hertz, Seconds};
//! let h = Seconds(1.0 / 48_000.0);
//! assert_eq!(format!("{:.1}", Seconds(25e-6).in_fast_periods(h)), "1.2 fast periods");
//! assert!((Hertz(12_000.0).angular().per_fast_period(h).0 - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
//! ```
//!
//! A value in another unit does not compile:
//!
//! ```compile_fail,E0308
//! use hybank_core::units::{FastPeriods, Seconds};
//! let delay: FastPeriods = Seconds(25e-6);
//! ```

mod grid_time;
mod timeline;

use crate::messages::Number;
use std::f64::consts::TAU;
use std::fmt;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

pub use grid_time::{Fraction, GridTime};
pub use timeline::Timeline;

/// Declares a newtype over f64 with the arithmetic that keeps its unit.
macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $symbol:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        #[derive(serde::Serialize)]
        #[serde(transparent)]
        pub struct $name(
            #[doc = concat!("The value in ", $symbol, ".")]
            pub f64,
        );

        impl Quantity for $name {
            const UNIT: &'static str = $symbol;

            fn value(self) -> f64 {
                self.0
            }
        }

        impl fmt::Display for $name {
            /// The value, formatted as a [`Number`] is, and its unit.
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::Display::fmt(&Number(self.0), f)?;
                write!(f, " {}", Self::UNIT)
            }
        }

        impl fmt::LowerExp for $name {
            /// The value in scientific notation and its unit.
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                fmt::LowerExp::fmt(&self.0, f)?;
                write!(f, " {}", Self::UNIT)
            }
        }

        impl Add for $name {
            type Output = Self;

            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl Sub for $name {
            type Output = Self;

            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl Neg for $name {
            type Output = Self;

            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Mul<f64> for $name {
            type Output = Self;

            fn mul(self, factor: f64) -> Self {
                Self(self.0 * factor)
            }
        }

        impl Div<f64> for $name {
            type Output = Self;

            fn div(self, divisor: f64) -> Self {
                Self(self.0 / divisor)
            }
        }

        impl Div for $name {
            type Output = f64;

            fn div(self, other: Self) -> f64 {
                self.0 / other.0
            }
        }
    };
}

/// A number with a unit.
pub trait Quantity: Copy + fmt::Debug + fmt::Display + PartialEq {
    /// The unit as messages write it.
    const UNIT: &'static str;

    /// The bare number.
    fn value(self) -> f64;
}

/// A unit of time and the units of frequency that belong to it. A value generic over `Time` cannot mix two
/// time bases.
pub trait Time: Quantity {
    /// Cycles per unit of this time.
    type Frequency: Quantity;
    /// Radians per unit of this time.
    type AngularFrequency: Quantity;
}

quantity! {
    /// A time in seconds.
    Seconds, "s"
}
quantity! {
    /// A time in units of the fast period, t' = t / h: the time of the designer and of the simulator.
    FastPeriods, "fast periods"
}
quantity! {
    /// A frequency in cycles per second.
    Hertz, "Hz"
}
quantity! {
    /// A frequency in cycles per fast period, f' = f h; 1/2 is the Nyquist frequency of the fast samples.
    CyclesPerFastPeriod, "cycles per fast period"
}
quantity! {
    /// An angular frequency in radians per second, w = 2 pi f.
    RadiansPerSecond, "rad/s"
}
quantity! {
    /// An angular frequency in radians per fast period, w' = w h; pi is the Nyquist frequency of the fast
    /// samples.
    RadiansPerFastPeriod, "rad per fast period"
}
quantity! {
    /// An angular frequency in radians per slow period, W = M h w; pi is the Nyquist frequency of one
    /// converter.
    RadiansPerSlowPeriod, "rad per slow period"
}
quantity! {
    /// An angle or a phase in radians.
    Radians, "rad"
}
quantity! {
    /// A ratio of amplitudes, 20 log10(ratio).
    Decibels, "dB"
}

impl Time for Seconds {
    type Frequency = Hertz;
    type AngularFrequency = RadiansPerSecond;
}

impl Time for FastPeriods {
    type Frequency = CyclesPerFastPeriod;
    type AngularFrequency = RadiansPerFastPeriod;
}

impl Seconds {
    /// t' = t / h.
    pub fn in_fast_periods(self, fast_period: Self) -> FastPeriods {
        FastPeriods(self / fast_period)
    }

    /// The rate 1/T of a period T.
    pub fn rate(self) -> Hertz {
        Hertz(self.0.recip())
    }
}

impl FastPeriods {
    /// t = t' h.
    pub fn in_seconds(self, fast_period: Seconds) -> Seconds {
        Seconds(self.0 * fast_period.0)
    }
}

impl Hertz {
    /// f' = f h.
    pub fn per_fast_period(self, fast_period: Seconds) -> CyclesPerFastPeriod {
        CyclesPerFastPeriod(self.0 * fast_period.0)
    }

    /// w = 2 pi f.
    pub fn angular(self) -> RadiansPerSecond {
        RadiansPerSecond(TAU * self.0)
    }

    /// The period 1/f of a rate f.
    pub fn period(self) -> Seconds {
        Seconds(self.0.recip())
    }
}

impl RadiansPerSecond {
    /// w' = w h.
    pub fn per_fast_period(self, fast_period: Seconds) -> RadiansPerFastPeriod {
        RadiansPerFastPeriod(self.0 * fast_period.0)
    }

    /// f = w / (2 pi).
    pub fn in_hertz(self) -> Hertz {
        Hertz(self.0 / TAU)
    }
}

impl RadiansPerSlowPeriod {
    /// f = W / (2 pi M h), with the slow period M h.
    pub fn in_hertz(self, slow_period: Seconds) -> Hertz {
        Hertz(self.0 / (TAU * slow_period.0))
    }
}

impl Decibels {
    /// 20 log10(ratio) of two amplitudes; minus infinity for 0, NaN for a negative ratio.
    pub fn of_amplitude(ratio: f64) -> Self {
        Self(20.0 * ratio.log10())
    }

    /// 10 log10(ratio) of two powers; minus infinity for 0, NaN for a negative ratio.
    pub fn of_power(ratio: f64) -> Self {
        Self(10.0 * ratio.log10())
    }

    /// 10^(dB / 20).
    pub fn amplitude_ratio(self) -> f64 {
        10f64.powf(self.0 / 20.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Equal up to `ulps` roundings.
    fn close(a: f64, b: f64, ulps: f64) -> bool {
        (a - b).abs() <= ulps * f64::EPSILON * a.abs().max(b.abs())
    }

    /// Mantissas of both signs over 18 decades.
    fn wild() -> impl Strategy<Value = f64> {
        (-9.0..9.0f64, prop::bool::ANY).prop_map(|(decade, negative)| {
            let size = 10f64.powf(decade);
            if negative { -size } else { size }
        })
    }

    proptest! {
        #[test]
        fn conversions_undo_each_other(x in wild(), h in wild()) {
            let h = Seconds(h.abs());
            prop_assert!(close(Seconds(x).in_fast_periods(h).in_seconds(h).0, x, 1.0));
            prop_assert!(close(Hertz(x).angular().in_hertz().0, x, 1.0));
            prop_assert!(close(Hertz(x).period().rate().0, x, 1.0));
        }

        #[test]
        fn the_phase_of_a_tone_does_not_depend_on_the_unit_of_time(f in wild(), t in wild(), h in wild()) {
            let (h, f, t) = (Seconds(h.abs()), Hertz(f), Seconds(t));
            let radians = f.angular().0 * t.0;
            prop_assert!(close(f.angular().per_fast_period(h).0 * t.in_fast_periods(h).0, radians, 3.0));
            prop_assert!(close(TAU * f.per_fast_period(h).0 * t.in_fast_periods(h).0, radians, 3.0));
        }

        #[test]
        fn both_ways_to_hertz_agree(f in wild(), h in wild(), ratio in 1usize..1024) {
            let h = Seconds(h.abs());
            let slow = RadiansPerSlowPeriod(Hertz(f).angular().per_fast_period(h).0 * ratio as f64);
            prop_assert!(close(slow.in_hertz(h * ratio as f64).0, f, 4.0));
        }

        #[test]
        fn decibels_of_an_amplitude_are_those_of_its_power(ratio in wild()) {
            let ratio = ratio.abs();
            let db = Decibels::of_amplitude(ratio);
            prop_assert!((db - Decibels::of_power(ratio * ratio)).0.abs() < 1e-12);
            prop_assert!((db.amplitude_ratio() / ratio - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn known_values() {
        let h = Seconds(1e-3);
        assert_eq!(Seconds(0.5).in_fast_periods(h), FastPeriods(500.0));
        assert_eq!(Hertz(250.0).per_fast_period(h), CyclesPerFastPeriod(0.25));
        assert_eq!(Hertz(0.5).angular(), RadiansPerSecond(std::f64::consts::PI));
        // Half the rate of a converter is pi per slow period.
        assert_eq!(RadiansPerSlowPeriod(std::f64::consts::PI).in_hertz(Seconds(0.5)), Hertz(1.0));
        assert_eq!(Decibels::of_amplitude(10.0), Decibels(20.0));
        assert_eq!(Decibels::of_power(0.0), Decibels(f64::NEG_INFINITY));
    }

    #[test]
    fn quantities_are_written_with_their_unit() {
        assert_eq!(Seconds(0.3).to_string(), "0.3 s");
        assert_eq!(format!("{:e}", Hertz(48e3)), "4.8e4 Hz");
        assert_eq!(format!("{:.2}", RadiansPerFastPeriod(1.23456)), "1.23 rad per fast period");
        assert_eq!(format!("{:.1}", Decibels(-3.01)), "-3.0 dB");
    }
}
