//! Direct collocation: points, derivatives, optima with closed forms, confirmation, and the arm of thesis 8.4.

mod arcs;
mod arm;
mod derivatives;
mod input;
mod known;
mod optima;
mod quaternions;
mod radau;
mod sensitivity;
mod solution_methods;
mod starts;
mod trees;
mod untraced;
