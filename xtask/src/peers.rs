//! `cargo xtask peers`: builds the program that measures other systems.

use std::path::Path;

use crate::failure::Failure;
use crate::steps::{Need, provide};
use crate::tool::Tool;
use crate::workspace::Workspace;

/// The folder of the program, a workspace of its own.
const FOLDER: &str = "benches/peers";

/// Builds it in release, into its own folder, where `sinew bench` looks for it.
pub(crate) fn build(workspace: &Workspace) -> Result<(), Failure> {
    let folder = workspace.root.join(FOLDER);
    let target = folder.join("target");
    provide(Need::Compiler)?;
    let cargo = Tool::cargo(&folder).args(["build", "--release", "--locked", "--target-dir"]).arg(&target);
    let cargo = match provide(Need::Libclang) {
        Ok(()) => cargo.args(["--features", "iceoryx2"]),
        Err(failure) => {
            println!("{failure}\n  iceoryx2 needs it: built without, so iceoryx2 cannot be measured");
            cargo
        }
    };
    cargo.run("What other systems need is in benches/peers/Cargo.toml; it is fetched at the first build.")?;
    let program = target.join("release/peers");
    Tool::new(&program, &workspace.root).arg("list").run("It was built, but does not run here.")?;
    println!("  {}", program.strip_prefix(&workspace.root).unwrap_or(Path::new(&program)).display());
    Ok(())
}
