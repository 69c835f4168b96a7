//! The control interface: everything that a plan can say can also be asked of a running system, from another process.
//!
//! | to find | look in |
//! |---|---|
//! | requests in words, for the command line, `[[at]]` and scripts | [`words`] |
//! | the lines on the socket | [`protocol`] |
//! | what `ls`, `graph`, `top` and `plan` look like | [`shapes`] |
//! | the socket of a running system | [`server`] |
//! | asking a running system | [`client`] |
//! | where sockets lie | [`sockets`] |
//!
//! Nothing here touches a real-time thread: all goes through [`runtime::Control`], and a client that does not read what it asked
//! for loses its own messages, is told how many, and slows nobody.

pub mod client;
mod commands;
pub mod json;
mod lines;
mod outbox;
pub mod protocol;
pub mod server;
pub mod shapes;
pub mod sockets;
mod taps;
pub mod words;

pub use client::{Client, ClientError, Event};
pub use server::{Hooks, Limits, Server, ServerError};
