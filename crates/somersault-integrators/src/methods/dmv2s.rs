//! Discrete Moser–Veselov between two half kicks, for bodies under torque.
//!
//! v½ = v + h a/2, L½ = L + h M/2; r₊ = r + h v½, R₊ = R Ωᵀ with Ωᵀ D − D Ω = h hat(Rᵀ L½) in the principal
//! frame, see [`crate::moser_veselov`]; v₊ = v½ + h a₊/2, L₊ = L½ + h M₊/2, ω₊ = I₊⁻¹ L₊.
//!
//! Order 2 on ℝ³ and on SO(3), with or without torque. 1 evaluation where wrenches do not depend on the
//! rates, 2 where they do; no start-up. Symplectic where wrenches come from a potential: the energy error
//! stays bounded over very long times. World angular momentum is constant without torque, its vertical
//! component under weight, to round-off that does not add up. A free body keeps its energy up to
//! rounding, which adds some 4e-19 of it per step; `dmv2` compensates that.
//!
//! Not for large steps: beyond h |ω| = 1 the equation of the drift need not have a solution, which is a typed
//! error. A step of a free body that turns by θ in it is off by 0.8 θ³ rad at most. Fourth order and smooth
//! forces: `rkmk`.
//!
//! R. I. McLachlan, A. Zanna, Found. Comput. Math. 5 (2005) 87; E. Hairer, G. Vilmart, J. Phys. A: Math.
//! Gen. 39 (2006) 13225.
//!
//! # Deviations
//! The second kick under wrenches that depend on the rates takes them at rates predicted by the first.

use crate::kick_drift_kick::KickDriftKickMemory;
use crate::moser_veselov::{MoserVeselov, NotConverged};
use crate::state::Poses;
use crate::stepper::{MethodInfo, Scheme, Scope, StepError, Stepper};
use crate::system::{RigidSystem, StateOf};

register! {
    140 => Dmv2s: SplitMoserVeselov, world;
}

/// The discrete Moser–Veselov method split for bodies under torque.
#[derive(Debug, Clone, Copy, Default)]
pub struct SplitMoserVeselov;

impl Scheme for SplitMoserVeselov {
    const INFO: MethodInfo = MethodInfo {
        evaluations: 1,
        scope: Scope::RigidBodies,
        implicit: true,
        angle_limit: Some(1.0),
        conserves: "energy and angular momentum of a free body to rounding; under a potential the energy error stays bounded",
        limitations: "unsuitable for h‖ω‖ beyond about 1 rad a step, where its equation has no solution: refused",
        ..MethodInfo::explicit(
            "dmv2s",
            "Discrete Moser-Veselov, split",
            "R. I. McLachlan, A. Zanna, Found. Comput. Math. 5 (2005) 87",
            2,
        )
    };
}

/// The maps of the bodies and the memory of the splitting.
pub struct SplitMemory<S: RigidSystem> {
    maps: Vec<MoserVeselov>,
    splitting: KickDriftKickMemory<S>,
}

impl<S: RigidSystem> Stepper<S> for SplitMoserVeselov {
    type Memory = SplitMemory<S>;

    fn start(&self, system: &S, x: &StateOf<S>) -> Result<Self::Memory, StepError> {
        let map = |i| MoserVeselov::new(system.body(i).inertia().principal_moments());
        Ok(SplitMemory {
            maps: (0..x.configuration.count()).map(map).collect(),
            splitting: KickDriftKickMemory::new(x),
        })
    }

    fn restart(&self, memory: &mut Self::Memory) {
        memory.splitting.restart();
    }

    #[inline(always)]
    fn step(
        &self,
        system: &S,
        t: f64,
        x: &StateOf<S>,
        h: f64,
        memory: &mut Self::Memory,
        out: &mut StateOf<S>,
    ) -> Result<(), StepError> {
        let SplitMemory { maps, splitting } = memory;
        splitting.step(system, t, x, h, out, |i, momentum| {
            let inertia = system.body(i).inertia();
            let refused = |e: NotConverged| e.of::<Self>(t, h, inertia.velocity(momentum).norm());
            if inertia.is_diagonal() {
                return Ok(maps[i].increment(momentum, h).map_err(refused)?.rotation);
            }
            let axes = inertia.principal_axes();
            let principal =
                maps[i].increment(&axes.inverse_transform_vector(momentum), h).map_err(refused)?;
            Ok(axes * principal.rotation * axes.inverse())
        })
    }
}
