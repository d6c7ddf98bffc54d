//! The files of measurements that a spec names.

use super::{MeasuredResponse, vector_fit};
use hybank_core::files::{self, Bound};
use hybank_core::messages::Quoted;
use hybank_core::quantity::readable;
use hybank_core::spec::{FilterModel, MeasuredFilter, MeasurementFile};
use std::cell::RefCell;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Largest file of a measurement.
const MEASUREMENT: Bound =
    Bound { bytes: 64 << 20, kind: "a measured response", remedy: "give the file that was meant" };

/// The measurements that a spec names, each read and fitted once.
///
/// ```
/// use hybank_verify::analog::fit::Measurements;
/// use hybank_core::spec::{MeasuredFilter, MeasurementFile};
/// use hybank_core::units::Seconds;
/// let folder = std::env::temp_dir().join(format!("hybank-fit-{}", std::process::id()));
/// std::fs::create_dir_all(&folder)?;
/// std::fs::write(folder.join("rc.csv"), "f (kHz),dB,deg\n0,0,0\n1,-3.0103,-45\n2,-6.9897,-63.4349\n")?;
/// let measurements = Measurements::in_folder(folder.clone());
/// let (path, measurement) = ("rc.csv".into(), MeasurementFile::Response);
/// let model = measurements.model(&MeasuredFilter { path, measurement, order: 1, deembed: Seconds(0.0) })?;
/// assert!(model.error.0 < 1e-4);
/// assert_eq!(measurements.files(), [folder.join("rc.csv")]);
/// # std::fs::remove_dir_all(folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Measurements {
    folder: PathBuf,
    made: RefCell<Vec<(MeasuredFilter, FilterModel)>>,
    echo: RefCell<Vec<String>>,
}

impl Measurements {
    /// For a spec in this folder, to which names of files are relative.
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder, made: RefCell::default(), echo: RefCell::default() }
    }

    /// The folder of the spec.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The files that were read.
    pub fn files(&self) -> Vec<PathBuf> {
        self.made.borrow().iter().map(|(made, _)| self.folder.join(&made.path)).collect()
    }

    /// What was understood of the measurements that were read since the last call, a line each.
    pub fn echo(&self) -> Vec<String> {
        self.echo.take()
    }

    /// The model of a measurement.
    ///
    /// # Errors
    /// A text with the file and the reason if it cannot be read or fitted.
    pub fn model(&self, wanted: &MeasuredFilter) -> Result<FilterModel, String> {
        let known =
            self.made.borrow().iter().find(|(made, _)| made == wanted).map(|(_, model)| model.clone());
        if let Some(model) = known {
            return Ok(model);
        }
        let path = self.folder.join(&wanted.path);
        let text = files::read_text(&path, MEASUREMENT).map_err(|error| error.to_string())?;
        let named = |error: &dyn Display| format!("{}: {error}", Quoted(&path));
        let measured = response(&path, &text, wanted).map_err(|error| named(&error))?;
        let fitted = vector_fit(&measured.without_delay(wanted.deembed), wanted.order);
        let fitted = fitted.map_err(|error| named(&error))?;
        let points = measured.points();
        let at = |k: usize| points.get(k).map_or(0.0, |point| point.0.0);
        self.echo.borrow_mut().push(format!(
            "{}: {} poles fitted to {} frequencies, {} to {}; error at most {:.2e} dB",
            Quoted(&path),
            wanted.order,
            points.len(),
            readable(at(0), "Hz"),
            readable(at(points.len() - 1), "Hz"),
            fitted.error.0
        ));
        let model = FilterModel { filter: fitted.filter, error: fitted.error };
        self.made.borrow_mut().push((wanted.clone(), model.clone()));
        Ok(model)
    }
}

fn response(path: &Path, text: &str, wanted: &MeasuredFilter) -> Result<MeasuredResponse, String> {
    let MeasurementFile::Touchstone(parameter) = &wanted.measurement else {
        return MeasuredResponse::from_csv(text).map_err(|error| error.to_string());
    };
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let ports = match extension.to_ascii_lowercase().as_str() {
        "s1p" => 1,
        "s2p" => 2,
        _ => return Err("Touchstone files of one or two ports end in .s1p or .s2p".to_owned()),
    };
    MeasuredResponse::from_touchstone(text, ports, parameter.as_deref()).map_err(|error| error.to_string())
}
