//! `ik-bench list`: what there is, from the registry, the embedded suites and the embedded robots.

use super::Listed;
use crate::limbs::LimbSuite;
use crate::suite::Suite;
use ik_core::robot::EMBEDDED;
use ik_methods::registry::{Entry, METHODS};
use std::io::{self, Write};

pub(super) fn list(what: Listed, out: &mut dyn Write) -> io::Result<()> {
    match what {
        Listed::Methods => METHODS.iter().try_for_each(|entry| method(entry, out)),
        Listed::Suites => suites(out),
        Listed::Robots => EMBEDDED
            .iter()
            .try_for_each(|robot| writeln!(out, "{:<26} {}", robot.id, robot.summary)),
    }
}

fn method(entry: &Entry, out: &mut dyn Write) -> io::Result<()> {
    let info = entry.info();
    writeln!(out, "{}: {}", info.id, info.name)?;
    writeln!(out, "    {}", info.summary)?;
    writeln!(out, "    {}", info.source)?;
    let defaults = entry.defaults();
    for field in entry.fields() {
        let default = defaults.get(field.key).map_or_else(String::new, shown);
        writeln!(
            out,
            "    --set {}={default}   [{}] {}; {}",
            field.key, field.unit, field.meaning, field.allowed
        )?;
    }
    writeln!(out)
}

/// A parameter's value; small numbers as powers of ten.
fn shown(value: &toml::Value) -> String {
    value
        .as_float()
        .map_or_else(|| value.to_string(), |number| format!("{number:?}"))
}

fn suites(out: &mut dyn Write) -> io::Result<()> {
    let suites = Suite::load_embedded().map_err(io::Error::other)?;
    for suite in suites {
        writeln!(out, "{}: {}", suite.id, suite.title)?;
        let ids: Vec<&str> = suite.scenarios.iter().map(|s| s.id.as_str()).collect();
        writeln!(out, "    dt {} s; scenarios: {}", suite.dt_s, ids.join(", "))?;
    }
    for suite in LimbSuite::load_embedded().map_err(io::Error::other)? {
        writeln!(out, "{}: {}", suite.id, suite.title)?;
        writeln!(out, "    closed-form limbs, without control steps")?;
    }
    Ok(())
}
