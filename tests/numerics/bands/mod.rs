//! Banks for the band of a signal: twelve systems in normalised time, from two interleaved converters to
//! eight, too few and too many, and an intermediate frequency.
//!
//! The figures in `systems.json` were found with W written by hand as a stage of every front end, and judged
//! by integrals over frequency in another program: the largest image of a tone in the band, and the SNR for
//! white noise in the band. In system B the band is what limits a bank of the usual W (78 and 82 dB), and a
//! sharp W gives 25 dB more: its figures are the least ones that are wanted there, above the margin.

use crate::support::designed;
use hybank::bank::Bank;
use hybank::figures::Figures;
use hybank::spec::{DesignOverrides, Spec};
use serde_json::Value;

const SYSTEMS: &str = include_str!("systems.json");
/// How far a figure may lie below the one in the table, decibels.
const MARGIN: f64 = 3.0;

struct System {
    spec: Spec,
    /// Image and SNR, decibels.
    without: [f64; 2],
    with_band: [f64; 2],
}

fn systems() -> Vec<System> {
    let list: Vec<Value> = serde_json::from_str(SYSTEMS).unwrap();
    let figures = |row: &Value| ["sfdr_db", "snr_db"].map(|key| row[key].as_f64().unwrap());
    let spec = |data: &Value| {
        let no_files = |_: &_| Err("no files".to_owned());
        Spec::from_data(data, "systems.json", DesignOverrides::default(), &no_files).unwrap()
    };
    let system = |row: &Value| System {
        spec: spec(&row["spec"]),
        without: figures(&row["without"]),
        with_band: figures(&row["with_band"]),
    };
    list.iter().map(system).collect()
}

/// Image and SNR, decibels.
fn reached(spec: &Spec) -> [f64; 2] {
    figures(&designed(spec))
}

fn figures(bank: &Bank) -> [f64; 2] {
    let figures = Figures::new(bank).unwrap();
    [-figures.image.unwrap().db.0, figures.snr.total_db.0]
}

#[test]
fn banks_for_a_band_reach_the_figures_of_the_table() {
    let most = if trials::is_slow("a bank of eight channels for a band") { 8 } else { 4 };
    for System { spec, without, with_band } in systems() {
        if spec.channels.len() > most {
            continue;
        }
        let (name, found) = (&spec.name, reached(&spec));
        println!("{name}: {found:.1?} dB with the band, table {with_band:?} dB; without {without:?} dB");
        // Beyond 160 dB the figure depends on the last digits of the solver: the mean-square optimum of A
        // has 164.2 and 166.2 dB.
        let margin = if with_band[0] > 160.0 { MARGIN + 1.0 } else { MARGIN };
        assert!((0..2).all(|k| found[k] >= with_band[k] - margin), "{name}: {found:?}, {with_band:?}");
    }
}

/// The same specs without the table: the band is worth 30 to 110 dB.
#[test]
fn banks_for_any_input_do_not_know_the_band() {
    for System { spec, without, with_band } in systems() {
        let mut bank = designed(&Spec { signal: None, ..spec.clone() });
        bank.spec = Some(spec);
        let found = figures(&bank);
        println!(
            "{}: {found:.1?} dB without the band, table {without:?} dB",
            bank.spec.as_ref().unwrap().name
        );
        assert!(
            (0..2).all(|k| (found[k] - without[k]).abs() < 1.0 && found[k] < with_band[k] - 25.0),
            "{found:?}"
        );
    }
}
