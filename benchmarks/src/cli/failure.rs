//! How a command can fail, and with which exit code.

use crate::error::InputError;
use crate::figures::FigureError;
use crate::records_io::RecordError;
use std::io;

/// Why a command ended early.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Bad input.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Rows, traces or tables.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Figures.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The terminal.
    #[error("cannot write the output: {0}")]
    Output(#[from] io::Error),
}

impl Failure {
    /// 2 for input that the user can correct, 1 for a system that fails.
    pub fn exit_code(&self) -> u8 {
        let record = |error: &RecordError| match error {
            RecordError::Io { action: "read", .. } => 2,
            RecordError::Io { .. } | RecordError::NotFinite { .. } => 1,
            _ => 2,
        };
        match self {
            Self::Input(_) => 2,
            Self::Record(error) | Self::Figure(FigureError::Record(error)) => record(error),
            Self::Figure(_) | Self::Output(_) => 1,
        }
    }

    /// Whoever read the output has seen enough.
    pub(super) fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }
}
