//! The published worlds of BARN against what was measured of them elsewhere. Run where they are, skipped in one line where they are not.

use sim::barn;

use crate::data::file;

#[test]
fn the_largest_disc_that_passes_a_published_world_is_as_large_as_it_is_said_to_be() {
    let Some(path) = file("barn/barn_grid_100.txt") else { return };
    let worlds = barn::read(&std::fs::read_to_string(path).unwrap()).unwrap();
    assert_eq!(worlds.len(), 100);
    let mut differences = 0.0;
    for world in &worlds {
        let count = world.cylinders().count();
        assert!((181..=365).contains(&count), "world {}: {count} cylinders", world.number);
        let (passable, shortest) = barn::measure(world);
        // The lattice on which we look is of 5 cm.
        let off = passable - world.passable;
        assert!(off.abs() < 0.07, "world {}: {passable} for {}", world.number, world.passable);
        differences += off;
        // Their planner keeps away from things, so its way is no shorter than the shortest.
        let shortest = shortest.unwrap();
        assert!(shortest < world.path_length + 0.1, "world {}: {shortest}", world.number);
    }
    assert!((differences / 100.0).abs() < 0.01, "{differences}");
}
