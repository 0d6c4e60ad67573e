//! The command line.
//!
//! Exit code 0: done; 2: bad input, one message, nothing written; 1: the system failed (a disk, for instance).

mod explain;
mod failure;
mod limbs;
mod list;
mod plan;
mod progress;
mod run;
mod solve;

pub use failure::Failure;

use crate::limbs::{LIMBS_FILE, read_limbs, replace_readme_limbs};
use crate::records_io::{ROWS_FILE, RecordError, read_rows};
use crate::suite::Variation;
use crate::trajectory::Rates;
use crate::{figures, summary};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Compares formulations of inverse kinematics. Without a command: every suite at full length, with figures and summary.
#[derive(Debug, Parser)]
#[command(name = "ik-bench", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    everything: Everything,
}

/// The shoot-out.
#[derive(Debug, Args)]
struct Everything {
    /// Folder of rows, traces, figures and summary. Rows of the same clean revision are kept and their runs not repeated;
    /// in results/local anything else starts over
    #[arg(long, default_value = DEFAULT_FOLDER)]
    out: PathBuf,
    #[command(flatten)]
    effort: EffortArgs,
}

/// Where the shoot-out goes unless told otherwise.
const DEFAULT_FOLDER: &str = "results/local";

/// How much work to put in.
#[derive(Clone, Copy, Debug, Args)]
struct EffortArgs {
    /// Fewer scenarios and fewer repeats of the timing, never shorter motions
    #[arg(long)]
    quick: bool,
    /// Start over: delete the rows, traces, figures and summary in the output folder first
    #[arg(long)]
    fresh: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show what there is
    List {
        /// What to show
        #[arg(value_enum)]
        what: Listed,
    },
    /// Run suites and print their table
    Run(RunArgs),
    /// Show how a method sees a problem: the graph and the network matrix of davies, the limbs with a closed form
    Explain(ExplainArgs),
    /// Solve the control step or the limb's pose in a file and print the answer as JSON
    Solve(SolveArgs),
    /// Draw the figures of a results folder
    Figures {
        /// Results folder
        dir: PathBuf,
    },
    /// Write the table of a results folder into a README, between its markers
    Readme {
        /// Results folder
        dir: PathBuf,
        /// File with the markers
        readme: PathBuf,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Listed {
    /// Methods and their parameters
    Methods,
    /// Suites and their scenarios
    Suites,
    /// Embedded robots
    Robots,
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Suites: ids (see `list suites`) or paths of .toml files
    #[arg(required = true, value_name = "SUITE")]
    suites: Vec<String>,
    /// Methods to run; may be repeated. Without it, those the suite names
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',')]
    methods: Vec<String>,
    /// Parameter for the methods that have it, e.g. gamma=3, rows=literal or n=[15,3]; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Time step in s, instead of the suite's
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    dt: Option<f64>,
    /// Speed limit of every joint in rad/s or m/s, instead of the robot's
    #[arg(long, value_name = "RAD_PER_S", allow_negative_numbers = true)]
    velocity: Option<f64>,
    /// Safety margin of the ellipse in rad or m, instead of the suite's
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    margin: Option<f64>,
    /// Where target rates come from: analytic, difference or zero
    #[arg(long, value_name = "RATES", value_parser = rates)]
    rates: Option<Rates>,
    /// Folder for rows (and traces); without it nothing is written
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write a trace of every run
    #[arg(long, requires = "out")]
    trace: bool,
    /// Write control step K of every run as an instance for `solve`
    #[arg(long, value_name = "K", requires = "out")]
    dump_step: Option<usize>,
    #[command(flatten)]
    effort: EffortArgs,
}

impl RunArgs {
    fn variation(&self) -> Variation {
        Variation {
            dt_s: self.dt,
            velocity: self.velocity,
            margin: self.margin,
            rates: self.rates,
        }
    }
}

#[derive(Debug, Args)]
struct SolveArgs {
    /// Instance (JSON), as `run --dump-step` writes it, or the pose of a limb (JSON) for its closed form
    instance: PathBuf,
    /// Method to use instead of the instance's
    #[arg(long, value_name = "METHOD")]
    method: Option<String>,
    /// Parameter of the method; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// All solutions of a limb's pose, not the nearest alone (of those within limits if there is one)
    #[arg(long, conflicts_with_all = ["method", "set"])]
    all_solutions: bool,
}

#[derive(Debug, Args)]
struct ExplainArgs {
    /// davies, davies-open or reverse-decoupling (also: closed-form)
    method: String,
    /// Embedded robot, for davies that of the first suite that has it; for reverse-decoupling also the path of a .urdf file,
    /// whose root is taken as fixed
    #[arg(
        long,
        value_name = "ROBOT",
        required_unless_present = "suite",
        conflicts_with = "suite"
    )]
    robot: Option<String>,
    /// Suite whose problem is explained: an id or the path of a .toml file
    #[arg(long, value_name = "SUITE")]
    suite: Option<String>,
    /// Draw the graph of davies into this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

fn rates(word: &str) -> Result<Rates, String> {
    let found = Rates::WORDS.iter().find(|(known, _)| *known == word);
    found
        .map(|(_, rates)| *rates)
        .ok_or_else(|| "allowed: analytic, difference, zero".to_owned())
}

/// Reads the command line, does what it says, and tells how it went.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut out = std::io::stdout().lock();
    let done = dispatch(&cli, &mut out).and_then(|()| out.flush().map_err(Failure::from));
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) if failure.is_closed_pipe() => ExitCode::SUCCESS,
        Err(failure) => {
            // If the message cannot be written either, the exit code is all that is left.
            let _ = writeln!(std::io::stderr(), "error: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

fn dispatch(cli: &Cli, out: &mut dyn Write) -> Result<(), Failure> {
    match &cli.command {
        None => run::everything(&cli.everything, out),
        Some(Command::List { what }) => list::list(*what, out).map_err(Failure::from),
        Some(Command::Run(args)) => run::run(args, out),
        Some(Command::Explain(args)) => explain::explain(args, out),
        Some(Command::Solve(args)) => solve::solve(args, out),
        Some(Command::Figures { dir }) => draw(dir, out),
        Some(Command::Readme { dir, readme }) => {
            let limbs = read_limbs(&dir.join(LIMBS_FILE))?;
            // A folder of limb suites alone has no runs.
            if limbs.is_empty() || dir.join(ROWS_FILE).exists() {
                let rows = rows_of(dir)?;
                summary::replace_readme_table(readme, &rows)?;
                writeln!(out, "{}: table of {} rows", readme.display(), rows.len())?;
            }
            if !limbs.is_empty() {
                replace_readme_limbs(readme, &limbs)?;
                writeln!(out, "{}: table of {} limb rows", readme.display(), limbs.len())?;
            }
            Ok(())
        }
    }
}

fn rows_of(dir: &Path) -> Result<Vec<crate::records::Row>, RecordError> {
    Ok(read_rows(&dir.join(ROWS_FILE))?.rows)
}

fn draw(dir: &Path, out: &mut dyn Write) -> Result<(), Failure> {
    let drawn = figures::draw_all(dir, &figures::DrawnLimits::COMAN)?;
    for note in &drawn.notes {
        writeln!(out, "note: {note}")?;
    }
    Ok(writeln!(
        out,
        "{} figures in {}",
        drawn.files.len(),
        dir.join("figures").display()
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn rates_by_word() {
        assert_eq!(rates("difference"), Ok(Rates::Difference));
        assert!(rates("exact").unwrap_err().contains("analytic"));
        assert!(Rates::WORDS.iter().all(|(word, rates)| rates.word() == *word));
    }
}
