//! The table of modes of a process supervisor: whoever is named in it must be there.

use agents::ProcessSupervisor;
use agents::process_supervisor::ModeTable;
use runtime::Declare as _;

use super::read::Reader;

/// Its parameter.
const PARAM: &str = "modes";

pub(super) fn read(reader: &mut Reader<'_>) {
    let supervisors = reader.plan.agents.iter().filter(|agent| agent.kind == ProcessSupervisor::KIND);
    let tables = supervisors.filter_map(|agent| agent.params.get(PARAM)?.value.as_table());
    let named = tables.flat_map(ModeTable::agents).map(|row| (row.key.clone(), row.key_at));
    let unknown: Vec<_> = named.filter(|(name, _)| reader.plan.agent(name).is_none()).collect();
    for (name, at) in unknown {
        let mistake = reader.no_agent(&name, at);
        reader.mistakes.push(mistake);
    }
}
