//! The error of one rendered view, pixel by pixel, without a photograph to compare it with.
//!
//! Numbers for each pixel, in grey levels:
//!
//! * **expected**: the root of the expected square. By Jensen's inequality the expected error is not larger;
//! * **estimate**: the expected absolute error against a photograph from the place of the virtual camera.
//!
//! Both are sums over causes. The size of each cause is computed: the bends of the view, which the fit
//! smooths; the views that share in a pixel; the slope; the change under errors of depth as large as the
//! maps' disagreement; depth edges nearby; holes, by the variogram of the photographs. The weights of the
//! causes are calibrated on the inputs themselves: each view is left out in turn and rendered from the
//! others, and its photograph is the truth. A single view cannot be left out; it takes the weights of
//! typical photographs.
//!
//! ```
//! use hybank_ibr::analysis::Predictor;
//! use hybank_ibr::depth::{DepthMap, Measure};
//! use hybank_ibr::image::Image;
//! use hybank_ibr::pipeline::RenderSettings;
//! use hybank_ibr::propagate::RectifiedView;
//! // A textured wall four pixels of disparity away.
//! let size = (64, 32);
//! let texture = |x: usize, y: usize| 120.0 + 60.0 * (0.7 * x as f32).sin() + 30.0 * (0.4 * y as f32).cos();
//! let shot = |shift: usize| (0..64 * 32).map(|p| texture(p % 64 + shift, p / 64)).collect();
//! let images = [Image::new(64, 32, 1, shot(0))?, Image::new(64, 32, 1, shot(4))?];
//! let map = DepthMap::new(size, vec![4.0; 64 * 32], 1.0, Measure::Disparity)?;
//! let views = [0, 1].map(|k| RectifiedView { image: &images[k], map: &map, camera: k as f64 });
//! // The view half-way, its error, and what makes it smaller.
//! let view = Predictor::new(&views, &RenderSettings::default())?.at(&0.5, size)?;
//! assert!(view.totals().estimate < 20.0);
//! println!("{}", view.dominant().remedy());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calibrate;
mod estimate;
mod examine;
mod jitter;
mod predictor;
mod regressors;
mod variogram;

pub use estimate::{Calibration, Totals, ViewError};
pub use jitter::{depth_jitter, with_noise};
pub use predictor::Predictor;

/// What an error comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Cause {
    /// Samples too far apart for the texture, and the smoothing of the fit.
    Density,
    /// Noise, exposure and colours that depend on the view.
    Texture,
    /// Depths, and places of the cameras.
    Depth,
    /// Outlines of surfaces.
    Edges,
    /// What no view sees.
    Holes,
}

impl Cause {
    /// All causes.
    pub const ALL: [Self; 5] = [Self::Density, Self::Texture, Self::Depth, Self::Edges, Self::Holes];

    /// What makes this part of the error smaller.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Density => "more views, or views of more pixels",
            Self::Texture => "less noise, equal exposure and white balance, views closer to the virtual one",
            Self::Depth => "finer depth, and better calibrated cameras",
            Self::Edges => "depth maps that are sharp at outlines, and more views",
            Self::Holes => "views that see behind the near surfaces",
        }
    }
}
