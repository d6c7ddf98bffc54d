//! What the users of a crate can name: its source without bodies, comments and what is private.
//!
//! Items stand below the module that defines them, and the `pub use` lines that pass them on below theirs.
//! What is `pub` can be reached: the compiler's `unreachable_pub` sees to that. What stands under
//! `#[doc(hidden)]` is no promise. Items that a macro makes appear as its call.

use crate::imports::{File, head, is_test};
use quote::ToTokens;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use syn::visit_mut::{self, VisitMut};
use syn::{Attribute, Fields, Item, ItemImpl, Meta, Type, Visibility, parse_quote};

/// The mark of an enum that may get more variants.
const OPEN: &str = "#[non_exhaustive]";

/// The lists of the libraries among these files, each with the interface as it is now.
fn interfaces(root: &Path, files: &[File]) -> Result<Vec<(PathBuf, String)>, String> {
    let libraries = files.iter().filter(|file| file.module.len() == 1 && file.path.ends_with("lib.rs"));
    let interface = |library: &File| {
        let name = &library.module[0];
        let list = root.join("tools/arrows/api").join(name).with_extension("txt");
        Ok((list, listing(files.iter().filter(|file| file.module[0] == *name))?))
    };
    libraries.map(interface).collect()
}

/// Writes the lists as the crates are now.
pub(crate) fn accept(root: &Path, files: &[File]) -> Result<(), String> {
    let write = |(list, now): (PathBuf, String)| {
        std::fs::write(&list, now).map_err(|error| format!("{}: {error}", list.display()))
    };
    interfaces(root, files)?.into_iter().try_for_each(write)
}

/// The first line of each list where the public interface of its crate is another one.
pub(crate) fn faults(root: &Path, files: &[File]) -> Result<Vec<String>, String> {
    let fault = |(list, found): (PathBuf, String)| {
        let listed = std::fs::read_to_string(&list).ok()?;
        let line = listed.lines().zip(found.lines()).take_while(|(listed, found)| listed == found).count();
        let [was, is] = [&listed, &found].map(|text| text.lines().nth(line).unwrap_or("nothing more").trim());
        let name = list.file_stem()?.display();
        let remedy = "if that is meant, `cargo run -p arrows accept`";
        let fault = format!("{name}: its public interface is not the listed one; {remedy}\n- {was}\n+ {is}");
        (listed != found).then_some(fault)
    };
    let interfaces = interfaces(root, files)?;
    let closed: Vec<String> = interfaces.iter().flat_map(|(_, found)| closed(found)).collect();
    Ok(interfaces.into_iter().filter_map(fault).chain(closed).collect())
}

/// Errors, warnings and faults of a list that users could match without a last arm.
fn closed(list: &str) -> Vec<String> {
    let reasons = ["Error", "Warning", "Fault"];
    let lines: Vec<&str> = list.lines().map(str::trim).collect();
    let fault = |(i, line): (usize, &&str)| {
        let name = line.strip_prefix("pub enum ")?.split([' ', '<']).next()?;
        let is_open =
            lines[..i].iter().rev().take_while(|line| line.starts_with("#[")).any(|line| *line == OPEN);
        let is_fault = !is_open && reasons.iter().any(|reason| name.ends_with(reason));
        is_fault.then(|| format!("{name} may get more variants: it needs {OPEN}"))
    };
    lines.iter().enumerate().filter_map(fault).collect()
}

/// The public items of these files, as rustfmt writes them.
fn listing<'a>(files: impl Iterator<Item = &'a File>) -> Result<String, String> {
    let (mut public, mut files): (_, Vec<File>) = (Public::default(), files.cloned().collect());
    files.retain(|file| !file.syntax.attrs.iter().any(is_hidden));
    files.sort_by(|a, b| a.module.cmp(&b.module));
    files.iter_mut().for_each(|file| public.visit_file_mut(&mut file.syntax));
    let mut source = String::new();
    for File { module, syntax, .. } in &files {
        let items = syntax.items.iter().filter(|item| public.is_shown(item));
        let items: Vec<String> =
            items.map(|item| item.to_token_stream().to_string().replace(" :: ", "::")).collect();
        if !items.is_empty() {
            source += &format!("\n// {}\n{}\n", module.join("::"), items.join("\n"));
        }
    }
    formatted(&source).map_err(|error| format!("rustfmt: {error}"))
}

