//! Charts as PNG files. They are drawn larger than they are written, so that slanted lines and letters get
//! grey edges.
//!
//! plotters' own pixels draw a wide curve as one polygon, whose mitres stick out far where a spectrum has a
//! narrow line. Here a line is all that is within half the width of it, so the joints are round.

use super::chart::{Chart, ENLARGED, PlotError};
use super::legend::OVERSIZE;
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, DrawingBackend, DrawingErrorKind};
use std::convert::Infallible;

/// Pixels of a PNG file per pixel of an SVG that is not enlarged.
const FINENESS: u32 = 2;

impl Chart {
    /// The chart as a PNG file of 1920 by 900 pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        let ranges = self.ranges()?;
        let mut pixels = Pixels::white(ENLARGED.0 as usize, ENLARGED.1 as usize);
        self.draw(Canvas(&mut pixels), ranges).map_err(|error| self.failed(&error))?;
        pixels.reduced((OVERSIZE / FINENESS) as usize).png().map_err(|error| self.failed(&error))
    }
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Pixels on which plotters draws.
struct Canvas<'a>(&'a mut Pixels);

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width as u32, self.0.height() as u32)
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Drawn {
        let inside = |at: i32, end: usize| usize::try_from(at).ok().filter(|at| *at < end);
        if let (Some(x), Some(y)) = (inside(x, self.0.width), inside(y, self.0.height())) {
            self.0.blend(x, y, colour.rgb.into(), colour.alpha);
        }
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Drawn {
        let line = ThickLine::new(from, to, f64::from(style.stroke_width().max(1)) / 2.0);
        let height = self.0.height() as i32;
        for y in line.rows().start.max(0)..line.rows().end.min(height) {
            for x in line.row(y).start.max(0)..line.row(y).end.min(self.0.width as i32) {
                if line.covers(x, y) {
                    self.draw_pixel((x, y), style.color())?;
                }
            }
        }
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        let mut path = path.into_iter();
        let Some(mut from) = path.next() else { return Ok(()) };
        path.try_for_each(|to| self.draw_line(std::mem::replace(&mut from, to), to, style))
    }
}

/// All points within a distance of a straight line between two points.
struct ThickLine {
    from: (f64, f64),
    /// From one end to the other.
    step: (f64, f64),
    radius: f64,
}

impl ThickLine {
    fn new(from: BackendCoord, to: BackendCoord, radius: f64) -> Self {
        let from = (f64::from(from.0), f64::from(from.1));
        Self { from, step: (f64::from(to.0) - from.0, f64::from(to.1) - from.1), radius }
    }

    fn rows(&self) -> std::ops::Range<i32> {
        around(self.from.1, self.from.1 + self.step.1, self.radius)
    }

    /// Columns that may be covered in a row: those beside the part of the line that is near it.
    fn row(&self, y: i32) -> std::ops::Range<i32> {
        if self.step.1 == 0.0 {
            return around(self.from.0, self.from.0 + self.step.0, self.radius);
        }
        let x = |y: f64| self.from.0 + self.step.0 * ((y - self.from.1) / self.step.1).clamp(0.0, 1.0);
        around(x(f64::from(y) - self.radius), x(f64::from(y) + self.radius), self.radius)
    }

    fn covers(&self, x: i32, y: i32) -> bool {
        let (dx, dy) = (f64::from(x) - self.from.0, f64::from(y) - self.from.1);
        let square = self.step.0 * self.step.0 + self.step.1 * self.step.1;
        let along = if square > 0.0 { (dx * self.step.0 + dy * self.step.1) / square } else { 0.0 };
        let along = along.clamp(0.0, 1.0);
        (dx - along * self.step.0).hypot(dy - along * self.step.1) <= self.radius
    }
}

/// Whole numbers within a distance of an interval, whichever of its ends comes first.
fn around(a: f64, b: f64, radius: f64) -> std::ops::Range<i32> {
    (a.min(b) - radius).floor() as i32..(a.max(b) + radius).ceil() as i32 + 1
}

/// Bytes of a pixel: red, green, blue.
const DEPTH: usize = 3;

/// Lines of pixels.
struct Pixels {
    width: usize,
    bytes: Vec<u8>,
}

impl Pixels {
    fn white(width: usize, height: usize) -> Self {
        Self { width, bytes: vec![u8::MAX; width * height * DEPTH] }
    }

    fn height(&self) -> usize {
        self.bytes.len() / (self.width * DEPTH)
    }

