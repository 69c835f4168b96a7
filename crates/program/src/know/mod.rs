//! `sinew know`: what is known from one run to the next.
//!
//! ```text
//!   words ──▶ KnowArgs ──answer──▶ Answer ──▶ terminal
//!                         │
//!                    knowledge::Knowledge
//! ```

mod ask;
mod put;
mod show;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use knowledge::{Kind, Knowledge, KnowledgeError, Snapshot};
use serde_json::Value as Json;
use types::Time;
use types::value::nearest;

use crate::error::Failure;
use crate::terminal;

/// What `sinew know` can be told.
#[derive(Args, Debug)]
pub(crate) struct KnowArgs {
    /// The file of the knowledge base; in the current folder when nothing is said. The first put makes it.
    #[arg(long, global = true, value_name = "F.db", default_value = "knowledge.db")]
    file: PathBuf,
    #[command(subcommand)]
    command: KnowCommand,
}

/// What can be done with a knowledge base.
#[derive(Debug, Subcommand)]
enum KnowCommand {
    /// Lists what is known.
    List {
        /// Only this kind.
        #[arg(value_parser = kind())]
        kind: Option<Kind>,
    },
    /// Shows one thing: sinew know get table NAME, sinew know get fact SUBJECT PREDICATE OBJECT
    Get(ask::GetArgs),
    /// Puts one thing, in the place of the one of its name; a table is a new version.
    #[command(subcommand)]
    Put(put::PutCommand),
    /// Finds facts, the newest first, with confidence, source and date (UTC): sinew know query _ in kitchen
    Query(ask::QueryArgs),
    /// Removes one thing, a table with all its versions: sinew know remove map NAME
    Remove {
        #[command(flatten)]
        which: Which,
    },
}

/// A kind and what is meant of it.
#[derive(Args, Debug)]
struct Which {
    /// The kind.
    #[arg(value_parser = kind())]
    kind: Kind,
    /// Its name; of a fact its subject, predicate and object, where _ stands for anything.
    #[arg(value_name = "NAME", required = true, num_args = 1..=3, allow_negative_numbers = true)]
    name: Vec<String>,
}

fn kind() -> impl TypedValueParser<Value = Kind> {
    PossibleValuesParser::new(Kind::ALL.map(Kind::name))
        .try_map(|name| Kind::named(&name).ok_or("there is no such kind"))
}

/// What a command says, for people and for programs, and its exit code.
#[derive(Debug)]
struct Answer {
    text: String,
    json: Json,
    code: u8,
}

impl Answer {
    fn new(text: impl Into<String>, json: Json) -> Answer {
        Answer { text: text.into(), json, code: 0 }
    }
}

/// Does it and says so.
pub(crate) fn know(args: &KnowArgs, json: bool) -> Result<ExitCode, Failure> {
    let Answer { text, json: document, code } = answer(args, terminal::host_date())?;
    if json {
        terminal::say_json(&document);
    } else if code != 0 {
        terminal::tell(&text);
    } else {
        terminal::say(&text);
    }
    Ok(ExitCode::from(code))
}

/// Does it; what is put is put at `now`.
fn answer(args: &KnowArgs, now: Time) -> Result<Answer, Failure> {
    match &args.command {
        KnowCommand::List { kind } => {
            let kinds = kind.map_or(Kind::ALL.to_vec(), |kind| vec![kind]);
            let mut knowledge = Knowledge::open_read_only(&args.file)?;
            let known = knowledge.read()?;
            let lists: Result<Vec<_>, KnowledgeError> =
                kinds.into_iter().map(|kind| Ok((kind, known.list(kind)?))).collect();
            Ok(show::lists(&args.file, &lists?))
        }
        KnowCommand::Get(get) => get.answer(&args.file),
        KnowCommand::Put(put) => put.answer(&args.file, now),
        KnowCommand::Query(query) => query.answer(&args.file),
        KnowCommand::Remove { which } => which.remove(&args.file),
    }
}

impl Which {
    /// The one word that a name is.
    fn one(&self) -> Result<&str, Failure> {
        match self.name.as_slice() {
            [name] => Ok(name),
            several => {
                Err(Failure::new(format!("a {} has one name, not {}", self.kind.name(), several.len()))
                    .help("put quotation marks around a name with blanks"))
            }
        }
    }

    /// The three words that a fact is.
    fn parts(&self) -> Result<[&str; 3], Failure> {
        match self.name.as_slice() {
            [subject, predicate, object] => Ok([subject, predicate, object]),
            words => Err(Failure::new(format!("a fact has three parts, not {}", words.len()))
                .help("say subject, predicate and object, as in cup in kitchen; _ stands for anything")),
        }
    }

    fn remove(&self, file: &Path) -> Result<Answer, Failure> {
        check_there(file)?;
        let mut knowledge = Knowledge::open(file)?;
        let count = match self.kind {
            Kind::Fact => knowledge.retract(&knowledge::Query::of(self.parts()?))?,
            kind => usize::from(knowledge.remove(kind, self.one()?)?),
        };
        if count == 0 {
            return Err(missing(&knowledge.read()?, file, self));
        }
        Ok(show::removed(file, self.kind, &self.name, count))
    }
}

/// Looking for something, or removing it, makes no file.
fn check_there(file: &Path) -> Result<(), Failure> {
    if file.exists() { Ok(()) } else { Err(KnowledgeError::NotThere { file: file.to_owned() }.into()) }
}

/// There is nothing of this name: exit code 1, and the name that may be meant.
fn missing(known: &Snapshot<'_>, file: &Path, which: &Which) -> Failure {
    let (kind, name) = (which.kind.name(), which.name.join(" "));
    let failure = Failure::new(format!("there is no {kind} \"{name}\" in {}", file.display())).code(1);
    let names: Vec<String> =
        known.list(which.kind).unwrap_or_default().into_iter().map(|listed| listed.name).collect();
    match nearest(&name, names.iter().map(String::as_str)) {
        Some(near) => failure.help(format!("did you mean \"{near}\"?")),
        None => failure.help(format!("\"sinew know list {kind}\" says what there is")),
    }
}

impl From<KnowledgeError> for Failure {
    fn from(error: KnowledgeError) -> Failure {
        let help = error.help();
        let failure = Failure::new(error.to_string());
        if help.is_empty() { failure } else { failure.help(help) }
    }
}
