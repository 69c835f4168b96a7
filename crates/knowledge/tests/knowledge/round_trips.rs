//! What is put is read as it was, after the file was closed and opened again.

use knowledge::{
    DecisionTable, Fact, Item, Kind, Knowledge, KnowledgeError, Map, Pattern, PatternKind, Query, Schedule,
    When,
};
use proptest::prelude::*;
use types::value::{Table, Value};
use types::{Duration, Pose, Time};

use crate::Folder;

fn word() -> impl Strategy<Value = String> {
    "[a-zA-Z0-9äöß☃'\"%_.-]([a-z 'äé☃\"*_]{0,10}[a-z])?".prop_filter("a wildcard", |word| word != "_")
}

fn time() -> impl Strategy<Value = Time> {
    any::<i64>().prop_map(Time)
}

fn number() -> impl Strategy<Value = f64> {
    any::<f64>().prop_filter("finite", |x| x.is_finite())
}

fn table_of(rows: impl IntoIterator<Item = (String, Value)>) -> Table {
    let mut table = Table::new();
    rows.into_iter().for_each(|(key, value)| table.set(&key, value));
    table
}

/// What a decision maker can read: situations, and agents with weights or with more.
pub(crate) fn weights() -> impl Strategy<Value = Table> {
    let plain = || {
        prop_oneof![
            (0.0..=1.0).prop_map(Value::Float),
            any::<bool>().prop_map(Value::Bool),
            any::<String>().prop_map(Value::Text),
        ]
    };
    let deeper = prop::collection::btree_map(any::<String>(), plain(), 0..3);
    let entry = prop_oneof![3 => plain(), 1 => deeper.prop_map(|rows| Value::Table(table_of(rows)))];
    let entries = prop::collection::btree_map(any::<String>(), entry, 0..5);
    prop::collection::btree_map(".+", entries, 1..5).prop_map(|rows| {
        table_of(rows.into_iter().map(|(row, entries)| (row, Value::Table(table_of(entries)))))
    })
}

fn when() -> impl Strategy<Value = When> {
    let field =
        |least: u32, most: u32| prop_oneof![Just("*".to_owned()), (least..=most).prop_map(|n| n.to_string())];
    let cron = (field(0, 59), field(0, 23), field(1, 28), field(1, 12), field(0, 7));
    prop_oneof![
        time().prop_map(When::Once),
        (time(), 1_000_000_000..i64::MAX)
            .prop_map(|(first, period)| When::Every { first, period: Duration(period) }),
        cron.prop_map(|(a, b, c, d, e)| When::Cron(format!("{a} {b} {c} {d} {e}").parse().unwrap())),
    ]
}

fn map() -> impl Strategy<Value = Map> {
    let place = (number(), number(), number()).prop_map(|(x, y, heading)| Pose { x, y, heading });
    (word(), 1u32..12, 1u32..12, 1e-6..1e6, place, time()).prop_flat_map(
        |(name, width, height, resolution, origin, time)| {
            prop::collection::vec(any::<u8>(), (width * height) as usize).prop_map(move |cells| Map {
                name: name.clone(),
                resolution,
                origin,
                width,
                height,
                cells,
                time,
            })
        },
    )
}

pub(crate) fn item() -> impl Strategy<Value = Item> {
    let source = prop_oneof![Just(String::new()), word()];
    prop_oneof![
        (word(), weights(), time())
            .prop_map(|(name, weights, time)| DecisionTable { name, weights, time }.into()),
        (word(), word(), word(), 0.0..=1.0, time(), source).prop_map(
            |(subject, predicate, object, confidence, time, source)| {
                Fact { subject, predicate, object, confidence, time, source }.into()
            }
        ),
        (word(), word(), prop::collection::vec(any::<u8>(), 1..200), weights()).prop_map(
            |(name, media_type, bytes, parameters)| {
                let kind = if bytes.len() > 100 { PatternKind::Image } else { PatternKind::ColourRange };
                Pattern { name, kind, media_type, bytes, parameters }.into()
            }
        ),
        (word(), when(), prop::collection::vec("[^\\p{Cc}]{0,12}", 1..4))
            .prop_map(|(name, when, words)| Schedule { name, when, words }.into()),
        map().prop_map(Item::from),
    ]
}

