//! `ik-bench solve`: one control step, or the pose of one limb, from a file.

use super::{Failure, SolveArgs, plan};
use crate::error::InputError;
use crate::instance::Instance;
use crate::limb_pose::{self, LimbPoseFile};
use serde::Serialize;
use std::io::Write;

pub(super) fn solve(args: &SolveArgs, out: &mut dyn Write) -> Result<(), Failure> {
    let source = args.instance.display().to_string();
    let text = std::fs::read_to_string(&args.instance).map_err(|e| InputError::File {
        file: source.clone(),
        reason: e.to_string(),
    })?;
    if is_limb_pose(&text) {
        return solve_limb(args, &text, &source, out);
    }
    if args.all_solutions {
        let allowed = format!("a file of schema {}", limb_pose::SCHEMA);
        return Err(InputError::value(&source, "--all-solutions", "a control step", &allowed).into());
    }
    let instance = Instance::parse(&text, &source)?;
    let set = plan::settings(&args.set)?;
    let contestant = instance.contestant(args.method.as_deref(), &set, &source)?;
    print(&instance.solve(&contestant, &source)?, out)
}

/// Whether the text says that it is the pose of a limb.
fn is_limb_pose(text: &str) -> bool {
    let value: Option<serde_json::Value> = serde_json::from_str(text).ok();
    value.is_some_and(|v| v.get("schema").and_then(|s| s.as_str()) == Some(limb_pose::SCHEMA))
}

fn solve_limb(args: &SolveArgs, text: &str, source: &str, out: &mut dyn Write) -> Result<(), Failure> {
    if args.method.is_some() || !args.set.is_empty() {
        let allowed = "neither --method nor --set: a limb's pose has a closed form";
        return Err(InputError::value(source, "--method or --set", "given", allowed).into());
    }
    let mut answer = LimbPoseFile::parse(text, source)?.solve(source)?;
    if !args.all_solutions {
        answer.solutions.truncate(1);
    }
    print(&answer, out)
}

fn print(answer: &impl Serialize, out: &mut dyn Write) -> Result<(), Failure> {
    serde_json::to_writer_pretty(&mut *out, answer).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
