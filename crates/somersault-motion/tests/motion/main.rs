//! Tests of recorded motions, as one program.

mod files;
mod hostile;
mod readers;
mod recorded;
