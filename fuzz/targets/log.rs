//! Logs of runs: what `log info`, `log play`, `log repair` and a replay read.
#![no_main]

use std::io::Cursor;
use std::path::PathBuf;
use std::sync::LazyLock;

use hardware::replay::Replayed;
use libfuzzer_sys::fuzz_target;
use record::log::{Message, Reader, info, repair};
use sinew_fuzz::{drive, put, scratch};
use types::Time;

static OLD: LazyLock<PathBuf> = LazyLock::new(|| scratch("old.mcap"));
static NEW: LazyLock<PathBuf> = LazyLock::new(|| scratch("new.mcap"));

fuzz_target!(|bytes: &[u8]| {
    let Some(messages) = messages(bytes) else { return };
    for message in &messages {
        // As `log play` shows them.
        if let Ok(schema) = message.channel.schema()
            && let Ok(value) = record::dynamic::decode_short(schema, &message.cdr, 64)
        {
            let _ = value.to_string();
        }
    }
    if !put(&OLD, bytes) {
        return;
    }
    if let Ok(info) = info(&*OLD) {
        assert_eq!(info.messages, messages.len() as u64);
        info.damage.iter().for_each(|damage| drop(damage.to_string()));
        info.topics.iter().for_each(|topic| assert_ne!(topic.rate(), Some(0.0)));
    }
    if let Ok(repaired) = repair(&*OLD, &*NEW) {
        let _ = (repaired.lost_messages(), repaired.lost_span());
        mended(&messages);
    }
    if let Ok(mut replayed) = Replayed::open(&OLD, "h1") {
        drive(&mut replayed, Time::ZERO);
    }
    if let Ok(mut replayed) = Replayed::open(&OLD, "h1") {
        drive(&mut replayed, Time(1_900_000_000_000_000_000));
    }
});

fn messages(bytes: &[u8]) -> Option<Vec<Message>> {
    let len = bytes.len() as u64;
    let reader = Reader::from(Box::new(Cursor::new(bytes.to_vec())), len, "the log").ok()?;
    reader.collect::<Result<_, _>>().ok()
}

/// What was mended is whole, and holds what could be read before.
fn mended(before: &[Message]) {
    let Ok(bytes) = std::fs::read(&*NEW) else { return };
    let len = bytes.len() as u64;
    let mut reader = Reader::from(Box::new(Cursor::new(bytes)), len, "the mended log").expect("it is a log");
    for old in before {
        let new = reader.next_message().expect("it can be read").expect("no message is lost");
        assert_eq!((new.time, &new.cdr), (old.time, &old.cdr));
        assert_eq!((&new.channel.topic, new.channel.id), (&old.channel.topic, old.channel.id));
        assert_eq!(new.header, old.header);
    }
    assert!(reader.next_message().expect("it can be read").is_none(), "no message is added");
    assert!(reader.is_whole() && reader.damage().is_empty());
}
