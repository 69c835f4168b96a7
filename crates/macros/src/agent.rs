//! Agents.

use quote::{format_ident, quote};
use syn::{DeriveInput, Expr, Field, GenericArgument, LitStr, PathArguments, Type};

use crate::names::{doc, ident, kebab, named_fields, path_to};

const PORTS: [&str; 4] = ["Input", "Output", "Service", "Client"];

/// The end at the router, of which an agent has one at most. No wire leads to it, so it has no handle in a plan.
const ROUTER: &str = "Router";

/// The end at the resource side of the runtime, likewise.
const MANAGER: &str = "Manager";

/// How far what an output gives is from the hardware.
const PROCESSING: [&str; 3] = ["raw", "filtered", "interpreted"];

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// `Input` and `[T]` of `Input<T>`; nothing for other types.
fn port_type(ty: &Type) -> Option<(String, Vec<&Type>)> {
    let Type::Path(path) = ty else { return None };
    let last = path.path.segments.last()?;
    let name = last.ident.to_string();
    if (name == ROUTER || name == MANAGER) && last.arguments.is_none() {
        return Some((name, Vec::new()));
    }
    if !PORTS.contains(&name.as_str()) {
        return None;
    }
    let PathArguments::AngleBracketed(arguments) = &last.arguments else { return None };
    let types =
        arguments.args.iter().filter_map(|a| if let GenericArgument::Type(t) = a { Some(t) } else { None });
    Some((name, types.collect()))
}

