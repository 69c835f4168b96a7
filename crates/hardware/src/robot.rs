//! The agent that has the ports of a robot: the way from other agents to the gate.
//!
//! ```text
//!              ┌────────────── Robot ──────────────┐
//!   drive    ─▶│                                   │─▶ sonar scan image ticks bumper gyro battery head
//!   head_to  ─▶│  commands ─▶ Gate ◀─▶ Driver      │─▶ landmarks   (seen, or heard by infrared)
//!              │                                   │─▶ pose        (a recording's own, in the frame "log")
//!   safety   ─▶│                                   │─▶ latch, transforms  (where the sensors sit)
//!              └───────────────────────────────────┘
//! ```

use std::sync::{Arc, Mutex};

use runtime::{Agent, AgentType, Envelope, Fault, Input, Output, Step};
use types::messages::{
    Battery, Bumper, Echoes, Gyro, Head, Image, Landmarks, LaserScan, Latch, Odometry, Safety, Transforms,
    Twist, WheelTicks,
};
use types::params::Params;
use types::{Duration, Time};

use crate::driver::{FillImage, FillScan, Listening, Sink};
use crate::gate::{Event, Gate};
use crate::guard::{Authority, Policy};
use crate::latch::{Cause, LatchState};

/// How often the mounts are told.
const MOUNTS_EVERY: Duration = Duration::secs(1);
/// Whoever listens to the latch hears so often that nothing has changed.
const LATCH_EVERY: Duration = Duration::millis(100);
/// The period of a gate: a controller at 50 Hz waits half of its own period for it at most, and physics steps as often.
pub const CYCLE: Duration = Duration::millis(10);

/// What can be set of a robot's gate.
#[derive(Clone, Debug, Params)]
pub struct RobotParams {
    /// A command older than this is zero: three periods of a slow controller, 0.2 m at a walking pace.
    #[param(default = Duration::millis(300), min = 0.01, max = 10.0)]
    pub age_limit: Duration,
    /// No faster than this forward or backward (m/s). More than an indoor robot does: its own limit counts where it is lower.
    #[param(default = 10.0, min = 0.0, max = 10.0)]
    pub linear_max: f64,
    /// No faster turns than this (rad/s). More than an indoor robot does: its own limit counts where it is lower.
    #[param(default = 20.0, min = 0.0, max = 20.0)]
    pub angular_max: f64,
    /// Whether a press of the bumper sets the latch. Without it a press only stops the wheels and bars the way to its side.
    #[param(default = true)]
    pub bumper_latches: bool,
    /// A verdict of the safety monitor older than this forbids to move forward (time). 700 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(700), min = 0.01, max = 60.0)]
    pub safety_age: Duration,
    /// How fast the speed falls to what the safety monitor allows (m/s²). 1 does not tip a tall body; safety counts on it.
    #[param(default = 1.0, min = 0.01, max = 20.0)]
    pub braking: f64,
}

/// The place where a gate waits for its agent, and where it comes back to when the agent ends. Clones are the same place.
#[derive(Clone, Default)]
pub struct Berth {
    place: Arc<Mutex<Option<Gate>>>,
    /// Bytes of a picture of this robot, known also while the gate is with an agent.
    picture: usize,
}

impl Berth {
    /// A place with a gate in it.
    pub fn with(gate: Gate) -> Berth {
        let picture = gate.description().picture;
        Berth { place: Arc::new(Mutex::new(Some(gate))), picture }
    }

    /// The agent type of the robot behind this gate, under the name `kind` in plans.
    pub fn agent_type(&self, kind: &'static str) -> AgentType {
        let berth = self.clone();
        AgentType::made_by(move |params| Robot::at(berth.clone(), params)).named(kind)
    }

    /// Whether the gate is here, and not with an agent.
    pub fn is_taken(&self) -> bool {
        self.place.try_lock().is_ok_and(|gate| gate.is_some())
    }

    /// The gate, if it is here. Nobody is waited for.
    fn take(&self) -> Option<Gate> {
        self.place.try_lock().ok()?.take()
    }

    fn put(&self, gate: Gate) {
        if let Ok(mut place) = self.place.lock() {
            *place = Some(gate);
        }
    }
}

