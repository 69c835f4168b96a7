//! Figures for papers and reports: white ground, units on every axis, colours that the colour-blind can tell apart.
//!
//! Each kind of figure is a plain struct to be filled from a log, with a `draw` that makes a [`Picture`]; the picture is
//! written as PNG or SVG. Times are seconds since the
//! start of the run, everything else is SI. The same data gives the same bytes.

mod axes;
mod bands;
mod canvas;
mod font;
mod key;
mod map;
mod periods;
mod plane;
mod potential;
mod raster;
mod sheet;
mod svg;
mod timing;
mod trajectory;
mod velocity;

pub use bands::{BandRow, Bands, RateBand, Span};
pub use canvas::{Colour, Picture};
pub use map::Map;
pub use periods::{PeriodRow, Periods};
pub use plane::{Drawing, Region};
pub use potential::{Potential, PotentialPanel};
pub use raster::RasterError;
pub use sheet::{Panel, Sheet};
pub use timing::{AgentTiming, Timing};
pub use trajectory::{Trajectory, Waypoint};
pub use velocity::{Series, Velocity};

/// A span of time in which one agent had the say.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Its start (s).
    pub from: f64,
    /// Its end (s).
    pub to: f64,
    /// The agent.
    pub agent: String,
}

/// Something that happened; drawn as a number, explained below the figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When (s).
    pub time: f64,
    /// What.
    pub text: String,
}

/// The agents of the bands in the order in which they first had the say.
fn agents(bands: &[Band]) -> Vec<&str> {
    let mut agents: Vec<&str> = Vec::new();
    for band in bands {
        if !agents.contains(&band.agent.as_str()) {
            agents.push(&band.agent);
        }
    }
    agents
}

