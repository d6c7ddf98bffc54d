//! What one file declares and imports. Items under `#[cfg(test)]` are left out: tests may use anything.

use crate::tokens::{Token, tokens};

/// A path as written in the inline module `scope` of a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Import {
    pub(crate) scope: Vec<String>,
    pub(crate) path: Vec<String>,
    /// The name that a `use` brings in (`*` for all names), `None` for a path in the code.
    pub(crate) name: Option<String>,
}

/// `mod name;` in the inline module `scope`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Child {
    pub(crate) scope: Vec<String>,
    pub(crate) name: String,
    /// Of `#[path = ".."]`.
    pub(crate) file: Option<String>,
}

#[derive(Debug, Default)]
pub(crate) struct Parsed {
    pub(crate) children: Vec<Child>,
    /// Inline modules, each with its path inside the file.
    pub(crate) inline: Vec<Vec<String>>,
    /// Items with the inline module they stand in.
    pub(crate) items: Vec<(Vec<String>, String)>,
    pub(crate) imports: Vec<Import>,
}

pub(crate) fn parse(source: &str) -> Parsed {
    let tokens = tokens(source);
    let mut parser =
        Parser { tokens: &tokens, at: 0, depth: 0, scope: Vec::new(), parsed: Parsed::default() };
    while parser.step() {}
    parser.parsed
}

struct Parser<'a> {
    tokens: &'a [Token],
    at: usize,
    depth: usize,
    /// Inline modules around this place, each with the depth of its braces.
    scope: Vec<(String, usize)>,
    parsed: Parsed,
}

impl Parser<'_> {
    fn step(&mut self) -> bool {
        let Some(token) = self.tokens.get(self.at) else { return false };
        match token {
            Token::Sign('#') => self.attributes(),
            Token::Sign('{') => (self.at, self.depth) = (self.at + 1, self.depth + 1),
            Token::Sign('}') => self.close(),
            Token::Word(word) => self.word(&word.clone()),
            _ => self.at += 1,
        }
        true
    }

    fn peek(&self, ahead: usize) -> Option<&Token> {
        self.tokens.get(self.at + ahead)
    }

    fn peek_word(&self, ahead: usize) -> Option<&str> {
        self.peek(ahead).and_then(Token::word)
    }

    fn scope(&self) -> Vec<String> {
        self.scope.iter().map(|(name, _)| name.clone()).collect()
    }

    fn close(&mut self) {
        self.at += 1;
        self.depth = self.depth.saturating_sub(1);
        if self.scope.last().is_some_and(|&(_, depth)| depth == self.depth) {
            self.scope.pop();
        }
    }

    fn word(&mut self, word: &str) {
        match word {
            "use" => self.use_tree(),
            "mod" if self.peek_word(1).is_some() => self.module(None),
            "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union" | "macro_rules" => {
                let ahead = if word == "macro_rules" { 2 } else { 1 };
                if let Some(name) = self.peek_word(ahead).map(str::to_owned) {
                    self.parsed.items.push((self.scope(), name));
                }
                self.at += 1;
            }
            _ => self.inline_path(),
        }
    }

    fn module(&mut self, file: Option<String>) {
        let name = self.peek_word(1).unwrap_or_default().to_owned();
        if self.peek(2).is_some_and(|token| token.is('{')) {
            self.scope.push((name, self.depth));
            self.parsed.inline.push(self.scope());
        } else {
            self.parsed.children.push(Child { scope: self.scope(), name, file });
        }
        self.at += 2;
    }

    /// Words joined by `::`, at least two.
    fn inline_path(&mut self) {
        let begins = self.at == 0 || self.tokens[self.at - 1] != Token::Path;
        let mut path = vec![self.peek_word(0).unwrap_or_default().to_owned()];
        self.at += 1;
        while self.peek(0) == Some(&Token::Path) {
            let Some(word) = self.peek_word(1) else { break };
            path.push(word.to_owned());
            self.at += 2;
        }
        if begins && path.len() > 1 {
            self.import(path, None);
        }
    }

    fn import(&mut self, path: Vec<String>, name: Option<String>) {
        let scope = self.scope();
        self.parsed.imports.push(Import { scope, path, name });
    }

    fn use_tree(&mut self) {
        self.at += 1;
        if self.peek(0) == Some(&Token::Path) {
            self.at += 1;
        }
        self.branch(&[]);
    }

    /// One branch of a use tree after `stem`; ends before `,`, `}` or `;`.
    fn branch(&mut self, stem: &[String]) {
        let mut path = stem.to_vec();
        loop {
            match self.peek(0).cloned() {
                Some(Token::Word(word)) => path.push(word),
                Some(Token::Path) => {}
                Some(Token::Sign('*')) => {
                    self.at += 1;
                    return self.import(path, Some("*".into()));
                }
                Some(Token::Sign('{')) => return self.group(&path),
                _ => return self.leaf(path),
            }
            self.at += 1;
        }
    }

    fn group(&mut self, stem: &[String]) {
        self.at += 1;
        while self.peek(0).is_some_and(|token| !token.is('}')) {
            self.branch(stem);
            if self.peek(0).is_some_and(|token| token.is(',')) {
                self.at += 1;
            }
        }
        self.at += 1;
    }

    fn leaf(&mut self, mut path: Vec<String>) {
        let renamed = path.len() > 2 && path[path.len() - 2] == "as";
        let name = if renamed { path.pop() } else { None };
        if renamed {
            path.pop();
        }
        if path.len() > 1 && path.last().is_some_and(|word| word == "self") {
            path.pop();
        }
        let Some(last) = path.last().cloned() else { return self.at += 1 };
        self.import(path, name.or(Some(last)));
    }

    /// Attributes and, where one of them is `cfg(test)`, the item after them.
    fn attributes(&mut self) {
        let (mut test, mut file) = (false, None);
        while self.peek(0).is_some_and(|token| token.is('#')) {
            let open = if self.peek(1).is_some_and(|token| token.is('!')) { 2 } else { 1 };
            if !self.peek(open).is_some_and(|token| token.is('[')) {
                break;
            }
            let start = self.at + open;
            self.at = self.end_of(start, '[', ']');
            let inside = &self.tokens[start..self.at];
            test |= is_test(inside);
            file = file.or_else(|| path_attribute(inside));
        }
        if test {
            self.skip_item();
        } else if file.is_some() {
            self.module_with_file(file);
        } else if self.peek(0).is_some_and(|token| token.is('#')) {
            self.at += 1;
        }
    }

    fn module_with_file(&mut self, file: Option<String>) {
        while self.peek_word(0).is_some_and(|word| word != "mod") {
            self.at += 1;
        }
        if self.peek_word(0) == Some("mod") {
            self.module(file);
        }
    }

    /// The place after the bracket that closes the one at `start`.
    fn end_of(&self, start: usize, open: char, close: char) -> usize {
        let mut depth = 0;
        for (at, token) in self.tokens.iter().enumerate().skip(start) {
            depth += usize::from(token.is(open));
            depth -= usize::from(token.is(close));
            if depth == 0 {
                return at + 1;
            }
        }
        self.tokens.len()
    }

    /// Up to the `;` or the closing brace of an item.
    fn skip_item(&mut self) {
        while let Some(token) = self.peek(0) {
            match token {
                Token::Sign('{') => return self.at = self.end_of(self.at, '{', '}'),
                Token::Sign(';') => return self.at += 1,
                Token::Sign('(') => self.at = self.end_of(self.at, '(', ')'),
                Token::Sign('[') => self.at = self.end_of(self.at, '[', ']'),
                _ => self.at += 1,
            }
        }
    }
}