/// A robot's sensors as outputs and its actuators as inputs, with the gate in between.
///
/// It runs every 10 ms, and at once when a command comes. Urgent commands are those of a referee or an emergency, those of high
/// priority a person's, all others the robot's own; the higher one is followed while it is fresh. A safety monitor that is wired to it
/// can slow and stop what anybody commands: it stands behind the drive, too.
#[derive(Agent)]
#[agent(kind = "robot")]
pub struct Robot {
    params: RobotParams,
    /// Firings of the sonar ring.
    #[port(raw)]
    sonar: Output<Echoes>,
    /// Scans of the laser.
    #[port(rows = 4096, raw)]
    scan: Output<LaserScan>,
    /// Pictures of the camera. There is room for those that the robot's own camera takes.
    #[port(rows = self.berth.picture, raw)]
    image: Output<Image>,
    /// Counts of the wheels.
    #[port(raw)]
    ticks: Output<WheelTicks>,
    /// What touches the robot.
    #[port(raw)]
    bumper: Output<Bumper>,
    /// The turn rate.
    #[port(raw)]
    gyro: Output<Gyro>,
    /// The battery.
    #[port(raw)]
    battery: Output<Battery>,
    /// Where the head looks.
    #[port(raw)]
    head: Output<Head>,
    /// The poses that came with a recording, in the frame "log"; other robots have none.
    #[port(interpreted)]
    pose: Output<Odometry>,
    /// What is seen or heard of landmarks.
    #[port(raw)]
    landmarks: Output<Landmarks>,
    /// Whether it is latched: when that changes, and ten times a second.
    latch: Output<Latch>,
    /// Where the sensors sit.
    #[port(rows = 64)]
    transforms: Output<Transforms>,
    /// How to drive.
    #[port(single)]
    drive: Input<Twist>,
    /// Where to turn the head.
    #[port(single)]
    head_to: Input<Head>,
    /// How fast is safe, past all who command. Once wired, its silence forbids to move forward.
    safety: Input<Safety>,
    berth: Berth,
    gate: Option<Gate>,
    next_mounts: Time,
    latched: Option<(Latch, Time)>,
}

impl Robot {
    /// A robot whose gate waits at `berth`.
    fn at(berth: Berth, params: RobotParams) -> Robot {
        let mut robot = <Robot as runtime::Declare>::build(params);
        robot.berth = berth;
        robot
    }

    /// Takes the gate when it is there. Where the agent before this one has not yet been put away, that is a little later.
    fn take_gate(&mut self) -> Result<bool, Fault> {
        if self.gate.is_none() {
            self.gate = self.berth.take();
            if let Some(gate) = &self.gate {
                self.check(gate)?;
            }
        }
        Ok(self.gate.is_some())
    }

    /// Whether the rows of the ports hold what the robot's sensors give.
    fn check(&self, gate: &Gate) -> Result<(), Fault> {
        let robot = gate.description();
        if self.scan.has_listeners() && robot.beams > self.scan.row_capacity() {
            return Err(Fault::new("a scan of this laser has more beams than the port has room for"));
        }
        if self.image.has_listeners() && robot.picture > self.image.row_capacity() {
            return Err(Fault::new("a picture of this camera has more bytes than the port has room for"));
        }
        if robot.mounts.len() > self.transforms.row_capacity() {
            return Err(Fault::new("this robot has more sensors than the port of the mounts has room for"));
        }
        Ok(())
    }

    fn listening(&self) -> Listening {
        Listening {
            sonar: self.sonar.has_listeners(),
            scan: self.scan.has_listeners(),
            image: self.image.has_listeners(),
            ticks: self.ticks.has_listeners(),
            bumper: self.bumper.has_listeners(),
            gyro: self.gyro.has_listeners(),
            battery: self.battery.has_listeners(),
            head: self.head.has_listeners(),
            pose: self.pose.has_listeners(),
            landmarks: self.landmarks.has_listeners(),
        }
    }

    fn policy(&self) -> Policy {
        let RobotParams { age_limit, linear_max, angular_max, safety_age, braking, .. } = self.params;
        Policy { age_limit, linear_max, angular_max, guarded: self.safety.is_wired(), safety_age, braking }
    }
}

impl Agent for Robot {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.take_gate().map(|_| ())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if !self.take_gate()? {
            return Ok(());
        }
        let wanted = self.listening();
        let policy = self.policy();
        let now = step.now;
        let Robot { gate, params, sonar, scan, image, ticks, bumper, gyro, battery, head, .. } = self;
        let (pose, landmarks) = (&mut self.pose, &mut self.landmarks);
        let Some(gate) = gate else { return Ok(()) };
        gate.set_policy(policy, params.bumper_latches);
        let mut outputs = Outputs { sonar, scan, image, ticks, bumper, gyro, battery, head, pose, landmarks };
        let polled = gate.poll(now, &wanted, &mut outputs).map_err(|error| Fault { what: error.what })?;
        if let Some(next) = polled.next {
            step.wake_at(next);
        }
        if let Some(verdict) = self.safety.newest() {
            gate.allow(now, verdict.header().stamp, if verdict.blind { 0.0 } else { verdict.linear_max });
        }
        while let Some(command) = self.drive.take() {
            let header = command.header();
            gate.command(now, Authority::of(header.priority), header.stamp, *command);
        }
        while let Some(command) = self.head_to.take() {
            let stamp = command.header().stamp;
            gate.command_head(now, stamp, *command).map_err(|error| Fault { what: error.what })?;
        }
        let cycle = gate.apply(now).map_err(|error| Fault { what: error.what })?;
        if let Some(event) = cycle.event {
            note(event, gate);
        }
        if self.latch.has_listeners() {
            let state = gate.latch().state();
            let latch = Latch { is_set: state.is_set(), resets: state.resets() };
            if self.latched.is_none_or(|(told, at)| told != latch || now - at >= LATCH_EVERY) {
                self.latched = Some((latch, now));
                self.latch.send(latch);
            }
        }
        if now >= self.next_mounts && self.transforms.has_listeners() {
            self.next_mounts = now + MOUNTS_EVERY;
            let mounts = &gate.description().mounts;
            self.transforms.send_with(|_, edges| {
                edges[..mounts.len()].copy_from_slice(mounts);
                mounts.len()
            });
        }
        Ok(())
    }
}

