//! Time that is left, shared among those whose answers get better with it.

use crate::Exact;
use crate::manage::room::Room;
use crate::manage::search::Search;
use crate::manage::{Managed, Setting};
use crate::system::{System, Unsound};

/// The budgets of the anytime agents, each in its place, when everything else is as it is set, and as ordered where nothing is set: bᵢ = leastᵢ + (mostᵢ - leastᵢ) min(1, s wᵢ) with the
/// importance wᵢ and the largest common share s, to a 4096th, for which all managed agents in real time meet their deadlines. Nothing where
/// even mandatory parts are too much. In nanoseconds, rounded down.
///
/// # Errors
/// As [`System::analyse`].
pub fn budgets(
    system: &System,
    managed: &[Managed],
    settings: &[Setting],
) -> Result<Option<Vec<Option<Exact>>>, Unsound> {
    let search = Search::new(system, managed);
    let rooms: Vec<Room> = search.managed().iter().map(Room::of).collect();
    let given = settings.iter().copied().map(Some).chain(std::iter::repeat(None));
    let settings: Vec<Setting> = rooms
        .iter()
        .zip(given)
        .map(|(room, given)| Setting { budget: room.least().budget, ..given.unwrap_or(room.most()) })
        .collect();
    if !search.fits(&settings)? {
        return Ok(None);
    }
    let granted = search.granted(&rooms, settings)?;
    Ok(Some(granted.into_iter().map(|setting| setting.budget).collect()))
}