/// `[cfg(test)]` or `[cfg(all(test, ..))]`, but not `any` or `not`.
fn is_test(attribute: &[Token]) -> bool {
    let has = |word: &str| attribute.iter().any(|token| token.word() == Some(word));
    attribute.get(1).and_then(Token::word) == Some("cfg") && has("test") && !has("any") && !has("not")
}

fn path_attribute(attribute: &[Token]) -> Option<String> {
    match attribute {
        [_, Token::Word(word), _, Token::Text(text), ..] if word == "path" => Some(text.clone()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Parsed, parse};

    fn paths(parsed: &Parsed) -> Vec<String> {
        parsed.imports.iter().map(|import| import.path.join("::")).collect()
    }

    #[test]
    fn use_trees_become_paths() {
        let parsed = parse("use a::{b::{self, c as d}, e::*}; pub(crate) use f::g;");
        assert_eq!(paths(&parsed), ["a::b", "a::b::c", "a::e", "f::g"]);
        let names: Vec<_> = parsed.imports.iter().map(|import| import.name.clone().unwrap()).collect();
        assert_eq!(names, ["b", "d", "*", "g"]);
    }

    #[test]
    fn paths_in_code_are_imports() {
        let parsed = parse("fn f() { let x: crate::a::B = super::c::d(&e::F::new::<u8>()); }");
        assert_eq!(paths(&parsed), ["crate::a::B", "super::c::d", "e::F::new"]);
        assert_eq!(parsed.items, [(vec![], "f".to_owned())]);
    }

    #[test]
    fn tests_are_left_out() {
        let source = "#[cfg(test)] mod tests; #[cfg(test)] #[allow(x)] mod more { use crate::a; } \
            #[cfg(test)] fn f(x: [u8; 2]) -> u8 { crate::b::c() } #[cfg(not(test))] use crate::d::e;";
        let parsed = parse(source);
        assert_eq!(paths(&parsed), ["crate::d::e"]);
        assert!(parsed.children.is_empty());
    }

    #[test]
    fn modules_have_scopes_and_files() {
        let parsed = parse("mod a; mod b { use super::c::D; } #[path = \"x.rs\"] pub mod e; fn f() {}");
        let children: Vec<_> = parsed.children.iter().map(|c| (c.name.as_str(), c.file.as_deref())).collect();
        assert_eq!(children, [("a", None), ("e", Some("x.rs"))]);
        assert_eq!(
            (parsed.inline, &parsed.imports[0].scope),
            (vec![vec!["b".into()]], &vec!["b".to_owned()])
        );
        assert_eq!(parsed.items, [(vec![], "f".to_owned())]);
    }
}