impl Drop for Robot {
    /// The gate goes back to its place, where the next agent finds it. Meanwhile the robot's own watchdog stops the wheels.
    fn drop(&mut self) {
        if let Some(gate) = self.gate.take() {
            self.berth.put(gate);
        }
    }
}

fn note(event: Event, gate: &Gate) {
    match event {
        Event::LatchSet => note_set(gate.latch().state()),
        Event::LatchCleared => {
            runtime::note!("the latch is reset ({} times so far)", gate.latch().state().resets())
        }
        Event::Stale => runtime::note!(
            "no new command came in time: standing ({} times so far)",
            gate.counts().stale.get()
        ),
        Event::Slowed => {
            runtime::note!(
                "a command is faster than the safety monitor allows: slowed ({} cycles so far)",
                gate.counts().slowed.get()
            );
        }
        Event::Clamped(_) => {
            runtime::note!(
                "a command is beyond the limits and is cut ({} cycles so far)",
                gate.counts().clamped.get()
            );
        }
    }
}

/// A note is a static text, so each cause has its own.
fn note_set(state: LatchState) {
    for cause in state.causes() {
        match cause {
            Cause::Bumper => runtime::note!("the latch is set: the bumper was pressed"),
            Cause::Safety => runtime::note!("the latch is set by the safety monitor"),
            Cause::Person => runtime::note!("the latch is set by a person"),
            Cause::Referee => runtime::note!("the latch is set by the referee"),
            Cause::Signal => runtime::note!("the latch is set: the process was told to end"),
            Cause::Watchdog => runtime::note!("the latch is set: a step did not come back"),
            Cause::Supervisor => runtime::note!("the latch is set: the supervisor gave up an agent"),
            Cause::Hardware => runtime::note!("the latch is set: the hardware failed"),
            Cause::Nonsense => runtime::note!("the latch is set: commands again and again were no numbers"),
            Cause::Heedless => runtime::note!("the latch is set: commands went on to be faster than is safe"),
        }
    }
}

/// The outputs of a robot as the place where its driver puts readings.
struct Outputs<'a> {
    sonar: &'a mut Output<Echoes>,
    scan: &'a mut Output<LaserScan>,
    image: &'a mut Output<Image>,
    ticks: &'a mut Output<WheelTicks>,
    bumper: &'a mut Output<Bumper>,
    gyro: &'a mut Output<Gyro>,
    battery: &'a mut Output<Battery>,
    head: &'a mut Output<Head>,
    pose: &'a mut Output<Odometry>,
    landmarks: &'a mut Output<Landmarks>,
}

/// Every reading carries the time at which it was true.
fn at(stamp: Time) -> Envelope {
    Envelope { stamp: Some(stamp), ..Envelope::default() }
}

impl Sink for Outputs<'_> {
    fn sonar(&mut self, stamp: Time, echoes: &Echoes) {
        self.sonar.send_as(at(stamp), *echoes);
    }
    fn scan(&mut self, stamp: Time, fill: FillScan<'_>) {
        self.scan.fill_as(at(stamp), fill);
    }
    fn image(&mut self, stamp: Time, fill: FillImage<'_>) {
        self.image.fill_as(at(stamp), fill);
    }
    fn ticks(&mut self, stamp: Time, ticks: &WheelTicks) {
        self.ticks.send_as(at(stamp), *ticks);
    }
    fn bumper(&mut self, stamp: Time, bumper: &Bumper) {
        self.bumper.send_as(at(stamp), *bumper);
    }
    fn gyro(&mut self, stamp: Time, gyro: &Gyro) {
        self.gyro.send_as(at(stamp), *gyro);
    }
    fn battery(&mut self, stamp: Time, battery: &Battery) {
        self.battery.send_as(at(stamp), *battery);
    }
    fn head(&mut self, stamp: Time, head: &Head) {
        self.head.send_as(at(stamp), *head);
    }
    fn pose(&mut self, stamp: Time, pose: &Odometry) {
        self.pose.send_as(at(stamp), *pose);
    }
    fn landmarks(&mut self, stamp: Time, landmarks: &Landmarks) {
        self.landmarks.send_as(at(stamp), *landmarks);
    }
}