/// What is known under the name of the item.
fn same(knowledge: &mut Knowledge, item: &Item) -> Option<Item> {
    let now = knowledge.read().unwrap();
    match item {
        Item::Table(one) => now.table(&one.name).unwrap().map(Item::Table),
        Item::Fact(one) => {
            let parts = [&one.subject, &one.predicate, &one.object].map(|part| Some(part.clone()));
            let [subject, predicate, object] = parts;
            let query =
                Query { subject, predicate, object, source: Some(one.source.clone()), ..Query::default() };
            now.facts(&query).unwrap().into_iter().next().map(Item::Fact)
        }
        Item::Pattern(one) => now.pattern(&one.name).unwrap().map(Item::Pattern),
        Item::Schedule(one) => now.schedule(&one.name).unwrap().map(Item::Schedule),
        Item::Map(one) => now.map(&one.name).unwrap().map(Item::Map),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn all_kinds_are_read_as_they_were_put(items in prop::collection::vec(item(), 1..6)) {
        let folder = Folder::new();
        let mut knowledge = Knowledge::open(folder.file()).unwrap();
        knowledge.put_all(items.clone()).unwrap();
        drop(knowledge);
        let mut knowledge = Knowledge::open_read_only(folder.file()).unwrap();
        let key = |item: &Item| match item {
            Item::Table(one) => format!("table {}", one.name),
            Item::Fact(one) => format!("fact {:?}", (&one.subject, &one.predicate, &one.object, &one.source)),
            Item::Pattern(one) => format!("pattern {}", one.name),
            Item::Schedule(one) => format!("schedule {}", one.name),
            Item::Map(one) => format!("map {}", one.name),
        };
        for (at, item) in items.iter().enumerate() {
            // Of two with one name the later one stays.
            let newest = items[at..].iter().rfind(|other| key(other) == key(item)).unwrap();
            let read = same(&mut knowledge, item);
            prop_assert_eq!(read.as_ref(), Some(newest));
        }
    }
}

fn table(name: &str, weight: f64, time: i64) -> DecisionTable {
    let mut row = Table::new();
    row.set("wall", Value::Float(weight));
    let mut weights = Table::new();
    weights.set("free", Value::Table(row));
    DecisionTable { name: name.into(), weights, time: Time(time) }
}

#[test]
fn a_table_keeps_the_versions_before() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    for (weight, time) in [(0.1, 1), (0.2, 2), (0.2, 3), (0.3, 4)] {
        knowledge.put(table("roaming", weight, time)).unwrap();
    }
    let now = knowledge.read().unwrap();
    let versions = now.history("roaming").unwrap();
    let said: Vec<_> = versions.iter().map(|version| (version.number, version.time.0)).collect();
    assert_eq!(said, [(3, 4), (2, 2), (1, 1)], "what says the same is no version");
    assert_eq!(now.table("roaming").unwrap(), Some(table("roaming", 0.3, 4)));
    assert_eq!(now.table("sleeping").unwrap(), None);
}

#[test]
fn rows_may_say_more_than_weights() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    let wall = [("weight", Value::Float(0.5)), ("importance", Value::Int(1)), ("rate", Value::Float(20.0))];
    let wall = wall.into_iter().chain([("active", Value::Bool(true)), ("method", Value::from("left"))]);
    let row = [
        ("wall", Value::Table(table_of(wall.map(|(key, value)| (key.to_owned(), value))))),
        ("track", Value::Float(0.25)),
        ("priority", Value::Int(7)),
        ("when", Value::from("battery < 0.2")),
        ("goal", Value::from("home")),
    ];
    let mut rich = table("roaming", 0.5, 1);
    rich.weights.set("free", Value::Table(table_of(row.map(|(key, value)| (key.to_owned(), value)))));
    knowledge.put(rich.clone()).unwrap();
    drop(knowledge);
    let mut knowledge = Knowledge::open_read_only(folder.file()).unwrap();
    let known = knowledge.read().unwrap();
    assert_eq!(known.table("roaming").unwrap(), Some(rich));
    assert_eq!(known.newest("roaming").unwrap().map(|version| version.number), Some(1));
}

#[test]
fn a_write_of_somebody_else_is_seen_by_a_number() {
    let folder = Folder::new();
    let mut writer = Knowledge::open(folder.file()).unwrap();
    writer.put(table("roaming", 0.1, 1)).unwrap();
    let mut reader = Knowledge::open_read_only(folder.file()).unwrap();
    let before = reader.writes().unwrap();
    assert_eq!(reader.writes(), Ok(before), "nobody wrote");
    writer.put(table("roaming", 0.2, 1)).unwrap();
    let after = reader.writes().unwrap();
    assert_ne!(after, before);
    let newest = reader.read().unwrap().newest("roaming").unwrap().unwrap();
    assert_eq!((newest.number, reader.writes()), (2, Ok(after)), "looking is no writing");
}

