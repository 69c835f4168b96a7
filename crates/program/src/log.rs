//! `sinew log`: looks into logs, draws them, plays them, mends them.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration as HostDuration;

use clap::Subcommand;
use record::log::{Info, Message, Reader, info, repair};
use serde_json::{Value as Json, json};
use types::Time;

use crate::cli::Speed;
use crate::error::Failure;
use crate::run::table;
use crate::{figures, terminal};

/// What can be done with a log.
#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    /// Says what is in a log.
    Info {
        /// The log.
        #[arg(value_name = "F.mcap")]
        log: PathBuf,
    },
    /// Draws a log: trajectory, velocity, periods, map.
    Plot {
        /// The log.
        #[arg(value_name = "F.mcap")]
        log: PathBuf,
        /// Where the figures go; else beside the log.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Shows the messages of a log as they came, in their time.
    Play {
        /// The log.
        #[arg(value_name = "F.mcap")]
        log: PathBuf,
        /// Only topics that begin so, as in /decision; may be given several times.
        #[arg(long, value_name = "TOPIC")]
        topic: Vec<String>,
        /// How many times as fast as they came: a number, or max.
        #[arg(long, value_name = "N|max", default_value = "1")]
        speed: Speed,
    },
    /// Makes a whole log of one that a crash or a full disk cut short.
    Repair {
        /// The log.
        #[arg(value_name = "F.mcap")]
        log: PathBuf,
        /// The mended log; else F-repaired.mcap.
        #[arg(long, value_name = "G.mcap")]
        out: Option<PathBuf>,
    },
}

