//! `check`, `schema` and `new`: what can be done without running anything.

use std::process::ExitCode;

use clap::Args;
use runtime::Registry;
use serde_json::json;

use crate::error::Failure;
use crate::{file, run, terminal};

/// What `sinew check` can be told.
#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    /// A system file, or a built-in scenario.
    #[arg(value_name = "FILE|NAME")]
    system: String,
    /// Changes an entry first, as in agent.wall.keep=0.6.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Finds all mistakes of a system file.
pub(crate) fn check(args: &CheckArgs, registry: &Registry, json: bool) -> Result<ExitCode, Failure> {
    let registry = run::with_robots(registry.clone());
    let loaded = file::check(&args.system, &args.set, &registry).map_err(Failure::from)?;
    let plan = &loaded.plan;
    if json {
        let (agents, wires) = (plan.agents.len(), plan.wires.len());
        terminal::say_json(&json!({"system": plan.name, "ok": true, "agents": agents, "wires": wires}));
    } else {
        terminal::say(&format!("{}: {} agents, {} wires, no mistakes", plan.name, plan.agents.len(), plan.wires.len()));
    }
    Ok(ExitCode::SUCCESS)
}
