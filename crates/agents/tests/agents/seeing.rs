//! Those who recognise, plan and look out in a system: they see what is there by either method, plan up to the shortest way, and take no memory
//! in real time.

use core::sync::atomic::{AtomicU64, Ordering};

use agents::lookout::LookoutParams;
use agents::path_planner::PlannerParams;
use agents::recogniser::RecogniserParams;
use agents::{Lookout, PathPlanner, Recogniser};
use runtime::{Agent, Envelope, Fault, Input, Output, Plan, Simulation, Step, registry};
use types::Duration;
use types::geometry::TAU;
use types::header::Quality;
use types::messages::{Encoding, Image, Odometry, Path, Ranges, Sighting};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// A robot before a red disc, which drives along a wall.
#[derive(Agent)]
struct Body {
    /// What its camera takes.
    #[port(rows = 230_400, history = 4)]
    image: Output<Image>,
    /// What is around it.
    ranges: Output<Ranges>,
    /// Where it is.
    #[port(history = 16)]
    odometry: Output<Odometry>,
    steps: u32,
}

impl Agent for Body {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.steps += 1;
        let (n, envelope) =
            (f64::from(self.steps), Envelope { stamp: Some(step.now), ..Envelope::default() });
        let mut odometry = Odometry::default();
        odometry.pose.x = 0.02 * n;
        self.odometry.send_as(envelope, odometry);
        let mut ranges =
            Ranges { angle_step: TAU as f32 / 12.0, range_min: 0.15, range_max: 6.0, ..Ranges::default() };
        ranges.values = [6.0; 12].into_iter().collect();
        (ranges.values[2], ranges.values[3], ranges.values[4]) = (0.8, 0.7, 0.8);
        self.ranges.send_as(envelope, ranges);
        self.image.send_with(|image, pixels| {
            (image.width, image.height) = (WIDTH as u32, HEIGHT as u32);
            (image.encoding, image.field_of_view) = (Encoding::Rgb8, 1.0);
            for (i, pixel) in pixels.chunks_exact_mut(3).take(WIDTH * HEIGHT).enumerate() {
                let (x, y) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
                let red = (x - 3.0 * n).hypot(y - 100.0) < 15.0;
                pixel.copy_from_slice(if red { &[200, 25, 20] } else { &[120, 118, 116] });
            }
            WIDTH * HEIGHT * 3
        });
        Ok(())
    }
}

/// The least quality of a way that came (a thousandth of the shortest).
static LEAST: AtomicU64 = AtomicU64::new(1000);

/// Takes what comes, and finds fault with what cannot be.
#[derive(Agent)]
struct Witness {
    /// What was recognised.
    sighting: Input<Sighting>,
    /// Which way was found.
    path: Input<Path>,
    /// What is around, with who is seen.
    ranges: Input<Ranges>,
    seen: u32,
}

impl Agent for Witness {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(sighting) = self.sighting.take() {
            self.seen += u32::from(sighting.visible);
            if !sighting.visible || sighting.what.as_str() != "disc" {
                return Err(Fault::new("the disc was not seen"));
            }
            // Of all its pixels there are seven hundred, of a sixteenth forty.
            if (sighting.header().quality == Quality::FULL) != (sighting.confidence > 0.9) {
                return Err(Fault::new("the method is not the one that it says"));
            }
        }
        while let Some(path) = self.path.take() {
            if !path.found || path.length < 1.0 {
                return Err(Fault::new("no way was found"));
            }
            if (path.quality == 1.0) != (path.header().quality == Quality::FULL) {
                return Err(Fault::new("the message is not as good as the way in it"));
            }
            LEAST.fetch_min((1000.0 * path.quality) as u64, Ordering::Relaxed);
        }
        while let Some(ranges) = self.ranges.take() {
            // The disc is to the left of the middle at first, and nothing was heard there.
            if self.seen == 1 && ranges.values.iter().take(2).all(|range| *range == 6.0) {
                return Err(Fault::new("who is seen is not among the ranges"));
            }
        }
        Ok(())
    }
}

fn plan(method: &str, budget: Option<Duration>) -> Plan {
    let mut plan = Plan::new("allocations");
    let body = plan.add::<Body>("body", Default::default());
    let disc = RecogniserParams { what: "disc".into(), ..RecogniserParams::default() };
    let recogniser = plan.add::<Recogniser>("recogniser", disc);
    let goal = PlannerParams { goal_x: 0.5, goal_y: 2.0, ..PlannerParams::default() };
    let planner = plan.add::<PathPlanner>("planner", goal);
    let lookout = plan.add::<Lookout>("lookout", LookoutParams::default());
    let witness = plan.add::<Witness>("witness", Default::default());
    plan.wire(&body.image, &recogniser.rgb);
    plan.wire(&body.ranges, &planner.ranges);
    plan.wire(&body.odometry, &planner.odometry);
    plan.wire(&body.ranges, &lookout.heard);
    plan.wire(&recogniser.sighting, &lookout.sightings);
    plan.wire(&recogniser.sighting, &witness.sighting);
    plan.wire(&planner.path, &witness.path);
    plan.wire(&lookout.ranges, &witness.ranges);
    plan.every("body", Duration::millis(100));
    plan.on("recogniser", "rgb");
    plan.on("planner", "ranges");
    plan.on("lookout", "heard");
    plan.every("witness", Duration::millis(100));
    if let Some(recogniser) = plan.agent_mut("recogniser") {
        recogniser.method = Some(method.into());
    }
    if let Some(planner) = plan.agent_mut("planner") {
        (planner.budget, planner.refinement) = (budget, budget.map(|_| Duration::micros(100)));
    }
    for agent in ["body", "recogniser", "planner", "lookout", "witness"] {
        if let Some(plan) = plan.agent_mut(agent) {
            plan.executor = Some("reflex".into());
        }
    }
    plan
}

/// Runs for five seconds, in which nobody takes memory; gives the least quality of a way, in thousandths.
fn least_quality(method: &str, budget: Option<Duration>) -> u64 {
    LEAST.store(1000, Ordering::Relaxed);
    let options = runtime::Options { limit: Some(Duration::secs(5)), ..runtime::Options::default() };
    let types = registry![Body, Recogniser, PathPlanner, Lookout, Witness];
    let report = Simulation::new(&plan(method, budget), &types, options).unwrap().run().unwrap();
    assert!(report.incidents.is_empty(), "{method}: {:?}", report.incidents);
    assert!(report.view.allocations_watched, "by the allocator of this program");
    for agent in &report.view.agents {
        assert_eq!(agent.counts.releases, 51, "{method}: {}", agent.name);
        assert_eq!(agent.counts.allocations, 0, "{method}: {}", agent.name);
    }
    assert!(report.view.wires.iter().all(|wire| wire.sent == 51), "{:?}", report.view.wires);
    LEAST.load(Ordering::Relaxed)
}

#[test]
fn who_recognises_plans_and_looks_out_takes_no_memory_by_any_method_or_budget() {
    assert_eq!(least_quality("exact", Some(Duration::millis(50))), 1000, "every way is the shortest");
    let first = least_quality("rough", None);
    assert!(
        first < 1000,
        "without a budget it is the first that is found, around what was heard at the left"
    );
    let some = least_quality("rough", Some(Duration::micros(150)));
    assert!((first..=1000).contains(&some), "{first}, and {some} with one refinement");
}
