//! What the page of the playground computes. A browser runs this program as WebAssembly with the system
//! interface WASI, of which it needs the standard streams and a clock. So there is no code that binds Rust
//! to JavaScript, and natively it is a program like others:
//!
//! ```sh
//! playground design   < spec.toml    # the bank with its figures
//! playground pictures < bank.json
//! playground listen sweep < bank.json
//! ```
//!
//! The answer is a line of JSON. What is refused has `refused` in it. While it works, `design` says on
//! standard error what it does. One process does one thing, so a page that waits too long ends it.

mod answer;
mod design;
mod listen;
mod pictures;

use answer::{Answer, Refusal};
use std::io::{self, Read, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "playground: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> io::Result<()> {
    let mut words = std::env::args().skip(1);
    let (command, signal) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let mut input = Vec::new();
    io::stdin().read_to_end(&mut input)?;
    let answer = answer(&command, &signal, &input).unwrap_or_else(|refusal| refusal.answer());
    answer.write(&mut io::stdout().lock())
}

fn answer(command: &str, signal: &str, input: &[u8]) -> Result<Answer, Refusal> {
    match command {
        "design" => design::design(input),
        "pictures" => pictures::pictures(input),
        "listen" => listen::listen(signal, input),
        _ => Err(Refusal::new(format!("\"{command}\": the commands are design, pictures and listen"))),
    }
}
