//! Where the robot is: counting wheels, set right by what it sees of landmarks, of other robots and of walls.
//!
//! In plain words: wheels tell each small step well, but their errors add up; a landmark or a wall whose place is known tells little at a
//! time, but its errors do not. A filter weighs the two by how much each is to be trusted, and learns meanwhile by how much the wheels are
//! wrong. Who does not know at all where it is scatters guesses over the map and keeps those that agree with what it measures.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`floor`] | what the wheels say, and scans | where the robot is on a known floor, or that it is not known |
//! | [`landmarks`] | what the wheels say, and sightings of landmarks and other robots | where it is, was and will be |
//!
//! A gyro comes in before: [`motion::heading`] fuses it with the wheels, learns its bias, and what it gives is a step of the wheels.

pub mod floor;
pub mod landmarks;

/// What is known of where the robot is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Not known, and nothing is seen by which it could be found.
    Lost,
    /// Not known; it is searched for.
    #[default]
    Searching,
    /// Known.
    Tracking,
}
