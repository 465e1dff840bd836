//! A symmetric top with a tip on frictionless compliant ground, in reduced coordinates.
//!
//! Height z of the centre of mass and Euler angles R = R_z(φ) R_x(θ) R_z(ψ). The momenta p_ψ and p_φ and the
//! horizontal velocity are constant, so that two degrees of freedom are left:
//! ```text
//! m z̈ = F − m g,   A θ̈ = A φ̇² sin θ cos θ − p_ψ φ̇ sin θ + F l sin θ,
//! φ̇ = (p_φ − p_ψ cos θ)/(A sin² θ),   ψ̇ = p_ψ/C − φ̇ cos θ,   x = z − l cos θ.
//! ```
//! From rest but for the spin, p_φ = p_ψ cos θ₀: the variable is θ − θ₀, of which cos θ₀ − cos θ =
//! 2 sin ½(θ + θ₀) sin ½(θ − θ₀) is formed without cancellation.
//!
//! Integrated by extrapolation of Gragg's modified midpoint rule to order 12 (Hairer, Nørsett and Wanner,
//! *Solving Ordinary Differential Equations I*, section II.9), a scheme that the library does not have; the
//! switches of the force by bisection of the step.

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

/// z, ż, θ − θ₀, θ̇, φ, ψ.
type Y = [f64; 6];

/// What stays: θ₀ and p_ψ.
#[derive(Debug, Clone, Copy)]
struct Constants {
    lean: f64,
    spin: f64,
}

impl SpinningTop {
    fn gap(&self, y: &Y, lean: f64) -> (f64, f64) {
        let (sin, cos) = (lean + y[2]).sin_cos();
        (y[0] - self.length * cos, y[1] + self.length * sin * y[3])
    }

    fn acts(&self, y: &Y, lean: f64) -> bool {
        let (x, v) = self.gap(y, lean);
        x < 0.0 && self.stiffness * x + self.damping * v < 0.0
    }

    fn precession(&self, y: &Y, c: Constants) -> f64 {
        let difference = 2.0 * (c.lean + 0.5 * y[2]).sin() * (0.5 * y[2]).sin();
        c.spin * difference / (self.across * (c.lean + y[2]).sin().powi(2))
    }

    fn slope(&self, y: &Y, c: Constants, held: bool) -> Y {
        let (x, v) = self.gap(y, c.lean);
        let force = if held { -self.stiffness * x - self.damping * v } else { 0.0 };
        let (sin, cos) = (c.lean + y[2]).sin_cos();
        let turn = self.precession(y, c);
        let nutation =
            turn * turn * sin * cos + (force * self.length * sin - c.spin * turn * sin) / self.across;
        [y[1], force / self.mass - self.gravity, y[3], nutation, turn, c.spin / self.about - turn * cos]
    }

    /// The change over a step: the midpoint rule with 2, 4, … 12 substeps, extrapolated.
    ///
    /// Changes are formed apart from the state, so that only their sum is rounded to it.
    fn change(&self, y: &Y, c: Constants, held: bool, h: f64) -> Y {
        const ROWS: usize = 6;
        let slope = |change: &Y| self.slope(&std::array::from_fn(|i| y[i] + change[i]), c, held);
        let moved = |x: &Y, k: &Y, h: f64| -> Y { std::array::from_fn(|i| x[i] + h * k[i]) };
        let first = self.slope(y, c, held);
        let mut table = [[0.0; 6]; ROWS];
        for row in 0..ROWS {
            let substeps = 2 * (row + 1);
            let small = h / substeps as f64;
            let (mut last, mut now) = ([0.0; 6], first.map(|k| small * k));
            for _ in 1..substeps {
                (last, now) = (now, moved(&last, &slope(&now), 2.0 * small));
            }
            let end = slope(&now);
            let mut value: Y = std::array::from_fn(|i| 0.5 * (last[i] + now[i] + small * end[i]));
            // Neville's scheme in the square of the substep.
            for column in 1..=row {
                let ratio = (row + 1) as f64 / (row + 1 - column) as f64;
                let before = std::mem::replace(&mut table[column - 1], value);
                value = std::array::from_fn(|i| value[i] + (value[i] - before[i]) / (ratio * ratio - 1.0));
            }
            table[row] = value;
        }
        table[ROWS - 1]
    }

    fn step(&self, y: &Y, c: Constants, held: bool, h: f64) -> Y {
        let change = self.change(y, c, held, h);
        std::array::from_fn(|i| y[i] + change[i])
    }

    /// State at `end` and the times of the switches, from rest at `height`, leaning by `lean` from the
    /// vertical towards +y and spinning about the axis.
    pub fn run(&self, height: f64, lean: f64, spin: f64, end: f64, dt: f64) -> (TopState, Vec<f64>) {
        // The axis is (sin θ sin φ, −sin θ cos φ, cos θ): φ = π leans towards +y.
        let mut y = [height, 0.0, 0.0, 0.0, std::f64::consts::PI, -std::f64::consts::PI];
        let c = Constants { lean, spin: self.about * spin };
        let (mut t, mut switches, mut held) = (0.0, Vec::new(), self.acts(&y, lean));
        while t < end {
            let h = dt.min(end - t);
            let next = self.step(&y, c, held, h);
            if self.acts(&next, lean) == held {
                (y, t) = (next, if h < dt { end } else { t + h });
                continue;
            }
            let (mut near, mut far) = (0.0, h);
            for _ in 0..50 {
                let middle = 0.5 * (near + far);
                if self.acts(&self.step(&y, c, held, middle), lean) == held {
                    near = middle;
                } else {
                    far = middle;
                }
            }
            (y, t) = (self.step(&y, c, held, far), t + far);
            held = !held;
            switches.push(t);
        }
        let turn = |axis: &nalgebra::Unit<Vector3<f64>>, angle| UnitQuaternion::from_axis_angle(axis, angle);
        let node = turn(&Vector3::z_axis(), y[4]);
        let tilt = node * turn(&Vector3::x_axis(), lean + y[2]);
        let precession = self.precession(&y, c);
        let own = c.spin / self.about - precession * (lean + y[2]).cos();
        let angular_velocity =
            Vector3::z() * precession + node * Vector3::x() * y[3] + tilt * Vector3::z() * own;
        let orientation = tilt * turn(&Vector3::z_axis(), y[5]);
        (TopState { height: y[0], climb: y[1], orientation, angular_velocity }, switches)
    }
}
