//! Tests of recorded motions, as one program.

mod analysis;
mod files;
mod fitting;
mod groups;
mod hostile;
mod judged;
mod readers;
mod recorded;
mod scoring;
mod synthetic;
mod writers;
