//! The pictures of a bank.

use crate::answer::{Answer, Refusal, bank};
use hybank::overview::{self, Picture};
use serde::Serialize;

#[derive(Serialize)]
struct Drawn {
    name: &'static str,
    title: String,
    caption: &'static str,
    svg: String,
}

/// Draws all pictures of a bank file.
pub(crate) fn pictures(input: &[u8]) -> Result<Answer, Refusal> {
    let drawn = |Picture { name, caption, chart }: Picture| {
        let svg = chart.to_svg().map_err(Refusal::new)?;
        Ok(Drawn { name, title: chart.title, caption, svg })
    };
    let all = overview::pictures(&bank(input)?).map_err(Refusal::new)?;
    Answer::of(&all.into_iter().map(drawn).collect::<Result<Vec<_>, Refusal>>()?)
}
