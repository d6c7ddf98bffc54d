//! What an error in the delays costs: the exact gamma of one bank over a table of delay errors, beside the
//! least that any bank could do had it known the true delays.
//!
//! `cargo run --release --example jitter_study`

use hybank::design::{DesignOptions, analyze, design};
use hybank::spec::Spec;
use hybank::units::Seconds;
use std::error::Error;

const SPEC: &str = r#"
fast_period = 1.0
ratio = 2
latency = 10
[target]
filter = { num = [0.25], den = [1.0, 1.0, 0.25] }
[[channel]]
delay = 1.2
[[channel]]
delay = 0.6
[design]
method = "fir"
taps = 22
"#;

/// Delay errors in seconds; the fast period of the spec is 1 s.
const ERRORS: [f64; 7] = [-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1];

fn main() -> Result<(), Box<dyn Error>> {
    let bank = design(&Spec::from_toml(SPEC, "spec")?, &DesignOptions::default())?.bank;
    println!("gamma; rows: error of delay 1, columns: error of delay 2 (fast periods)\n");
    print!("{:>7}", "");
    ERRORS.iter().for_each(|second| print!("{second:>9.2}"));
    println!();
    let mut worst = (0.0, [0.0; 2]);
    for first in ERRORS {
        print!("{first:>7.2}");
        for second in ERRORS {
            let judged = analyze(&bank, &[Seconds(first), Seconds(second)])?;
            assert!(judged.noncausal.is_none_or(|bound| judged.gamma >= bound));
            if judged.gamma > worst.0 {
                worst = (judged.gamma, [first, second]);
            }
            print!("{:>9.5}", judged.gamma);
        }
        println!();
    }
    let (gamma, [first, second]) = worst;
    let known = analyze(&bank, &[Seconds(first), Seconds(second)])?.noncausal;
    let known = known.map_or("an unknown bound".to_owned(), |bound| format!("{bound:.5}"));
    println!("\nworst {gamma:.5} at ({first}, {second}); no bank is below {known} there");
    Ok(())
}
