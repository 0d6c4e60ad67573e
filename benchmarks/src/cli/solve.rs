//! `ik-bench solve`: one control step, or the pose of one limb, from a file.

use super::{Failure, SolveArgs, plan};
use crate::error::InputError;
use crate::instance::{self, Instance};
use crate::limb_pose::{self, LimbPoseFile};
use serde::Serialize;
use std::io::Write;

pub(super) fn solve(args: &SolveArgs, out: &mut dyn Write) -> Result<(), Failure> {
    let source = args.instance.display().to_string();
    let text = std::fs::read_to_string(&args.instance).map_err(|e| InputError::File {
        file: source.clone(),
        reason: e.to_string(),
    })?;
    if schema(&text, &source)? == limb_pose::SCHEMA {
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

/// The schema that a file says to have: one of those that can be solved.
fn schema(text: &str, source: &str) -> Result<&'static str, InputError> {
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| InputError::Syntax {
        file: source.to_owned(),
        reason: not_json(text, &e),
    })?;
    let known = [instance::SCHEMA, limb_pose::SCHEMA];
    let found = value.get("schema");
    let same = |schema: &&str| found.and_then(|found| found.as_str()) == Some(*schema);
    known.into_iter().find(same).ok_or_else(|| {
        let found = found.map_or("missing".to_owned(), ToString::to_string);
        InputError::value(source, "schema", found, &known.join(", "))
    })
}

/// The parser's words, but for numbers that other languages write and JSON does not have.
fn not_json(text: &str, error: &serde_json::Error) -> String {
    let (line, column) = (error.line(), error.column());
    let at = text.lines().nth(line.saturating_sub(1));
    let rest = at.and_then(|at| at.get(column.saturating_sub(1)..));
    let rest = rest.unwrap_or_default().to_ascii_lowercase();
    if ["nan", "inf"].iter().any(|word| rest.starts_with(word)) {
        return format!("not a number at line {line} column {column}");
    }
    error.to_string()
}

fn solve_limb(args: &SolveArgs, text: &str, source: &str, out: &mut dyn Write) -> Result<(), Failure> {
    if args.method.is_some() || !args.set.is_empty() {
        let allowed = "neither --method nor --set: a limb's pose has a closed form";
        return Err(InputError::value(source, "--method or --set", "given", allowed).into());
    }
    let answer = LimbPoseFile::parse(text, source)?.solve(source)?;
    let answer = if args.all_solutions {
        answer
    } else {
        answer.nearest()
    };
    print(&answer, out)
}

fn print(answer: &impl Serialize, out: &mut dyn Write) -> Result<(), Failure> {
    serde_json::to_writer_pretty(&mut *out, answer).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
