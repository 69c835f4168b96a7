//! What is wrong with a world, and what that is told.

use super::*;

#[test]
fn all_mistakes_of_a_world_are_told_at_once() {
    let text = r##"
        ligth = 1.0
        [[wall]]
        line = [[0, 0]]
        [[box]]
        at = [1, 2]
        colour = "purpel"
        angle = "east"
        [[person]]
        at = [0, 0]
        appears = "kitchen"
        [[door]]
        places = { east = [50, 1] }
        open = "west"
    "##;
    let mut mistakes = Vec::new();
    assert_eq!(WorldPlan::read(&common::table(text), &mut mistakes), None);
    let said = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for expect in [
        "\"light\"",
        "at least 2 points",
        "\"purple\"",
        "must be an angle",
        "no region \"kitchen\"",
        "lies on no wall",
        "\"west\"",
    ] {
        assert!(said.contains(expect), "{expect} not in\n{said}");
    }
}

/// What is said of a world, with the text of the place where it stands.
fn said_of(world: &str, find: impl Fn(&Table) -> Span) -> (Vec<types::value::Mistake>, Span, &str) {
    let mut table = common::table(world);
    common::number_places(&mut table);
    let mut mistakes = Vec::new();
    assert_eq!(WorldPlan::read(&table, &mut mistakes), None, "{world}");
    let place = find(&table);
    (mistakes, place, world)
}

#[test]
fn a_world_that_is_too_large_for_its_grid_is_refused_at_what_makes_it_so() {
    let wide = "[[wall]]\nline = [[-1000, 0], [1000, 0]]\n[[round]]\nat = [0, 1000]\n";
    let of_round = |table: &Table| table.get("round").unwrap().value.as_list().unwrap()[0].at;
    let (mistakes, place, _) = said_of(wide, of_round);
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    assert!(mistakes[0].what.contains("2000 m by 1000 m"), "{}", mistakes[0]);
    assert_eq!(mistakes[0].at, place);
    // A long corridor is no large world.
    let long = "[[wall]]\nline = [[-1000, 0], [1000, 0]]\n[[wall]]\nline = [[-1000, 2], [1000, 2]]\n";
    assert!(WorldPlan::read(&common::table(long), &mut Vec::new()).is_some());
}

#[test]
fn corners_that_are_no_place_are_refused() {
    for (world, said) in [
        ("[[region]]\nname = \"a\"\nrect = [0, 0, 1e300, 1]\n", "\"rect\" lies more than 1000 m away"),
        ("[[region]]\nname = \"a\"\nrect = [0, nan, 1, 1]\n", "\"rect\" lies more than 1000 m away"),
    ] {
        let (mistakes, ..) = said_of(world, |_| Span::default());
        assert!(mistakes.iter().any(|mistake| mistake.what == said), "{world}: {mistakes:?}");
    }
}

#[test]
fn names_that_are_taken_and_doors_off_the_walls_are_told_at_their_place() {
    let doubled =
        "[[region]]\nname = \"a\"\nrect = [0, 0, 1, 1]\n[[region]]\nname = \"a\"\nrect = [0, 0, 1, 1]\n";
    let second = |table: &Table| {
        table.get("region").unwrap().value.as_list().unwrap()[1]
            .value
            .as_table()
            .unwrap()
            .get("name")
            .unwrap()
            .at
    };
    let (mistakes, place, _) = said_of(doubled, second);
    assert_eq!((mistakes.len(), mistakes[0].at), (1, place), "{mistakes:?}");
    let off = "[[wall]]\nline = [[0, 0], [9, 0]]\n[[door]]\nplaces = { on = [4, 0], off = [4, 2] }\n";
    let of_place = |table: &Table| {
        let door = table.get("door").unwrap().value.as_list().unwrap()[0].value.as_table().unwrap().clone();
        door.get("places").unwrap().value.as_table().unwrap().get("off").unwrap().at
    };
    let (mistakes, place, _) = said_of(off, of_place);
    assert_eq!((mistakes.len(), mistakes[0].at), (1, place), "{mistakes:?}");
}

#[test]
fn a_robot_needs_a_free_place_and_a_name_of_its_own() {
    let (mut world, id) = alone(&WorldPlan::hall(4.0, 4.0), Model::h1(), Pose::new(1.0, 1.0, 0.0));
    assert!(world.add_robot("h1", Model::h1(), Pose::new(3.0, 3.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(1.3, 1.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(0.1, 3.0, 0.0)).is_err());
    assert!(world.add_robot("h2", Model::h1(), Pose::new(f64::NAN, 3.0, 0.0)).is_err());
    assert!(world.put(id, Pose::new(3.9, 3.0, 0.0)).is_err());
    assert_eq!(world.truth(id).pose, Pose::new(1.0, 1.0, 0.0));
    assert_eq!(world.robots().count(), 1);
}