/// Does it.
pub(crate) fn log(command: LogCommand, json: bool) -> Result<ExitCode, Failure> {
    match command {
        LogCommand::Info { log } => {
            let info = info(&log).map_err(wrong)?;
            if json { terminal::say_json(&info_json(&info)) } else { terminal::say(&info_text(&info)) }
        }
        LogCommand::Plot { log, out } => {
            let folder = out.unwrap_or_else(|| log.parent().map(PathBuf::from).unwrap_or_default());
            let (files, _) = figures::of_log(&log, &folder, None).map_err(wrong)?;
            if files.is_empty() {
                return Err(
                    Failure::new(format!("{} holds nothing that could be drawn", log.display())).code(1)
                );
            }
            let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
            if json { terminal::say_json(&json!({"files": names})) } else { terminal::say(&names.join("\n")) }
        }
        LogCommand::Play { log, topic, speed } => play(&log, &topic, speed, json)?,
        LogCommand::Repair { log, out } => {
            let out = out.unwrap_or_else(|| log.with_file_name(format!("{}-repaired.mcap", stem(&log))));
            mend(&log, &out, json)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn wrong(error: impl std::fmt::Display) -> Failure {
    Failure::new(error.to_string())
}

fn stem(path: &std::path::Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

fn info_json(info: &Info) -> Json {
    let run = info.run.as_ref();
    let topics = info.topics.iter().map(|topic| {
        json!({
            "topic": topic.topic,
            "definition": topic.definition,
            "messages": topic.messages,
            "bytes": topic.bytes,
            "first_s": topic.first.seconds(),
            "last_s": topic.last.seconds(),
            "hz": topic.rate(),
        })
    });
    let damage = info.damage.iter().map(|damage| damage.to_string());
    json!({
        "system": run.map(|run| &run.system),
        "seed": run.and_then(|run| run.seed),
        "clock": run.map(|run| run.clock.name()),
        "profile": info.profile,
        "library": info.library,
        "messages": info.messages,
        "from_s": info.span.map(|span| span.0.seconds()),
        "to_s": info.span.map(|span| span.1.seconds()),
        "chunks": info.chunks,
        "whole": info.whole,
        "damage": damage.collect::<Vec<_>>(),
        "topics": topics.collect::<Vec<_>>(),
    })
}

fn info_text(info: &Info) -> String {
    let mut out = String::new();
    if let Some(run) = &info.run {
        let seed = run.seed.map_or(String::new(), |seed| format!(", seed {seed}"));
        out += &format!("{}{seed}, {} clock\n", run.system, run.clock.name());
    } else {
        out += &format!("a log of another program ({})\n", info.library);
    }
    if let Some((from, to)) = info.span {
        out += &format!(
            "{} messages over {:.2} s, from {:.2} s\n",
            info.messages,
            (to - from).seconds(),
            from.seconds()
        );
    }
    if !info.whole {
        out += "the file has no proper end; \"sinew log repair\" makes one\n";
    }
    for damage in &info.damage {
        out += &format!("damaged: {damage}\n");
    }
    let mut rows = vec![["topic", "definition", "messages", "Hz", "kB"].map(str::to_owned)];
    rows.extend(info.topics.iter().map(|topic| {
        [
            topic.topic.clone(),
            topic.definition.clone(),
            topic.messages.to_string(),
            topic.rate().map_or("-".to_owned(), |rate| format!("{rate:.1}")),
            format!("{:.1}", topic.bytes as f64 / 1e3),
        ]
    }));
    out + &table(&rows, 2)
}

fn play(log: &std::path::Path, topics: &[String], speed: Speed, json: bool) -> Result<(), Failure> {
    let mut reader = Reader::open(log).map_err(wrong)?;
    let begun = terminal::host_now();
    let mut first: Option<Time> = None;
    let mut shown = 0u64;
    while let Some(message) = reader.next_message().map_err(wrong)? {
        let topic = &message.channel.topic;
        if !topics.is_empty() && !topics.iter().any(|wanted| topic.starts_with(wanted.as_str())) {
            continue;
        }
        let first = *first.get_or_insert(message.time);
        if let Speed::Times(times) = speed {
            let due = (message.time - first).seconds().max(0.0) / times;
            terminal::pause(HostDuration::from_secs_f64(due).saturating_sub(begun.elapsed()));
        }
        shown += 1;
        if json {
            terminal::say_json(&message_json(&message))
        } else {
            terminal::say(&message_text(&message))
        }
    }
    for damage in reader.damage() {
        terminal::tell(&format!("damaged: {damage}"));
    }
    if shown == 0 && !topics.is_empty() {
        return Err(Failure::new(format!("no topic begins with {}", topics.join(" or ")))
            .help("\"sinew log info\" lists the topics"));
    }
    Ok(())
}

fn message_json(message: &Message) -> Json {
    let value = match short(message) {
        Ok(value) => control::json::to_json(&value),
        Err(error) => json!({"unreadable": error}),
    };
    json!({"time_s": message.time.seconds(), "topic": message.channel.topic, "message": value})
}

fn message_text(message: &Message) -> String {
    let value = short(message).map_or_else(|error| format!("unreadable: {error}"), |value| value.to_string());
    let most = 200;
    let cut: String = value.chars().take(most).collect();
    let more = if value.chars().count() > most { " …" } else { "" };
    format!("{:10.3} s  {}  {cut}{more}", message.time.seconds(), message.channel.topic)
}

/// The message without what is too long to be read.
fn short(message: &Message) -> Result<types::value::Value, String> {
    /// Values of a row that people look at.
    const MOST: usize = 64;
    let schema = message.channel.schema().map_err(ToString::to_string)?;
    record::dynamic::decode_short(schema, &message.cdr, MOST).map_err(|error| error.to_string())
}

fn mend(log: &std::path::Path, out: &std::path::Path, json: bool) -> Result<(), Failure> {
    let repaired = repair(log, out).map_err(wrong)?;
    let lost = repaired.lost_messages();
    if json {
        terminal::say_json(&json!({
            "file": out.display().to_string(),
            "messages": repaired.messages,
            "was_whole": repaired.was_whole,
            "lost_messages": lost,
            "lost_from_s": repaired.lost_span().map(|span| span.0.seconds()),
            "lost_to_s": repaired.lost_span().map(|span| span.1.seconds()),
            "damage": repaired.lost.iter().map(ToString::to_string).collect::<Vec<_>>(),
        }));
        return Ok(());
    }
    let mut text = format!("{}: {} messages", out.display(), repaired.messages);
    if repaired.was_whole {
        text += "; the log was whole already";
    }
    if repaired.nameless > 0 {
        text += &format!("\nlost: {} messages whose topic stood in a lost part", repaired.nameless);
    }
    for damage in &repaired.lost {
        text += &format!("\nlost: {damage}");
    }
    terminal::say(&text);
    Ok(())
}
