//! Rigid bodies: what moves, under what, by which method, and what comes of it.

pub(crate) mod batch;
pub(crate) mod bodies;
pub(crate) mod event;
pub(crate) mod exact;
pub(crate) mod forces;
pub(crate) mod integrate;
pub(crate) mod located;
pub(crate) mod methods;
pub(crate) mod monitor;
pub(crate) mod plan;
pub(crate) mod studies;
pub(crate) mod trajectory;
