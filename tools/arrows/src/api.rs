//! What the users of a crate can name: one line for each public item, by every path that leads to it.
//!
//! A line shows what a caller relies on: signatures, fields, variants, derived and implemented traits. What
//! stands under `#[doc(hidden)]` is promised to nobody. Items that a macro makes appear as its call.

use crate::imports::{Imports, is_test};
use quote::ToTokens;
use std::collections::{BTreeMap, BTreeSet};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, Fields, ImplItem, Item, ItemImpl, Meta, Signature, TraitItem, Type, UseTree, Visibility,
};

/// The public items of the crate that was read under this name, in order.
pub(crate) fn listing(imports: &Imports, krate: &str) -> Vec<String> {
    let mut api = Api { imports, lines: BTreeSet::new(), types: BTreeMap::new() };
    api.module(&[krate.to_owned()], krate);
    api.implementations(krate);
    api.lines.into_iter().collect()
}

/// The module of an item and its name there.
type Place = (Vec<String>, String);

struct Api<'a> {
    imports: &'a Imports,
    lines: BTreeSet<String>,
    /// The public paths of types and traits.
    types: BTreeMap<Place, BTreeSet<String>>,
}

impl Api<'_> {
    /// What a module shows under a path.
    fn module(&mut self, module: &[String], path: &str) {
        for item in self.imports.items(module) {
            if let Item::Use(item) = item {
                if is_shown(&item.vis, &item.attrs) {
                    self.passed_on(module, &[], &item.tree, path);
                }
            } else {
                self.item(module, item, path, None);
            }
        }
    }

    /// The names that a `pub use` in a module adds to a path.
    fn passed_on(&mut self, module: &[String], stem: &[String], tree: &UseTree, path: &str) {
        let below = |name: &syn::Ident| [stem, &[name.to_string()]].concat();
        let (from, name) = match tree {
            UseTree::Path(tree) => return self.passed_on(module, &below(&tree.ident), &tree.tree, path),
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.passed_on(module, stem, tree, path));
            }
            UseTree::Glob(_) => {
                if let Some((inside, None)) = self.leads_to(module, stem) {
                    self.module(&inside, path);
                }
                return;
            }
            UseTree::Rename(tree) => (below(&tree.ident), tree.rename.to_string()),
            UseTree::Name(tree) => (below(&tree.ident), tree.ident.to_string()),
        };
        let shown = format!("{path}::{name}");
        match self.leads_to(module, &from) {
            Some((inside, _)) if inside[0] != module[0] => self.foreign(&from, &shown),
            Some((inside, None)) => self.module(&inside, &shown),
            Some((inside, Some(item))) => self.named(&inside, &item, path, &name),
            None => self.foreign(&from, &shown),
        }
    }

    /// As [`Imports::leads_to`], and a name of the module itself.
    fn leads_to(&self, module: &[String], path: &[String]) -> Option<(Vec<String>, Option<String>)> {
        let own = || {
            let [name] = path else { return None };
            let is_own = self.imports.items(module).iter().any(|item| ident(item).as_ref() == Some(name));
            is_own.then(|| (module.to_vec(), Some(name.clone())))
        };
        self.imports.leads_to(module, path).or_else(own)
    }

    fn foreign(&mut self, from: &[String], shown: &str) {
        self.lines.insert(format!("pub use {} as {shown}", from.join("::")));
    }

    /// The items of a name in a module, shown under another path and perhaps another name.
    fn named(&mut self, module: &[String], name: &str, path: &str, shown: &str) {
        let items = self.imports.items(module);
        for item in items.iter().filter(|item| ident(item).is_some_and(|ident| ident == name)) {
            self.item(module, item, path, Some(shown));
        }
    }

    /// One item of a module under a path; `passed_on` is the name by which it is passed on.
    fn item(&mut self, module: &[String], item: &Item, path: &str, passed_on: Option<&str>) {
        let Some(ident) = ident(item).filter(|_| is_public(item)) else { return };
        let shown = format!("{path}::{}", passed_on.unwrap_or(&ident));
        let mut lines = Vec::new();
        match item {
            Item::Mod(_) => self.module(&[module, &[ident]].concat(), &shown),
            Item::Fn(item) => lines.push(function(&shown, &item.sig)),
            Item::Const(item) => lines.push(format!("pub const {shown}: {}", text(&item.ty))),
            Item::Static(item) => lines.push(format!("pub static {shown}: {}", text(&item.ty))),
            Item::Type(item) => {
                lines.push(format!("pub type {shown}{} = {}", text(&item.generics), text(&item.ty)));
            }
            Item::Struct(item) => {
                self.is_shown_as(module, ident, &shown);
                let head = format!("pub struct {shown}{}", text(&item.generics));
                lines.push(format!("{head}{}", closed(&item.fields)));
                lines.extend(public_fields(&shown, &item.fields));
                lines.extend(derived(&shown, &item.attrs));
            }
            Item::Enum(item) => {
                self.is_shown_as(module, ident, &shown);
                lines.push(format!("pub enum {shown}{}", text(&item.generics)));
                let variants = item.variants.iter().filter(|variant| !is_hidden(&variant.attrs));
                lines.extend(variants.map(|v| format!("pub {shown}::{}{}", v.ident, all_fields(&v.fields))));
                lines.extend(derived(&shown, &item.attrs));
            }
            Item::Trait(item) => {
                self.is_shown_as(module, ident, &shown);
                let bounds = if item.supertraits.is_empty() { "" } else { ": " };
                let head = format!("pub trait {shown}{}", text(&item.generics));
                lines.push(format!("{head}{bounds}{}", text(&item.supertraits)));
                lines.extend(item.items.iter().filter_map(|item| trait_item(&shown, item)));
            }
            Item::Macro(item) => {
                self.is_shown_as(module, ident, &shown);
                let tokens = item.mac.tokens.clone().into_iter();
                // The name and what follows it, without the comment before.
                let arguments = tokens.skip_while(|token| token.to_string() != shown_name(&shown));
                let arguments: Vec<String> = arguments.map(|token| token.to_string()).collect();
                lines.push(format!("{}! {shown} {}", text(&item.mac.path), arguments.concat()));
            }
            _ => {}
        }
        self.lines.extend(lines);
    }

    fn is_shown_as(&mut self, module: &[String], name: String, shown: &str) {
        self.types.entry((module.to_vec(), name)).or_default().insert(shown.to_owned());
    }

    /// What `impl` blocks anywhere in the crate add to the types that are shown.
    fn implementations(&mut self, krate: &str) {
        for (module, item) in self.imports.all_items(krate) {
            if let Item::Impl(item) = item
                && !item.attrs.iter().any(is_test)
            {
                self.implementation(module, item);
            }
        }
    }

    fn implementation(&mut self, module: &[String], item: &ItemImpl) {
        let Type::Path(path) = &*item.self_ty else { return };
        let path: Vec<String> = path.path.segments.iter().map(|s| s.ident.to_string()).collect();
        let Some((inside, Some(name))) = self.leads_to(module, &path) else { return };
        let Some(shown) = self.types.get(&(inside, name)) else { return };
        for shown in shown {
            match &item.trait_ {
                Some((_, path, _)) => {
                    self.lines.insert(format!("impl {} for {shown}", text(path)));
                }
                None => self.lines.extend(item.items.iter().filter_map(|item| own_item(shown, item))),
            }
        }
    }
}