#[test]
fn what_is_wrong_is_refused_whole_and_the_old_one_kept() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    let cup = Fact::new("cup", "in", "kitchen", Time::ZERO);
    knowledge.put(table("roaming", 0.5, 1)).unwrap();
    let bad_row = {
        let mut bad = table("roaming", 0.7, 2);
        bad.weights.set("narrow", Value::from("fast"));
        bad
    };
    let schedule = |period: Duration, words: &[&str]| Schedule {
        name: "nightly".into(),
        when: When::Every { first: Time::ZERO, period },
        words: words.iter().map(|word| (*word).to_owned()).collect(),
    };
    let pattern = |kind, bytes: &[u8]| Pattern {
        name: "ball".into(),
        kind,
        media_type: String::new(),
        bytes: bytes.to_vec(),
        parameters: Table::new(),
    };
    let map = |resolution, width| Map {
        name: "hall".into(),
        resolution,
        origin: Pose::default(),
        width,
        height: 2,
        cells: vec![0; 4],
        time: Time::ZERO,
    };
    let rich = |row: &str, key: &str, value: Value| {
        let mut bad = table("roaming", 0.7, 2);
        bad.weights.set(row, Value::Table(table_of([(key.to_owned(), value)])));
        bad
    };
    let inner = |key: &str, value: Value| Value::Table(table_of([(key.to_owned(), value)]));
    let bad: [(Item, &str); 18] = [
        (rich("", "wall", Value::Int(1)).into(), "table \"roaming\": a row has no name"),
        (
            rich("free", "wall", inner("weight", Value::Float(1.5))).into(),
            "table \"roaming\": \"weight\" of \"wall\" in \"free\" cannot be 1.5",
        ),
        (
            rich("free", "wall", inner("rate", Value::Float(f64::NAN))).into(),
            "\"rate\" of \"wall\" in \"free\" cannot be nan",
        ),
        (
            rich("free", "wall", inner("rate", inner("deep", Value::Int(1)))).into(),
            "\"rate\" of \"wall\" in \"free\" cannot be { deep = 1 }",
        ),
        (rich("free", "wall", Value::List(Vec::new())).into(), "the weight of \"wall\" in \"free\" is []"),
        (rich("free", "priority", Value::Float(f64::INFINITY)).into(), "\"priority\" in \"free\" is inf"),
        (
            table("roaming", 1.5, 2).into(),
            "table \"roaming\": the weight of \"wall\" in \"free\" is 1.5, not a number from 0 to 1",
        ),
        (table("roaming", f64::NAN, 2).into(), "the weight of \"wall\" in \"free\" is nan"),
        (bad_row.into(), "table \"roaming\": \"narrow\" is a text, not a table of weights"),
        (table("", 0.5, 2).into(), "the name of a decision table is empty"),
        (Fact { confidence: -0.1, ..cup.clone() }.into(), "the confidence is -0.1, not a number from 0 to 1"),
        (
            Fact { object: "_".into(), ..cup.clone() }.into(),
            "the object of a fact is \"_\", which stands for anything in a query",
        ),
        (
            Fact { source: "a\nb".into(), ..cup.clone() }.into(),
            "the source of a fact has letters that cannot be seen",
        ),
        (schedule(Duration::millis(999), &["reset"]).into(), "schedule \"nightly\" comes every 999ms"),
        (schedule(Duration::secs(1), &[]).into(), "schedule \"nightly\" does not say what to do"),
        (pattern(PatternKind::Image, b"").into(), "pattern \"ball\" has no bytes"),
        (map(0.0, 2).into(), "map \"hall\" has cells of 0 m"),
        (map(0.1, 3).into(), "map \"hall\" of 3 × 2 cells has 4"),
    ];
    for (item, said) in bad {
        let refused = knowledge.put_all([cup.clone().into(), item]).unwrap_err();
        assert!(refused.to_string().contains(said), "{refused}");
        assert!(matches!(&refused, KnowledgeError::Wrong { help, .. } if !help.is_empty()), "{refused:?}");
    }
    let now = knowledge.read().unwrap();
    assert_eq!(now.facts(&Query::default()).unwrap(), [], "all or none");
    assert_eq!(now.history("roaming").unwrap().len(), 1);
    for kind in [Kind::Pattern, Kind::Schedule, Kind::Map] {
        assert_eq!(now.list(kind).unwrap(), [], "{kind:?}");
    }
}

#[test]
fn what_is_removed_is_gone_and_the_rest_stays() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    knowledge.put_all([table("roaming", 0.5, 1).into(), table("resting", 0.5, 1).into()]).unwrap();
    assert_eq!(knowledge.remove(Kind::Table, "roaming"), Ok(true));
    assert_eq!(knowledge.remove(Kind::Table, "roaming"), Ok(false));
    assert_eq!(knowledge.remove(Kind::Map, "resting"), Ok(false));
    assert!(matches!(knowledge.remove(Kind::Fact, "cup"), Err(KnowledgeError::Wrong { .. })));
    let now = knowledge.read().unwrap();
    let names: Vec<String> = now.list(Kind::Table).unwrap().into_iter().map(|listed| listed.name).collect();
    assert_eq!(names, ["resting"]);
}
