//! Delays that drift.
//!
//! Each channel's delay relative to the reference changes, and the rate at which it changes walks at random
//! (two free-running clocks). A [`DelayFilter`] is the Kalman filter of one delay and its rate: measurements
//! of block fits enter with their variance, silence lets the variance grow. A tracker per channel refuses
//! measurements that contradict the filter, and says whether it is locked. A warning comes ahead of
//! delays that come together, where no bank recovers the signal. A [`Follower`] measures the delays of the
//! channels block by block, by a pilot tone or by any signal. Delays measured before are known on both sides
//! of every instant: a smoothing spline of [`crate::sampling`] goes through them. [`align`] measures them so
//! for whole recordings, which may have begun at any time.
//!
//! ```
//! use hybank::track::{DelayFilter, DelayMeasurement, DelayState};
//! use hybank::units::Seconds;
//! // Clocks whose rate walks by 1e-9 in a second; delays known to 1 ns at the beginning, rates to 10 ppm.
//! let rate_walk = 1e-18;
//! let mut filter = DelayFilter::new(DelayState::known(Seconds(3e-9), 1e-9, 1e-5), rate_walk);
//! for block in 0..100 {
//!     filter.advance(Seconds(0.01));
//!     // The delay grows by 2 ppm.
//!     let delay = Seconds(3e-9 + 2e-6 * 0.01 * f64::from(block + 1));
//!     filter.update(DelayMeasurement { delay, variance: 1e-24 });
//! }
//! assert!((filter.state().rate - 2e-6).abs() < 1e-9);
//! ```

mod align;
mod error;
mod filter;
mod follower;
mod log;
mod readings;
mod source;
#[cfg(test)]
mod tests;
mod timeline;
mod tracker;
mod tracking;

pub use align::{AlignError, AlignSettings, AlignWarning, AlignedChannel, Alignment, RATE_WALK, align};
pub use error::{ReadingProblem, TrackError};
pub use filter::{DelayFilter, DelayMeasurement, DelayState, Innovation};
pub use follower::{Followed, Follower};
pub use log::{Logged, TrackWarning};
pub use readings::Reading;
pub use source::DelaySource;
pub use tracker::Lock;
pub use tracking::Tracking;
