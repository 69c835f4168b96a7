//! What can be measured.

use crate::document::Document;
use crate::settings::Settings;
use crate::{chain, channels, copper, futex, nanosleep, rings, spin};

/// One measurement.
pub(crate) struct Measurement {
    pub(crate) name: &'static str,
    pub(crate) what: &'static str,
    pub(crate) peer: &'static str,
    pub(crate) figures: &'static [&'static str],
    pub(crate) measure: fn(&Settings) -> Result<Document, String>,
}

/// All of them.
pub(crate) const ALL: &[Measurement] = &[
    Measurement {
        name: "hop",
        what: "64 bytes from a source over three tasks to a sink, one thread, without a log",
        peer: copper::PEER,
        figures: copper::HOP_FIGURES,
        measure: copper::hop,
    },
    Measurement {
        name: "hop_logged",
        what: "the same with its log on, 10 000 iterations a second",
        peer: copper::PEER,
        figures: copper::LOGGED_FIGURES,
        measure: copper::hop_logged,
    },
    Measurement {
        name: "caterpillar",
        what: "a source, eight tasks that hand on, and eight sinks, with its log on",
        peer: copper::PEER,
        figures: copper::CATERPILLAR_FIGURES,
        measure: copper::caterpillar,
    },
    Measurement {
        name: "caterpillar_paced",
        what: "the same at a pace, 10 000 iterations a second",
        peer: copper::PEER,
        figures: copper::CATERPILLAR_PACED_FIGURES,
        measure: copper::caterpillar_paced,
    },
    Measurement {
        name: "rtrb",
        what: "push and pop of 64 bytes in one thread, to one receiver and to 64",
        peer: rings::PEER,
        figures: rings::FIGURES,
        measure: rings::measure,
    },
    Measurement {
        name: "channels",
        what: "send and receive of 64 bytes in one thread",
        peer: channels::PEER,
        figures: channels::FIGURES,
        measure: channels::measure,
    },
    Measurement {
        name: "futex",
        what: "from a wake to the return of the wait, between two bare threads",
        peer: futex::PEER,
        figures: futex::FIGURES,
        measure: futex::measure,
    },
    Measurement {
        name: "chain",
        what: "three bare threads of falling priority that wake each other in a ring",
        peer: chain::PEER,
        figures: chain::FIGURES,
        measure: chain::measure,
    },
    #[cfg(feature = "iceoryx2")]
    Measurement {
        name: "iceoryx2",
        what: "64 bytes and 230 400, sent and received in one thread, and one way between two threads that poll",
        peer: crate::iceoryx2::PEER,
        figures: crate::iceoryx2::FIGURES,
        measure: crate::iceoryx2::measure,
    },
    Measurement {
        name: "nanosleep",
        what: "how late a bare thread is woken that sleeps until a time",
        peer: nanosleep::PEER,
        figures: nanosleep::FIGURES,
        measure: nanosleep::measure,
    },
    Measurement {
        name: "spin",
        what: "round trip over two atomics between two threads that poll",
        peer: spin::PEER,
        figures: spin::FIGURES,
        measure: spin::measure,
    },
];

/// The measurement of this name.
pub(crate) fn named(name: &str) -> Option<&'static Measurement> {
    ALL.iter().find(|one| one.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One after the other, since copper's sinks leave what they saw in one place.
    #[test]
    fn every_measurement_gives_the_figures_that_it_lists() {
        for one in ALL {
            let settings = Settings { iterations: Some(20), ..Settings::default() };
            let document = (one.measure)(&settings).unwrap().to_json(one.name, &settings);
            let mut given: Vec<&str> = Vec::new();
            for figure in document["figures"].as_array().unwrap() {
                let (name, max) = (figure["name"].as_str().unwrap(), figure["max"].as_f64().unwrap());
                match name {
                    "missing" => assert_eq!(max, 0.0, "{}", one.name),
                    // How many wakes come while the thread is late is the machine's affair.
                    "awake" => {}
                    _ => assert!(max > 0.0, "{}: {name}", one.name),
                }
                given.push(name);
            }
            let mut listed = one.figures.to_vec();
            (given.sort_unstable(), listed.sort_unstable());
            assert_eq!(given, listed, "{}", one.name);
        }
    }
}
