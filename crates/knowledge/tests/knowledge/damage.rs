//! Files that are no knowledge base, or no longer one: an error says so, and they stay as they are.

use std::fs;
use std::path::Path;

use knowledge::{Fact, Kind, Knowledge, KnowledgeError, Map, Query, Reach};
use types::chance::Stream;
use types::{Pose, Time};

use crate::{Folder, bytes};

/// A closed file with facts and a map over many pages.
fn filled(folder: &Folder) -> Vec<u8> {
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    let facts =
        (0..300).map(|n| Fact::new(format!("thing {n}"), "in", format!("place {}", n / 7), Time(n)).into());
    knowledge.put_all(facts).unwrap();
    let (width, height) = (200, 100);
    let cells = (0..width * height).map(|n| n as u8).collect();
    let map = Map {
        name: "hall".into(),
        resolution: 0.1,
        origin: Pose::default(),
        width,
        height,
        cells,
        time: Time::ZERO,
    };
    knowledge.put(map).unwrap();
    drop(knowledge);
    fs::read(folder.file()).unwrap()
}

#[test]
fn a_row_that_is_changed_while_the_file_is_open_is_told_when_it_is_read() {
    for change in [
        "UPDATE fact SET confidence = 0.5 WHERE id = 3",
        "UPDATE map SET cells = zeroblob(20000)",
        "UPDATE map SET x = 0.25",
    ] {
        let folder = Folder::new();
        filled(&folder);
        let mut knowledge = Knowledge::open(folder.file()).unwrap();
        rusqlite::Connection::open(folder.file()).unwrap().execute_batch(change).unwrap();
        let error = read_all(&mut knowledge).unwrap_err();
        assert!(matches!(error, KnowledgeError::Damaged { .. }), "{change}: {error:?}");
        assert!(error.to_string().contains("a row is not what was written"), "{error}");
    }
}

/// Reads all that there is; errors are answers.
fn read_all(knowledge: &mut Knowledge) -> Result<(), KnowledgeError> {
    let now = knowledge.read()?;
    now.facts(&Query::default())?;
    now.reach(&Reach::to("in", "place 3"))?;
    now.map("hall")?;
    now.history("roaming")?;
    Kind::ALL.into_iter().try_for_each(|kind| now.list(kind).map(drop))
}

fn open_both(file: &Path) -> [Result<(), KnowledgeError>; 2] {
    [Knowledge::open(file).map(drop), Knowledge::open_read_only(file).map(drop)]
}

#[test]
fn what_is_no_knowledge_base_is_told_and_left_as_it_is() {
    let folder = Folder::new();
    let file = folder.file();
    let noise: Vec<u8> = (0..9000).map(|n| Stream::new(3, "noise").bits(n) as u8).collect();
    let other = {
        let path = folder.0.join("other.db");
        let connection = rusqlite::Connection::open(&path).unwrap();
        connection.execute_batch("CREATE TABLE song (name TEXT); INSERT INTO song VALUES ('x');").unwrap();
        drop(connection);
        fs::read(path).unwrap()
    };
    for text in [b"name = \"exploration\"\n".to_vec(), noise, other, b"SQLite format 3\0".to_vec()] {
        fs::write(&file, &text).unwrap();
        let before = bytes(&folder.0);
        for error in open_both(&file).map(Result::unwrap_err) {
            assert!(
                matches!(error, KnowledgeError::Foreign { .. } | KnowledgeError::Damaged { .. }),
                "{error:?}"
            );
            assert!(error.to_string().contains("knowledge.db") && !error.help().is_empty(), "{error}");
        }
        assert!(bytes(&folder.0) == before, "it is as it was");
    }
}

#[test]
fn folders_and_places_where_nothing_can_be_are_told() {
    let folder = Folder::new();
    for error in open_both(&folder.0).map(Result::unwrap_err) {
        assert!(matches!(error, KnowledgeError::NotAFile { what: "a folder", .. }), "{error:?}");
    }
    for error in open_both(Path::new("/dev/null")).map(Result::unwrap_err) {
        assert!(matches!(error, KnowledgeError::NotAFile { .. }), "{error:?}");
    }
    let nowhere = Knowledge::open(folder.0.join("none/knowledge.db")).unwrap_err();
    assert!(matches!(nowhere, KnowledgeError::NoAccess { .. }), "{nowhere:?}");
    let below_a_file = folder.0.join("file");
    fs::write(&below_a_file, "x").unwrap();
    let error = Knowledge::open(below_a_file.join("knowledge.db")).unwrap_err();
    assert!(matches!(error, KnowledgeError::NoAccess { .. }), "{error:?}");
    let missing = Knowledge::open_read_only(folder.file()).unwrap_err();
    assert!(matches!(missing, KnowledgeError::NotThere { .. }), "{missing:?}");
    assert!(!folder.file().exists(), "looking makes no file");
    fs::write(folder.file(), "").unwrap();
    assert!(matches!(Knowledge::open_read_only(folder.file()), Err(KnowledgeError::NotThere { .. })));
    assert!(Knowledge::open(folder.file()).is_ok(), "an empty file is a fresh one");
    assert!(Knowledge::open("").is_err());
}

