//! The picture of README.md: three tones in one converter, in two that take turns, and in the fused signal.
//!
//! `cargo run --release --example spectra > docs/spectra.svg`
//!
//! Lines that the signal does not have are red.

use hybank::design::{Problem, design};
use hybank::measure::{RecordSpectrum, Window};
use hybank::runtime::{Options, Stream};
use hybank::simulate::{Analog, Source, capture};
use hybank::spec::Spec;
use hybank::units::Hertz;
use std::error::Error;
use std::fmt::Write as _;

const SPEC: &str = r#"
fast_rate = 48000.0
ratio = 2
target = { filter = { family = "butterworth", order = 4, cutoff = 9000.0 } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
signal = { band = 14000.0 }
design = { method = "fir", taps = 24 }
"#;
/// The last one lies above half the rate of one converter.
const TONES: [f64; 3] = [2_137.3, 5_711.9, 13_301.7];
const FRAMES: usize = 16_500;
/// Output samples of a spectrum, and how many are left out before it.
const RECORD: usize = 1 << 15;
const SETTLED: usize = 100;

const WIDTH: f64 = 840.0;
const PANEL: f64 = 130.0;
const LEFT: f64 = 60.0;
/// The lowest level in dB.
const FLOOR: f64 = -140.0;
const HIGHEST: f64 = 24_000.0;
const COLUMNS: usize = 600;
/// From this level on a line is seen above the noise.
const FALSE_FROM: f64 = -100.0;
/// Pixels above a spectrum, and between two panels.
const TITLE: f64 = 24.0;
const GAP: f64 = 16.0;
const STYLE: &str = "text{font:13px sans-serif;fill:#333}polyline{fill:none;stroke:#1f77b4}.grid{stroke:#8884}\
    .false{stroke:#d62728;stroke-width:2}@media(prefers-color-scheme:dark){text{fill:#ddd}polyline{stroke:#6cb6ff}\
    .false{stroke:#ff7b72}}";

/// A spectrum with the text above it.
struct Panel {
    title: &'static str,
    /// Frequency in hertz and level in dB below the largest line.
    points: Vec<(f64, f64)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let spec = Spec::from_toml(SPEC, "spec")?;
    let bank = design(&spec, &Default::default())?.bank;
    let tones = TONES.map(|tone| format!("{tone}Hz")).join(",");
    let source: Source = format!("tones:{tones}").parse()?;
    let signal = Analog::Known(source.normalised(spec.fast_period));
    let captured = capture(&Problem::new(&spec, bank.latency)?, &signal, FRAMES);
    let channels: Vec<Vec<f64>> =
        captured.channels.iter().map(|x| x.iter().copied().map(rounded).collect()).collect();

    let frames: Vec<f64> = (0..FRAMES).flat_map(|k| channels.iter().map(move |x| x[k])).collect();
    let mut fused = vec![0.0; frames.len()];
    Stream::new(&bank.plan(Options::default())?).process(&frames, &mut fused)?;

    let slow = &channels[0][SETTLED..][..RECORD / 2];
    let panels = [
        Panel::new("one converter of 24 kS/s: the tone of 13.3 kHz appears at 10.7 kHz", slow, 24e3),
        Panel::new("two converters in turn", &frames[SETTLED..][..RECORD], 48e3),
        Panel::new("the same samples, fused", &fused[SETTLED..][..RECORD], 48e3),
    ];
    print!("{}", picture(&panels)?);
    Ok(())
}

/// The sample of a 16-bit converter that the sum of the tones does not overload.
fn rounded(x: f64) -> f64 {
    (0.3 * 32_768.0 * x).round() / 32_768.0
}

impl Panel {
    fn new(title: &'static str, samples: &[f64], rate: f64) -> Self {
        let spectrum = RecordSpectrum::new(samples, Hertz(rate), Window::Bh7);
        let columns = (COLUMNS as f64 * rate / (2.0 * HIGHEST)) as usize;
        let (_, largest) = spectrum.largest();
        let level = |(f, a): (Hertz, f64)| (f.0, (20.0 * (a / largest).log10()).max(FLOOR));
        Self { title, points: spectrum.columns(columns).into_iter().map(level).collect() }
    }

    /// Lines above the noise that are none of the tones.
    fn false_lines(&self) -> impl Iterator<Item = &(f64, f64)> {
        let is_tone = |f: f64| TONES.iter().any(|tone| (f - tone).abs() < 60.0);
        self.points.iter().filter(move |(f, level)| *level > FALSE_FROM && !is_tone(*f))
    }
}

fn across(frequency: f64) -> f64 {
    LEFT + (WIDTH - LEFT - 10.0) * frequency / HIGHEST
}

/// Pixels below the top of a panel.
fn down(level: f64) -> f64 {
    TITLE + (PANEL - TITLE) * level / FLOOR
}

/// The panels, one above the other, in colours for light and dark pages.
fn picture(panels: &[Panel]) -> Result<String, std::fmt::Error> {
    let height = (PANEL + GAP) * panels.len() as f64 + 6.0;
    let mut svg = String::new();
    writeln!(svg, r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}">"#)?;
    writeln!(svg, "<style>{STYLE}</style>")?;
    for (k, panel) in panels.iter().enumerate() {
        writeln!(svg, r#"<g transform="translate(0 {})">"#, k as f64 * (PANEL + GAP))?;
        draw(panel, &mut svg)?;
        writeln!(svg, "</g>")?;
    }
    for frequency in (0..=24).step_by(4) {
        let x = across(1e3 * f64::from(frequency));
        let (unit, anchor) = if frequency == 24 { (" kHz", "end") } else { ("", "middle") };
        let y = height - 4.0;
        writeln!(svg, r#"<text x="{x:.1}" y="{y}" text-anchor="{anchor}">{frequency}{unit}</text>"#)?;
    }
    writeln!(svg, "</svg>")?;
    Ok(svg)
}

fn draw(panel: &Panel, svg: &mut String) -> std::fmt::Result {
    writeln!(svg, r#"<text x="{LEFT}" y="14">{}</text>"#, panel.title)?;
    for level in [0.0, -50.0, -100.0] {
        let y = down(level);
        let (left, right) = (across(0.0), across(HIGHEST));
        writeln!(svg, r#"<path class="grid" d="M{left:.1} {y:.1}H{right:.1}"/>"#)?;
        let x = LEFT - 8.0;
        writeln!(svg, r#"<text x="{x}" y="{:.1}" text-anchor="end">{level} dB</text>"#, y + 4.0)?;
    }
    let points: Vec<String> =
        panel.points.iter().map(|(f, level)| format!("{:.1} {:.1}", across(*f), down(*level))).collect();
    writeln!(svg, r#"<polyline points="{}"/>"#, points.join(" "))?;
    for (f, level) in panel.false_lines() {
        let (x, top, bottom) = (across(*f), down(*level), down(FLOOR));
        writeln!(svg, r#"<path class="false" d="M{x:.1} {top:.1}V{bottom:.1}"/>"#)?;
    }
    Ok(())
}
