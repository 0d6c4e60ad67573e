//! The `ik-bench` command; everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    benchmarks::cli::main()
}
