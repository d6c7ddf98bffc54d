//! Samples enter the normal equations: into the whole image, or into several parts of it at a time.

use super::{Fit2Sample, GUESSED, PlaneProblem};
use crate::interpolate::holes::reach;
use crate::occlusion::LARGEST_SPACING;
use crate::sample::Sample;
use hybank_sampling::fit2::Fit2Rows;
use rayon::prelude::*;
use std::ops::Range;

/// Some rows of the image, with all that samples change there.
struct Part<'a, const ORDER: usize, const C: usize> {
    size: (usize, usize),
    /// Index of the first pixel.
    first: usize,
    fit: Fit2Rows<'a, ORDER, C>,
    depth: &'a mut [f32],
    distance: &'a mut [f32],
    counts: &'a mut [u16],
}

impl<'a, const ORDER: usize, const C: usize> Part<'a, ORDER, C> {
    fn split(self, row: usize) -> (Self, Self) {
        let (size, pixel) = (self.size, row * self.size.0);
        let (fit, at) = (self.fit.split_at(row), pixel - self.first);
        let (depth, distance) = (self.depth.split_at_mut(at), self.distance.split_at_mut(at));
        let counts = self.counts.split_at_mut(at);
        let part = |first, fit, depth, distance, counts| Self { size, first, fit, depth, distance, counts };
        (
            part(self.first, fit.0, depth.0, distance.0, counts.0),
            part(pixel, fit.1, depth.1, distance.1, counts.1),
        )
    }

    /// Adds samples that touch this part only; returns how many lie in the image, and the sum of the areas
    /// that they stand for, at least a pixel each.
    fn add(&mut self, samples: &[Sample<C>]) -> (usize, f64) {
        let (right, bottom) = (self.size.0 as f64 - 1.0, self.size.1 as f64 - 1.0);
        let (mut count, mut area) = (0, 0.0);
        for s in samples {
            let inside = s.x >= -0.5 && s.x <= right + 0.5 && s.y >= -0.5 && s.y <= bottom + 0.5;
            if inside {
                self.register(s);
                self.fit.add(&Fit2Sample { x: s.x, y: s.y, values: s.value, weight: s.weight });
                count += 1;
                area += f64::from(s.spacing).powi(2).max(1.0);
            }
        }
        (count, area)
    }

    /// Records the depth of the sample at the pixels within its reach, half a gap, unless another sample is
    /// closer, and counts it at its nearest pixel.
    fn register(&mut self, s: &Sample<C>) {
        let (width, height) = self.size;
        let half = reach(s.spacing);
        let range = |centre: f64, length: usize| {
            // Casts cut toward zero, by way of 32 bits; rounding functions are library calls on baseline
            // x86-64, and other casts take several instructions.
            let (start, end) = ((centre - half).max(0.0), (centre + half).max(0.0) as u32 as usize + 1);
            let low = start as u32 as usize + usize::from(start > f64::from(start as u32));
            low.min(length)..end.min(length)
        };
        let columns = range(s.x, width);
        for row in range(s.y, height) {
            for column in columns.clone() {
                let (dx, dy) = (s.x - column as f64, s.y - row as f64);
                let squared = dx * dx + dy * dy;
                let p = row * width + column - self.first;
                let distance = squared as f32 + if s.origin.is_guess() { GUESSED } else { 0.0 };
                if squared <= half * half && distance < self.distance[p] {
                    (self.distance[p], self.depth[p]) = (distance, s.depth);
                }
            }
        }
        let (column, row) = ((s.x + 0.5) as u32 as usize, (s.y + 0.5) as u32 as usize);
        let count = &mut self.counts[row.min(height - 1) * width + column.min(width - 1) - self.first];
        *count = count.saturating_add(1);
    }
}

impl<const ORDER: usize, const C: usize> PlaneProblem<ORDER, C> {
    fn whole(&mut self) -> Part<'_, ORDER, C> {
        Part {
            size: (self.width, self.height),
            first: 0,
            fit: self.fit.rows(),
            depth: &mut self.depth,
            distance: &mut self.distance,
            counts: &mut self.counts,
        }
    }

    /// Adds visible samples, all of whose numbers are finite. Samples more than half a pixel outside the
    /// image are ignored; samples less far outside are moved to its border.
    pub(crate) fn add(&mut self, samples: &[Sample<C>]) {
        let added = self.whole().add(samples);
        self.count_in(added);
    }

    fn count_in(&mut self, (count, area): (usize, f64)) {
        self.count += count;
        self.area += area;
    }

    /// Adds the samples of bands of rows, which `make` returns: those whose row, cut to the image, lies in
    /// the band. The bands follow each other and cover the image. Bands that do not touch are made and added
    /// at the same time; the result does not depend on the number of threads.
    pub(crate) fn add_bands(
        &mut self,
        bands: &[Range<usize>],
        make: impl Fn(&Range<usize>) -> Vec<Sample<C>> + Sync,
    ) {
        // A sample changes the rows of its splines and those within its reach.
        let margin = reach(LARGEST_SPACING).ceil() as usize + ORDER - 1;
        if bands.iter().any(|band| band.len() < 2 * margin) {
            return bands.iter().for_each(|band| self.add(&make(band)));
        }
        for parity in 0..2 {
            let height = self.height;
            let mut parts: Vec<(&Range<usize>, Part<'_, ORDER, C>)> = Vec::new();
            let mut rest = self.whole();
            for band in bands.iter().skip(parity).step_by(2) {
                let (_, after) = rest.split(band.start.saturating_sub(margin));
                let (part, after) = after.split((band.end + margin).min(height));
                parts.push((band, part));
                rest = after;
            }
            let add = |(band, mut part): (&Range<usize>, Part<'_, ORDER, C>)| part.add(&make(band));
            let added: Vec<(usize, f64)> = parts.into_par_iter().with_max_len(1).map(add).collect();
            added.into_iter().for_each(|added| self.count_in(added));
        }
    }

    /// Multiplies the stiffness of bicubic splines by the mean area of the samples so far. That of bilinear
    /// ones, which bending smooths, stays: they lose 0.2 to 0.6 dB by it where a view is magnified by two.
    pub(crate) fn stiffened_by_area(mut self) -> Self {
        if ORDER == 4 && self.count > 0 {
            self.settings.plane.stiffness *= self.area / self.count as f64;
        }
        self
    }

    pub(super) fn add_on_pixel(&mut self, pixel: usize, values: [f32; C], weight: f32) {
        let (x, y) = ((pixel % self.width) as f64, (pixel / self.width) as f64);
        self.fit.rows().add(&Fit2Sample { x, y, values, weight });
    }
}
