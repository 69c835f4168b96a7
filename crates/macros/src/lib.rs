//! Derives for agents, parameters and messages.
//!
//! They write tables and typed handles from the fields of a struct, never control flow: everything that they write can be
//! written by hand.

mod agent;
mod message;
mod names;
mod params;

use proc_macro::TokenStream;

/// Writes `runtime::Declare` for a struct of ports, a field `params` and state that has a default.
///
/// * A field of type `Input<T>`, `Output<T>`, `Service<Q, A>` or `Client<Q, A>` is a port named like the field.
/// * A field of type `Router` is the agent's end at the router; one is enough, and no wire leads to it.
/// * `#[robot("drive")]` on a port wires it to that port of the robot which the system file names for the agent.
/// * `#[port(history = 16)]` on an output keeps its last messages in memory; `#[port(rows = 4096)]` is the greatest length of
///   the row of a large message; `#[port(priorities = "urgent, normal")]` names the priorities that it uses;
///   `#[port(single)]` on an input lets one sender at most be wired to it; `#[port(raw)]`, `#[port(filtered)]` or `#[port(interpreted)]`
///   on an output says how far what it gives is from the hardware.
/// * `#[agent(kind = "wall-follower")]` names the type in system files; by default it is the name of the struct in that form.
/// * `#[agent(methods(exact = 1.0, rough = 0.6))]` names the ways in which it can do its step, the best first, with their quality;
///   `#[agent(anytime)]` says that its step refines its result while it may.
/// * A field of type `Manager` is the end of a resource manager.
#[proc_macro_derive(Agent, attributes(agent, port, robot))]
pub fn agent(input: TokenStream) -> TokenStream {
    expand(input, agent::derive)
}

/// Writes `types::params::Params` for a struct of documented fields.
///
/// `#[param(default = 0.5, min = 0.1, max = 2.0)]` gives a default and a range, `words = ["left", "right"]` the words of which a text is
/// one; where a field names a default, `Default` is
/// written too. `#[param(flatten)]` takes in the fields of another such struct. `#[params(check = path)]` on the struct names a function
/// of it and of the table it was read from, which says what is wrong with the whole.
#[proc_macro_derive(Params, attributes(param, params))]
pub fn params(input: TokenStream) -> TokenStream {
    expand(input, params::derive)
}

/// Writes `types::Message` for a plain struct: a message without a row behind it, of the package `sinew_msgs`.
#[proc_macro_derive(Message)]
pub fn message(input: TokenStream) -> TokenStream {
    expand(input, message::derive_message)
}

/// Writes `types::cdr::Field` for a plain struct, or for an enum of numbered cases (a byte).
#[proc_macro_derive(Field)]
pub fn field(input: TokenStream) -> TokenStream {
    expand(input, message::derive_field)
}

fn expand(
    input: TokenStream,
    derive: fn(syn::DeriveInput) -> syn::Result<proc_macro2::TokenStream>,
) -> TokenStream {
    let input = syn::parse_macro_input!(input as syn::DeriveInput);
    derive(input).unwrap_or_else(syn::Error::into_compile_error).into()
}