fn shown_name(path: &str) -> &str {
    path.rsplit("::").next().unwrap_or(path)
}

/// The name of an item. That of a macro's call is the first word of its arguments after comments.
fn ident(item: &Item) -> Option<String> {
    Some(match item {
        Item::Const(item) => item.ident.to_string(),
        Item::Enum(item) => item.ident.to_string(),
        Item::Fn(item) => item.sig.ident.to_string(),
        Item::Mod(item) => item.ident.to_string(),
        Item::Static(item) => item.ident.to_string(),
        Item::Struct(item) => item.ident.to_string(),
        Item::Trait(item) => item.ident.to_string(),
        Item::Type(item) => item.ident.to_string(),
        Item::Macro(item) if item.ident.is_none() => {
            let words = item.mac.tokens.clone().into_iter();
            words.map(|token| token.to_string()).find(|word| word.starts_with(char::is_alphabetic))?
        }
        _ => return None,
    })
}

fn is_public(item: &Item) -> bool {
    match item {
        Item::Const(item) => is_shown(&item.vis, &item.attrs),
        Item::Enum(item) => is_shown(&item.vis, &item.attrs),
        Item::Fn(item) => is_shown(&item.vis, &item.attrs),
        Item::Mod(item) => is_shown(&item.vis, &item.attrs),
        Item::Static(item) => is_shown(&item.vis, &item.attrs),
        Item::Struct(item) => is_shown(&item.vis, &item.attrs),
        Item::Trait(item) => is_shown(&item.vis, &item.attrs),
        Item::Type(item) => is_shown(&item.vis, &item.attrs),
        Item::Macro(item) => !item.attrs.iter().any(is_test),
        _ => false,
    }
}