/// The place of the agent that had the say at a time in the list of [`agents`].
fn active(bands: &[Band], agents: &[&str], time: f64) -> Option<usize> {
    let band = bands.iter().rev().find(|band| band.from <= time && time < band.to)?;
    agents.iter().position(|agent| *agent == band.agent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::{Point, Pose};

    /// Width and height that a PNG file says it has: bytes 16 to 23 of it, highest byte first (PNG 1.2, 11.2.2).
    fn dots(png: &[u8]) -> (u32, u32) {
        let number = |at: usize| u32::from_be_bytes([png[at], png[at + 1], png[at + 2], png[at + 3]]);
        (number(16), number(20))
    }

    fn awkward() -> Vec<Picture> {
        let broken = [(0.0, f64::NAN), (f64::INFINITY, 1.0), (1.0, 2.0)].to_vec();
        let series = vec![Series { name: "a".into(), points: broken }];
        let nowhere = Pose { x: f64::NAN, y: 0.0, heading: f64::INFINITY };
        let event = Event { time: f64::NAN, text: "<&>".into() };
        let path =
            vec![Waypoint { time: f64::NAN, pose: nowhere }, Waypoint { time: 1.0, pose: Pose::default() }];
        let agent = AgentTiming {
            name: "a".into(),
            execution: vec![(0.0, 1), (f64::NAN, 2), (-1.0, 3), (1.0, 0)],
            jitter: vec![(0.0, 1)],
            execution_max: Some(f64::INFINITY),
            jitter_max: Some(0.0),
            ..AgentTiming::default()
        };
        let row = PeriodRow { releases: vec![f64::NAN, 1.0], ..PeriodRow::default() };
        let rates = BandRow {
            rate: vec![(f64::NAN, 1.0), (0.0, f64::INFINITY), (1.0, 0.5)],
            misses: vec![f64::NAN],
            suspended: vec![(2.0, f64::INFINITY), (1.0, 0.0)],
            ..BandRow::default()
        };
        let spans = vec![Span { from: f64::NAN, to: 1.0, label: "<&>".into() }];
        vec![
            Trajectory::default().draw(),
            Trajectory { path, events: vec![event.clone()], ..Trajectory::default() }.draw(),
            Velocity::default().draw(),
            Velocity { speed: series.clone(), heading: series, events: vec![event], ..Velocity::default() }
                .draw(),
            Timing::default().draw(),
            Timing { agents: vec![agent] }.draw(),
            Periods::default().draw(),
            Periods { rows: vec![row], window: Some((2.0, 1.0)) }.draw(),
            Bands::default().draw(),
            Bands {
                bands: vec![RateBand { rows: vec![rates], ..RateBand::default() }],
                spans,
                window: Some((f64::NAN, 1.0)),
            }
            .draw(),
            Map::default().draw(),
            Map { points: vec![Point { x: f64::NAN, y: 0.0 }], ..Map::default() }.draw(),
            Potential::default().draw(),
            Potential {
                panels: vec![PotentialPanel {
                    columns: 1,
                    values: vec![f64::NAN, f64::INFINITY],
                    ..Default::default()
                }],
                unit: "<&>".into(),
            }
            .draw(),
        ]
    }

    #[test]
    fn nothing_to_draw_and_no_numbers_give_a_figure_all_the_same() {
        for (i, picture) in awkward().iter().enumerate() {
            let svg = picture.svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{i}: {svg}");
            let png = picture.png(72.0).unwrap();
            let (width, height) = picture.size();
            assert_eq!(dots(&png), (width.ceil() as u32, height.ceil() as u32), "{i}");
        }
    }

    #[test]
    fn the_same_data_gives_the_same_bytes() {
        for (a, b) in awkward().iter().zip(awkward()) {
            assert_eq!(a.svg(), b.svg());
            assert_eq!(a.png(100.0).unwrap(), b.png(100.0).unwrap());
        }
    }

    #[test]
    fn a_figure_without_dots_or_with_too_many_is_refused() {
        let picture = Map::default().draw();
        for dots_per_inch in [0.0, -1.0, f64::NAN, 1e9] {
            assert!(matches!(picture.png(dots_per_inch), Err(RasterError::Size { .. })), "{dots_per_inch}");
        }
    }

    #[test]
    fn the_path_has_the_colour_of_the_agent_that_had_the_say() {
        let band = |from, to, agent: &str| Band { from, to, agent: agent.into() };
        let bands = vec![band(0.0, 1.0, "wall"), band(1.0, 2.0, "track"), band(2.0, 3.0, "wall")];
        let names = agents(&bands);
        assert_eq!(names, ["wall", "track"]);
        assert_eq!(
            [0.5, 1.0, 2.5, 3.5].map(|time| active(&bands, &names, time)),
            [Some(0), Some(1), Some(0), None]
        );
        let waypoint = |i: u32| Waypoint {
            time: f64::from(i) * 0.5,
            pose: Pose { x: f64::from(i), y: 0.0, heading: 0.0 },
        };
        let figure = Trajectory {
            path: (0..6).map(waypoint).collect(),
            bands,
            outline_every: 0.0,
            ..Trajectory::default()
        };
        let svg = figure.draw().svg();
        // Blue, vermilion and green of Okabe and Ito: one line in the key each, and the stretches.
        let lines = |colour: &str| svg.matches(&format!("stroke=\"{colour}\"")).count();
        assert_eq!((lines("#0072b2"), lines("#d55e00"), lines("#009e73")), (1 + 2, 1 + 1, 0));
        assert!(svg.contains(">track</text>") && svg.contains(">x (m)</text>"));
    }

    #[test]
    fn a_crowd_is_one_line_of_the_key_and_a_few_have_one_each() {
        let with = |many: usize| {
            let way = vec![Point { x: 0.0, y: 0.0 }, Point { x: 1.0, y: 1.0 }];
            let others = (0..many).map(|i| (format!("walker {i}"), way.clone())).collect();
            Trajectory { others, ..Trajectory::default() }.draw().svg()
        };
        let (few, many) = (with(3), with(12));
        assert!(few.contains(">walker 2</text>") && !few.contains("others"));
        assert!(many.contains(">12 others</text>") && !many.contains("walker"));
    }
}
