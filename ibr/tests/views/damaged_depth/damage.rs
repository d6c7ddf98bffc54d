//! Damages of depth maps, as cameras, matchers and lidar make them, and of the exposure.

use hybank_ibr::camera::Camera;
use hybank_ibr::image::{Image, MOST_PIXELS, pfm, read_image, read_map, save};
use hybank_ibr::propagate::Viewpoint;
use hybank_ibr::scene::SceneSpec;
use nalgebra::Matrix3x4;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::error::Error;
use std::path::{Path, PathBuf};

/// What is done to a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Damage {
    Clean,
    /// This share of the values is anything between the least and the largest of the map.
    Outliers(f64),
    /// This share of the values lies in discs of a radius of 3 pixels, each with one such value.
    Blobs(f64),
    /// Within two pixels of another surface a value lies anywhere between both, as that of a camera that
    /// measures the time of flight.
    Flying,
    /// Each value is the mean of those within two rows and columns.
    Blurred,
    /// White errors of this many pixels in the virtual view for a rig, or to the next view.
    Noise(f64),
    /// This share of the values is known, the rest is 0.
    Scattered(f64),
    /// The same, and of what is known this share is anything between the least and the largest of the map.
    ScatteredOutliers(f64, f64),
    /// Every sixth value in rows and columns is used.
    Lattice,
    /// There are no maps: the depths are found from the photographs.
    Matched,
    /// What is infinitely far away has this value.
    Sky(f32),
    /// Red, green and blue of the second photograph have these factors.
    Exposure([f64; 3]),
    /// What is infinitely far away is unknown, and of the rest this share is known.
    ScatteredSky(f64),
}

impl Damage {
    pub(crate) fn name(self) -> String {
        match self {
            Self::Clean => "clean".into(),
            Self::Outliers(share) => format!("outliers {} %", 100.0 * share),
            Self::Blobs(share) => format!("blobs {} %", 100.0 * share),
            Self::Flying => "flying pixels".into(),
            Self::Blurred => "blurred".into(),
            Self::Noise(pixels) => format!("noise {pixels} px"),
            Self::Scattered(share) => format!("scattered {} %", 100.0 * share),
            Self::ScatteredOutliers(share, wrong) => {
                format!("scattered {} %, of which {} % outliers", 100.0 * share, 100.0 * wrong)
            }
            Self::Lattice => "lattice 2.8 %".into(),
            Self::Matched => "matched".into(),
            Self::ScatteredSky(share) => format!("scattered {} %, nothing in the sky", 100.0 * share),
            Self::Sky(value) => format!("sky as {value:e}"),
            Self::Exposure(gains) => format!("exposure {gains:?}"),
        }
    }

    pub(crate) fn step(self) -> usize {
        if self == Self::Lattice { 6 } else { 1 }
    }

    /// The scene with damaged maps, which are written into a folder.
    pub(crate) fn applied(
        self,
        spec: &SceneSpec,
        path: &Path,
        folder: &Path,
    ) -> Result<SceneSpec, Box<dyn Error>> {
        let mut damaged = spec.clone();
        let beside = path.parent().unwrap_or(Path::new(""));
        for (k, view) in damaged.view.iter_mut().enumerate() {
            let view_path = view.image.clone();
            view.image = beside.join(view_path);
            if let (Self::Exposure(gains), 1) = (self, k) {
                view.image = exposed(&view.image, gains, folder)?;
            }
            let is_depth = view.depth.is_some();
            let Some(map) = view.depth.as_mut().or(view.disparity.as_mut()) else { continue };
            if self == Self::Matched {
                *map = "matched".into();
                (view.depth_scale, view.disparity_scale) = (None, None);
                continue;
            }
            let (width, height, mut values) = read_map(&beside.join(&map), MOST_PIXELS)?;
            let seed = &mut Pcg64::seed_from_u64(100 + k as u64);
            match is_depth {
                // Errors in pixels are errors of the reciprocal depth.
                true => {
                    let unit = reciprocal_per_pixel(spec, k);
                    self.change(&mut values, width, seed, |v, e| (1.0 / (1.0 / v + e * unit)).max(0.1 * v));
                }
                false => {
                    let scale = view.disparity_scale.or(spec.disparity_scale).unwrap_or(1.0);
                    self.change(&mut values, width, seed, |v, e| (v + e * scale).max(0.1 * v));
                }
            }
            let file: PathBuf = folder.join(format!("damaged{k}.pfm"));
            std::fs::write(&file, pfm::encode(&Image::new(width, height, 1, values)?))?;
            *map = file;
        }
        Ok(damaged)
    }

