//! The page as HTML.

use crate::overview::{ChannelFact, Fact, Facts, change};
use crate::plot::{Chart, PlotError};
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin: 0.5rem 0 0; } h2 { font-size: 1.15rem; margin: 2rem 0 0.5rem; }
.understood { color: #555; margin-top: 0.25rem; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 0.3rem 1rem 0.3rem 0; border-bottom: 1px solid #ddd; }
td.value { font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: 1.5rem 0; } figure div { overflow-x: auto; }
figure svg { display: block; width: 100%; min-width: 42rem; height: auto; }
figcaption { color: #555; }
pre { background: #f5f5f5; padding: 0.8rem; overflow-x: auto; font-size: 0.85rem; }
@media (max-width: 40rem) { .facts td, .facts th { display: block; border: 0; padding-right: 0; }
  .facts tr { display: block; border-bottom: 1px solid #ddd; padding: 0.4rem 0; } td.value { white-space: normal; } }
";

/// A chart in the page.
pub(super) struct Figure {
    svg: String,
    caption: String,
}

impl Figure {
    pub(super) fn new(chart: &Chart, caption: &str) -> Result<Self, PlotError> {
        Ok(Self { svg: chart.to_svg()?, caption: caption.to_owned() })
    }

    fn html(&self) -> Markup {
        html! {
            figure {
                div { (PreEscaped(&self.svg)) }
                figcaption { (self.caption) }
            }
        }
    }
}

/// All that the page shows.
pub(super) struct Page {
    pub(super) facts: Facts,
    pub(super) figures: Vec<Figure>,
    /// The captures, if there are any.
    pub(super) spectra: Option<Figure>,
    /// TOML.
    pub(super) spec: String,
    pub(super) commands: Vec<String>,
}

impl Page {
    /// A document that loads nothing.
    pub(super) fn html(&self) -> String {
        let Facts { title, understood, error, cost, channels } = &self.facts;
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    link rel="icon" href="data:,";
                    title { (title) " - hybank" }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { (title) }
                    p class="understood" { (understood) }
                    h2 { "Error" }
                    (facts(error))
                    h2 { "Cost" }
                    (facts(cost))
                    h2 { "Channels" }
                    (channel_table(channels))
                    @if let Some(spectra) = &self.spectra {
                        h2 { "Captures" }
                        (spectra.html())
                    }
                    h2 { "Pictures" }
                    @for figure in &self.figures { (figure.html()) }
                    h2 { "Spec" }
                    pre { (self.spec) }
                    h2 { "Commands" }
                    pre { (self.commands.join("\n")) }
                    p class="understood" { "hybank " (env!("CARGO_PKG_VERSION")) }
                }
            }
        };
        page.into_string() + "\n"
    }
}

fn facts(facts: &[Fact]) -> Markup {
    html! {
        table class="facts" {
            @for fact in facts {
                tr { th { (fact.name) } td class="value" { (fact.value) } td { (fact.meaning) } }
            }
        }
    }
}

fn channel_table(channels: &[ChannelFact]) -> Markup {
    html! {
        table {
            tr { th { "channel" } th { "delay" } th { "gain" } th { "gamma, if the delay is 0.001 samples longer" } }
            @for (channel, number) in channels.iter().zip(1..) {
                tr {
                    td { (number) }
                    td class="value" { (channel.delay) }
                    td class="value" { (channel.gain) }
                    td class="value" {
                        @match channel.sensitivity {
                            Some(share) => { (change(share)) }
                            None => "no derivative",
                        }
                    }
                }
            }
        }
    }
}
