//! Names: of crates as the user's crate knows them, of types as files write them, and what a doc comment says.

use proc_macro_crate::{FoundCrate, crate_name};
use proc_macro2::{Span, TokenStream};
use quote::quote;
use syn::{Attribute, Data, DeriveInput, Expr, ExprLit, Field, Fields, Ident, Lit, Meta};

/// The path to a crate of ours: by its own name where the user's crate depends on it, else through the facade.
pub(crate) fn path_to(krate: &str) -> TokenStream {
    let bare = Ident::new(krate, Span::call_site());
    match crate_name(&format!("sinew-{krate}")) {
        // The package's own tests see it under the name of its library, not of the package.
        Ok(FoundCrate::Name(name)) if name == format!("sinew_{krate}") => quote!(::#bare),
        Ok(FoundCrate::Name(name)) => {
            let name = Ident::new(&name, Span::call_site());
            quote!(::#name)
        }
        Ok(FoundCrate::Itself) => quote!(::#bare),
        Err(_) => match crate_name("sinew") {
            Ok(FoundCrate::Name(name)) => {
                let name = Ident::new(&name, Span::call_site());
                quote!(::#name::#bare)
            }
            _ => quote!(::sinew::#bare),
        },
    }
}

/// The named fields of a struct.
pub(crate) fn named_fields(input: &DeriveInput) -> syn::Result<Vec<&Field>> {
    match &input.data {
        Data::Struct(data) => match &data.fields {
            Fields::Named(fields) => Ok(fields.named.iter().collect()),
            Fields::Unit => Ok(Vec::new()),
            Fields::Unnamed(_) => Err(syn::Error::new_spanned(&input.ident, "the fields need names")),
        },
        _ => Err(syn::Error::new_spanned(&input.ident, "this derive is for structs")),
    }
}

/// The identifier of a named field.
pub(crate) fn ident(field: &Field) -> syn::Result<&Ident> {
    field.ident.as_ref().ok_or_else(|| syn::Error::new_spanned(field, "the field needs a name"))
}

/// What the doc comments say, in one line.
pub(crate) fn doc(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter(|a| a.path().is_ident("doc")).filter_map(|a| match &a.meta {
        Meta::NameValue(pair) => match &pair.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    });
    lines.collect::<Vec<_>>().join(" ").trim().to_owned()
}

/// `WallFollower` as files write it: `wall-follower`.
pub(crate) fn kebab(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('-');
        }
        out.extend(c.to_lowercase());
    }
    out
}
