use super::checks::allowed;
use std::fs;
use std::path::Path;

/// A workspace of so many files, with the rules `a -> b`, `b -> nothing`.
fn faults(files: &[(&str, &str)]) -> Vec<String> {
    let name = format!("arrows-{}-{}", std::process::id(), files.iter().map(|f| f.1.len()).sum::<usize>());
    let folder = std::env::temp_dir().join(name);
    let rules = "## Who may import whom\n```text\na -> b   b -> nothing\n```\n";
    for (path, text) in
        [("ARCHITECTURE.md", rules), ("src/lib.rs", "pub mod a; pub mod b;")].iter().chain(files)
    {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let faults = super::faults(&folder).unwrap();
    fs::remove_dir_all(folder).unwrap();
    faults
}

#[test]
fn arrows_that_run_up_are_found_however_they_are_written() {
    assert!(faults(&[("src/a.rs", "use crate::b::B;"), ("src/b.rs", "pub struct B;")]).is_empty());
    let a = ("src/a.rs", "pub struct A;");
    for b in [
        "use crate::a::A;",
        "use super::a::A as Other;",
        "use super::*; fn f(_: a::A) {}",
        "fn f() -> crate::a::A { todo!() }",
        "use crate::{a::{self}}; fn f() -> a::A { todo!() }",
        "mod inner { use super::super::a::A; }",
        "pub use crate::a::*;",
    ] {
        let found = faults(&[a, ("src/b.rs", b)]);
        assert_eq!(found, ["src/b.rs imports src/a.rs: ARCHITECTURE.md does not allow b -> a"], "{b}");
    }
}

#[test]
fn circles_are_found_through_names_that_are_passed_on() {
    let found = faults(&[
        ("src/a/mod.rs", "mod x; mod y; pub use x::X; use y::Y;"),
        ("src/a/x.rs", "use super::y::Y; pub struct X;"),
        ("src/a/y.rs", "use super::X; pub struct Y;"),
        ("src/b.rs", ""),
    ]);
    assert_eq!(found, ["these import each other in a circle: src/a/y.rs, src/a/x.rs"]);
}

#[test]
fn rooms_and_rules_belong_together() {
    let found = faults(&[("src/lib.rs", "pub mod a; pub mod c;"), ("src/a.rs", ""), ("src/c.rs", "")]);
    assert_eq!(
        found,
        ["b", "c"].map(|room| format!("{room} is not both a room and a rule of ARCHITECTURE.md"))
    );
}

#[test]
fn what_users_can_name_is_compared_with_its_list() {
    let a = "pub mod c { pub use super::d::*; pub struct S { pub x: u8, y: u8 } }\nmod d; pub use d::E as F;";
    let d = "/// E\n#[must_use] #[derive(Debug)] #[non_exhaustive] pub enum E { A, B { n: u8 } } struct P;\n\
            impl E { pub fn f(\n&self,\nmut n: u8,\n) -> u8 { n } fn g() {} }\nimpl Clone for E {} impl Clone for P {}";
    let b = "pub(crate) fn no() {} #[doc(hidden)] pub fn hidden() {} #[cfg(test)] pub fn test() {}\n\
            pub trait T { const C: u8; fn f(&self) -> u8 { 1 } }\nm! { /// Of a macro.\n M, \"s\" }";
    let want = "\
// hybank
pub mod a;
pub mod b;

// hybank::a
pub mod c {
    pub use super::d::*;
    pub struct S {
        pub x: u8,
        _private: (),
    }
}
pub use d::E as F;

// hybank::a::d
#[derive(Debug)]
#[non_exhaustive]
pub enum E {
    A,
    B { n: u8 },
}
impl E {
    pub fn f(&self, n: u8) -> u8 {}
}
impl Clone for E {}

// hybank::b
pub trait T {
    const C: u8;
    fn f(&self) -> u8 {}
}
m! { M , \"s\" }
";
    let found = |listed: &str| {
        let files = ["src/a.rs", "src/a/d.rs", "src/b.rs", "tools/arrows/api/hybank.txt"];
        faults(&[(files[0], a), (files[1], d), (files[2], b), (files[3], listed)])
    };
    assert_eq!(found(want), [""; 0]);
    for (was, line) in [("pub x: u8,", "pub z: u8,"), ("m! { M", "pub fn gone() {}\nm! { M")] {
        let found = found(&want.replace(was, line));
        let [fault] = &*found else { panic!("{found:?}") };
        assert!(fault.contains("cargo run -p arrows accept"), "{fault}");
        let line = line.lines().next().unwrap();
        assert!(fault.contains(&format!("\n- {line}\n+ {}", &was[..6])), "{fault}");
    }
}

#[test]
fn errors_that_are_closed_are_found() {
    let marked = "#[derive(Debug)] #[non_exhaustive] pub enum OneError { A } pub enum Error2 { A } pub struct NoError;";
    let list = "// hybank\npub mod a;\n\n// hybank::a\n";
    let found = |source: &str| {
        let found = faults(&[("src/a.rs", source), ("src/b.rs", ""), ("tools/arrows/api/hybank.txt", list)]);
        found.into_iter().filter(|fault| fault.contains("non_exhaustive")).collect::<Vec<_>>()
    };
    assert_eq!(found(marked), [""; 0]);
    for name in ["AError", "Warning", "InputFault"] {
        let fault = format!("{name} may get more variants: it needs #[non_exhaustive]");
        assert_eq!(found(&format!("{marked} #[derive(Debug)] pub enum {name} {{ A }}")), [fault]);
    }
}

#[test]
fn this_workspace_keeps_its_arrows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let faults = super::faults(&root).unwrap();
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

#[test]
fn statements_are_read() {
    let text = "## Who may import whom\n\n```text\na -> everything\nb, c -> d (as, such), e    \
            d -> nothing\ne -> nothing  b-f -> hybank::d\n```\n";
    let rules = allowed(text).unwrap();
    let named: Vec<&str> = rules["b"].iter().map(String::as_str).collect();
    assert_eq!((named, rules["b-f"].len(), rules.len()), (vec!["d", "e"], 1, 6));
    assert!(allowed("nothing").is_err());
    assert!(allowed("## Who may import whom\n```text\na b\n```").unwrap_err().contains("a b"));
}
