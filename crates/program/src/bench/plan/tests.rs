//! Maps of our own and those of the benchmark.

use std::fs;

use navigation::path::moving_ai;

use super::*;

/// A map of few cells with queries of chance.
fn small() -> Vec<Floor> {
    own::floors(1000)
}

#[test]
fn all_planners_find_the_same_lengths_on_our_own_maps() {
    let answers = rounds::all(&small(), 1);
    assert_eq!(answers.rows.len(), 7);
    for row in &answers.rows {
        assert_eq!((row.found(), row.right()), (answers.with_a_way(), answers.with_a_way()), "{}", row.name);
        assert_eq!(row.refused(), answers.without_a_way(), "{}", row.name);
    }
    assert!(answers.with_a_way() > 8, "{}", answers.with_a_way());
}

#[test]
fn each_map_has_a_row_of_its_own_queries() {
    let floors = small();
    let rows = rounds::maps(&floors, &rounds::all(&floors, 1));
    assert_eq!(rows.len(), floors.len() + 1);
    for (floor, row) in floors.iter().zip(&rows[1..]) {
        let with_a_way = floor.queries.iter().filter(|query| query.length.is_some()).count();
        assert_eq!((&row[0], &row[1]), (&floor.name, &with_a_way.to_string()));
    }
}

#[test]
fn each_way_in_the_picture_goes_down_in_the_potential_beside_it() {
    for floor in small() {
        for query in floor.queries.iter().filter(|query| query.length.is_some()) {
            let figure = picture::figure(&floor, *query);
            assert_eq!(figure.panels.len(), 2);
            for panel in &figure.panels {
                let value = |(x, y): &(u32, u32)| panel.values[*y as usize * panel.columns + *x as usize];
                let along: Vec<f64> = panel.way.iter().map(value).collect();
                assert!(along.windows(2).all(|two| two[1] <= two[0] - 0.999), "{}: {along:?}", floor.name);
                assert_eq!(along.last(), Some(&0.0));
            }
        }
    }
}

/// A folder for one test, with these files.
fn folder(name: &str, files: &[(&str, &str)]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("sinew-bench-plan-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    for (name, text) in files {
        fs::write(folder.join(name), text).unwrap();
    }
    folder
}

#[test]
fn what_is_wrong_with_maps_and_queries_is_told_with_its_place() {
    let map = "2 4\n....\n..@.\n";
    let check = |name: &str, files: &[(&str, &str)], expect: &[&str]| {
        let folder = folder(name, files);
        let failure = maps::read(&folder, None).err().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!((failure.problems.len(), failure.code), (1, 2), "{name}");
        let text = failure.to_text(crate::error::Paint::Plain);
        for words in expect {
            assert!(text.contains(words), "{name}: {words:?} is not in\n{text}");
        }
        assert!(failure.problems[0].help.is_some(), "{name}");
    };
    check("empty", &[], &["there is no map in it", "--maps DIR"]);
    check("letter", &[("a.map", "1 2\n.x\n")], &["a.map:2", "'x' is no letter of a map", ".x"]);
    check("archive", &[("a.tar.xz", "no archive")], &["a.tar.xz", "tar xf"]);
    let with = |scen: &'static str| [("a.map", map), ("q.scen", scen)];
    check("no-map", &with("b.map\n0 0 0 1 1\n"), &["q.scen:2", "there is no map b.map"]);
    check("no-query", &with("a.map\n0 0 0\n"), &["q.scen:2", "row column row column length"]);
    check("none", &with("a.map\n"), &["there is no query in it"]);
    check(
        "closed",
        &with("a.map\n0 0 1 2 1\n"),
        &["q.scen:2", "the goal is closed: column 2, row 1", "another map"],
    );
    check("outside", &with("a.map\n0 4 1 1 1\n"), &["q.scen:2", "the start is closed: column 4, row 0"]);
    check(
        "length",
        &with("a.map\n0 0 0 3 2.5\n"),
        &["q.scen:2", "the shortest way is 3.00000000 long, not 2.5"],
    );
    check("size", &with("version 1\n0 x/a.map 9 2 0 0 1 1 1\n"), &["q.scen:2", "4 × 2 cells, not 9 × 2"]);
    let nowhere = maps::read(std::path::Path::new("/nowhere/maps"), None).err().unwrap();
    assert!(nowhere.problems[0].what.starts_with("/nowhere/maps: "), "{nowhere:?}");
}

/// Where the maps of the benchmark are; said aloud where they are not.
fn benchmark() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join("../shared/data");
    let folder = std::env::var_os("SINEW_DATA").map_or(beside, PathBuf::from).join("maps");
    if !folder.is_dir() {
        println!("skipped: there is no {}", folder.display());
        return None;
    }
    Some(folder)
}

#[test]
fn every_planner_gives_the_lengths_of_the_benchmark() {
    let Some(folder) = benchmark() else { return };
    let floors = maps::read(&folder, Some(&folder.join("lak303d.scen"))).unwrap();
    assert_eq!((floors.len(), floors[0].queries.len()), (1, 300));
    assert_eq!((floors[0].grid.width(), floors[0].grid.height()), (194, 194));
    let answers = rounds::all(&floors, 1);
    for row in &answers.rows {
        assert_eq!((row.found(), row.right()), (300, 300), "{}", row.name);
    }
}

#[test]
fn all_maps_of_the_benchmark_are_read_with_and_without_their_heads() {
    let Some(folder) = benchmark() else { return };
    let floors = maps::read(&folder, None).unwrap();
    assert_eq!(floors.len(), 1, "the folder has one list of queries");
    let archive = maps::texts(&folder.join("dao_maps.tar.xz")).unwrap();
    assert_eq!(archive.len(), 26);
    let heads = archive.values().filter(|text| text.starts_with("type octile")).count();
    assert!(heads > 0 && heads < 26, "{heads}");
    for (name, text) in &archive {
        assert!(moving_ai::map(text).is_ok(), "{name}");
    }
}
