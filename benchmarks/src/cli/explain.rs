//! How a method sees a problem.

use super::{ExplainArgs, Failure};
use crate::error::InputError;
use crate::figures::mechanism_svg;
use crate::records_io::write_atomically;
use crate::suite::{Case, RobotSpec, Suite, Variation, known_method};
use ik_core::driver::Driver;
use ik_core::problem::PhaseId;
use ik_methods::davies::{
    LinkKind, Mechanism, MechanismBlock, Network, OrientationRates, ReferencePoint, Role,
};
use std::io::{self, Write};

/// Methods that can be explained.
const EXPLAINED: [&str; 2] = ["davies", "davies-open"];
/// Width of a line on a terminal.
const WIDTH: usize = 100;

pub(super) fn explain(args: &ExplainArgs, out: &mut dyn Write) -> Result<(), Failure> {
    let entry = known_method(&args.method, "explain")?;
    if !EXPLAINED.contains(&entry.info().id) {
        return Err(InputError::value("explain", "method", &args.method, "davies or davies-open").into());
    }
    let suite = match (&args.suite, &args.robot) {
        (Some(name), _) => Suite::load(name)?,
        (None, Some(robot)) => suite_of(robot)?,
        (None, None) => unreachable!("one of them is required"),
    };
    let case = Case::new(&suite, 0, &Variation::default())?;
    writeln!(
        out,
        "{} on {}, robot {}, at the start of scenario {}",
        entry.info().name,
        suite.id,
        case.problem.robot().name(),
        case.scenario
    )?;
    let phases = case.problem.phases().iter().enumerate();
    for (phase, name) in phases.map(|(k, phase)| (PhaseId(k), &phase.name)) {
        let how = OrientationRates::Euler;
        let network = Network::new(&case.problem, phase, &case.q_start, ReferencePoint::Task, how);
        writeln!(out, "phase {name}")?;
        graph(&network.mechanism, out)?;
        matrix(&network, out)?;
        if let Some(file) = &args.svg {
            let title = format!("{}, phase {name}", suite.id);
            write_atomically(file, &mechanism_svg(&network.mechanism, &title)?)?;
            writeln!(out, "  graph     {}", file.display())?;
        }
    }
    let contestant = entry
        .build(&toml::Table::new())
        .map_err(|source| InputError::Parameter {
            place: "explain".to_owned(),
            source,
        })?;
    match Driver::new(&*contestant.formulation, &case.problem) {
        Ok(driver) => driver
            .notes()
            .iter()
            .try_for_each(|note| writeln!(out, "note: {note}"))?,
        Err(declined) => writeln!(out, "declined: {declined}")?,
    }
    Ok(())
}

/// The first embedded suite on a robot.
fn suite_of(robot: &str) -> Result<Suite, InputError> {
    let suites = Suite::load_embedded()?;
    let id = |suite: &Suite| match &suite.problem.robot {
        RobotSpec::Embedded(id) => Some(id.clone()),
        _ => None,
    };
    let mut known: Vec<String> = suites.iter().filter_map(id).collect();
    known.dedup();
    let found = suites
        .into_iter()
        .find(|suite| id(suite).as_deref() == Some(robot));
    let allowed = format!(
        "the robot of an embedded suite ({}), or --suite with a file",
        known.join(", ")
    );
    found.ok_or_else(|| InputError::value("explain", "--robot", robot, &allowed))
}

fn graph(mechanism: &Mechanism, out: &mut dyn Write) -> io::Result<()> {
    let count = |kind| mechanism.links.iter().filter(|l| l.kind == kind).count();
    let real = mechanism.joints.iter().filter(|j| j.chain.is_none()).count();
    writeln!(
        out,
        "  links     {}: ground, {} bodies, {} of virtual chains",
        mechanism.links.len(),
        count(LinkKind::Body),
        count(LinkKind::Virtual) + count(LinkKind::CentreOfMass)
    )?;
    let bodies = mechanism.links.iter().filter(|l| l.kind == LinkKind::Body);
    listed("", bodies.map(|l| l.name.clone()), out)?;
    writeln!(
        out,
        "  joints    {}: {real} real, {} virtual",
        mechanism.joints.len(),
        mechanism.joints.len() - real
    )?;
    if !mechanism.followers.is_empty() {
        listed("mimic: ", mechanism.followers.iter().map(|j| j.name.clone()), out)?;
    }
    writeln!(out, "  circuits  {}", mechanism.circuits.len())?;
    for circuit in &mechanism.circuits {
        let name = |(joint, sense): &(usize, i8)| {
            let sign = if *sense < 0 { "-" } else { "" };
            format!("{sign}{}", mechanism.joints[*joint].name)
        };
        listed(
            &format!("{}: ", circuit.task),
            circuit.joints.iter().map(name),
            out,
        )?;
    }
    Ok(())
}

fn matrix(network: &Network, out: &mut dyn Write) -> io::Result<()> {
    let mechanism = &network.mechanism;
    let (ns, np) = (network.secondary(), network.primary());
    writeln!(
        out,
        "  N         {} x {}, rank {}; mobility {}",
        network.n.nrows(),
        network.n.ncols(),
        Network::rank(&network.n),
        mechanism.mobility()
    )?;
    writeln!(out, "  Np        {} x {}, primary", np.nrows(), np.ncols())?;
    for (role, word) in [(Role::Imposed, "imposed: "), (Role::Compromised, "compromised: ")] {
        let joints = mechanism.joints.iter().filter(|j| j.role == role);
        let names: Vec<String> = joints.map(|j| j.name.clone()).collect();
        if !names.is_empty() {
            listed(word, names.into_iter(), out)?;
        }
    }
    writeln!(
        out,
        "  Ns        {} x {}, rank {}, condition {:.1}, secondary",
        ns.nrows(),
        ns.ncols(),
        Network::rank(&ns),
        network.condition()
    )?;
    let secondary = mechanism.columns(Role::Secondary);
    listed(
        "",
        secondary.iter().map(|&j| mechanism.joints[j].name.clone()),
        out,
    )?;
    writeln!(
        out,
        "  blocks    {} after the monitored coordinates are eliminated",
        mechanism.blocks.len()
    )?;
    mechanism
        .blocks
        .iter()
        .try_for_each(|block| described(block, out))
}

fn described(block: &MechanismBlock, out: &mut dyn Write) -> io::Result<()> {
    let root = if block.free_root { " and the free root" } else { "" };
    let (imposed, compromised) = (block.imposed, block.compromised);
    let size = format!(
        "{imposed} imposed, {compromised} compromised, on {} joints{root}: ",
        block.joints.len()
    );
    listed(&size, block.tasks.iter().cloned(), out)
}

/// Words after a heading, broken into indented lines.
fn listed(heading: &str, words: impl Iterator<Item = String>, out: &mut dyn Write) -> io::Result<()> {
    const INDENT: &str = "            ";
    let mut line = format!("{INDENT}{heading}");
    let mut first = true;
    for word in words {
        if !first {
            line.push_str(", ");
        }
        if line.chars().count() + word.chars().count() > WIDTH {
            writeln!(out, "{}", line.trim_end())?;
            line = format!("{INDENT}  ");
        }
        line.push_str(&word);
        first = false;
    }
    writeln!(out, "{line}")
}
