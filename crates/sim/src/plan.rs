//! What a world is made of, as plain data. [`WorldPlan::read`](crate::WorldPlan::read) makes it from a file's tables.

use types::geometry::Pose;
use types::{Duration, Point};

use crate::colour::Colour;
use crate::shape;

/// A world: what stands in it, who walks in it, and the names of its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldPlan {
    /// Its name.
    pub name: String,
    /// Strength of the light: 1 is a well-lit room, 0.3 dusk.
    pub light: f64,
    /// Colour of the floor.
    pub floor: Colour,
    /// Colour of the ceiling.
    pub ceiling: Colour,
    /// Height of the ceiling (m).
    pub ceiling_height: f64,
    /// Where a robot starts that says nothing else.
    pub start: Pose,
    /// Walls.
    pub walls: Vec<Wall>,
    /// Doors in the walls.
    pub doors: Vec<Door>,
    /// Tables, cupboards, boxes.
    pub boxes: Vec<Cuboid>,
    /// Bins, pillars, stools.
    pub rounds: Vec<Round>,
    /// People.
    pub people: Vec<Person>,
    /// Crowds of people who walk about.
    pub crowds: Vec<Crowd>,
    /// Coloured things that stand by themselves.
    pub things: Vec<Thing>,
    /// What sensors can tell from everything else.
    pub landmarks: Vec<Landmark>,
    /// Named parts of the floor.
    pub regions: Vec<Region>,
}

/// A poly-line of wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Its corners (m).
    pub line: Vec<Point>,
    /// Thickness (m), half of it to either side; 0 is a thin partition.
    pub thickness: f64,
    /// Height (m).
    pub height: f64,
    /// Colour.
    pub colour: Colour,
}

/// A door: an opening that is at one of several places of the walls.
#[derive(Clone, Debug, PartialEq)]
pub struct Door {
    /// Its name.
    pub name: String,
    /// Clear width (m).
    pub width: f64,
    /// The places where it can be: a name and the middle of the opening (m).
    pub places: Vec<(String, Point)>,
    /// Which place is open; none when it is shut.
    pub open: Option<usize>,
}

/// An upright box.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuboid {
    /// Its name; may be empty.
    pub name: String,
    /// Its middle (m).
    pub at: Point,
    /// Length and depth (m).
    pub size: Point,
    /// How far it is turned (rad).
    pub angle: f64,
    /// Height of its upper side (m).
    pub height: f64,
    /// Thin legs under a board instead of a closed body: what looks below the board sees the legs only.
    pub legs: bool,
    /// Colour of its sides.
    pub colour: Colour,
    /// Colour of its upper side.
    pub top: Colour,
    /// Whether scattering may move it.
    pub movable: bool,
}

/// An upright cylinder.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Its name; may be empty.
    pub name: String,
    /// Its middle (m).
    pub at: Point,
    /// Its radius (m).
    pub radius: f64,
    /// Its height (m).
    pub height: f64,
    /// Its colour.
    pub colour: Colour,
    /// Whether scattering may move it.
    pub movable: bool,
}

/// A coloured ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Thing {
    /// Its name.
    pub name: String,
    /// Where it is (m). For a carried thing this is not used.
    pub at: Point,
    /// Its radius (m).
    pub radius: f64,
    /// Height of its middle (m).
    pub height: f64,
    /// Its colour.
    pub colour: Colour,
}

/// An upright tube in two colours that sensors can tell from everything else, and whose infrared transmitters tell who it is.
///
/// There are four transmitters, a quarter turn apart; each sends its own code, so whoever hears one knows the landmark and the
/// side from which it hears.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// Its name.
    pub name: String,
    /// Its number, from 1.
    pub id: u32,
    /// Its middle (m).
    pub at: Point,
    /// Where its first side looks (rad).
    pub facing: f64,
    /// Its radius (m); 0 is a mark without a body, such as one on a wall.
    pub radius: f64,
    /// Its height (m).
    pub height: f64,
    /// Colour of its lower half.
    pub colour: Colour,
    /// Colour of its upper half.
    pub top: Colour,
    /// Whether it has transmitters.
    pub infrared: bool,
}

/// A person, who stands or follows a script.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// The name.
    pub name: String,
    /// Where the person is at first (m).
    pub at: Point,
    /// Where the person looks at first (rad).
    pub facing: f64,
    /// Radius (m).
    pub radius: f64,
    /// Height (m).
    pub height: f64,
    /// Colour of the shirt.
    pub shirt: Colour,
    /// Colour of the trousers.
    pub trousers: Colour,
    /// A thing in the hands, held in front.
    pub carries: Option<Thing>,
    /// Hidden until a robot is inside this region.
    pub appears: Option<String>,
    /// Walking speed (m/s).
    pub speed: f64,
    /// Leads: walks on only while a robot is nearer than this (m, centre to centre), and looks at it.
    pub gap: Option<f64>,
    /// The legs of the walk, one after another.
    pub walk: Vec<Leg>,
    /// Whether the walk begins again at its end.
    pub repeat: bool,
    /// Whether scattering may move the person.
    pub movable: bool,
    /// Walks about for ever, instead of a script.
    pub roams: Option<Roam>,
}

/// How a person walks about: from one place of an area to another, as chance has it, around what stands in the way.
#[derive(Clone, Debug, PartialEq)]
pub struct Roam {
    /// The region in which the places lie.
    pub area: String,
    /// Whether the person stops or steps aside before a robot. One who does not walks on until the two touch, and then around.
    pub yields: bool,
}

