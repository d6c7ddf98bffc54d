//! Rust source as a list of tokens, without comments and without the content of literals (except strings,
//! which name files).

/// What an import is made of.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Token {
    Word(String),
    Text(String),
    /// `::`
    Path,
    Sign(char),
}

impl Token {
    pub(crate) fn is(&self, sign: char) -> bool {
        *self == Self::Sign(sign)
    }

    pub(crate) fn word(&self) -> Option<&str> {
        match self {
            Self::Word(word) => Some(word),
            _ => None,
        }
    }
}

pub(crate) fn tokens(source: &str) -> Vec<Token> {
    let mut reader = Reader { rest: source, tokens: Vec::new() };
    while reader.step() {}
    reader.tokens
}

struct Reader<'a> {
    rest: &'a str,
    tokens: Vec<Token>,
}

impl Reader<'_> {
    /// One token, comment or gap; false at the end.
    fn step(&mut self) -> bool {
        let Some(first) = self.rest.chars().next() else { return false };
        if self.rest.starts_with("//") {
            self.skip(self.rest.find('\n').unwrap_or(self.rest.len()));
        } else if self.rest.starts_with("/*") {
            self.skip(block_comment(self.rest));
        } else if let Some(hashes) = raw_string(self.rest) {
            self.raw(hashes);
        } else if first == '"' {
            self.text();
        } else if first == '\'' {
            self.skip(character_or_lifetime(self.rest));
        } else if first.is_alphanumeric() || first == '_' {
            self.word();
        } else if self.rest.starts_with("::") {
            self.push(Token::Path, 2);
        } else if first.is_whitespace() {
            self.skip(first.len_utf8());
        } else {
            self.push(Token::Sign(first), first.len_utf8());
        }
        true
    }

    fn skip(&mut self, bytes: usize) {
        self.rest = &self.rest[bytes..];
    }

    fn push(&mut self, token: Token, bytes: usize) {
        self.tokens.push(token);
        self.skip(bytes);
    }

    fn word(&mut self) {
        let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest.len());
        // `b"..."`, `c"..."` and `b'.'` are literals; `r#name` was seen before as no raw string.
        if matches!(&self.rest[..end], "b" | "c") && self.rest[end..].starts_with(['"', '\'']) {
            return self.skip(end);
        }
        self.push(Token::Word(self.rest[..end].to_owned()), end);
    }

    fn text(&mut self) {
        let mut escaped = false;
        let end = self.rest[1..].find(|c: char| {
            let closes = c == '"' && !escaped;
            escaped = c == '\\' && !escaped;
            closes
        });
        self.literal(1, end, 1);
    }

    fn raw(&mut self, hashes: usize) {
        let open = self.rest.find('"').map_or(0, |quote| quote + 1);
        let close = format!("\"{}", "#".repeat(hashes));
        self.literal(open, self.rest[open..].find(&close), close.len());
    }

    /// A string that begins at `open` and has `length` bytes, or lasts to the end of the file.
    fn literal(&mut self, open: usize, length: Option<usize>, close: usize) {
        let body = &self.rest[open..];
        let text = &body[..length.unwrap_or(body.len())];
        let bytes = length.map_or(self.rest.len(), |length| open + length + close);
        self.push(Token::Text(text.to_owned()), bytes);
    }
}

/// Number of `#` of a raw string that begins here.
fn raw_string(rest: &str) -> Option<usize> {
    let after = ["r", "br", "cr"].iter().find_map(|prefix| rest.strip_prefix(prefix))?;
    let hashes = after.len() - after.trim_start_matches('#').len();
    after[hashes..].starts_with('"').then_some(hashes)
}

/// Length of a block comment; they nest.
fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match &rest.as_bytes()[at..(at + 2).min(rest.len())] {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            return at;
        }
    }
    rest.len()
}

/// Length of `'a'` or `'\n'`, or of the quote alone that begins a lifetime.
fn character_or_lifetime(rest: &str) -> usize {
    let mut chars = rest.char_indices().skip(1);
    match chars.next() {
        Some((_, '\\')) => {
            chars.next();
            chars.find(|&(_, c)| c == '\'').map_or(1, |(end, _)| end + 1)
        }
        Some(_) => chars.next().filter(|&(_, c)| c == '\'').map_or(1, |(end, _)| end + 1),
        None => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::{Token, tokens};

    fn words(source: &str) -> Vec<String> {
        let word = |token: Token| token.word().map(str::to_owned);
        tokens(source).into_iter().filter_map(word).collect()
    }

    #[test]
    fn comments_and_literals_hold_no_words() {
        let source = r##"a /* b /* c */ d */ // e
            "f \" g" r#"h " i"# b"j" 'k' '\'' '\u{1F600}' b'l' m<'n> o"##;
        assert_eq!(words(source), ["a", "m", "n", "o"]);
    }

    #[test]
    fn paths_are_one_token() {
        let expected = [Token::Word("a".into()), Token::Path, Token::Word("b".into()), Token::Sign(';')];
        assert_eq!(tokens("a::b;"), expected);
    }

    #[test]
    fn strings_that_never_end_end_with_the_file() {
        for source in ["\"", "\"a", "r#\"a\"#", "/* a", "'", "'\\"] {
            assert!(tokens(source).len() <= 1, "{source}");
        }
    }
}
