//! Floor plans, and what a robot asks of them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use navigation::floor::{Distances, FloorPlan, PlanField};
use types::params::ParamValue;
use types::value::Value;
use types::{Point, Pose};

/// So far a ray is followed (m).
const SIGHT: f64 = 8.0;

fuzz_target!(|text: &str| {
    let Ok(value) = program::file::tree(text) else { return };
    let Value::Table(table) = &value else { unreachable!("a file is a table") };
    let mut mistakes = Vec::new();
    let plan = FloorPlan::read(table, &mut mistakes);
    for mistake in &mistakes {
        assert!(mistake.at.end as usize <= text.len() && !mistake.what.is_empty(), "{mistake}");
    }
    assert_eq!(FloorPlan::from_value(&value), mistakes.is_empty().then(|| plan.clone()));
    if mistakes.is_empty() {
        assert_eq!(
            FloorPlan::from_value(&plan.to_value()),
            Some(plan.clone()),
            "it is the same when it is read again"
        );
        asked(&plan);
    }
});

/// All that is asked of a floor has an answer that is a number.
fn asked(plan: &FloorPlan) {
    let Ok(field) = PlanField::new(plan) else { return };
    let (low, high) = field.bounds();
    let middles =
        plan.discs.iter().map(|disc| disc.centre).chain(plan.boxes.iter().map(|block| block.at.position()));
    let walls = plan.walls.iter().flat_map(|wall| [wall.from, wall.to]);
    for at in walls.chain(middles).take(50).chain([low, high, (low + high) * 0.5]) {
        let near = at + Point::new(0.05, 0.3);
        let nearest = field.nearest(near);
        assert_eq!(nearest.is_some(), field.square(near).is_some());
        if let Some(nearest) = nearest {
            assert!((0.0..=2.0).contains(&nearest.distance), "{near:?}: {nearest:?}");
            assert!((nearest.away.norm() - 1.0).abs() < 1e-6, "{near:?}: {nearest:?}");
        }
        for bearing in [0.0, 1.0, 3.0] {
            let ahead = Pose::new(0.0, 0.0, bearing).transform(Point::new(1.0, 0.0));
            assert!(
                field.cast(near, ahead, SIGHT).is_none_or(|way| (0.0..=SIGHT).contains(&way)),
                "{near:?}"
            );
            assert!(field.met_square(near, ahead).is_none_or(|square| square >= 0.0), "{near:?}");
        }
        let _ = field.is_free(near, 0.3);
    }
}
