//! The snippets of the pages work as they stand: specs and banks can be read, and command lines
//! run in the order of the text.

use crate::support::{Desk, repository};
use hybank::bank::Bank;
use hybank::spec::Spec;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A fenced block of a Markdown text.
struct Snippet {
    /// The word after the fence.
    language: String,
    text: String,
    /// Line of the opening fence, from 1.
    line: usize,
}

fn snippets(markdown: &str) -> Vec<Snippet> {
    let mut found: Vec<Snippet> = Vec::new();
    let mut inside = false;
    for (index, line) in markdown.lines().enumerate() {
        match line.strip_prefix("```") {
            Some(_) if inside => inside = false,
            Some(language) => {
                inside = true;
                found.push(Snippet { language: language.to_owned(), text: String::new(), line: index + 1 });
            }
            None if inside => {
                let text = &mut found.last_mut().expect("a block was opened").text;
                text.push_str(line);
                text.push('\n');
            }
            None => {}
        }
    }
    assert!(!inside, "a fence is not closed");
    found
}

/// README.md and the pages of these folders; hybank-ibr has tests of its own.
fn pages() -> Vec<PathBuf> {
    let root = repository("");
    let mut pages = vec![repository("README.md")];
    for folder in ["docs", "docs/tutorials", "filters", "benches", "examples"] {
        let folder = fs::read_dir(root.join(folder)).expect("a folder of pages");
        pages.extend(folder.map(|entry| entry.expect("an entry").path()));
    }
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

/// A folder in which the snippets of one page run, with the spec of the README and the ready specs in it.
struct Folder {
    page: PathBuf,
    desk: Desk,
}

impl Folder {
    fn new(page: &Path) -> Self {
        let readme = fs::read_to_string(repository("README.md")).expect("README.md");
        let spec = snippets(&readme).into_iter().find(|snippet| snippet.language == "toml");
        let desk = Desk::with_spec(&spec.expect("a spec in README.md").text);
        desk.write("speech-2x.toml", include_str!("../../../filters/speech-2x.toml"));
        Self { page: page.to_owned(), desk }
    }

    fn check(&self, snippet: &Snippet) {
        match snippet.language.as_str() {
            "toml" => self.check_spec(snippet),
            "json" => self.check_bank(snippet),
            "sh" => self.run(snippet),
            "text" => self.check_text(snippet),
            "jsonl" => self.desk.write("lost.jsonl", &snippet.text),
            // Python has tests of its own; Rust is a documentation test.
            "rust" | "python" | "text illustration" => {}
            "c" => self.desk.write(self.name(snippet, "// "), &snippet.text),
            // Directives of the site.
            directive if directive.starts_with('{') => {}
            other => panic!("{}: no check for a snippet of {other:?}", self.place(snippet)),
        }
    }

    fn place(&self, snippet: &Snippet) -> String {
        format!("{}:{}", self.page.display(), snippet.line)
    }

    /// A file is named in its first line, after the mark of a comment.
    fn name<'a>(&self, snippet: &'a Snippet, comment: &str) -> &'a str {
        let name = snippet.text.lines().next().and_then(|line| line.strip_prefix(comment));
        name.unwrap_or_else(|| panic!("{}: the first line names no file", self.place(snippet)))
    }

    fn check_spec(&self, snippet: &Snippet) {
        let name = self.name(snippet, "# ");
        let spec = Spec::from_toml(&snippet.text, name);
        assert!(spec.is_ok(), "{}: {spec:?}", self.place(snippet));
        self.desk.write(name, &snippet.text);
    }

    /// A command in a block that runs nowhere goes wrong unseen.
    fn check_text(&self, snippet: &Snippet) {
        let is_command = |line: &&str| {
            let program = line.trim_start_matches("$ ").split_whitespace().next();
            matches!(program, Some("hybank" | "hybank-ibr"))
        };
        let command = snippet.text.lines().find(is_command);
        assert!(
            command.is_none(),
            "{}: make this block `sh`, or `text illustration` if it cannot run: {command:?}",
            self.place(snippet)
        );
    }

    fn check_bank(&self, snippet: &Snippet) {
        let bank = Bank::from_json(&snippet.text, "bank.json");
        assert!(bank.is_ok(), "{}: {bank:?}", self.place(snippet));
    }

    /// Runs the lines that call `hybank`, the C compiler, what it made and `sed`; `cargo` lines are the
    /// business of a fresh clone.
    fn run(&self, snippet: &Snippet) {
        let programs = ["hybank ", "cc ", "./", "sed "];
        let runs = |line: &&str| programs.iter().any(|program| line.starts_with(program));
        for line in snippet.text.replace("\\\n", "").lines().filter(runs) {
            let binary = Path::new(env!("CARGO_BIN_EXE_hybank")).parent().expect("the folder of the binary");
            let path = std::env::join_paths([binary, Path::new("/usr/bin"), Path::new("/bin")]);
            let output = Command::new("sh")
                .args(["-e", "-c", line])
                .env("PATH", path.expect("a search path"))
                .current_dir(self.desk.path(""))
                .output()
                .expect("a shell");
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}: {line}\n{stderr}", self.place(snippet));
        }
    }
}

#[test]
fn snippets_of_readme_and_docs_work() {
    let is_slow = trials::is_slow("the commands of the pages beside README.md");
    for page in pages() {
        let folder = Folder::new(&page);
        let text = fs::read_to_string(&page).expect("a page");
        let is_run = is_slow || page == repository("README.md");
        let checked = snippets(&text).into_iter().filter(|snippet| is_run || snippet.language != "sh");
        checked.for_each(|snippet| folder.check(&snippet));
    }
}

/// The anchor that the site and the repository give to a heading.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || "-_ ".contains(*c);
    heading.to_lowercase().chars().filter(kept).map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn has_anchor(page: &Path, wanted: &str) -> bool {
    let text = fs::read_to_string(page).expect("a page");
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| anchor(line.trim_start_matches('#').trim())).any(|own| own == wanted)
}

#[test]
fn links_between_the_pages_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|target| !target.contains("://")) {
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let path =
                if file.is_empty() { page.clone() } else { page.parent().expect("a folder").join(file) };
            let is_there = path.exists() && (heading.is_empty() || has_anchor(&path, heading));
            assert!(is_there, "{}: the link to {target} leads nowhere", page.display());
        }
    }
}

#[test]
fn lines_of_the_pages_end_before_column_110() {
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        let outside_tables = text.lines().enumerate().filter(|(_, line)| !line.starts_with('|'));
        for (index, line) in outside_tables {
            assert!(line.chars().count() < 110, "{}:{}: {line}", page.display(), index + 1);
        }
    }
}
