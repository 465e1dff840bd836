//! A ball that bounces on compliant ground, in closed form between and during contacts.
//!
//! With x the gap: free, ẍ = −g; in contact, m ẍ = −k x − c ẋ − m g, a damped oscillation about
//! −m g/k. Contact begins where x falls to zero, or below the surface where k x + c ẋ falls to zero, and
//! ends where k x + c ẋ rises to zero.

/// Mass, law and weight.
#[derive(Debug, Clone, Copy)]
pub struct BouncingBall {
    /// m, kg.
    pub mass: f64,
    /// k, N/m.
    pub stiffness: f64,
    /// c, N s/m; below critical damping.
    pub damping: f64,
    /// g, m/s².
    pub gravity: f64,
}

/// Gap and velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// x, m.
    pub x: f64,
    /// ẋ, m/s.
    pub v: f64,
}

/// Times of the events, whether contact begins at each, and the impulse of a contact that ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switch {
    /// When.
    pub t: f64,
    /// Whether contact begins (or ends).
    pub begins: bool,
    /// ∫ F dt of the contact that ends, N s.
    pub impulse: f64,
}

impl BouncingBall {
    fn free(&self, s: Motion, t: f64) -> Motion {
        Motion { x: s.x + s.v * t - 0.5 * self.gravity * t * t, v: s.v - self.gravity * t }
    }

    fn held(&self, s: Motion, t: f64) -> Motion {
        let rest = -self.mass * self.gravity / self.stiffness;
        let decay = 0.5 * self.damping / self.mass;
        let w = (self.stiffness / self.mass - decay * decay).sqrt();
        let (a, b) = (s.x - rest, (s.v + decay * (s.x - rest)) / w);
        let (sin, cos) = (w * t).sin_cos();
        let e = (-decay * t).exp();
        Motion {
            x: rest + e * (a * cos + b * sin),
            v: e * ((b * w - decay * a) * cos - (a * w + decay * b) * sin),
        }
    }

    fn force_function(&self, s: Motion) -> f64 {
        self.stiffness * s.x + self.damping * s.v
    }

    /// Time from a free state to the next contact.
    fn until_contact(&self, s: Motion) -> f64 {
        let g = self.gravity;
        if s.x < 0.0 {
            // Below the surface: k x + c ẋ is quadratic in time and starts at zero or above.
            let (k, c) = (self.stiffness, self.damping);
            let (a, b, f) = (0.5 * k * g, k * s.v - c * g, self.force_function(s));
            let t = (b + (b * b + 4.0 * a * f).sqrt()) / (2.0 * a);
            if self.free(s, t).x < 0.0 {
                return t;
            }
        }
        (s.v + (s.v * s.v + 2.0 * g * s.x).sqrt()) / g
    }

    /// Time from touch-down to release; `None` for a contact that lasts.
    fn until_release(&self, s: Motion) -> Option<f64> {
        let dt = 0.01 * (self.mass / self.stiffness).sqrt();
        let ends = |t: f64| self.force_function(self.held(s, t)) >= 0.0;
        let steps = (1..20_000).find(|&i| ends(f64::from(i) * dt))?;
        let (mut near, mut far) = (f64::from(steps - 1) * dt, f64::from(steps) * dt);
        for _ in 0..80 {
            let middle = 0.5 * (near + far);
            if ends(middle) { far = middle } else { near = middle }
        }
        Some(far)
    }

    /// State at `end` and the switches on the way, from a free state at time 0.
    pub fn run(&self, mut s: Motion, end: f64) -> (Motion, Vec<Switch>) {
        let (mut t, mut switches) = (0.0, Vec::new());
        loop {
            let flight = self.until_contact(s);
            if t + flight >= end {
                return (self.free(s, end - t), switches);
            }
            (s, t) = (self.free(s, flight), t + flight);
            switches.push(Switch { t, begins: true, impulse: 0.0 });
            match self.until_release(s) {
                Some(hold) if t + hold < end => {
                    let after = self.held(s, hold);
                    let impulse = self.mass * (after.v - s.v + self.gravity * hold);
                    (s, t) = (after, t + hold);
                    switches.push(Switch { t, begins: false, impulse });
                }
                _ => return (self.held(s, end - t), switches),
            }
        }
    }
}
