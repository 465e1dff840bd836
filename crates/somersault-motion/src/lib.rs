#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! A fit places the markers of a model, scaled by s, nearest to those that were recorded, with weights c and a robust loss ρ:
//!
//! ```math
//! \min_{r, s, q}\ \frac12 \sum_k c_k\, \rho\left( \| r + s\, d_k(q) - y_k \|^2 \right)
//! ```
//! | Step | Here | Thesis |
//! |---|---|---|
//! | files ↔ markers, skeletons | [`readers`], [`writers`] | 4.1.1 |
//! | gaps, resampling, joint centres | [`recording`] | 4.1.1 |
//! | markers → scale, pose, joint angles or eigenweights of a model | [`fit`] | 4.2 |
//! | markers → sizes of segments and places of markers | [`scaling`] | – |
//! | heights, markers → take-off and entry | [`phases`] | – |
//! | markers of any motion → a smooth motion with velocities and accelerations | [`smoothing`] | – |
//! | markers of a flight → momentum and motion that obey the laws of flight | [`reconstruction`] | – |
//! | a reconstructed flight → dive number and figures, with intervals | [`identification`] | – |
//! | a reconstructed flight flown again with a change → advice for the entry | [`advice`] | – |
//! | attitudes of a free body → its inertia up to a factor, with intervals | [`inertia`] | – |
//! | eigenpostures of motions, projection on a base, comparison of groups | [`analysis`] | 4.1.1, 4.2 |
//! | motions with scores that users provide | [`judged`] | 4.1.2 |
//! | motions → scores | [`scoring`] | 4.1 |
//! | SYNTHETIC judged dives, while no judged ones are public | [`synthetic`] | – |
//!
//! Inside, lengths are in m, times in s, angles in rad, and the world has x forward, y left and z up,
//! whatever a file has.
//!
//! Filters are not here: no Rust crate for zero-phase low-pass filters is kept well enough to rest
//! measurements on it. SciPy's `butter` and `sosfiltfilt` do it on the Python side.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

pub mod advice;
pub mod analysis;
mod cholesky;
pub mod fit;
mod frame_fits;
pub mod identification;
pub mod inertia;
pub mod judged;
mod noise;
pub mod phases;
pub mod readers;
pub mod reconstruction;
pub mod recording;
pub mod scaling;
pub mod scoring;
mod singular;
pub mod smoothing;
pub mod synthetic;
pub mod writers;

pub use nalgebra;
