//! Articulated bodies. One program, so that the kernels are compiled for each scalar once.

mod derivatives;
mod dynamics;
mod flight;
mod mimic;
mod mjcf;
mod models;
mod motion;
mod urdf;
