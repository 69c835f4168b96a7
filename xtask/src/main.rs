//! Project chores. 
fn main() {}
