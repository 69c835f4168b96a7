//! A source, eight tasks that hand on and eight sinks, with the log on: the shape of copper's own example of this name.
//!
//! Its sinks drive pins of a board; these keep what they were told, as the example's do on a machine without pins.

use cu29::bincode::{Decode, Encode};
use cu29::prelude::*;
use serde::{Deserialize, Serialize};

use super::hop::each;
use super::log::{LogFolder, iterations_in};
use super::part::{Part, WARM_UP};
use super::{document, failed};
use crate::document::{Document, Figure};
use crate::machine::{means, now, settle};
use crate::settings::Settings;

/// `iteration`: mean over 1000 of them, as fast as they can be. `missing`: iterations that are not in the log.
pub(crate) const FIGURES: &[&str] = &["iteration", "iteration_each", "rate", "missing", "log_size"];

/// As those of the hop with its log.
pub(crate) const PACED_FIGURES: &[&str] =
    &["iteration_each", "rate", "thread", "process", "missing", "log_size"];

/// Iterations where nobody says how many, and how many make a mean.
const ITERATIONS: u64 = 100_000;
const BLOCK: u64 = 1000;
/// At a pace: iterations where nobody says how many, the time between them (ns), and in how many parts they are divided.
const PACED: u64 = 20_000;
const PERIOD: u64 = 100_000;
const PARTS: u64 = 10;
/// The room that the example reserves for its log (bytes).
const SLAB: usize = 1 << 30;

/// Whether a light is on.
#[derive(Clone, Copy, Debug, Default, Encode, Decode, Serialize, Deserialize, Reflect)]
struct Light {
    on: bool,
}

/// Turns the light on and off.
#[derive(Reflect)]
struct Head {
    on: bool,
}

impl Freezable for Head {}

impl CuSrcTask for Head {
    type Resources<'r> = ();
    type Output<'m> = output_msg!(Light);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Head { on: false })
    }

    fn process(&mut self, context: &CuContext, output: &mut Self::Output<'_>) -> CuResult<()> {
        self.on = !self.on;
        output.tov = Tov::Time(context.now());
        output.set_payload(Light { on: self.on });
        Ok(())
    }
}

/// Hands on what it is told.
#[derive(Reflect)]
struct Segment;

impl Freezable for Segment {}

impl CuTask for Segment {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Light);
    type Output<'m> = output_msg!(Light);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Segment)
    }

    fn process(
        &mut self,
        _: &CuContext,
        input: &Self::Input<'_>,
        output: &mut Self::Output<'_>,
    ) -> CuResult<()> {
        if let Some(light) = input.payload() {
            output.tov = input.tov;
            output.set_payload(*light);
        }
        Ok(())
    }
}

/// Does as it is told.
#[derive(Reflect)]
struct Foot {
    on: bool,
}

impl Freezable for Foot {}

impl CuSinkTask for Foot {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Light);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Foot { on: false })
    }

    fn process(&mut self, _: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        self.on = std::hint::black_box(input.payload().is_some_and(|light| light.on));
        Ok(())
    }
}

#[copper_runtime(config = "src/copper/caterpillar.ron")]
struct Caterpillar {}

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let folder = LogFolder::make()?;
    let granted = settle("caterpillar", settings, 0);
    let clock = RobotClock::default();
    let blocks = settings.iterations_or(ITERATIONS).div_ceil(BLOCK);
    let builder = Caterpillar::builder().with_clock(clock.clone()).with_log_path(folder.base(), Some(SLAB));
    let app = builder.and_then(|builder| builder.build()).map_err(failed)?;
    let mut app = app.start().map_err(failed)?;
    let mut result = Ok(());
    let mut iterate = || {
        if result.is_ok() {
            result = app.run_one_iteration();
        }
    };
    let begun = now();
    let iteration = means(blocks, BLOCK, &mut iterate);
    let rate = (blocks * BLOCK) as f64 * 1e9 / (now() - begun) as f64;
    let each = each(blocks * BLOCK, &clock, &mut iterate);
    result.map_err(failed)?;
    drop(app.stop().map_err(failed)?);
    let written = iterations_in::<default::CuStampedDataSet>(&folder.base())?;
    Ok(document(
        granted,
        vec![
            Figure::new("iteration", "ns", iteration),
            Figure::times("iteration_each", each),
            Figure::new("rate", "1/s", vec![rate]),
            Figure::new("missing", "1", vec![(2 * blocks * BLOCK).saturating_sub(written) as f64]),
            Figure::new("log_size", "B", vec![folder.size() as f64]),
        ],
    ))
}

/// Measures at a pace.
pub(crate) fn paced(settings: &Settings) -> Result<Document, String> {
    let folder = LogFolder::make()?;
    let granted = settle("caterpillar_paced", settings, 0);
    let period = settings.period.unwrap_or(PERIOD);
    let part = settings.iterations_or(PACED).div_ceil(PARTS);
    let builder =
        Caterpillar::builder().with_clock(RobotClock::default()).with_log_path(folder.base(), Some(SLAB));
    let app = builder.and_then(|builder| builder.build()).map_err(failed)?;
    let mut app = app.start().map_err(failed)?;
    let mut result = Ok(());
    let mut iterate = || {
        if result.is_ok() {
            result = app.run_one_iteration();
        }
    };
    (0..WARM_UP).for_each(|_| iterate());
    let parts: Vec<Part> = (0..PARTS).map(|_| Part::run(part, period, &mut iterate)).collect();
    result.map_err(failed)?;
    drop(app.stop().map_err(failed)?);
    let written = iterations_in::<default::CuStampedDataSet>(&folder.base())?;
    let missing = (WARM_UP + PARTS * part).saturating_sub(written);
    let means = |of: fn(&Part) -> f64| parts.iter().map(of).collect();
    Ok(document(
        granted,
        vec![
            Figure::new("rate", "1/s", means(|part| 1e9 / part.whole)),
            Figure::new("thread", "ns", means(|part| part.thread)),
            Figure::new("process", "ns", means(|part| part.process)),
            Figure::new("missing", "1", vec![missing as f64]),
            Figure::new("log_size", "B", vec![folder.size() as f64]),
            Figure::times("iteration_each", parts.into_iter().flat_map(|part| part.spans).collect()),
        ],
    ))
}
