//! The page of a report: all that is known of a bank.

use super::measured::{BeforeAfter, causes, column};
use super::spur_chart::before_after;
use super::{ChannelFact, Fact, Facts, key_figures, pictures, spectra};
use crate::bank::Bank;
use crate::design::DesignError;
use crate::measure::{Cause, Measurement, Spur};
use crate::pipeline::{PipelineError, Settings, fused};
use crate::plot::{Chart, PlotError};
use crate::quantity::readable;
use crate::simulate::interleaved;
use crate::spec::SpecError;
use crate::units::{Decibels, Hertz};

/// Frames of captures that are used; more would only make the lines denser.
pub const MOST_FRAMES: usize = 1 << 20;
/// Signal over all else above which captures are those of a tone.
const LEAST_TONE: Decibels = Decibels(0.0);
/// Frames that the spectra need.
const LEAST_FRAMES: usize = 16;

/// A page that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// The bank has no spec, or does not fit it.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// The captures cannot be fused.
    #[error(transparent)]
    Fuse(#[from] PipelineError),
    /// The spec cannot be written.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// Captures without a spectrum.
    #[error("{frames} frames, and a spectrum needs {LEAST_FRAMES}; give longer captures, or none")]
    Short {
        /// Frames of the captures.
        frames: usize,
    },
}

/// What the page shows of captures.
pub struct CapturesOnPage {
    spectra: CaptionedChart,
    /// Of the tone that they hold.
    measured: Option<BeforeAfter>,
}

impl CapturesOnPage {
    /// Captures, a list per channel of `bank`, plainly interleaved and fused by the bank; `rate` is that of
    /// the output. `is_cut`: they are only the first frames.
    ///
    /// # Errors
    /// [`PageError`].
    pub fn new(
        bank: &Bank,
        rate: Hertz,
        mut channels: Vec<Vec<f64>>,
        is_cut: bool,
    ) -> Result<Self, PageError> {
        let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
        if frames < LEAST_FRAMES {
            return Err(PageError::Short { frames });
        }
        let part = match is_cut {
            true => format!("the first {frames} frames of the captures"),
            false => "the captures".to_owned(),
        };
        // What was lost is a zero, as `fuse` has it without --gaps.
        channels.iter_mut().flatten().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        let fused = fused(bank, &channels, Settings::default())?;
        let measured = BeforeAfter::of(bank, rate, &channels, &fused, Vec::new());
        let measured = measured.map_err(|reason| reason.to_string()).and_then(|measured| {
            let is_tone = measured.after.sinad > LEAST_TONE;
            if is_tone { Ok(measured) } else { Err("they hold more than a tone".to_owned()) }
        });
        let what = format!(
            "The spectra of {part}, interleaved as if they were taken in turn, and fused by the bank."
        );
        let (spectra, measured) = match measured {
            Ok(measured) => {
                let chart = before_after(&measured.before, &measured.after);
                let caption = format!(
                    "{what} Rings mark what the first has beside the tone, discs what the second has. Each cause has \
                     one colour; Hn is harmonic n of the tone f, and k/M a part of the rate."
                );
                (CaptionedChart::new(&chart, &caption), Some(measured))
            }
            Err(reason) => {
                let plain = interleaved(&bank.sample_delays(), bank.ratio, bank.wait(), &channels);
                let chart = spectra(rate, &[("plain interleaving", &plain[..]), ("fused", &fused)]);
                let caption = format!(
                    "{what} Lines that only the first has are errors of the converters: at multiples of the slow rate \
                     their offsets, elsewhere images of the signal by their instants, gains and filters. No tone was measured ({reason})."
                );
                (CaptionedChart::new(&chart, &caption), None)
            }
        };
        Ok(Self { spectra: spectra?, measured })
    }

    fn html(&self) -> String {
        let measured = self.measured.as_ref();
        let tables = measured.map(|measured| figures_before_after(measured) + &spurs_before_after(measured));
        self.spectra.html() + &tables.unwrap_or_default()
    }
}

/// The tone and the figures of both.
fn figures_before_after(measured: &BeforeAfter) -> String {
    let BeforeAfter { before, after } = measured;
    let level = |measured: &Measurement| {
        measured.tones.first().map_or_else(String::new, |tone| format!("{:.2} dBFS", tone.level.0))
    };
    let tone = after.tones.first().map(|tone| readable(tone.frequency.value.0, "Hz")).unwrap_or_default();
    let mut rows = headings(&["", "interleaved", "fused", ""]);
    rows += &row("tone", &[level(before), level(after)], &format!("at {tone}"));
    for (own, fused) in column(before).iter().zip(column(after)) {
        let values = [own, &fused].map(|figure| format!("{} {}", figure.value, figure.unit));
        rows += &row(fused.name, &values, &fused.meaning);
    }
    let offsets = [before, after].map(|measured| format!("{:.2e}", measured.offset.value));
    rows += &row("offset", &offsets, "the mean, of full scale");
    table(&rows)
}

/// Most lines of the table of spurs.
const MOST_SPURS: usize = 24;

/// The spurs of both, the largest of the captures first.
fn spurs_before_after(measured: &BeforeAfter) -> String {
    let BeforeAfter { before, after } = measured;
    let level = |spur: &Spur| {
        let noise = if spur.above_noise { "" } else { " (noise)" };
        format!("{:.2} dBc{noise}", spur.level.0)
    };
    let same = |spur: &Spur| after.spurs.iter().find(|other| other.causes == spur.causes);
    let spurs = before
        .spurs
        .iter()
        .filter(|spur| !matches!(spur.causes[..], [Cause::Unknown | Cause::Noise]))
        .take(MOST_SPURS);
    let mut rows = headings(&["spur", "frequency", "interleaved", "fused", ""]);
    for spur in spurs {
        let frequency = readable(spur.frequency.0, "Hz");
        rows += &row(&causes(spur), &[frequency, level(spur), same(spur).map(level).unwrap_or_default()], "");
    }
    table(&rows)
}