    /// Changes the values; `moved` adds an error in pixels to a value.
    fn change(self, values: &mut [f32], width: usize, random: &mut Pcg64, moved: impl Fn(f64, f64) -> f64) {
        let known = values.iter().copied().filter(|v| v.is_finite() && *v > 0.0);
        let (low, high) = known.fold((f32::MAX, f32::MIN), |(low, high), v| (low.min(v), high.max(v)));
        match self {
            Self::Blobs(share) => blobs(values, width, share, random, |share| low + (high - low) * share),
            Self::Flying => flying(values, width, random),
            Self::Blurred => blurred(values, width),
            _ => {}
        }
        for value in values {
            let is_known = value.is_finite() && *value > 0.0;
            match self {
                Self::Clean | Self::Lattice | Self::Matched | Self::Exposure(_) => {}
                Self::Outliers(share) if uniform(random) < share => {
                    *value = low + (high - low) * uniform(random) as f32;
                }
                Self::Noise(pixels) if is_known => {
                    let normal = (0..12).map(|_| uniform(random)).sum::<f64>() - 6.0;
                    *value = moved(f64::from(*value), pixels * normal) as f32;
                }
                Self::Scattered(share) | Self::ScatteredOutliers(share, _) if uniform(random) >= share => {
                    *value = 0.0;
                }
                Self::ScatteredOutliers(_, wrong) if uniform(random) < wrong => {
                    *value = low + (high - low) * uniform(random) as f32;
                }
                Self::ScatteredSky(share) if value.is_infinite() || uniform(random) >= share => *value = 0.0,
                Self::Sky(far) if value.is_infinite() => *value = far,
                _ => {}
            }
        }
    }
}

/// A photograph with other factors for its colours, in 8 bits; its file.
fn exposed(photograph: &Path, gains: [f64; 3], folder: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let mut image = read_image(photograph, MOST_PIXELS)?;
    let channels = image.channels();
    for pixel in image.data_mut().chunks_mut(channels) {
        pixel.iter_mut().zip(gains).for_each(|(value, gain)| *value *= gain as f32);
    }
    let file = folder.join("exposed.png");
    save(&image, &file)?;
    Ok(file)
}

/// Rows and columns over which values are blurred.
const BLUR: usize = 2;

/// Radius of a blob in pixels.
const BLOB: isize = 3;

/// Discs of one value each, which is a random share of the range.
fn blobs(values: &mut [f32], width: usize, share: f64, random: &mut Pcg64, value: impl Fn(f32) -> f32) {
    let inside: Vec<(isize, isize)> = (-BLOB..=BLOB)
        .flat_map(|dy| (-BLOB..=BLOB).map(move |dx| (dx, dy)))
        .filter(|(dx, dy)| dx * dx + dy * dy <= BLOB * BLOB)
        .collect();
    for _ in 0..(share * values.len() as f64 / inside.len() as f64) as usize {
        let middle = (uniform(random) * values.len() as f64) as usize;
        let (x, y) = ((middle % width) as isize, (middle / width) as isize);
        let wrong = value(uniform(random) as f32);
        for (dx, dy) in inside.iter().filter(|(dx, _)| (0..width as isize).contains(&(x + dx))) {
            let pixel = (y + dy) * width as isize + x + dx;
            if let Some(value) = usize::try_from(pixel).ok().and_then(|pixel| values.get_mut(pixel)) {
                *value = wrong;
            }
        }
    }
}

/// Values beside a jump of a tenth lie between both sides.
fn flying(values: &mut [f32], width: usize, random: &mut Pcg64) {
    let clean = values.to_vec();
    for (p, value) in values.iter_mut().enumerate().filter(|(_, value)| value.is_finite() && **value > 0.0) {
        let beside = [1, 2, width, 2 * width].into_iter();
        let beside = beside.flat_map(|step| [p.checked_sub(step), Some(p + step)]).flatten();
        let others = beside.filter_map(|q| clean.get(q)).filter(|other| other.is_finite() && **other > 0.0);
        let apart = |other: &f32| (*other / *value).max(*value / *other);
        if let Some(other) = others.max_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|o| apart(o) > 1.1) {
            *value += (other - *value) * uniform(random) as f32;
        }
    }
}

/// The mean of the known values within [`BLUR`] rows and columns; what is unknown stays so.
fn blurred(values: &mut [f32], width: usize) {
    let clean = values.to_vec();
    let is_known = |value: &f32| value.is_finite() && *value > 0.0;
    for (p, value) in values.iter_mut().enumerate().filter(|(_, value)| is_known(value)) {
        let (x, y) = (p % width, p / width);
        let row = |y: usize| &clean[y * width..][x.saturating_sub(BLUR)..(x + BLUR + 1).min(width)];
        let rows = y.saturating_sub(BLUR)..(y + BLUR + 1).min(clean.len() / width);
        let around: Vec<f32> = rows.flat_map(|y| row(y).iter().copied().filter(is_known)).collect();
        *value = around.iter().sum::<f32>() / around.len() as f32;
    }
}

fn uniform(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// By how much the reciprocal depth changes if the middle of a view moves by a pixel in the next view.
fn reciprocal_per_pixel(spec: &SceneSpec, view: usize) -> f64 {
    let camera = |k: usize| {
        let rows = spec.view[k % spec.view.len()].camera.unwrap_or_default();
        Camera::metric(Matrix3x4::from_fn(|i, j| rows[i][j]), false)
    };
    let (Ok(from), Ok(to)) = (camera(view), camera(view + 1)) else { return 0.0 };
    let map = from.map_to(&to);
    let at = |reciprocal: f64| map(240.0, 180.0, 1.0 / reciprocal);
    let (reciprocal, step) = (0.15, 1e-4);
    let (a, b) = (at(reciprocal), at(reciprocal + step));
    step / (b.0 - a.0).hypot(b.1 - a.1)
}