fn is_shown(visibility: &Visibility, attributes: &[Attribute]) -> bool {
    matches!(visibility, Visibility::Public(_)) && !is_hidden(attributes)
}

fn is_hidden(attributes: &[Attribute]) -> bool {
    let is_hidden = |attribute: &Attribute| match &attribute.meta {
        Meta::List(list) => list.path.is_ident("doc") && list.tokens.to_string() == "hidden",
        _ => false,
    };
    attributes.iter().any(|attribute| is_hidden(attribute) || is_test(attribute))
}

/// The source of a piece of syntax on one line.
fn text(syntax: &impl ToTokens) -> String {
    let source = syntax.span().source_text().unwrap_or_default();
    let source = if syntax.to_token_stream().is_empty() { String::new() } else { source };
    let line = source.split_whitespace().collect::<Vec<_>>().join(" ");
    line.replace("( ", "(").replace(", )", ")").replace("< ", "<").replace(", >", ">")
}

fn function(shown: &str, signature: &Signature) -> String {
    let word = |is: bool, word: &'static str| if is { word } else { "" };
    let words = word(signature.constness.is_some(), "const ").to_owned()
        + word(signature.unsafety.is_some(), "unsafe ");
    let generics = &signature.generics;
    let inputs: Vec<String> = signature.inputs.iter().map(text).collect();
    let (output, rule) = (text(&signature.output), text(&generics.where_clause));
    let line = format!("pub {words}fn {shown}{}({}) {output} {rule}", text(generics), inputs.join(", "));
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What a pattern of a struct must leave open.
fn closed(fields: &Fields) -> &'static str {
    if fields.iter().all(|field| matches!(field.vis, Visibility::Public(_))) { "" } else { " { .. }" }
}

fn public_fields(shown: &str, fields: &Fields) -> Vec<String> {
    let name =
        |index: usize, field: &syn::Field| field.ident.as_ref().map_or(index.to_string(), |i| i.to_string());
    let public = fields.iter().enumerate().filter(|(_, field)| is_shown(&field.vis, &field.attrs));
    public.map(|(index, field)| format!("pub {shown}::{}: {}", name(index, field), text(&field.ty))).collect()
}

/// The fields of a variant, which are as public as it is.
fn all_fields(fields: &Fields) -> String {
    let field = |field: &syn::Field| match &field.ident {
        Some(name) => format!("{name}: {}", text(&field.ty)),
        None => text(&field.ty),
    };
    let list = fields.iter().map(field).collect::<Vec<_>>().join(", ");
    match fields {
        Fields::Unit => list,
        Fields::Unnamed(_) => format!("({list})"),
        Fields::Named(_) => format!(" {{ {list} }}"),
    }
}

/// A line for each trait in `#[derive(..)]`, and one for `#[non_exhaustive]`.
fn derived(shown: &str, attributes: &[Attribute]) -> Vec<String> {
    let mut lines = Vec::new();
    for attribute in attributes {
        if attribute.path().is_ident("non_exhaustive") {
            lines.push(format!("#[non_exhaustive] {shown}"));
        } else if attribute.path().is_ident("derive") {
            let traits = attribute.parse_args_with(Punctuated::<syn::Path, syn::Token![,]>::parse_terminated);
            lines.extend(traits.iter().flatten().map(|path| format!("impl {} for {shown}", text(path))));
        }
    }
    lines
}

fn trait_item(shown: &str, item: &TraitItem) -> Option<String> {
    let (name, line) = match item {
        TraitItem::Fn(item) => {
            let name = format!("{shown}::{}", item.sig.ident);
            let provided = if item.default.is_some() { " { .. }" } else { "" };
            return Some(function(&name, &item.sig) + provided);
        }
        TraitItem::Const(item) => (&item.ident, format!(": {}", text(&item.ty))),
        TraitItem::Type(item) => (&item.ident, format!(": {}", text(&item.bounds))),
        _ => return None,
    };
    Some(format!("pub {shown}::{name}{line}"))
}

fn own_item(shown: &str, item: &ImplItem) -> Option<String> {
    match item {
        ImplItem::Fn(item) if is_shown(&item.vis, &item.attrs) => {
            Some(function(&format!("{shown}::{}", item.sig.ident), &item.sig))
        }
        ImplItem::Const(item) if is_shown(&item.vis, &item.attrs) => {
            Some(format!("pub const {shown}::{}: {}", item.ident, text(&item.ty)))
        }
        _ => None,
    }
}
