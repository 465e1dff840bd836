//! Optimal motions.
