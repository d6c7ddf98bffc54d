//! The summary of a rendering as text and as JSON.

use super::inputs;
use crate::image::quality::Quality;
use crate::interpolate::HoleCount;
use crate::interpolate::plane::Convergence;
use crate::pipeline::uncalibrated::GeometryReport;
use crate::pipeline::{Agreement, Rendering, Report};
use serde::Serialize;

/// Everything `--json` prints. Figures of merit are null without a truth; an infinite PSNR (equal images)
/// is null too, with mae 0.
#[derive(Debug, Default, Serialize)]
pub(super) struct Summary {
    pub(super) psnr: Option<f64>,
    pub(super) ssim: Option<f64>,
    pub(super) mae: Option<f64>,
    /// Share of all pixels that samples cover.
    pub(super) coverage: f64,
    /// Time of the rendering, without reading, making depth dense, comparing and writing.
    pub(super) seconds: f64,
    /// Time of reading the files and making depth dense.
    pub(super) preparation_seconds: f64,
    /// The views that were used, by number from 0.
    pub(super) views: Vec<usize>,
    pub(super) samples: Report,
    pub(super) holes: HoleCount,
    /// Unknown depths filled before propagation.
    pub(super) filled_depths: usize,
    pub(super) size: [usize; 2],
    /// Region of psnr, ssim and mae: the whole "image", or the "hull" of the features.
    pub(super) compared_on: &'static str,
    /// Share of the pixels that were compared.
    pub(super) compared_share: Option<f64>,
    /// The same figures over the whole image, if that is another region.
    pub(super) whole_image: Option<Quality>,
    pub(super) convergence: Option<Convergence>,
    /// How well the views agree in depth and colour, from the inputs alone.
    pub(super) agreement: Agreement,
    pub(super) geometry: Option<GeometryReport>,
    /// What the numbers in the file of --depth are.
    pub(super) depths: Option<&'static str>,
}

impl Summary {
    /// A summary without figures of merit.
    pub(super) fn new(rendering: &Rendering, seconds: f64, filled_depths: usize) -> Self {
        let r = &rendering.report;
        let (width, height) = rendering.image.size();
        Self {
            coverage: rendering.coverage(),
            seconds,
            views: rendering.views.clone(),
            samples: *r,
            holes: r.holes,
            filled_depths,
            size: [width, height],
            compared_on: "image",
            convergence: r.convergence,
            agreement: rendering.agreement.clone(),
            ..Self::default()
        }
    }

    /// Adds the figures of a comparison.
    pub(super) fn compare(&mut self, quality: &Quality) {
        (self.psnr, self.ssim, self.mae) = (Some(quality.psnr), Some(quality.ssim), Some(quality.mae));
        self.compared_share = Some(quality.pixels as f64 / (self.size[0] * self.size[1]) as f64);
    }

    /// The summary as text.
    pub(super) fn text(&self) -> String {
        let mut lines = Vec::new();
        if let (Some(psnr), Some(ssim), Some(mae)) = (self.psnr, self.ssim, self.mae) {
            lines.push(format!(
                "PSNR      {psnr:.2} dB   SSIM {ssim:.4}   MAE {mae:.3}   (on the {})",
                self.compared_on
            ));
        }
        lines.push(format!("coverage  {:.2} %", 100.0 * self.coverage));
        lines.extend(self.counts());
        lines.extend(inputs::line(&self.agreement));
        lines.extend(self.depths_line());
        lines.extend(self.geometry_line());
        lines.push(format!(
            "time      {:.3} s, after {:.3} s of reading and making depth dense",
            self.seconds, self.preparation_seconds
        ));
        lines.join("\n") + "\n"
    }

    /// Samples, holes and depths that were filled.
    fn counts(&self) -> Vec<String> {
        let s = &self.samples;
        let d = &s.dropped;
        let mut lines = vec![
            format!(
                "samples   {} propagated, {} occluded, {} used; dropped: {} unknown depth, {} behind, {} outside",
                s.propagated, s.occluded, s.used, d.unknown, d.behind, d.outside
            ),
            format!(
                "holes     {} px cracks, {} px disocclusions; {} px shown by samples of guessed depth only",
                self.holes.crack, self.holes.disocclusion, self.holes.guessed
            ),
        ];
        if self.filled_depths > 0 {
            lines.push(format!(
                "depth     {} unknown values filled from their neighbours",
                self.filled_depths
            ));
        }
        lines
    }

    fn depths_line(&self) -> Option<String> {
        self.depths.as_ref().map(|depths| format!("depths    written {depths}"))
    }

    /// What all views of a path have in common.
    pub(super) fn common_lines(&self) -> String {
        let lines = inputs::line(&self.agreement).into_iter().chain(self.depths_line());
        lines.map(|line| line + "\n").collect()
    }

    fn geometry_line(&self) -> Option<String> {
        let g = self.geometry.as_ref()?;
        Some(format!(
            "geometry  {} of {} matches agree (RMS {:.3} px); virtual camera from {} of {} (RMS {:.3} px)",
            g.inliers, g.matches, g.sampson_rms, g.resection_inliers, g.sightings, g.resection_rms
        ))
    }
}
