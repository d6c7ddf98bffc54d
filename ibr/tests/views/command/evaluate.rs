//! Views that are left out and compared with their photographs.

use super::*;

#[test]
fn views_left_out_are_what_render_gives() {
    let dir = rig();
    let scene = std::fs::read_to_string(dir.path().join("scene.toml")).unwrap();
    let middle =
        "[[view]]\nname = \"middle\"\nimage = \"middle.png\"\nposition = 0.5\ndisparity = \"middle.pfm\"\n";
    std::fs::write(dir.path().join("three.toml"), scene.replace("[virtual]", &format!("{middle}[virtual]")))
        .unwrap();
    let figures = json(&run(
        dir.path(),
        &["evaluate", "three.toml", "--every", "2", "--pictures", "out", "--predict", "--json"],
    ));
    let rows = figures["views"].as_array().unwrap();
    assert_eq!((rows.len(), &rows[1]["view"]), (2, &serde_json::json!("middle")));
    let arguments =
        ["render", "three.toml", "--view", "middle", "--truth", "middle.png", "-o", "o.png", "--json"];
    let alone = json(&run(dir.path(), &arguments));
    assert_eq!((&rows[1]["psnr"], &rows[1]["ssim"]), (&alone["psnr"], &alone["ssim"]));
    assert!(
        std::fs::read(dir.path().join("out/0003.png")).unwrap()
            == std::fs::read(dir.path().join("o.png")).unwrap()
    );
    let mean = rows.iter().map(|row| row["psnr"].as_f64().unwrap()).sum::<f64>() / 2.0;
    assert!((figures["psnr"].as_f64().unwrap() - mean).abs() < 1e-9);
    let ratio = rows[1]["predicted"].as_f64().unwrap() / rows[1]["mae"].as_f64().unwrap();
    assert!((0.5..3.0).contains(&ratio), "{figures}");
    refused(dir.path(), &["evaluate", "three.toml", "--pictures", "out"], 1, &["0001.png exists"]);
    refused(dir.path(), &["evaluate", "three.toml", "--view", "left"], 2, &["its own photograph"]);
}