const STYLE: &str = "
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin: 0.5rem 0 0; } h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; }
.understood { color: #555; margin-top: 0.25rem; }
table { border-collapse: collapse; width: 100%; margin-top: 0.75rem; }
th, td { text-align: left; vertical-align: top; padding: 0.3rem 1rem 0.3rem 0; border-bottom: 1px solid #ddd; }
td.value { font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: 1.5rem 0; } figure div { overflow-x: auto; }
figure svg { display: block; width: 100%; min-width: 42rem; height: auto; }
figcaption { color: #555; }
pre { background: #f5f5f5; padding: 0.8rem; overflow-x: auto; font-size: 0.85rem; }
@media (prefers-color-scheme: dark) { body { background: #191919; color: #ddd; } pre { background: #2a2a2a; }
  .understood, figcaption { color: #aaa; } th, td { border-color: #444; } }
@media (max-width: 40rem) { .facts td, .facts th { display: block; border: 0; padding-right: 0; }
  .facts tr { display: block; border-bottom: 1px solid #ddd; padding: 0.4rem 0; } td.value { white-space: normal; } }
";

/// A chart in the page.
struct CaptionedChart {
    svg: String,
    caption: String,
}

impl CaptionedChart {
    fn new(chart: &Chart, caption: &str) -> Result<Self, PlotError> {
        Ok(Self { svg: chart.to_svg()?, caption: caption.to_owned() })
    }

    fn html(&self) -> String {
        let Self { svg, caption } = self;
        format!("<figure><div>{svg}</div><figcaption>{}</figcaption></figure>\n", escaped(caption))
    }
}

/// All that the page shows.
pub struct Page {
    facts: Facts,
    figures: Vec<CaptionedChart>,
    captures: Option<CapturesOnPage>,
    /// TOML.
    spec: String,
}

impl Page {
    /// The page of a bank with a spec, and of captures that it fuses.
    ///
    /// # Errors
    /// [`PageError`]: a bank without a spec, or one that does not fit it.
    pub fn new(bank: &Bank, captures: Option<CapturesOnPage>) -> Result<Self, PageError> {
        let spec = bank.spec.as_ref().ok_or(DesignError::NoSpec)?;
        let mut figures = Vec::new();
        for picture in pictures(bank)? {
            figures.push(CaptionedChart::new(&picture.chart, picture.caption)?);
        }
        Ok(Self { facts: Facts::new(bank, spec)?, figures, captures, spec: spec.to_toml()? })
    }

    /// A document that loads nothing; `commands` lead to what it shows.
    pub fn html(&self, commands: &[String]) -> String {
        let Facts { title, understood, error, cost, channels } = &self.facts;
        let captures = self.captures.as_ref();
        let captures = captures.map(|captures| format!("<h2>Captures</h2>\n{}", captures.html()));
        format!(
            "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<link rel=\"icon\" href=\"data:,\">
<title>{title} - hybank</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{title}</h1>
<p class=\"understood\">{understood}</p>
<h2>Error</h2>
{error}<h2>Cost</h2>
{cost}<h2>Channels</h2>
{channels}{captures}<h2>Pictures</h2>
{pictures}<h2>Spec</h2>
<pre>{spec}</pre>
<h2>Commands</h2>
<pre>{commands}</pre>
<p class=\"understood\">hybank {version}</p>
</body>
</html>
",
            title = escaped(title),
            understood = escaped(understood),
            error = facts(error),
            cost = facts(cost),
            channels = channel_table(channels),
            captures = captures.unwrap_or_default(),
            pictures = self.figures.iter().map(CaptionedChart::html).collect::<String>(),
            spec = escaped(&self.spec),
            commands = escaped(&commands.join("\n")),
            version = env!("CARGO_PKG_VERSION"),
        )
    }
}

fn facts(facts: &[Fact]) -> String {
    let rows = facts.iter().map(|fact| row(fact.name, std::slice::from_ref(&fact.value), &fact.meaning));
    table(&rows.collect::<String>()).replace("<table>", "<table class=\"facts\">")
}

fn channel_table(channels: &[ChannelFact]) -> String {
    let mut rows =
        headings(&["channel", "delay", "gain", "offset", "if this delay is 0.001 samples longer", ""]);
    for (ChannelFact { delay, gain, offset, later }, number) in channels.iter().zip(1..) {
        let values = [delay.clone(), gain.clone(), offset.clone(), key_figures(*later)];
        rows += &row(&number.to_string(), &values, "");
    }
    table(&rows)
}

fn table(rows: &str) -> String {
    format!("<table>\n{rows}</table>\n")
}

fn headings(names: &[&str]) -> String {
    let cells: String = names.iter().map(|name| format!("<th>{name}</th>")).collect();
    format!("<tr>{cells}</tr>\n")
}

/// A row of a table: a name, numbers, and what they mean.
fn row(name: &str, values: &[String], meaning: &str) -> String {
    let value = |value: &String| format!("<td class=\"value\">{}</td>", escaped(value));
    let values: String = values.iter().map(value).collect();
    format!("<tr><th>{}</th>{values}<td>{}</td></tr>\n", escaped(name), escaped(meaning))
}

/// Text in which nothing is read as markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_no_markup() {
        let want = "<tr><th>a&lt;b</th><td class=\"value\">&amp;lt;</td><td>&lt;td&gt;</td></tr>\n";
        assert_eq!(row("a<b", &["&lt;".to_owned()], "<td>"), want);
    }
}
