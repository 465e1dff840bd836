//! A symmetric top with a tip on frictionless compliant ground, in reduced coordinates.
//!
//! Height z of the centre of mass and Euler angles R = R_z(φ) R_x(θ) R_z(ψ). The momenta p_ψ and p_φ and the
//! horizontal velocity are constant, so that two degrees of freedom are left:
//! ```text
//! m z̈ = F − m g,   A θ̈ = A φ̇² sin θ cos θ − p_ψ φ̇ sin θ + F l sin θ,
//! φ̇ = (p_φ − p_ψ cos θ)/(A sin² θ),   ψ̇ = p_ψ/C − φ̇ cos θ,   x = z − l cos θ.
//! ```
//! Integrated with the classic Runge–Kutta method in very small steps; the switches of the force by
//! bisection of the step.

use nalgebra::{UnitQuaternion, Vector3};

/// The top and its contact.
#[derive(Debug, Clone, Copy)]
pub struct SpinningTop {
    /// m, kg.
    pub mass: f64,
    /// Moment across the axis, A, kg m².
    pub across: f64,
    /// Moment about the axis, C, kg m².
    pub about: f64,
    /// Distance of the tip below the centre of mass, l, m.
    pub length: f64,
    /// k, N/m.
    pub stiffness: f64,
    /// c, N s/m.
    pub damping: f64,
    /// g, m/s².
    pub gravity: f64,
}

/// Where the top is and how it moves, world frame.
#[derive(Debug, Clone, Copy)]
pub struct TopState {
    /// Height of the centre of mass, m.
    pub height: f64,
    /// Its rate, m/s.
    pub climb: f64,
    /// Orientation.
    pub orientation: UnitQuaternion<f64>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// z, ż, θ, θ̇, φ, ψ.
type Y = [f64; 6];

impl SpinningTop {
    fn gap(&self, y: &Y) -> (f64, f64) {
        (y[0] - self.length * y[2].cos(), y[1] + self.length * y[2].sin() * y[3])
    }

    fn acts(&self, y: &Y) -> bool {
        let (x, v) = self.gap(y);
        x < 0.0 && self.stiffness * x + self.damping * v < 0.0
    }

    fn precession(&self, y: &Y, momenta: (f64, f64)) -> f64 {
        (momenta.1 - momenta.0 * y[2].cos()) / (self.across * y[2].sin().powi(2))
    }

    fn slope(&self, y: &Y, momenta: (f64, f64), held: bool) -> Y {
        let (x, v) = self.gap(y);
        let force = if held { -self.stiffness * x - self.damping * v } else { 0.0 };
        let (sin, cos) = y[2].sin_cos();
        let turn = self.precession(y, momenta);
        let nutation =
            turn * turn * sin * cos + (force * self.length * sin - momenta.0 * turn * sin) / self.across;
        [y[1], force / self.mass - self.gravity, y[3], nutation, turn, momenta.0 / self.about - turn * cos]
    }

    fn step(&self, y: &Y, momenta: (f64, f64), held: bool, h: f64) -> Y {
        let moved = |k: &Y, h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        let k1 = self.slope(y, momenta, held);
        let k2 = self.slope(&moved(&k1, 0.5 * h), momenta, held);
        let k3 = self.slope(&moved(&k2, 0.5 * h), momenta, held);
        let k4 = self.slope(&moved(&k3, h), momenta, held);
        std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// State at `end` and the times of the switches, from rest at `height`, leaning by `lean` from the
    /// vertical towards +y and spinning about the axis.
    pub fn run(&self, height: f64, lean: f64, spin: f64, end: f64, dt: f64) -> (TopState, Vec<f64>) {
        // The axis is (sin θ sin φ, −sin θ cos φ, cos θ): φ = π leans towards +y.
        let mut y = [height, 0.0, lean, 0.0, std::f64::consts::PI, -std::f64::consts::PI];
        let momenta = (self.about * spin, self.about * spin * lean.cos());
        let (mut t, mut switches, mut held) = (0.0, Vec::new(), self.acts(&y));
        while t < end {
            let h = dt.min(end - t);
            let next = self.step(&y, momenta, held, h);
            if self.acts(&next) == held {
                (y, t) = (next, if h < dt { end } else { t + h });
                continue;
            }
            let (mut near, mut far) = (0.0, h);
            for _ in 0..50 {
                let middle = 0.5 * (near + far);
                if self.acts(&self.step(&y, momenta, held, middle)) == held {
                    near = middle;
                } else {
                    far = middle;
                }
            }
            (y, t) = (self.step(&y, momenta, held, far), t + far);
            held = !held;
            switches.push(t);
        }
        let turn = |axis: &nalgebra::Unit<Vector3<f64>>, angle| UnitQuaternion::from_axis_angle(axis, angle);
        let node = turn(&Vector3::z_axis(), y[4]);
        let tilt = node * turn(&Vector3::x_axis(), y[2]);
        let precession = self.precession(&y, momenta);
        let own = momenta.0 / self.about - precession * y[2].cos();
        let angular_velocity =
            Vector3::z() * precession + node * Vector3::x() * y[3] + tilt * Vector3::z() * own;
        let orientation = tilt * turn(&Vector3::z_axis(), y[5]);
        (TopState { height: y[0], climb: y[1], orientation, angular_velocity }, switches)
    }
}
