//! Parameters.

use proc_macro2::{TokenStream, TokenTree};
use quote::{ToTokens as _, quote};
use syn::token::Bracket;
use syn::{DeriveInput, Expr, Field, Path};

use crate::names::{doc, ident, named_fields, path_to};

#[derive(Default)]
struct Said {
    default: Option<Expr>,
    min: Option<Expr>,
    max: Option<Expr>,
    words: Option<TokenStream>,
    flatten: bool,
}

fn said(field: &Field) -> syn::Result<Said> {
    let mut said = Said::default();
    for attribute in field.attrs.iter().filter(|a| a.path().is_ident("param")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("flatten") {
                said.flatten = true;
                return Ok(());
            }
            let place = if meta.path.is_ident("default") {
                &mut said.default
            } else if meta.path.is_ident("min") {
                &mut said.min
            } else if meta.path.is_ident("max") {
                &mut said.max
            } else if meta.path.is_ident("words") {
                let value = meta.value()?;
                // Lists are no expressions for a parser that knows the simple ones alone.
                said.words = Some(if value.peek(Bracket) {
                    value.parse::<TokenTree>()?.into()
                } else {
                    value.parse::<Expr>()?.into_token_stream()
                });
                return Ok(());
            } else {
                return Err(meta.error("a parameter has `default`, `min`, `max`, `words` or `flatten`"));
            };
            *place = Some(meta.value()?.parse()?);
            Ok(())
        })?;
    }
    Ok(said)
}

/// The function that says what is wrong with the whole.
fn check(input: &DeriveInput) -> syn::Result<Option<Path>> {
    let mut check = None;
    for attribute in input.attrs.iter().filter(|a| a.path().is_ident("params")) {
        attribute.parse_nested_meta(|meta| {
            if !meta.path.is_ident("check") {
                return Err(meta.error("a struct of parameters has `check`"));
            }
            check = Some(meta.value()?.parse()?);
            Ok(())
        })?;
    }
    Ok(check)
}

pub(crate) fn derive(input: DeriveInput) -> syn::Result<TokenStream> {
    let types = path_to("types");
    let name = &input.ident;
    let (mut rows, mut sets, mut gets, mut defaults) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut writes_default = false;
    let mut checks = Vec::new();
    if let Some(check) = check(&input)? {
        checks.push(quote!(mistakes.extend(#check(self, table));));
    }
    for field in named_fields(&input)? {
        let (id, ty, doc) = (ident(field)?, &field.ty, doc(&field.attrs));
        let key = id.to_string();
        let said = said(field)?;
        writes_default |= said.default.is_some();
        defaults.push(match &said.default {
            Some(value) => quote!(#id: ::core::convert::Into::into(#value)),
            None => quote!(#id: ::core::default::Default::default()),
        });
        if said.flatten {
            checks.push(quote!(mistakes.extend(#types::params::Params::check(&self.#id, table));));
            rows.push(quote!(rows.extend(<#ty as #types::params::Params>::fields());));
            sets.push(quote! {
                if let ::core::option::Option::Some(done) = #types::params::Params::set(&mut self.#id, key, value) {
                    return ::core::option::Option::Some(done);
                }
            });
            gets.push(quote! {
                if let ::core::option::Option::Some(value) = #types::params::Params::get(&self.#id, key) {
                    return ::core::option::Option::Some(value);
                }
            });
            continue;
        }
        if doc.is_empty() {
            return Err(syn::Error::new_spanned(
                field,
                "a parameter needs a doc comment: what it is, with its unit",
            ));
        }
        let bound = |bound: Option<Expr>| match bound {
            Some(value) => quote!(::core::option::Option::Some((#value) as f64)),
            None => quote!(::core::option::Option::None),
        };
        let (min, max) = (bound(said.min), bound(said.max));
        let words = match &said.words {
            Some(words) => quote!(&#words),
            None => quote!(&[]),
        };
        let assign = match &said.words {
            Some(_) => quote!(assign_word(&mut self.#id, value, #words)),
            None => quote!(assign(&mut self.#id, value, #min, #max)),
        };
        rows.push(quote! {
            rows.push(#types::params::ParamField {
                name: #key,
                doc: #doc,
                kind: <#ty as #types::params::ParamValue>::KIND,
                default: #types::params::ParamValue::to_value(&default.#id),
                min: #min,
                max: #max,
                words: #words,
            });
        });
        sets.push(quote! {
            if key == #key {
                return ::core::option::Option::Some(#types::params::#assign);
            }
        });
        gets.push(quote! {
            if key == #key {
                return ::core::option::Option::Some(#types::params::ParamValue::to_value(&self.#id));
            }
        });
    }
    let default = writes_default.then(|| {
        quote! {
            impl ::core::default::Default for #name {
                fn default() -> Self {
                    Self { #(#defaults),* }
                }
            }
        }
    });
    Ok(quote! {
        #default

        impl #types::params::Params for #name {
            fn fields() -> #types::params::Fields {
                #[allow(unused_variables)]
                let default = <Self as ::core::default::Default>::default();
                #[allow(unused_mut)]
                let mut rows = #types::params::Fields::new();
                #(#rows)*
                rows
            }

            #[allow(unused_variables)]
            fn set(
                &mut self,
                key: &str,
                value: &#types::value::Value,
            ) -> ::core::option::Option<::core::result::Result<(), #types::params::Refused>> {
                #(#sets)*
                ::core::option::Option::None
            }

            #[allow(unused_variables)]
            fn get(&self, key: &str) -> ::core::option::Option<#types::value::Value> {
                #(#gets)*
                ::core::option::Option::None
            }

            #[allow(unused_variables)]
            fn check(&self, table: &#types::value::Table) -> #types::params::Mistakes {
                #[allow(unused_mut)]
                let mut mistakes = #types::params::Mistakes::new();
                #(#checks)*
                mistakes
            }
        }
    })
}
