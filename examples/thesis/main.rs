//! The examples of the thesis on hybrid filter banks (H. T. Nguyen, UIUC 2007, section 5.6): figures 5.8 to
//! 5.17 as charts, table 5.1, and a page that sets each beside what is known of the thesis's own.
//!
//! ```text
//! cargo run --release --example thesis -- [FOLDER]
//! ```
//!
//! writes `index.html` and the charts to FOLDER (`thesis`).

mod filters;
mod jitter;
mod page;
mod signals;

use hybank::bank::Bank;
use hybank::design::DesignOptions;
use hybank::plot::Chart;
use hybank::spec::{Method, Spec};
use page::Page;
use std::path::PathBuf;

/// The FIR example: Phi = 0.25 / (s + 0.5)^2 for the target and both channels, m0 = 10, and 10 slow samples
/// of memory beside the newest.
fn spec() -> Outcome<Spec> {
    Ok(Spec::from_toml(include_str!("../../filters/thesis-fir.toml"), "filters/thesis-fir.toml")?)
}

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// A figure of the thesis, drawn again.
struct Figure {
    number: &'static str,
    title: &'static str,
    charts: Vec<Chart>,
    /// What is known of the thesis's figure.
    thesis: &'static str,
    found: String,
}

/// The banks that the thesis compares, all for [`spec`].
struct Banks {
    iir: Bank,
    fir: Bank,
    sinc: Bank,
    separation: Bank,
}

impl Banks {
    fn design() -> Outcome<Self> {
        let bank = |method: Method| -> Outcome<Bank> {
            let mut spec = spec()?;
            spec.design.method = method;
            spec.design.taps = spec.design.taps.filter(|_| method.has_taps());
            Ok(hybank::design::design(&spec, &DesignOptions::without_proof())?.bank)
        };
        Ok(Self {
            iir: bank(Method::Iir)?,
            fir: bank(Method::Fir)?,
            sinc: bank(Method::Sinc)?,
            separation: bank(Method::Separation)?,
        })
    }
}

fn main() -> Outcome<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "thesis".into()));
    std::fs::create_dir_all(&folder)?;
    let banks = Banks::design()?;
    let mut figures = filters::figures(&banks)?;
    figures.push(jitter::figure(&banks.fir)?);
    let (compared, table) = signals::compare(&banks)?;
    figures.extend(compared);
    let page = Page { figures, table };
    page.write(&folder)?;
    print!("{}", page.summary());
    println!("\nThe page and its charts are in {}.", folder.display());
    Ok(())
}
