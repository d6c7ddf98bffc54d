//! gamma against the errors of the delays, as CSV or as a picture.

use super::super::bank_file::write_bytes;
use super::super::picture_format::PictureFormat;
use super::Failure;
use crate::bank::Bank;
use crate::design::DesignError;
use crate::design::uncertainty::norm_at;
use crate::plot::{Chart, Series};
use crate::units::Seconds;
use crate::verify::uncertainty::{ErrorBox, ErrorPoint};
use std::fmt::Write;
use std::path::Path;

/// Points per curve; an odd number has the nominal delays among them.
const POINTS: usize = 41;

/// Curves of gamma over the share of the box, from -1 to 1.
pub(super) struct Sweep {
    half_widths: Vec<Seconds>,
    shares: Vec<f64>,
    /// One per channel whose delay is uncertain, then the one through the worst point.
    curves: Vec<Curve>,
}

struct Curve {
    label: String,
    gammas: Vec<f64>,
}

impl Sweep {
    /// Moves each channel alone, and all together towards `worst`.
    pub(super) fn new(bank: &Bank, errors: &ErrorBox, worst: &ErrorPoint) -> Result<Self, DesignError> {
        let shares: Vec<f64> = (0..POINTS).map(|k| 2.0 * k as f64 / (POINTS - 1) as f64 - 1.0).collect();
        let along = |label: String, delays: &[Seconds]| -> Result<Curve, DesignError> {
            let gamma = |share: &f64| {
                let delays = delays.iter().map(|&delay| delay * *share).collect();
                let point = ErrorPoint { delays, ..ErrorPoint::none(bank.channel_count()) };
                norm_at(bank, &point).map(|(gamma, _)| gamma)
            };
            Ok(Curve { label, gammas: shares.iter().map(gamma).collect::<Result<_, _>>()? })
        };
        let mut curves = Vec::new();
        for i in (0..bank.channel_count()).filter(|&i| errors.delays[i].0 > 0.0) {
            let mut alone = vec![Seconds(0.0); bank.channel_count()];
            alone[i] = errors.delays[i];
            curves.push(along(format!("channel {}", i + 1), &alone)?);
        }
        curves.push(along("all, towards the worst point".into(), &worst.delays)?);
        Ok(Self { half_widths: errors.delays.clone(), shares, curves })
    }

    /// Writes the file that `path` names: SVG or PNG if its extension says so, else CSV.
    pub(super) fn write(&self, path: &Path, force: bool) -> Result<(), Failure> {
        let bytes = match PictureFormat::of(path) {
            Some(format) => format.file(&self.chart(), &[]).map_err(Failure::input)?,
            None => self.csv().into_bytes(),
        };
        write_bytes(path, &bytes, force)
    }

    fn csv(&self) -> String {
        let mut text = String::from("share_of_box");
        for curve in &self.curves {
            let _ = write!(text, ",{}", curve.label.replace(", ", " ").replace(' ', "_"));
        }
        text.push('\n');
        for (k, share) in self.shares.iter().enumerate() {
            let _ = write!(text, "{share}");
            for curve in &self.curves {
                let _ = write!(text, ",{}", curve.gammas[k]);
            }
            text.push('\n');
        }
        text
    }

    fn chart(&self) -> Chart {
        let series = |curve: &Curve| Series {
            label: curve.label.clone(),
            points: self.shares.iter().copied().zip(curve.gammas.iter().copied()).collect(),
        };
        let widths: Vec<String> = self.half_widths.iter().map(|half| format!("{:.3e}", half.0)).collect();
        Chart {
            title: "gamma with delays that are not those of the bank".into(),
            x_label: format!("error, in units of the box ({} s)", widths.join(", ")),
            y_label: "gamma".into(),
            series: self.curves.iter().map(series).collect(),
        }
    }
}
