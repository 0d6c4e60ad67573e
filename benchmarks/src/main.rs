//! The `ik-bench` command.

fn main() {}
