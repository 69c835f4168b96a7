//! The end of the power between two writes: what was answered is in what lies on the disk at that moment.

use std::fs;
use std::path::Path;

use knowledge::{Fact, Item, Kind, Knowledge, Query};
use proptest::prelude::*;
use types::Time;

use crate::{Folder, round_trips};

/// What a disk holds when the power ends while the writer still has the file open: the file and its log, and no memory that is shared.
pub(crate) fn left_on_disk(from: &Path, to: &Path) {
    for name in ["knowledge.db", "knowledge.db-wal"] {
        if from.join(name).exists() {
            fs::copy(from.join(name), to.join(name)).unwrap();
        }
    }
}

/// All that is known, in an order of its own.
pub(crate) fn all(knowledge: &mut Knowledge) -> Result<Vec<String>, knowledge::KnowledgeError> {
    let now = knowledge.read()?;
    let mut all = Vec::new();
    for listed in now.list(Kind::Table)? {
        all.push(format!("table {} {:?}", listed.name, now.history(&listed.name)?));
    }
    all.extend(now.facts(&Query::default())?.iter().map(|fact| format!("{fact:?}")));
    for listed in now.list(Kind::Pattern)? {
        all.push(format!("{:?}", now.pattern(&listed.name)?));
    }
    all.extend(now.schedules()?.iter().map(|schedule| format!("{schedule:?}")));
    for listed in now.list(Kind::Map)? {
        all.push(format!("{:?}", now.map(&listed.name)?));
    }
    Ok(all)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn what_was_answered_outlives_the_end_of_the_power(
        writes in prop::collection::vec(prop::collection::vec(round_trips::item(), 1..4), 1..8),
        reads in any::<bool>(),
    ) {
        let folder = Folder::new();
        let mut writer = Knowledge::open(folder.file()).unwrap();
        // Somebody who reads all the while keeps the log from being emptied.
        let mut reader = Knowledge::open_read_only(folder.file()).unwrap();
        let _held = reads.then(|| reader.read().unwrap());
        for items in writes {
            writer.put_all(items).unwrap();
            let known = all(&mut writer).unwrap();
            let after = Folder::new();
            left_on_disk(&folder.0, &after.0);
            let mut found = Knowledge::open(after.file()).unwrap();
            prop_assert_eq!(all(&mut found).unwrap(), known);
            found.put(Fact::new("it", "goes", "on", Time::ZERO)).unwrap();
        }
    }
}

#[test]
fn what_was_removed_stays_removed() {
    let folder = Folder::new();
    let mut writer = Knowledge::open(folder.file()).unwrap();
    let facts = (0..50).map(|n| Item::from(Fact::new(format!("thing {n}"), "in", "house", Time(n))));
    writer.put_all(facts).unwrap();
    for n in 0..50 {
        let name = format!("thing {n}");
        assert_eq!(writer.retract(&Query::of([&name, "_", "_"])), Ok(1));
        let after = Folder::new();
        left_on_disk(&folder.0, &after.0);
        let mut found = Knowledge::open(after.file()).unwrap();
        assert_eq!(all(&mut found).unwrap().len(), 49 - n as usize);
    }
}
