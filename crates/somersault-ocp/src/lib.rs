//! Optimal motions of articulated bodies.
//!
//! A motion is sought that makes a cost small and keeps to constraints. What is unknown about it, the decision
//! vector z, is a start and the parameters of the joint motion; a transcription makes nodes of it, terms
//! make numbers of the nodes, and the result is a nonlinear program ([`nlp`]) for a solver.
#![forbid(unsafe_code)]

pub mod dive;
pub mod flight;
pub mod motion;
pub mod nlp;
pub mod term;
pub mod solver;

pub use nalgebra;
