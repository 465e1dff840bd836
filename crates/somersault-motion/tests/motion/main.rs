//! Tests of recorded motions, as one program.

mod analysis;
mod files;
mod fitting;
mod hostile;
mod readers;
mod recorded;
mod scoring;
