//! The example runs, finds the claims again, and writes a page with all its pictures.

use std::path::Path;
use std::process::Command;

#[test]
fn the_thesis_page_is_made() {
    let program = Path::new(env!("CARGO_BIN_EXE_hybank-ibr")).with_file_name("examples/thesis_views");
    assert!(program.is_file(), "{} is not built; `cargo build --examples` builds it", program.display());
    let dir = tempfile::tempdir().unwrap();
    let done = Command::new(program).args(["page", "--few"]).current_dir(dir.path()).output().unwrap();
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{text}{}", String::from_utf8_lossy(&done.stderr));
    let page = std::fs::read_to_string(dir.path().join("page/index.html")).unwrap();
    for figure in ["3.5", "3.6", "3.7", "3.9", "4.6", "4.7", "4.8"] {
        let file = format!("figure-{figure}.svg");
        assert!(page.contains(&format!("src=\"{file}\"")), "{file}");
        let chart = std::fs::read_to_string(dir.path().join("page").join(&file)).unwrap();
        assert!(chart.contains("measured") && chart.contains(&format!("Figure {figure}")), "{file}");
    }
    assert!(page.contains("Table 3.1") && page.contains("Table 4.1") && !page.contains("class=\"miss\""));
}
