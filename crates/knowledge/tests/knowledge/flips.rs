//! A byte that changed on the disk: an error, or nothing that anybody reads. Never other knowledge than was put.

use std::fs;

use knowledge::{DecisionTable, Fact, Item, Knowledge, Pattern, PatternKind, Schedule, When};
use proptest::prelude::*;
use types::value::{Table, Value};
use types::{Duration, Time};

use crate::Folder;
use crate::power::{all, left_on_disk};

fn table(version: i64) -> Item {
    let mut row = Table::new();
    row.set("wall", Value::Float(0.25 + version as f64 / 256.0));
    row.set("safety", Value::Float(0.5));
    let mut weights = Table::new();
    for situation in ["free", "danger.near", "narrow"] {
        weights.set(situation, Value::Table(row.clone()));
    }
    DecisionTable { name: "home".into(), weights, time: Time(version) }.into()
}

/// File and log of a store whose writer is there still, and what it knows.
fn stored(folder: &Folder) -> (Vec<u8>, Vec<u8>, Vec<String>) {
    let live = Folder::new();
    let mut writer = Knowledge::open(live.file()).unwrap();
    let mut parameters = Table::new();
    parameters.set("hue_from", Value::Float(350.0));
    let (kind, media_type, bytes) = (PatternKind::ColourRange, String::new(), Vec::new());
    writer.put(Pattern { name: "ball".into(), kind, media_type, bytes, parameters }).unwrap();
    let when = When::Every { first: Time::ZERO, period: Duration::secs(60) };
    writer.put(Schedule { name: "bell".into(), when, words: vec!["reset".into()] }).unwrap();
    // Enough for tables of several pages.
    writer.put_all((0..80).map(table)).unwrap();
    for n in 0..60 {
        let fact = Fact::new(format!("thing {n}"), "in", format!("place {}", n / 7), Time(n));
        writer.put(fact).unwrap();
    }
    left_on_disk(&live.0, &folder.0);
    let log = fs::read(folder.0.join("knowledge.db-wal")).unwrap();
    (fs::read(folder.file()).unwrap(), log, all(&mut writer).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn a_changed_byte_is_an_error_or_seen_by_nobody(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 1_u8..=255, any::<bool>()), 150),
    ) {
        let folder = Folder::new();
        let (file, log, known) = stored(&folder);
        let mut errors = 0;
        for (place, change, in_log) in flips {
            let (mut file, mut log) = (file.clone(), log.clone());
            let bytes = if in_log { &mut log } else { &mut file };
            let at = place.index(bytes.len());
            bytes[at] ^= change;
            fs::write(folder.file(), &file).unwrap();
            fs::write(folder.0.join("knowledge.db-wal"), &log).unwrap();
            let _ = fs::remove_file(folder.0.join("knowledge.db-shm"));
            let read = Knowledge::open_read_only(folder.file()).and_then(|mut knowledge| all(&mut knowledge));
            match read {
                Ok(read) => prop_assert_eq!(&read, &known, "byte {} changed by {} (in the log: {})", at, change, in_log),
                Err(_) => errors += 1,
            }
        }
        prop_assert!(errors > 5, "{} of 150 were seen", errors);
    }
}
