//! `check`, `schema`, `new` and `doctor`: what can be done without running anything.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use runtime::Registry;
use serde_json::json;

use crate::error::Failure;
use crate::{doctor, file, new, run, schema, terminal};

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

/// What `sinew new` can make.
#[derive(Debug, Subcommand)]
pub(crate) enum NewCommand {
    /// A crate that is the whole of sinew with your agent in it, a system that runs it, and its test.
    Agent(NewArgs),
    /// A system file.
    System(NewArgs),
}

/// How it is called, and where it goes.
#[derive(Args, Debug)]
pub(crate) struct NewArgs {
    /// Its name.
    name: String,
    /// The language.
    #[arg(long, default_value = "rust")]
    lang: String,
    /// The folder into which it is put.
    #[arg(long, value_name = "DIR", default_value = ".")]
    folder: PathBuf,
}

/// Finds all mistakes of a system file.
pub(crate) fn check(args: &CheckArgs, registry: &Registry, json: bool) -> Result<ExitCode, Failure> {
    let registry = run::with_robots(registry.clone());
    // A file with mistakes is a check that failed; one that is not there is wrong usage.
    let loaded = file::check(&args.system, &args.set, &registry).map_err(|mistakes| {
        let has_place = mistakes.list.iter().any(|mistake| mistake.at.start < mistake.at.end);
        Failure::from(mistakes).code(if has_place { 1 } else { 2 })
    })?;
    let plan = &loaded.plan;
    if json {
        let (agents, wires) = (plan.agents.len(), plan.wires.len());
        terminal::say_json(&json!({"system": plan.name, "ok": true, "agents": agents, "wires": wires}));
    } else {
        terminal::say(&format!(
            "{}: {} agents, {} wires, no mistakes",
            plan.name,
            plan.agents.len(),
            plan.wires.len()
        ));
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the schema of system files; it is JSON either way.
pub(crate) fn print_schema(registry: &Registry) -> ExitCode {
    let schema = schema::schema(&run::with_robots(registry.clone()));
    terminal::say(&serde_json::to_string_pretty(&schema).unwrap_or_default());
    ExitCode::SUCCESS
}

/// Writes a template.
pub(crate) fn make(command: &NewCommand, json: bool) -> Result<ExitCode, Failure> {
    let files = match command {
        NewCommand::Agent(args) => new::agent(&args.name, &args.folder, &args.lang)?,
        NewCommand::System(args) => new::system(&args.name, &args.folder, &args.lang)?,
    };
    let shown = |file: &PathBuf| file.strip_prefix(".").unwrap_or(file).display().to_string();
    let names: Vec<String> = files.iter().map(shown).collect();
    if json {
        terminal::say_json(&json!({"files": names}));
        return Ok(ExitCode::SUCCESS);
    }
    let then = match command {
        NewCommand::Agent(args) => {
            let file = names.iter().find(|name| name.ends_with(".toml") && !name.ends_with("Cargo.toml"));
            let folder =
                file.and_then(|file| file.rsplit_once('/')).map_or(args.name.as_str(), |(folder, _)| folder);
            let name = file.and_then(|file| file.rsplit('/').next()).unwrap_or_default();
            format!("\nto try it: cd {folder} && cargo test && cargo run --release -- run {name}")
        }
        NewCommand::System(_) => {
            format!("\nto try it: sinew run {}", names.first().map_or("", String::as_str))
        }
    };
    terminal::say(&(names.join("\n") + &then));
    Ok(ExitCode::SUCCESS)
}

/// Says whether this machine can do real time.
pub(crate) fn examine(json: bool) -> ExitCode {
    let examination = doctor::examine();
    if json {
        terminal::say_json(&examination.to_json())
    } else {
        terminal::say(&examination.to_text())
    }
    if examination.real_time() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
