//! A box that falls on its edges in a plane, in three coordinates.
//!
//! Position (x, z) of the centre and the angle θ of a turn about y. A corner (a, b) of the rectangle stands for
//! two corners of the box, at
//! ```text
//! X = x + a cos θ + b sin θ,   Z = z − a sin θ + b cos θ,
//! ```
//! with a spring and damper at Z < 0 and smooth friction:
//! ```text
//! F = 2 max(−k Z − c Ż, 0) where Z < 0,   T = −μ F Ẋ/√(Ẋ² + v_ε²),
//! m ẍ = Σ T,   m z̈ = Σ F − m g,   I θ̈ = Σ ((Z − z) T − (X − x) F).
//! ```
//! Integrated with the classic Runge–Kutta method in very small steps; the switches of the forces by
//! bisection of the step.

/// The box and its contacts.
#[derive(Debug, Clone, Copy)]
pub struct PlanarBox {
    /// m, kg.
    pub mass: f64,
    /// Moment about y, I, kg m².
    pub moment: f64,
    /// Half lengths along x and z, m.
    pub half: [f64; 2],
    /// k of each of the eight corners, N/m.
    pub stiffness: f64,
    /// c of each, N s/m.
    pub damping: f64,
    /// μ.
    pub friction: f64,
    /// v_ε, m/s.
    pub speed: f64,
    /// g, m/s².
    pub gravity: f64,
}

/// x, z, θ, ẋ, ż, θ̇.
pub type PlanarState = [f64; 6];

const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];

impl PlanarBox {
    /// Arm and velocity of a corner.
    fn corner(&self, y: &PlanarState, i: usize) -> ([f64; 2], [f64; 2]) {
        let (a, b) = (self.half[0] * SIGNS[i][0], self.half[1] * SIGNS[i][1]);
        let (sin, cos) = y[2].sin_cos();
        let arm = [a * cos + b * sin, b * cos - a * sin];
        (arm, [y[3] + y[5] * arm[1], y[4] - y[5] * arm[0]])
    }

    fn push(&self, y: &PlanarState, i: usize) -> f64 {
        let (arm, velocity) = self.corner(y, i);
        -self.stiffness * (y[1] + arm[1]) - self.damping * velocity[1]
    }

    fn acts(&self, y: &PlanarState) -> [bool; 4] {
        std::array::from_fn(|i| y[1] + self.corner(y, i).0[1] < 0.0 && self.push(y, i) > 0.0)
    }

    fn slope(&self, y: &PlanarState, acts: &[bool; 4]) -> PlanarState {
        let (mut along, mut up, mut turn) = (0.0, -self.mass * self.gravity, 0.0);
        for i in (0..4).filter(|&i| acts[i]) {
            let (arm, velocity) = self.corner(y, i);
            let push = 2.0 * self.push(y, i);
            let drag = -self.friction * push * velocity[0] / velocity[0].hypot(self.speed);
            along += drag;
            up += push;
            turn += arm[1] * drag - arm[0] * push;
        }
        [y[3], y[4], y[5], along / self.mass, up / self.mass, turn / self.moment]
    }

    fn step(&self, y: &PlanarState, acts: &[bool; 4], h: f64) -> PlanarState {
        let moved = |k: &PlanarState, h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        let k1 = self.slope(y, acts);
        let k2 = self.slope(&moved(&k1, 0.5 * h), acts);
        let k3 = self.slope(&moved(&k2, 0.5 * h), acts);
        let k4 = self.slope(&moved(&k3, h), acts);
        std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// State at `end` and the times of the switches, one for each corner of the rectangle.
    pub fn run(&self, mut y: PlanarState, end: f64, dt: f64) -> (PlanarState, Vec<f64>) {
        let (mut t, mut switches, mut acts) = (0.0, Vec::new(), self.acts(&y));
        while t < end {
            let h = dt.min(end - t);
            let next = self.step(&y, &acts, h);
            if self.acts(&next) == acts {
                (y, t) = (next, if h < dt { end } else { t + h });
                continue;
            }
            let (mut near, mut far) = (0.0, h);
            for _ in 0..50 {
                let middle = 0.5 * (near + far);
                if self.acts(&self.step(&y, &acts, middle)) == acts { near = middle } else { far = middle }
            }
            (y, t) = (self.step(&y, &acts, far), t + far);
            let now = self.acts(&y);
            switches.extend((0..4).filter(|&i| now[i] != acts[i]).map(|_| t));
            acts = now;
        }
        (y, switches)
    }
}
