//! Who gives way when there is more to do than there is time for, and how far.
//!
//! Concessions are made in a fixed order, and of each kind only as much as is needed:
//!
//! 1. **periods** grow, by elasticity over importance ([`crate::elastic`]), up to the longest that each one's designer allows;
//! 2. **methods** become cheaper, of the least important first;
//! 3. **budgets** of anytime agents shrink, down to their mandatory parts ([`budgets`]);
//! 4. **lives**: the least important of those that may be suspended are.
//!
//! ```text
//!              fit?     longest periods    cheapest methods    least budgets     suspended
//!   as ordered ──no──▶ fit? ──────no─────▶ fit? ─────no──────▶ fit? ────no─────▶ fit?
//!       │yes            │yes                │yes                │yes              │yes
//!       ▼               │                   │                   │                 ▼ give lives back
//!     done              │                   │                   ▼ give budgets back  ◀─┘
//!                       │                   ▼ give methods back  ◀─┘
//!                       ▼ shorten periods  ◀─┘
//!                     done
//! ```
//!
//! *To fit* is the verdict of [`System::do_meet`], in exact arithmetic. All is reckoned from the nominal values, so the same load gives the same
//! settings, whatever was before; a [`Governor`] adds the patience that a running system needs.
//!
//! **Who cannot be helped.** Who misses its deadline even when everybody has given all, starved by something above that does not give way, say,
//! drags nobody down: it gives way itself, all but its life, and the others are asked only for what they need among themselves.
//!
//! **Who can help.** Those are left alone whose giving way helps nobody who is late: they run on other processors, below, or make nobody run.

mod apply;
mod budgets;
mod change;
mod concerned;
mod governor;
mod ladder;
mod lengthen;
mod room;
mod search;
mod work;

use crate::Exact;
use crate::system::{System, Unsound};

pub use apply::apply;
pub use budgets::budgets;
pub use change::{Cause, Change, Late, Shift};
pub use governor::{Governor, Patience};
pub use ladder::Ladder;
pub use lengthen::lengthen;
pub use work::{Work, useful_work};

use room::Room;
use search::Search;

/// How far an agent may give way, and how readily. Times in nanoseconds.
#[derive(Clone, Debug, PartialEq)]
pub struct Managed {
    /// It is never touched.
    pub rigid: bool,
    /// Its nominal period; for one that only messages make run the gap between two of its steps that they make at nominal rates. Nothing where
    /// there is none that could be lengthened.
    pub nominal: Option<Exact>,
    /// The longest that its designer allows; the nominal one where nothing is said.
    pub longest: Option<Exact>,
    /// How readily its period gives way, relative to others; 0 for not at all.
    pub elasticity: f64,
    /// 0..1. Who is more important gives way less, and loses method, budget and life later.
    pub importance: f64,
    /// What it can do instead, the best first. None for one way only, whose cost is the system's.
    pub methods: Vec<Way>,
    /// How much time for improving its answer it can do with.
    pub anytime: Option<Anytime>,
    /// Whether it may be put to sleep.
    pub may_suspend: bool,
    /// What a decision wants of it.
    pub orders: Orders,
}

/// One of several methods for the same thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// Processor time of a step at worst, in nanoseconds; with the whole budget where it is an anytime one.
    pub cost: Exact,
    /// How good the outcome is, in 0..1.
    pub quality: f64,
}

/// An agent whose answer is good after the mandatory part and gets better with time. Times in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anytime {
    /// The mandatory part.
    pub least: Exact,
    /// What it is given where there is time enough. The cost of a step holds for this; with less it is as much less.
    pub most: Exact,
}

/// What a decision wants of an agent; within this it is managed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orders {
    /// Its share of the nominal rate, in 0..=1; never less than its longest period allows.
    pub rate: f64,
    /// Whether it runs at all.
    pub active: bool,
    /// The best method that it may use, by its place.
    pub method: usize,
}

impl Default for Orders {
    /// Everything, as its designer wishes it.
    fn default() -> Orders {
        Orders { rate: 1.0, active: true, method: 0 }
    }
}

impl Managed {
    /// One that is never touched.
    pub fn rigid() -> Managed {
        Managed {
            rigid: true,
            nominal: None,
            longest: None,
            elasticity: 0.0,
            importance: 1.0,
            methods: Vec::new(),
            anytime: None,
            may_suspend: false,
            orders: Orders::default(),
        }
    }
}

/// How an agent is to run. Times in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Its period; for one that only messages make run the least gap between two steps. Nothing where it has none that could be lengthened.
    pub period: Option<Exact>,
    /// The place of its method.
    pub method: usize,
    /// What it may spend on its answer; nothing where it is not an anytime agent.
    pub budget: Option<Exact>,
    /// Whether it runs at all.
    pub active: bool,
}

/// The last kind of concession that was needed, by those who can be helped.
///
/// It is what grows with the load: as long as nobody is beyond help, no load that is greater in each cost is met by an earlier stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// All run as ordered.
    Nothing,
    /// Periods were lengthened.
    Periods,
    /// Methods became cheaper.
    Methods,
    /// Budgets were cut.
    Budgets,
    /// Some were suspended.
    Lives,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// How each of the managed agents is to run.
    pub settings: Vec<Setting>,
    /// Whether with that all of them meet their deadlines.
    pub feasible: bool,
    /// The last kind of concession that was needed.
    pub stage: Stage,
    /// Who would still miss: those whom no concession helps.
    pub missing: Vec<usize>,
    /// How many times the system was analysed for it.
    pub tests: usize,
}

/// How the managed agents have to run so that all of them that run in real time meet their deadlines, with as little given away as needed.
///
/// `system` has nominal timings and present costs. `managed` stands in the order of its agents; agents behind the managed ones are load that
/// others bring: they keep waiting whom they will, they are not changed, and nobody answers for their deadlines.
///
/// # Errors
/// As [`System::analyse`].
pub fn manage(system: &System, managed: &[Managed]) -> Result<Found, Unsound> {
    let search = Search::new(system, managed);
    let rooms: Vec<Room> = search.managed().iter().map(Room::of).collect();
    let ordered: Vec<Setting> = rooms.iter().map(Room::most).collect();
    if search.fits(&ordered)? {
        return Ok(search.found(ordered, Stage::Nothing, Vec::new()));
    }
    let least: Vec<Setting> = rooms.iter().map(Room::least).collect();
    let missing = search.late(&least)?;
    let search = search.without(&missing);
    let mut rooms = rooms;
    missing.iter().for_each(|at| rooms[*at] = rooms[*at].at_least());
    let settings: Vec<Setting> = rooms.iter().map(Room::most).collect();
    let late = search.late(&settings)?;
    if late.is_empty() {
        return Ok(search.found(settings, Stage::Nothing, missing));
    }
    let (settings, stage) = search.with_help(&rooms, &late)?;
    Ok(search.found(settings, stage, missing))
}
