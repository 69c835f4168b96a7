//! Several that read and write one file at a time.

use std::sync::atomic::{AtomicBool, Ordering};

use knowledge::{Fact, Item, Knowledge, Query, Snapshot};
use types::Time;

use crate::Folder;

/// Two facts that are true together or not at all.
fn pair(number: i64) -> [Item; 2] {
    [("left", "is"), ("right", "is")]
        .map(|(subject, predicate)| Fact::new(subject, predicate, number.to_string(), Time(number)).into())
}

#[test]
fn readers_see_whole_writes_and_stay_in_their_moment() {
    let folder = Folder::new();
    let mut writer = Knowledge::open(folder.file()).unwrap();
    writer.put_all(pair(0)).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let readers: Vec<_> = (0..2)
            .map(|_| {
                scope.spawn(|| {
                    let mut reader = Knowledge::open_read_only(folder.file()).unwrap();
                    let mut most = 0;
                    // Once more after the end, so that the end is seen.
                    for last in [false, true] {
                        while last || !done.load(Ordering::Acquire) {
                            let now = reader.read().unwrap();
                            let first = now.facts(&Query::of(["left", "is", "_"])).unwrap();
                            std::thread::yield_now();
                            let second = now.facts(&Query::of(["right", "is", "_"])).unwrap();
                            assert_eq!(first.len(), second.len(), "both facts of a pair, or none");
                            assert!(first.len() >= most, "nothing goes back");
                            most = first.len();
                            if last {
                                break;
                            }
                        }
                    }
                    most
                })
            })
            .collect();
        for number in 1..=100 {
            writer.put_all(pair(number)).unwrap();
        }
        done.store(true, Ordering::Release);
        for reader in readers {
            assert_eq!(reader.join().unwrap(), 101);
        }
    });
}

#[test]
fn writers_take_turns_from_the_first_moment_of_the_file_on() {
    let folder = Folder::new();
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let file = folder.file();
            scope.spawn(move || {
                let mut knowledge = Knowledge::open(file).unwrap();
                for number in 0..20 {
                    let fact =
                        Fact::new(format!("writer {writer}"), "wrote", number.to_string(), Time(number));
                    knowledge.put(fact).unwrap();
                }
            });
        }
    });
    let mut knowledge = Knowledge::open_read_only(folder.file()).unwrap();
    assert_eq!(knowledge.read().unwrap().facts(&Query::default()).unwrap().len(), 80);
}

#[test]
fn a_snapshot_is_of_the_moment_at_which_it_was_taken() {
    let folder = Folder::new();
    let mut writer = Knowledge::open(folder.file()).unwrap();
    writer.put_all(pair(1)).unwrap();
    let mut reader = Knowledge::open_read_only(folder.file()).unwrap();
    let count = |known: &Snapshot<'_>| known.facts(&Query::default()).unwrap().len();
    let before = reader.read().unwrap();
    writer.put_all(pair(2)).unwrap();
    assert_eq!(count(&before), 2);
    drop(before);
    assert_eq!(count(&reader.read().unwrap()), 4);
}
