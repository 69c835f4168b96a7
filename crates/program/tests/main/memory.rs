//! The budget of memory of a process.

use runtime::{AgentPlan, Host, HostReading, Options, Plan, Simulation};
use types::Duration;
use types::value::Value;

use crate::registry;

/// A computer that tells these numbers of MB in use, one after another.
struct Told(std::vec::IntoIter<u64>);

impl Host for Told {
    fn read(&mut self) -> HostReading {
        HostReading { memory: self.0.next().unwrap_or(0) * 1_000_000, ..HostReading::default() }
    }
}

#[test]
fn each_time_that_a_process_exceeds_its_memory_is_told_once() {
    let mut manager =
        AgentPlan { name: "manager".into(), kind: "resource-manager".into(), ..Default::default() };
    manager.period = Some(Duration::millis(200));
    manager.params.set("memory", Value::from(4.0));
    let plan = Plan { agents: vec![manager], ..Plan::new("full") };
    let told = |limit: Option<u64>| {
        // The first look finds no census yet, and sends nothing.
        let host = Told(vec![0, 3, 4, 5, 6, 5, 4, 3, 7, 2].into_iter());
        let mut plan = plan.clone();
        if let Some(limit) = limit {
            plan.agents[0].params.set("memory", Value::from(limit as f64));
        }
        let options =
            Options { limit: Some(Duration::secs(2)), host: Some(Box::new(host)), ..Options::default() };
        let report = Simulation::new(&plan, &registry(), options).unwrap().run().unwrap();
        report.noted.iter().map(|noted| (noted.what.clone(), noted.count)).collect::<Vec<_>>()
    };
    let noted = told(None);
    assert_eq!(noted.len(), 1, "{noted:?}");
    assert!(noted[0].0.contains("MB of memory, and may use"), "{noted:?}");
    assert_eq!(noted[0].1, 2, "at 5 MB, and again at 7 MB after it was below");
    // Nobody is told of a budget that is kept, or that there is none.
    assert!(told(Some(7)).is_empty() && told(Some(0)).is_empty());
}
