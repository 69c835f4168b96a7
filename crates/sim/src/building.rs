//! What of a world stands still, as a plan of the building shows it: for robots that know the house but not what is strewn about in it.

use types::{Point, Pose};

use crate::outline::{BOARD, LEG, pieces};
use crate::plan::{Cuboid, WorldPlan};
use crate::shape;

/// Walls with their open doors, boxes and pillars, cut at one height.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Building {
    /// Middle lines of walls and their thickness (m).
    pub walls: Vec<(Point, Point, f64)>,
    /// Boxes: middle and angle, length and depth (m).
    pub boxes: Vec<(Pose, Point)>,
    /// Round things: middle and radius (m).
    pub rounds: Vec<(Point, f64)>,
}

impl WorldPlan {
    /// What a plan of the building shows at a height above the floor (m): that of the laser that looks for it. People, things and whatever can be
    /// moved are not in it; doors are as the world's file has them, whatever a seed draws.
    pub fn building(&self, height: f64) -> Building {
        let mut building = Building::default();
        for wall in self.walls.iter().filter(|wall| wall.height > height) {
            building.walls.extend(pieces(self, wall).into_iter().map(|(a, b)| (a, b, wall.thickness)));
        }
        self.boxes.iter().filter(|item| !item.movable).for_each(|item| building.cuboid(item, height));
        let rounds = self.rounds.iter().filter(|item| !item.movable && item.height > height);
        building.rounds.extend(rounds.map(|item| (item.at, item.radius)));
        building
    }
}

impl Building {
    fn cuboid(&mut self, item: &Cuboid, height: f64) {
        if height >= item.height {
            return;
        }
        if item.legs && height < item.height - BOARD {
            let inner = Point::new(item.size.x - 4.0 * LEG, item.size.y - 4.0 * LEG);
            self.rounds
                .extend(shape::rectangle(item.at, inner, item.angle).into_iter().map(|leg| (leg, LEG)));
        } else {
            self.boxes.push((Pose::new(item.at.x, item.at.y, item.angle), item.size));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Door, Round};

    #[test]
    fn it_shows_what_stands_still_at_a_height_and_nothing_that_moves() {
        let mut plan = WorldPlan::hall(8.0, 6.0);
        let (places, open) = (vec![("east".into(), Point::new(8.0, 2.0))], Some(0));
        plan.doors.push(Door { name: "door".into(), width: 1.0, places, open });
        let still = Cuboid { at: Point::new(2.0, 2.0), height: 0.5, ..Cuboid::default() };
        plan.boxes = vec![
            still.clone(),
            Cuboid { movable: true, ..still.clone() },
            Cuboid { height: 0.3, ..still.clone() },
            Cuboid { legs: true, height: 0.75, ..still },
        ];
        let round = Round { at: Point::new(4.0, 4.0), ..Round::default() };
        plan.rounds = vec![round.clone(), Round { movable: true, ..round }];
        let building = plan.building(0.35);
        // Four walls, one of them in two parts beside the door.
        assert_eq!(building.walls.len(), 5);
        let length: f64 = building.walls.iter().map(|(a, b, _)| a.distance(*b)).sum();
        assert!((length - 27.0).abs() < 1e-9, "{length}");
        assert_eq!(building.boxes, [(Pose::new(2.0, 2.0, 0.0), Point::new(1.2, 0.6))]);
        assert_eq!((building.rounds.len(), building.rounds[4]), (5, (Point::new(4.0, 4.0), 0.2)));
        assert_eq!(plan.building(0.74).boxes.len(), 1, "the board of the table alone");
        assert_eq!(plan.building(3.0), Building::default());
    }
}
