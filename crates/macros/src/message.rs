//! Messages and their fields.

use quote::quote;
use syn::{Data, DeriveInput, Fields};

use crate::names::{ident, named_fields, path_to};

pub(crate) fn derive_message(input: DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    let types = path_to("types");
    let name = &input.ident;
    let field = derive_field(input.clone())?;
    let full = format!("sinew_msgs/msg/{name}");
    Ok(quote! {
        #field

        impl #types::Message for #name {
            type Element = #types::cdr::NoElement;
            const NAME: &'static str = #full;

            fn definition() -> #types::definition::Definition {
                match <Self as #types::cdr::Field>::kind() {
                    #types::definition::Kind::Struct(definition) => definition,
                    _ => #types::definition::Definition::new(#full, []),
                }
            }

            fn encode(&self, _: &[#types::cdr::NoElement], _: #types::Time, out: &mut #types::cdr::Writer) {
                #types::cdr::Field::write(self, out);
            }

            fn decode(
                input: &mut #types::cdr::Reader<'_>,
                _: &mut #types::cdr::NoRow,
            ) -> ::core::result::Result<Self, #types::cdr::Error> {
                #types::cdr::Field::read(input)
            }

            fn disturb(&mut self, _: &mut [#types::cdr::NoElement], wild: bool, draw: &mut dyn FnMut() -> f64) {
                #types::cdr::Field::disturb(self, wild, draw);
            }
        }
    })
}

pub(crate) fn derive_field(input: DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    match &input.data {
        Data::Enum(_) => derive_byte(&input),
        _ => derive_struct(&input),
    }
}

fn derive_struct(input: &DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    let types = path_to("types");
    let name = &input.ident;
    let full = format!("sinew_msgs/msg/{name}");
    let fields = named_fields(input)?;
    let idents = fields.iter().map(|f| ident(f)).collect::<syn::Result<Vec<_>>>()?;
    let names: Vec<String> = idents.iter().map(|i| i.to_string()).collect();
    let kinds: Vec<_> = fields.iter().map(|f| &f.ty).collect();
    Ok(quote! {
        impl #types::cdr::Field for #name {
            fn kind() -> #types::definition::Kind {
                #types::definition::Kind::Struct(#types::definition::Definition::new(
                    #full,
                    [#((#names, <#kinds as #types::cdr::Field>::kind())),*],
                ))
            }

            fn write(&self, out: &mut #types::cdr::Writer) {
                #(#types::cdr::Field::write(&self.#idents, out);)*
            }

            fn read(input: &mut #types::cdr::Reader<'_>) -> ::core::result::Result<Self, #types::cdr::Error> {
                ::core::result::Result::Ok(Self { #(#idents: #types::cdr::Field::read(input)?),* })
            }

            #[allow(unused_variables)]
            fn disturb(&mut self, wild: bool, draw: &mut dyn FnMut() -> f64) {
                #(#types::cdr::Field::disturb(&mut self.#idents, wild, draw);)*
            }
        }
    })
}

fn derive_byte(input: &DeriveInput) -> syn::Result<proc_macro2::TokenStream> {
    let types = path_to("types");
    let name = &input.ident;
    let Data::Enum(data) = &input.data else {
        return Err(syn::Error::new_spanned(name, "this derive is for structs and enums"));
    };
    if let Some(case) = data.variants.iter().find(|case| !matches!(case.fields, Fields::Unit)) {
        return Err(syn::Error::new_spanned(case, "a case of a message's enum has no fields"));
    }
    let cases: Vec<_> = data.variants.iter().map(|case| &case.ident).collect();
    Ok(quote! {
        impl #types::cdr::Field for #name {
            fn kind() -> #types::definition::Kind {
                #types::definition::Kind::U8
            }

            fn write(&self, out: &mut #types::cdr::Writer) {
                #types::cdr::Field::write(&(*self as u8), out);
            }

            fn read(input: &mut #types::cdr::Reader<'_>) -> ::core::result::Result<Self, #types::cdr::Error> {
                let at = input.offset();
                let byte = <u8 as #types::cdr::Field>::read(input)?;
                #(if byte == #name::#cases as u8 {
                    return ::core::result::Result::Ok(#name::#cases);
                })*
                ::core::result::Result::Err(#types::cdr::Error::NoSuchValue(at))
            }
        }
    })
}
