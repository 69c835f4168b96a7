//! From a system file to a plan and back.
//!
//! ```text
//!   text ──tree──▶ Table with places ──set──▶ Table ──read──▶ Plan ──write──▶ text
//!                                               │
//!                                     groups (`use`), world, goal
//! ```
//!
//! | to find | look in |
//! |---|---|
//! | which texts there are, and what place an offset is | `sources` |
//! | TOML to a tree of values | `tree` |
//! | built-in scenarios and worlds, and files by name | `library` |
//! | `--set KEY=VALUE` | `set` |
//! | the tree to a plan, with all mistakes | `read`, with `agent`, `group`, `wires`, `decide`, `modes`, `figure`, `lasting`, `knowledge`, `requests`, `calls`, `untriggered` |
//! | the plan to a text | `write` |

mod agent;
mod burden;
pub(crate) mod calls;
mod compare;
pub(crate) mod decide;
mod figure;
mod floor;
mod group;
pub(crate) mod knowledge;
mod lasting;
mod library;
mod modes;
mod read;
mod requests;
mod set;
mod sources;
mod syntax;
pub(crate) mod tree;
mod untriggered;
mod wires;
mod write;

pub(crate) use burden::{as_declared, burdens, processors};
pub(crate) use compare::compared;
pub(crate) use decide::read_alone;
pub(crate) use figure::{Part, figures};
pub(crate) use lasting::lasting;
pub use library::{Found, Shelf};
pub(crate) use read::SECTIONS;
pub use read::{Loaded, check, load, read, read_plan};
pub(crate) use set::set_in;
pub use sources::{Mistakes, Sources};
pub use write::write_plan;

use types::value::{Table, Value};

/// Reads a TOML text to a tree of values with their places.
///
/// # Errors
/// All syntax errors.
pub fn tree(text: &str) -> Result<Value, Mistakes> {
    let mut sources = Sources::default();
    let base = sources.add("text", text);
    let mut list = Vec::new();
    let table: Option<Table> = tree::read(&sources, base, &mut list);
    table.map(Value::Table).ok_or(Mistakes { sources, list })
}
