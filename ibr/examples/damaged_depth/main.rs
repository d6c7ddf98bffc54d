//! What damaged depth costs: scenes with true views, whose maps are damaged by a seeded generator.
//!
//! ```text
//! cargo run --release -p hybank-ibr --example damaged_depth            # all scenes, all damages
//! cargo run --release -p hybank-ibr --example damaged_depth -- poster1 "outliers 5 %"
//! ```
//!
//! The scenes poster1, spheres and grid are those of the data folder (`HYBANK_DATA`); the scene sky is made
//! here. Each line is a scene with a damage: the PSNR of the rendered view against the true one, the share
//! of the pixels that the mask shows as seen, and the share of the depths that were found to be outliers.
//! Then follows the PSNR of plain ways to the view (`peers`): the mean of the photographs, forward splats
//! with a hard and a soft depth test, warped meshes, and colours fetched backwards.

mod case;
mod damage;
mod peers;
mod sky;

use case::Case;
use damage::Damage;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let is_chosen = |line: &str| wanted.iter().all(|part| line.contains(part.as_str()));
    let folder = tempfile::tempdir()?;
    let scenes = [("poster1", "im4.png"), ("spheres", "truth.png"), ("grid", "truth.png")];
    let mut cases = Vec::new();
    for (name, truth) in scenes {
        cases.extend(Case::of_data(name, truth)?);
    }
    let (path, truth) = sky::write(folder.path())?;
    cases.push(Case::read("sky", &path, &truth)?);
    for case in &cases {
        let damages: &[Damage] = if case.name == "sky" { &Damage::OF_SKY } else { &Damage::ALL };
        for damage in damages {
            if is_chosen(&format!("{} {}", case.name, damage.name())) {
                let found = case.rendered(*damage, folder.path())?;
                print!(
                    "{:9} {:15} {:6.2} dB   seen {:5.1} %   outliers {:5.2} %  ",
                    case.name,
                    damage.name(),
                    found.psnr,
                    100.0 * found.coverage,
                    100.0 * found.outliers
                );
                for peer in case.peers(*damage, &found)? {
                    print!("   {} {:.2}", peer.name, peer.psnr);
                }
                println!();
            }
        }
    }
    Ok(())
}
