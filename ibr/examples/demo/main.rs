//! Writes the folder of a synthetic scene: seven views of general cameras with exact depth, and scene.toml
//! with the place of one more as the virtual view, whose photograph is truth.png.
//!
//! ```sh
//! cargo run --release -p hybank-ibr --example demo -- folder
//! hybank-ibr render folder -o view.png --truth folder/truth.png
//! ```

mod synthetic;

use hybank_ibr::camera::Camera;
use hybank_ibr::image::{Image, pfm, save};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use synthetic::{SyntheticScene, rig_camera};

const SIZE: (usize, usize) = (480, 360);

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: demo FOLDER")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let mut scene = String::new();
    for view in 0..7 {
        let matrix = rig_camera(f64::from(view) / 6.0, SIZE);
        let (image, depth) = SyntheticScene::default().view(&Camera::metric(matrix, false)?, SIZE);
        save(&image, &folder.join(format!("{view}.png")))?;
        let depth = Image::new(SIZE.0, SIZE.1, 1, depth.data().to_vec())?;
        std::fs::write(folder.join(format!("{view}.pfm")), pfm::encode(&depth))?;
        let camera = rows(&matrix);
        writeln!(scene, "[[view]]\nimage = \"{view}.png\"\ndepth = \"{view}.pfm\"\ncamera = {camera}")?;
    }
    let matrix = rig_camera(0.4, SIZE);
    let (truth, _) = SyntheticScene::default().view(&Camera::metric(matrix, false)?, SIZE);
    save(&truth, &folder.join("truth.png"))?;
    writeln!(scene, "[virtual]\ncamera = {}\nsize = [{}, {}]", rows(&matrix), SIZE.0, SIZE.1)?;
    std::fs::write(folder.join("scene.toml"), scene)?;
    Ok(())
}

fn rows(matrix: &nalgebra::Matrix3x4<f64>) -> String {
    let row = |i: usize| {
        format!("[{}, {}, {}, {}]", matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)], matrix[(i, 3)])
    };
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}