#[test]
fn a_reader_writes_nothing() {
    let folder = Folder::new();
    filled(&folder);
    let mut reader = Knowledge::open_read_only(folder.file()).unwrap();
    let error = reader.put(Fact::new("cup", "in", "kitchen", Time::ZERO)).unwrap_err();
    assert!(matches!(error, KnowledgeError::NoAccess { .. }), "{error:?}");
    assert_eq!(reader.read().unwrap().facts(&Query::default()).unwrap().len(), 300);
}

#[test]
fn a_newer_form_is_left_to_newer_programs() {
    let folder = Folder::new();
    filled(&folder);
    let connection = rusqlite::Connection::open(folder.file()).unwrap();
    connection.execute_batch("PRAGMA user_version = 99").unwrap();
    drop(connection);
    let before = bytes(&folder.0);
    for error in open_both(&folder.file()).map(Result::unwrap_err) {
        assert!(matches!(error, KnowledgeError::Newer { found: 99, .. }), "{error:?}");
    }
    assert!(bytes(&folder.0) == before, "it is as it was");
}

#[test]
fn tables_that_others_changed_are_damage() {
    for change in [
        "DROP TABLE map",
        "ALTER TABLE fact ADD COLUMN mood TEXT",
        "CREATE TRIGGER t AFTER INSERT ON fact BEGIN DELETE FROM map; END",
        "PRAGMA user_version = -1",
    ] {
        let folder = Folder::new();
        filled(&folder);
        rusqlite::Connection::open(folder.file()).unwrap().execute_batch(change).unwrap();
        for error in open_both(&folder.file()).map(Result::unwrap_err) {
            assert!(matches!(error, KnowledgeError::Damaged { .. }), "{change}: {error:?}");
        }
    }
}

#[test]
fn values_that_nobody_here_wrote_are_damage() {
    for change in [
        "UPDATE map SET width = 201",
        "UPDATE map SET height = -1",
        "UPDATE map SET resolution = -1",
        "UPDATE fact SET subject = CAST(x'ff' AS TEXT) WHERE id = 3",
        "INSERT INTO decision_table VALUES ('roaming', 1, 0, '{ free = ', 0)",
        "INSERT INTO decision_table VALUES ('roaming', -1, 0, '{}', 0)",
        "INSERT INTO schedule VALUES ('nightly', 'cron', NULL, NULL, 'never', '{ do = [\"reset\"] }', 0)",
        "INSERT INTO schedule VALUES ('nightly', 'every', 0, 1, NULL, '{ do = [\"reset\"] }', 0)",
        "DELETE FROM seal",
        "UPDATE seal SET rows = rows - 1",
        "DROP TRIGGER fact_gone; DELETE FROM fact WHERE id = 3; CREATE TRIGGER fact_gone AFTER DELETE ON fact BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'fact'; END",
    ] {
        let folder = Folder::new();
        filled(&folder);
        rusqlite::Connection::open(folder.file()).unwrap().execute_batch(change).unwrap();
        for error in open_both(&folder.file()).map(Result::unwrap_err) {
            assert!(matches!(error, KnowledgeError::Damaged { .. }), "{change}: {error:?}");
        }
    }
}

#[test]
fn a_file_that_was_cut_short_is_told_and_kept() {
    let folder = Folder::new();
    let whole = filled(&folder);
    let file = folder.file();
    for length in [1, 15, 100, 512, 1024, 4095, 4096, 5000, 8192, 20_000, whole.len() - 1] {
        fs::write(&file, &whole[..length]).unwrap();
        let before = bytes(&folder.0);
        for (at, opened) in open_both(&file).into_iter().enumerate() {
            let error = opened.expect_err(&length.to_string());
            assert!(
                matches!(error, KnowledgeError::Foreign { .. } | KnowledgeError::Damaged { .. }),
                "{length} of {} ({at}): {error:?}",
                whole.len()
            );
        }
        assert!(bytes(&folder.0) == before, "{length}");
    }
}

#[test]
fn random_damage_is_an_error_or_seen_by_nobody_and_never_a_panic() {
    let folder = Folder::new();
    let whole = filled(&folder);
    let file = folder.file();
    let mut errors = 0;
    for round in 0..150 {
        let stream = Stream::new(round, "damage");
        let mut spoiled = whole.clone();
        let from = stream.index(0, whole.len());
        let length = 1 << stream.index(1, 11);
        for (at, byte) in spoiled[from..].iter_mut().take(length).enumerate() {
            *byte = stream.bits(10 + at as u64) as u8;
        }
        fs::write(&file, &spoiled).unwrap();
        let read = Knowledge::open_read_only(&file).and_then(|mut knowledge| read_all(&mut knowledge));
        errors += usize::from(read.is_err());
        match Knowledge::open(&file) {
            Ok(mut knowledge) => drop(read_all(&mut knowledge)),
            Err(_) => assert!(fs::read(&file).unwrap() == spoiled, "round {round}: it stays as it is"),
        }
        for name in ["knowledge.db-wal", "knowledge.db-shm"] {
            let _ = fs::remove_file(folder.0.join(name));
        }
    }
    assert!(errors > 30, "{errors} of 150 were seen");
}