/// People who walk about an area. Who they are, where they begin and where they go comes from the seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Crowd {
    /// How many they are; fewer where there is no room for all.
    pub count: u32,
    /// The region in which they walk.
    pub area: String,
    /// The share of those who give way to a robot, 0 to 1.
    pub yields: f64,
    /// The slowest and the fastest (m/s).
    pub speed: (f64, f64),
    /// Radius of each (m).
    pub radius: f64,
}

/// One leg of a person's walk.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Where it leads (m).
    pub to: Point,
    /// It begins only after a robot has been inside this region.
    pub when: Option<String>,
    /// Waiting before it begins.
    pub wait: Duration,
}

/// A named part of the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its name.
    pub name: String,
    /// Its corners (m).
    pub polygon: Vec<Point>,
}

impl Default for WorldPlan {
    /// An endless, empty, well-lit hall.
    fn default() -> WorldPlan {
        WorldPlan {
            name: String::new(),
            light: 1.0,
            floor: Colour([122, 112, 100]),
            ceiling: Colour([232, 232, 228]),
            ceiling_height: 2.6,
            start: Pose::default(),
            walls: Vec::new(),
            doors: Vec::new(),
            boxes: Vec::new(),
            rounds: Vec::new(),
            people: Vec::new(),
            crowds: Vec::new(),
            things: Vec::new(),
            landmarks: Vec::new(),
            regions: Vec::new(),
        }
    }
}

impl WorldPlan {
    /// An empty rectangular hall with its lower left corner at the origin.
    pub fn hall(width: f64, depth: f64) -> WorldPlan {
        let line = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth), (0.0, 0.0)]
            .map(|(x, y)| Point::new(x, y));
        WorldPlan { walls: vec![Wall { line: line.to_vec(), ..Wall::default() }], ..WorldPlan::default() }
    }

    /// The region of this name.
    pub fn region(&self, name: &str) -> Option<&Region> {
        self.regions.iter().find(|region| region.name == name)
    }

    /// The person of this name.
    pub fn person(&self, name: &str) -> Option<usize> {
        self.people.iter().position(|person| person.name == name)
    }

    /// How many things of the world scattering may move.
    pub fn movables(&self) -> usize {
        self.boxes.iter().filter(|item| item.movable).count()
            + self.rounds.iter().filter(|item| item.movable).count()
            + self.people.iter().filter(|item| item.movable).count()
    }
}

impl Region {
    /// Whether a point lies inside.
    pub fn contains(&self, point: Point) -> bool {
        shape::inside(&self.polygon, point)
    }

    /// The corners of the smallest upright rectangle around it.
    pub fn bounds(&self) -> (Point, Point) {
        self.polygon.iter().fold(
            (Point::new(f64::INFINITY, f64::INFINITY), Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY)),
            |(min, max), p| {
                (Point::new(min.x.min(p.x), min.y.min(p.y)), Point::new(max.x.max(p.x), max.y.max(p.y)))
            },
        )
    }
}

impl Default for Wall {
    /// A thin, light wall up to the ceiling.
    fn default() -> Wall {
        Wall { line: Vec::new(), thickness: 0.0, height: 2.6, colour: Colour([206, 204, 192]) }
    }
}

impl Default for Landmark {
    /// A tube of 10 cm, red below and green above, as high as a camera.
    fn default() -> Landmark {
        Landmark {
            name: String::new(),
            id: 1,
            at: Point::default(),
            facing: 0.0,
            radius: 0.05,
            height: 1.1,
            colour: Colour([205, 22, 30]),
            top: Colour([40, 150, 60]),
            infrared: true,
        }
    }
}

impl Default for Person {
    /// Somebody of average build in a blue shirt who stands still.
    fn default() -> Person {
        Person {
            name: String::new(),
            at: Point::default(),
            facing: 0.0,
            radius: 0.25,
            height: 1.72,
            shirt: Colour([45, 85, 165]),
            trousers: Colour([58, 56, 66]),
            carries: None,
            appears: None,
            speed: 0.5,
            gap: None,
            walk: Vec::new(),
            repeat: false,
            movable: false,
            roams: None,
        }
    }
}

impl Default for Crowd {
    /// Twelve people between a stroll and a fast walk, of whom every other one gives way.
    fn default() -> Crowd {
        Crowd { count: 12, area: String::new(), yields: 0.5, speed: (0.5, 1.5), radius: 0.25 }
    }
}

impl Default for Cuboid {
    /// A desk of 1.2 m by 0.6 m.
    fn default() -> Cuboid {
        Cuboid {
            name: String::new(),
            at: Point::default(),
            size: Point::new(1.2, 0.6),
            angle: 0.0,
            height: 0.75,
            legs: false,
            colour: Colour([135, 137, 140]),
            top: Colour([180, 183, 186]),
            movable: false,
        }
    }
}

impl Default for Round {
    /// A grey bin.
    fn default() -> Round {
        Round {
            name: String::new(),
            at: Point::default(),
            radius: 0.2,
            height: 0.6,
            colour: Colour([135, 137, 140]),
            movable: false,
        }
    }
}

impl Default for Thing {
    /// A red ball of 12 cm radius at the height of the hands.
    fn default() -> Thing {
        Thing {
            name: String::new(),
            at: Point::default(),
            radius: 0.12,
            height: 1.1,
            colour: Colour([205, 22, 30]),
        }
    }
}
