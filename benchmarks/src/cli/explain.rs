//! How a method sees a problem.

use super::{ExplainArgs, Failure};
use crate::error::InputError;
use crate::figures::mechanism_svg;
use crate::limbs::is_limb_suite;
use crate::records_io::write_atomically;
use crate::suite::{Case, RobotSpec, Suite, Variation, known_method};
use ik_core::driver::Driver;
use ik_core::problem::PhaseId;
use ik_core::robot::{EMBEDDED, Root, embedded};
use ik_methods::davies::{
    LinkKind, Mechanism, MechanismBlock, Network, OrientationRates, ReferencePoint, Role,
};
use ik_methods::reverse_decoupling::analyser::{denavit_hartenberg, limbs};
use std::io::{self, Write};
use std::sync::Arc;

/// Methods that can be explained.
const EXPLAINED: [&str; 2] = ["davies", "davies-open"];
/// Width of a line on a terminal.
const WIDTH: usize = 100;

/// What stands for the closed forms of limbs: how they are derived, and the method that uses them.
const CLOSED_FORM: [&str; 2] = ["reverse-decoupling", "closed-form"];

pub(super) fn explain(args: &ExplainArgs, out: &mut dyn Write) -> Result<(), Failure> {
    if CLOSED_FORM.contains(&args.method.as_str()) {
        return closed_forms(args, out);
    }
    let entry = known_method(&args.method, "explain")?;
    if !EXPLAINED.contains(&entry.info().id) {
        let allowed = "davies, davies-open or reverse-decoupling (or closed-form)";
        return Err(InputError::value("explain", "method", &args.method, allowed).into());
    }
    let suite = match (&args.suite, &args.robot) {
        (Some(name), _) => suite_named(name)?,
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

/// Which limbs of a robot have a closed form, and why the others have none.
fn closed_forms(args: &ExplainArgs, out: &mut dyn Write) -> Result<(), Failure> {
    if let Some(file) = &args.svg {
        let allowed = "with davies and davies-open only: limbs have no graph to draw";
        let place = format!("explain {}", args.method);
        return Err(InputError::value(&place, "--svg", file.display(), allowed).into());
    }
    let robot = match (&args.suite, &args.robot) {
        (Some(name), _) => {
            let suite = suite_named(name)?;
            Case::new(&suite, 0, &Variation::default())?
                .problem
                .robot_arc()
                .clone()
        }
        (None, Some(path)) if path.ends_with(".urdf") => {
            let spec = RobotSpec::UrdfFile {
                path: path.clone(),
                root: Root::default(),
            };
            Arc::new(spec.build("explain: --robot")?)
        }
        (None, Some(id)) => {
            let known = EMBEDDED.iter().map(|robot| robot.id);
            let known = known.chain(["or the path of a .urdf file"]);
            let robot =
                embedded(id).map_err(|_| InputError::unknown("explain: --robot", "robot", id, known))?;
            Arc::new(robot)
        }
        (None, None) => unreachable!("one of them is required"),
    };
    writeln!(out, "limbs of {}", robot.name())?;
    for limb in limbs(&robot) {
        let (joints, count) = (limb.joint_names.join(" "), limb.joint_names.len());
        writeln!(
            out,
            "  {} -> {}, {count} joints: {joints}",
            limb.base_name, limb.tip_name
        )?;
        writeln!(out, "      {}", limb.verdict)?;
        if let Ok(table) = denavit_hartenberg(&robot, &limb) {
            for (i, row) in table.rows.iter().enumerate() {
                writeln!(
                    out,
                    "      {}  alpha {:8.3} deg  a {:9.6} m  d {:9.6} m  theta = {}q {:+.3} deg",
                    i + 1,
                    rounded(row.alpha.to_degrees()),
                    rounded(row.a),
                    rounded(row.d),
                    if row.sign < 0.0 { "-" } else { "" },
                    rounded(row.offset.to_degrees())
                )?;
            }
        }
    }
    Ok(())
}

/// Without the sign of a zero and what rounding leaves beside it.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9 + 0.0
}

/// A suite with a problem.
fn suite_named(name: &str) -> Result<Suite, InputError> {
    if is_limb_suite(name) {
        let allowed = "a suite of control steps; of a suite of limbs, --robot with one of its robots";
        return Err(InputError::value("explain", "--suite", name, allowed));
    }
    Suite::load(name)
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
