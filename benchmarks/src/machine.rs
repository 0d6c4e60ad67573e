//! Where and from which source a run was made.

use crate::records::Machine;
use std::process::Command;
use std::thread::available_parallelism;

/// What is written where the revision cannot be found.
const UNKNOWN: &str = "unknown";
/// Ends the revision of a source tree with changes that are not committed.
const DIRTY: &str = "-dirty";

/// This machine.
pub fn machine() -> Machine {
    Machine {
        cpu: processor().unwrap_or_else(|| UNKNOWN.to_owned()),
        cores: available_parallelism().map_or(0, usize::from),
        system: format!("{}/{}", std::env::consts::OS, std::env::consts::ARCH),
    }
}

/// Model of the first processor, where the system tells it as a file.
fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Revision of the source tree this program was built in, as git tells it now.
pub fn revision() -> String {
    let Some(commit) = git(&["rev-parse", "--short=12", "HEAD"]) else {
        return UNKNOWN.to_owned();
    };
    match git(&["status", "--porcelain", "--untracked-files=no"]) {
        Some(changes) if changes.is_empty() => commit,
        _ => commit + DIRTY,
    }
}

/// Whether a revision pins the source: rows of an unpinned one are never reused.
pub fn is_pinned(revision: &str) -> bool {
    revision != UNKNOWN && !revision.ends_with(DIRTY)
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .arg("-C")
        .arg(env!("CARGO_MANIFEST_DIR"))
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_clean_commit_pins_the_source() {
        assert!(is_pinned("0123456789ab"));
        assert!(!is_pinned("0123456789ab-dirty"));
        assert!(!is_pinned("unknown"));
    }

    #[test]
    fn a_machine_has_cores_and_a_system() {
        let machine = machine();
        assert!(machine.cores >= 1 && machine.system.contains('/') && !machine.cpu.is_empty());
    }
}
