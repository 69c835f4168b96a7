//! `know get` and `know query`.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use knowledge::{Kind, Knowledge, Query, Reach, Reached};
use record::grey::Grey;

use super::{Answer, Which, missing, show};
use crate::error::Failure;

/// What `sinew know get` can be told.
#[derive(Args, Debug)]
pub(super) struct GetArgs {
    #[command(flatten)]
    which: Which,
    /// Of a table: this version, not the newest.
    #[arg(long, value_name = "N", conflicts_with = "history")]
    version: Option<u32>,
    /// Of a table: all versions.
    #[arg(long)]
    history: bool,
    /// Of a pattern or map: writes its bytes, or the map as PGM, into this new file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl GetArgs {
    pub(super) fn answer(&self, file: &Path) -> Result<Answer, Failure> {
        let kind = self.which.kind;
        if kind != Kind::Table && (self.history || self.version.is_some()) {
            return Err(Failure::new(format!("a {} has no versions", kind.name())).help("tables have"));
        }
        if self.out.is_some() && !matches!(kind, Kind::Pattern | Kind::Map) {
            return Err(Failure::new(format!("a {} is no file", kind.name()))
                .help("--out is for patterns and maps; what is shown can be sent into a file"));
        }
        let mut knowledge = Knowledge::open_read_only(file)?;
        let known = knowledge.read()?;
        let found = match kind {
            Kind::Table => {
                let name = self.which.one()?;
                let mut versions = known.history(name)?;
                if self.history && !versions.is_empty() {
                    return Ok(show::history(name, &versions));
                }
                if let Some(number) = self.version
                    && !versions.is_empty()
                {
                    let numbers: Vec<String> =
                        versions.iter().map(|version| version.number.to_string()).collect();
                    versions.retain(|version| version.number == number);
                    if versions.is_empty() {
                        return Err(Failure::new(format!("table \"{name}\" has no version {number}"))
                            .help(format!("it has: {}", numbers.join(", ")))
                            .code(1));
                    }
                }
                versions.first().map(|version| show::table(name, version))
            }
            Kind::Fact => {
                let facts = known.facts(&Query::of(self.which.parts()?))?;
                (!facts.is_empty()).then(|| show::facts(&facts))
            }
            Kind::Pattern => known
                .pattern(self.which.one()?)?
                .map(|pattern| {
                    let shown = show::pattern(&pattern);
                    self.written(&pattern.bytes, shown)
                })
                .transpose()?,
            Kind::Schedule => known.schedule(self.which.one()?)?.map(|schedule| show::schedule(&schedule)),
            Kind::Map => known
                .map(self.which.one()?)?
                .map(|map| {
                    let shown = show::map(&map);
                    // The first row of a map is its lowest, that of a picture its highest.
                    let rows = map.cells.chunks_exact(map.width as usize).rev();
                    let pixels = rows.flatten().copied().collect();
                    self.written(&Grey { width: map.width, height: map.height, pixels }.to_pgm(), shown)
                })
                .transpose()?,
        };
        found.ok_or_else(|| missing(&known, file, &self.which))
    }

    /// Writes the bytes, where they are wanted. A file that is there already stays.
    fn written(&self, bytes: &[u8], mut shown: Answer) -> Result<Answer, Failure> {
        let Some(out) = &self.out else { return Ok(shown) };
        let wrote = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(out)
            .and_then(|mut file| file.write_all(bytes));
        wrote.map_err(|error| {
            Failure::new(format!("{} cannot be written: {error}", out.display()))
                .help("name a new file in a folder that is there")
        })?;
        shown.text = out.display().to_string();
        shown.json["out"] = out.display().to_string().into();
        Ok(shown)
    }
}

/// What `sinew know query` can be told.
#[derive(Args, Debug)]
pub(super) struct QueryArgs {
    /// The subject, or _ for any.
    #[arg(allow_negative_numbers = true)]
    subject: String,
    /// The predicate, or _ for any.
    #[arg(allow_negative_numbers = true)]
    predicate: String,
    /// The object, or _ for any.
    #[arg(allow_negative_numbers = true)]
    object: String,
    /// The least confidence, from 0 to 1.
    #[arg(long, value_name = "X", default_value_t = 0.0, value_parser = super::put::confidence)]
    confidence: f64,
    /// Only what this source says.
    #[arg(long, value_name = "NAME", conflicts_with = "in_depth")]
    source: Option<String>,
    /// So many at most.
    #[arg(long, value_name = "N", conflicts_with = "in_depth")]
    most: Option<u32>,
    /// Over any number of steps: all that is in something that is in the house.
    #[arg(long)]
    in_depth: bool,
}

impl QueryArgs {
    pub(super) fn answer(&self, file: &Path) -> Result<Answer, Failure> {
        let mut query = Query::of([&self.subject, &self.predicate, &self.object]);
        query.least_confidence = self.confidence;
        query.source = self.source.clone();
        query.most = self.most;
        let reach = if self.in_depth { Some(reach(&query)?) } else { None };
        let mut knowledge = Knowledge::open_read_only(file)?;
        let known = knowledge.read()?;
        let mut answer = match &reach {
            None => show::facts(&known.facts(&query)?),
            Some(reach) => {
                let mut reached: Vec<Reached> = known.reach(reach)?;
                // Where both ends are named, the question is whether the one leads to the other.
                if let (Some(_), Some(object)) = (&query.subject, &query.object) {
                    reached.retain(|reached| reached.name == *object);
                }
                show::reached(reach, &reached)
            }
        };
        if answer.text.is_empty() {
            answer.text = "nothing fits".to_owned();
            answer.code = 1;
        }
        Ok(answer)
    }
}

fn reach(query: &Query) -> Result<Reach, Failure> {
    let Some(predicate) = &query.predicate else {
        return Err(
            Failure::new("a question in depth follows one predicate").help("name it, as in _ in house")
        );
    };
    let reach = match (&query.subject, &query.object) {
        (Some(subject), _) => Reach::from(subject, predicate),
        (None, Some(object)) => Reach::to(predicate, object),
        (None, None) => {
            return Err(Failure::new("a question in depth begins somewhere")
                .help("name the subject or the object, as in _ in house"));
        }
    };
    Ok(Reach { least_confidence: query.least_confidence, ..reach })
}