/// The options of a port as an expression of `runtime::PortOptions`.
fn options(field: &Field, runtime: &proc_macro2::TokenStream) -> syn::Result<proc_macro2::TokenStream> {
    let mut sets = Vec::new();
    for attribute in &field.attrs {
        if attribute.path().is_ident("robot") {
            let port: LitStr = attribute.parse_args()?;
            sets.push(quote!(robot: ::core::option::Option::Some(#port)));
        } else if attribute.path().is_ident("port") {
            attribute.parse_nested_meta(|meta| {
                if meta.path.is_ident("single") {
                    sets.push(quote!(single: true));
                    return Ok(());
                }
                if let Some(processing) = PROCESSING.iter().find(|known| meta.path.is_ident(known)) {
                    let variant = format_ident!("{}", capitalised(processing));
                    sets.push(quote!(processing: ::core::option::Option::Some(#runtime::Processing::#variant)));
                    return Ok(());
                }
                for known in ["history", "rows", "priorities"] {
                    if meta.path.is_ident(known) {
                        let id = format_ident!("{known}");
                        let value: Expr = meta.value()?.parse()?;
                        sets.push(quote!(#id: #value));
                        return Ok(());
                    }
                }
                Err(meta.error("a port has `history`, `rows`, `priorities`, `single`, `raw`, `filtered` or `interpreted`"))
            })?;
        }
    }
    Ok(quote!(#runtime::PortOptions { #(#sets,)* ..#runtime::PortOptions::DEFAULT }))
}

/// One of a kind is enough, and it has nothing to be chosen.
fn check_single(field: &Field, name: &str, known: &mut Vec<String>) -> syn::Result<()> {
    if known.iter().any(|known| known == name) {
        return Err(syn::Error::new_spanned(field, format!("an agent has one `{name}`")));
    }
    known.push(name.to_owned());
    match field.attrs.iter().find(|a| a.path().is_ident("port") || a.path().is_ident("robot")) {
        Some(attribute) => Err(syn::Error::new_spanned(attribute, format!("a `{name}` has no options"))),
        None => Ok(()),
    }
}

/// The methods of an agent as rows of `runtime::Method`, from `methods(exact = 1.0, rough = 0.6)`.
fn methods(
    meta: &syn::meta::ParseNestedMeta<'_>,
    runtime: &proc_macro2::TokenStream,
) -> syn::Result<Vec<proc_macro2::TokenStream>> {
    let content;
    syn::parenthesized!(content in meta.input);
    let mut rows = Vec::new();
    while !content.is_empty() {
        let name = if content.peek(LitStr) {
            content.parse::<LitStr>()?.value()
        } else {
            content.parse::<syn::Ident>()?.to_string()
        };
        content.parse::<syn::Token![=]>()?;
        let quality = content.parse::<syn::Lit>()?;
        rows.push(quote!(#runtime::Method { name: #name, quality: #quality }));
        if !content.is_empty() {
            content.parse::<syn::Token![,]>()?;
        }
    }
    if rows.is_empty() {
        return Err(meta.error("an agent with `methods` has one at least, as in methods(exact = 1.0)"));
    }
    Ok(rows)
}

pub(crate) fn derive(input: DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    let runtime = path_to("runtime");
    let name = &input.ident;
    let visibility = &input.vis;
    let mut kind = kebab(&name.to_string());
    let (mut ways, mut is_anytime) = (Vec::new(), false);
    for attribute in input.attrs.iter().filter(|a| a.path().is_ident("agent")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("kind") {
                kind = meta.value()?.parse::<LitStr>()?.value();
                return Ok(());
            }
            if meta.path.is_ident("methods") {
                ways = methods(&meta, &runtime)?;
                return Ok(());
            }
            if meta.path.is_ident("anytime") {
                is_anytime = true;
                return Ok(());
            }
            Err(meta.error("an agent has `kind`, `methods` or `anytime`"))
        })?;
    }
    let description = doc(&input.attrs);

    let (mut builds, mut visits, mut handle_fields, mut handle_makes) = (vec![], vec![], vec![], vec![]);
    let mut params_type = None;
    let mut singles = Vec::new();
    for field in named_fields(&input)? {
        let id = ident(field)?;
        let key = id.to_string();
        if key == "params" {
            params_type = Some(&field.ty);
            builds.push(quote!(params));
            continue;
        }
        builds.push(quote!(#id: ::core::default::Default::default()));
        let Some((port, types)) = port_type(&field.ty) else { continue };
        let about = doc(&field.attrs);
        let is_single = port == ROUTER || port == MANAGER;
        if is_single {
            check_single(field, &port, &mut singles)?;
        }
        let options = options(field, &runtime)?;
        visits.push(quote! {
            visit(#runtime::PortVisit { name: #key, doc: #about, options: #options, port: &mut self.#id });
        });
        if is_single {
            continue;
        }
        let end = format_ident!("{port}End");
        handle_fields.push(quote! {
            #[doc = #about]
            pub #id: #runtime::#end<#(#types),*>
        });
        handle_makes.push(quote!(#id: #runtime::#end::new(agent, #key)));
    }
    let (params, take_params, swap_params) = match params_type {
        Some(ty) => (quote!(#ty), quote!(), quote!(::core::mem::swap(&mut self.params, params);)),
        None => (quote!(#runtime::NoParams), quote!(let _ = params;), quote!(let _ = params;)),
    };
    let handle = format_ident!("{name}Ports");
    let handle_doc = format!("The ports of a [`{name}`] in a plan.");

    Ok(quote! {
        #[doc = #handle_doc]
        #[derive(Clone, Debug)]
        #visibility struct #handle { #(#handle_fields,)* }

        impl #runtime::Declare for #name {
            const KIND: &'static str = #kind;
            const DOC: &'static str = #description;
            const METHODS: &'static [#runtime::Method] = &[#(#ways),*];
            const IS_ANYTIME: bool = #is_anytime;
            type Params = #params;
            type Ports = #handle;

            fn build(params: Self::Params) -> Self {
                #take_params
                Self { #(#builds,)* }
            }

            fn swap_params(&mut self, params: &mut Self::Params) {
                #swap_params
            }

            #[allow(unused_variables)]
            fn visit_ports(&mut self, visit: &mut dyn FnMut(#runtime::PortVisit<'_>)) {
                #(#visits)*
            }

            #[allow(unused_variables)]
            fn ports_of(agent: &str) -> Self::Ports {
                #handle { #(#handle_makes,)* }
            }
        }
    })
}