    /// Puts a share of a colour in place of as much of what is there.
    fn blend(&mut self, x: usize, y: usize, colour: [u8; DEPTH], share: f64) {
        let first = (y * self.width + x) * DEPTH;
        let mixed =
            |old: u8, new: u8| (f64::from(old) + share * (f64::from(new) - f64::from(old))).round() as u8;
        self.bytes[first..first + DEPTH]
            .iter_mut()
            .zip(colour)
            .for_each(|(old, new)| *old = mixed(*old, new));
    }

    /// The means of the squares of `factor` by `factor` pixels, of which there is a whole number.
    fn reduced(&self, factor: usize) -> Self {
        let (width, line) = (self.width / factor, self.width * DEPTH);
        let mean = |lines: &[u8], column: usize, colour: usize| {
            let first = column * factor * DEPTH + colour;
            let square = (0..factor).flat_map(|y| (0..factor).map(move |x| first + y * line + x * DEPTH));
            let sum: usize = square.map(|at| usize::from(lines[at])).sum();
            ((sum + factor * factor / 2) / (factor * factor)) as u8
        };
        let all = |lines: &[u8]| -> Vec<u8> {
            (0..width * DEPTH).map(|k| mean(lines, k / DEPTH, k % DEPTH)).collect()
        };
        Self { width, bytes: self.bytes.chunks_exact(line * factor).flat_map(all).collect() }
    }

    /// The picture as a PNG file.
    fn png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height() as u32);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.bytes)?;
        writer.finish()?;
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters_backend::BackendColor;

    struct Pen(u32);

    impl BackendStyle for Pen {
        fn color(&self) -> BackendColor {
            BackendColor { alpha: 1.0, rgb: (0, 0, 0) }
        }

        fn stroke_width(&self) -> u32 {
            self.0
        }
    }

    /// Black pixels are those within half the width, in every direction and beyond the edges too.
    #[test]
    fn a_curve_is_what_is_near_it() {
        let curves: [&[BackendCoord]; 5] = [
            &[(5, 5), (40, 5)],
            &[(10, 30), (12, 2), (13, 31)],
            &[(-10, -5), (60, 45)],
            &[(20, 20)],
            &[(20, 20), (20, 20), (3, 33)],
        ];
        for (curve, width) in curves.into_iter().flat_map(|curve| [(curve, 1), (curve, 6)]) {
            let mut pixels = Pixels::white(50, 40);
            Canvas(&mut pixels).draw_path(curve.iter().copied(), &Pen(width)).unwrap();
            for (x, y) in (0..50).flat_map(|x| (0..40).map(move |y| (x, y))) {
                let near = |pair: &[BackendCoord]| {
                    let steps = (0..=400).map(|k| f64::from(k) / 400.0);
                    let at = |a: i32, b: i32, t: f64| f64::from(a) + t * f64::from(b - a);
                    let distance = |t: f64| {
                        (at(pair[0].0, pair[1].0, t) - f64::from(x))
                            .hypot(at(pair[0].1, pair[1].1, t) - f64::from(y))
                    };
                    steps.map(distance).fold(f64::INFINITY, f64::min)
                };
                let distance = curve.windows(2).map(near).fold(f64::INFINITY, f64::min);
                let black = pixels.bytes[3 * (y as usize * 50 + x as usize)] == 0;
                if (distance - f64::from(width) / 2.0).abs() > 0.02 {
                    assert_eq!(black, distance < f64::from(width) / 2.0, "{curve:?} {width} at {x} {y}");
                }
            }
        }
    }

    #[test]
    fn light_letters_let_the_ground_show() {
        let mut pixels = Pixels::white(1, 1);
        let colour = BackendColor { alpha: 0.25, rgb: (55, 155, 255) };
        Canvas(&mut pixels).draw_pixel((0, 0), colour).unwrap();
        assert_eq!(pixels.bytes, [205, 230, 255]);
        Canvas(&mut pixels).draw_pixel((1, 0), colour).unwrap();
        assert_eq!(pixels.bytes, [205, 230, 255]);
    }

    #[test]
    fn squares_become_their_means() {
        let bytes = vec![0, 10, 20, 4, 10, 21, 0, 10, 20, 4, 10, 21, 255, 255, 255, 255, 255, 255];
        let picture = Pixels { width: 2, bytes: [&bytes[..12], &bytes[..12]].concat() };
        let small = picture.reduced(2);
        assert_eq!((small.width, small.bytes), (1, [2, 10, 21].repeat(2)));
    }

    #[test]
    fn a_file_reads_back() {
        let picture = Pixels { width: 2, bytes: (0..18).collect() };
        let file = picture.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut read).unwrap();
        assert_eq!((frame.width, frame.height, read), (2, 3, picture.bytes));
    }
}
