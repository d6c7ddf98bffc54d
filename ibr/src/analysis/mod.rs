//! The error of one rendered view, pixel by pixel, without a photograph to compare it with.
//!
//! Numbers for each pixel, in grey levels:
//!
//! * **local limit**: what the error does not exceed where slopes, second differences and residuals are at
//!   most those of the photographs nearby. It is not sure: photographs break it where surfaces reflect,
//!   where depth is wrong in all views, and where something lies between the samples;
//! * **expected**: the root of the expected square. By Jensen's inequality the expected error is not larger;
//! * **estimate**: the expected absolute error against a photograph from the place of the virtual camera.
//!
//! The local limit has the form of that of linear interpolation, (1/8) |f''| D^2 + E_T + E_D B |f'|, with
//! residuals, slopes and second differences of the photographs nearby (`lookup.rs`).
//!
//! The other two are sums over causes. The size of each cause is computed: the bias of the fit, by
//! fitting the fit once more (`rows.rs`); the views that share in a pixel; the slope; the change under
//! errors of depth as large as the maps' disagreement; depth edges nearby; doubtful depths; holes, by the
//! variogram of the photographs. The weights of the causes are calibrated on the inputs themselves:
//! each view is left out in turn and rendered from the others, and its photograph is the truth. A single
//! view cannot be left out; it takes the weights of typical photographs.
//!
//! ```
//! use hybank_ibr::analysis::Predictor;
//! use hybank_ibr::camera::Camera;
//! use hybank_ibr::pipeline::RenderSettings;
//! use hybank_ibr::propagate::RectifiedView;
//! use hybank_ibr::synthetic::{SyntheticScene, rig_camera, rig_disparity};
//! let (size, settings) = ((64, 32), RenderSettings::default());
//! let shots = [0.0, 1.0].map(|position| {
//!     let camera = Camera::metric(rig_camera(position, size), false).expect("a pinhole camera");
//!     let (image, depth) = SyntheticScene::default().view(&camera, size);
//!     (image, rig_disparity(&depth, size.0), position)
//! });
//! let views = shots.each_ref().map(|(image, map, camera)| RectifiedView { image, map, camera: *camera });
//! // The view half-way, its error, and what makes it smaller.
//! let predictor = Predictor::new(&views, &settings)?;
//! let view = predictor.at(&0.5, size)?;
//! assert!((0.1..20.0).contains(&view.totals().estimate));
//! println!("{}", view.dominant().remedy());
//! # Ok::<(), hybank_ibr::pipeline::RenderError>(())
//! ```

mod calibrate;
mod choice;
mod estimate;
mod general;
mod jitter;
mod lookup;
mod predictor;
mod regressors;
mod rows;
mod variogram;

pub use choice::Choice;
pub use estimate::{Calibration, Predicted, Totals, ViewError};
pub use jitter::{depth_jitter, with_noise};
pub use predictor::Predictor;
#[cfg(feature = "cli")]
pub(crate) use regressors::difference;

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
