//! `ik-bench solve`: one control step from a file.

use super::{Failure, SolveArgs, plan};
use crate::error::InputError;
use crate::instance::Instance;
use std::io::Write;

pub(super) fn solve(args: &SolveArgs, out: &mut dyn Write) -> Result<(), Failure> {
    let source = args.instance.display().to_string();
    let text = std::fs::read_to_string(&args.instance).map_err(|e| InputError::File {
        file: source.clone(),
        reason: e.to_string(),
    })?;
    let instance = Instance::parse(&text, &source)?;
    let set = plan::settings(&args.set)?;
    let contestant = instance.contestant(args.method.as_deref(), &set, &source)?;
    let answer = instance.solve(&contestant, &source)?;
    serde_json::to_writer_pretty(&mut *out, &answer).map_err(std::io::Error::from)?;
    Ok(writeln!(out)?)
}
