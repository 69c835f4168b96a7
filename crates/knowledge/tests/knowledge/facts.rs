//! Questions to facts.

use knowledge::{Fact, Knowledge, Query, Reach};
use types::Time;

use crate::Folder;

/// Subject, predicate, object, and confidence in percent; the time is the line.
const HOUSE: [(&str, &str, &str, u32); 8] = [
    ("cup", "in", "kitchen", 90),
    ("cup", "in", "cupboard", 40),
    ("cupboard", "in", "kitchen", 100),
    ("kitchen", "in", "house", 100),
    ("cup", "is", "red", 100),
    ("garden", "beside", "house", 100),
    ("ghost", "in", "mirror", 10),
    ("mirror", "in", "ghost", 10),
];

fn house(folder: &Folder) -> Knowledge {
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    let facts = HOUSE.iter().enumerate().map(|(line, (subject, predicate, object, percent))| {
        let fact = Fact::new(*subject, *predicate, *object, Time(line as i64));
        Fact { confidence: f64::from(*percent) / 100.0, ..fact }.into()
    });
    knowledge.put_all(facts).unwrap();
    knowledge
}

/// The lines that fit, as they come.
fn lines(knowledge: &mut Knowledge, query: &Query) -> Vec<i64> {
    knowledge.read().unwrap().facts(query).unwrap().iter().map(|fact| fact.time.0).collect()
}

#[test]
fn any_part_may_be_asked_for_and_the_newest_comes_first() {
    let folder = Folder::new();
    let mut knowledge = house(&folder);
    for (parts, least_confidence, most, wanted) in [
        (["cup", "in", "_"], 0.0, None, vec![1, 0]),
        (["cup", "in", "*"], 0.5, None, vec![0]),
        (["_", "_", "house"], 0.0, None, vec![5, 3]),
        (["_", "in", "kitchen"], 0.0, Some(1), vec![2]),
        (["_", "_", "_"], 1.0, None, vec![5, 4, 3, 2]),
        (["cup", "is", "blue"], 0.0, None, vec![]),
        (["CUP", "_", "_"], 0.0, None, vec![]),
        (["c%", "_", "_"], 0.0, None, vec![]),
    ] {
        let query = Query { least_confidence, most, ..Query::of(parts) };
        assert_eq!(lines(&mut knowledge, &query), wanted, "{parts:?}");
    }
}

#[test]
fn a_source_corrects_itself_and_nobody_else() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    let says = |source: &str, confidence, time| Fact {
        source: source.into(),
        confidence,
        ..Fact::new("door", "is", "open", Time(time))
    };
    for fact in [says("camera", 0.9, 1), says("sonar", 0.3, 2), says("camera", 0.2, 3)] {
        knowledge.put(fact).unwrap();
    }
    let facts = knowledge.read().unwrap().facts(&Query::of(["door", "is", "open"])).unwrap();
    assert_eq!(facts, [says("camera", 0.2, 3), says("sonar", 0.3, 2)]);
    let of_camera = Query { source: Some("camera".into()), ..Query::default() };
    assert_eq!(knowledge.retract(&of_camera), Ok(1));
    assert_eq!(lines(&mut knowledge, &Query::default()), [2]);
    assert_eq!(knowledge.retract(&of_camera), Ok(0));
}

#[test]
fn many_steps_lead_through_the_house_and_a_circle_ends() {
    let folder = Folder::new();
    let mut knowledge = house(&folder);
    let now = knowledge.read().unwrap();
    let reached = |reach: Reach| -> Vec<(String, u32)> {
        now.reach(&reach).unwrap().into_iter().map(|reached| (reached.name, reached.steps)).collect()
    };
    let pair = |name: &str, steps| (name.to_owned(), steps);
    assert_eq!(reached(Reach::to("in", "house")), [pair("kitchen", 1), pair("cup", 2), pair("cupboard", 2)]);
    assert_eq!(
        reached(Reach::from("cup", "in")),
        [pair("cupboard", 1), pair("kitchen", 1), pair("house", 2)]
    );
    let sure = Reach { least_confidence: 0.5, ..Reach::from("cup", "in") };
    assert_eq!(reached(sure), [pair("kitchen", 1), pair("house", 2)]);
    let near = Reach { most_steps: 1, ..Reach::to("in", "house") };
    assert_eq!(reached(near), [pair("kitchen", 1)]);
    let ghost = Reach { most_steps: 1000, ..Reach::to("in", "ghost") };
    assert_eq!(reached(ghost), [pair("mirror", 1)]);
    assert_eq!(reached(Reach::to("in", "nowhere")), []);
}

#[test]
fn many_ways_to_one_thing_are_one() {
    let folder = Folder::new();
    let mut knowledge = Knowledge::open(folder.file()).unwrap();
    // Each leads to each other: there are more ways than could be walked.
    let ends = (0..20).flat_map(|a| (0..20).map(move |b| (a, b)));
    let facts = ends.map(|(a, b)| Fact::new(format!("n{a}"), "near", format!("n{b}"), Time::ZERO).into());
    knowledge.put_all(facts).unwrap();
    let reached = knowledge.read().unwrap().reach(&Reach::from("n0", "near")).unwrap();
    assert_eq!(reached.len(), 19);
    assert!(reached.iter().all(|reached| reached.steps == 1));
}
