//! Niwaki's commands.
fn main() {}