fn formatted(source: &str) -> std::io::Result<String> {
    let mut program = Command::new("rustfmt");
    program.args(["--edition", "2024", "--config", "max_width=110,use_small_heuristics=Max"]);
    let mut program = program.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    program.stdin.take().map_or(Ok(()), |mut input| input.write_all(source.as_bytes()))?;
    let output = program.wait_with_output()?;
    if !output.status.success() {
        return Err(std::io::Error::other(output.status.to_string()));
    }
    String::from_utf8(output.stdout).map_err(std::io::Error::other)
}

/// Takes away what users cannot name, and collects the names of the types that they can.
#[derive(Default)]
struct Public {
    types: BTreeSet<String>,
}

impl Public {
    /// What remains of a module without what is empty now. Traits are shown for public types.
    fn is_shown(&self, item: &Item) -> bool {
        match item {
            Item::Impl(ItemImpl { trait_: Some(_), self_ty, .. }) => match &**self_ty {
                Type::Path(path) => {
                    path.path.segments.last().is_some_and(|name| self.types.contains(&name.ident.to_string()))
                }
                _ => false,
            },
            Item::Impl(item) => !item.items.is_empty(),
            Item::Mod(item) => item.content.as_ref().is_none_or(|(_, items)| !items.is_empty()),
            _ => true,
        }
    }
}

impl VisitMut for Public {
    fn visit_file_mut(&mut self, file: &mut syn::File) {
        file.items.retain(may_be_shown);
        visit_mut::visit_file_mut(self, file);
    }

    fn visit_item_mod_mut(&mut self, item: &mut syn::ItemMod) {
        if let Some((_, items)) = &mut item.content {
            items.retain(may_be_shown);
        }
        visit_mut::visit_item_mod_mut(self, item);
    }

    fn visit_item_impl_mut(&mut self, item: &mut ItemImpl) {
        let is_own = item.trait_.is_none();
        item.items.retain(|item| is_own && is_public(item) && !is_test(item));
        visit_mut::visit_item_impl_mut(self, item);
    }

    fn visit_item_struct_mut(&mut self, item: &mut syn::ItemStruct) {
        self.types.insert(item.ident.to_string());
        if let Fields::Named(fields) = &mut item.fields {
            let count = fields.named.len();
            fields.named = fields.named.iter().filter(is_public).cloned().collect();
            if fields.named.len() < count {
                fields.named.push(parse_quote!(_private: ()));
            }
        }
        visit_mut::visit_item_struct_mut(self, item);
    }

    fn visit_item_enum_mut(&mut self, item: &mut syn::ItemEnum) {
        self.types.insert(item.ident.to_string());
        visit_mut::visit_item_enum_mut(self, item);
    }

    fn visit_item_macro_mut(&mut self, item: &mut syn::ItemMacro) {
        let words = item.mac.tokens.clone().into_iter().map(|token| token.to_string());
        let words: Vec<String> = words.filter(|word| word != "#" && !word.starts_with('[')).collect();
        item.mac.tokens = words.join(" ").parse().unwrap_or_default();
        self.types.extend(words);
    }

    fn visit_item_const_mut(&mut self, item: &mut syn::ItemConst) {
        *item.expr = parse_quote!(_);
        visit_mut::visit_item_const_mut(self, item);
    }

    fn visit_item_static_mut(&mut self, item: &mut syn::ItemStatic) {
        *item.expr = parse_quote!(_);
        visit_mut::visit_item_static_mut(self, item);
    }

    fn visit_impl_item_const_mut(&mut self, item: &mut syn::ImplItemConst) {
        item.expr = parse_quote!(_);
        visit_mut::visit_impl_item_const_mut(self, item);
    }

    fn visit_block_mut(&mut self, block: &mut syn::Block) {
        block.stmts.clear();
    }

    fn visit_pat_ident_mut(&mut self, argument: &mut syn::PatIdent) {
        argument.mutability = None;
    }

    fn visit_attributes_mut(&mut self, attributes: &mut Vec<Attribute>) {
        let kept = ["cfg", "derive", "non_exhaustive"];
        attributes.retain(|attribute| kept.iter().any(|name| attribute.path().is_ident(name)));
    }
}

fn may_be_shown(item: &Item) -> bool {
    match item {
        _ if is_test(item) => false,
        Item::Impl(_) => true,
        Item::Mod(item) if item.content.is_some() => true,
        Item::Macro(item) => item.ident.is_none(),
        _ => is_public(item),
    }
}

fn is_public(syntax: &impl ToTokens) -> bool {
    let (attributes, visibility) = head(syntax);
    matches!(visibility, Visibility::Public(_)) && !attributes.iter().any(is_hidden)
}

fn is_hidden(attribute: &Attribute) -> bool {
    let Meta::List(list) = &attribute.meta else { return false };
    list.path.is_ident("doc") && list.tokens.to_string() == "hidden"
}
