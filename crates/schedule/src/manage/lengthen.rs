//! Longer periods, and nothing else, so that there is time for somebody.

use crate::manage::room::Room;
use crate::manage::search::Search;
use crate::manage::{Managed, Setting};
use crate::system::{System, Unsound};

/// The least lengthening of periods with which those of `must` that run in real time meet their deadlines: shared by elasticity over importance
/// among those whose giving way can help, up to their longest. Nothing where even the longest are not enough.
///
/// `system`, `managed` and the agents behind the managed ones are as for [`manage`](crate::manage::manage). Who is not in `must` may go on to be late.
///
/// # Errors
/// As [`System::analyse`].
pub fn lengthen(
    system: &System,
    managed: &[Managed],
    must: &[bool],
) -> Result<Option<Vec<Setting>>, Unsound> {
    let search = Search::new(system, managed).only(must);
    let rooms: Vec<Room> = search.managed().iter().map(|it| Room::of(it).of_period_alone()).collect();
    let settings: Vec<Setting> = rooms.iter().map(Room::most).collect();
    let late = search.late(&settings)?;
    if late.is_empty() {
        return Ok(Some(settings));
    }
    let (settings, _) = search.with_help(&rooms, &late)?;
    Ok(search.fits(&settings)?.then_some(settings))
}
