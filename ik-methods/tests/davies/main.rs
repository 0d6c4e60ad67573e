//! Davies' method against the network matrix written out, against other solutions, and against its own counts.

#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs, reason = "tests")]

mod motion;
mod network;
mod steps;
mod support;
