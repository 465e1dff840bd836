"""Recorded motions: read, fitted by a model, analysed and scored.

Readers bring files to one convention: m, s, x forward, y left and z up. A `MarkerRecording` has positions of
named markers, with gaps; a `SkeletonRecording` a tree of joints and how they turned; a `KeypointRecording`
what a pose estimator found; a `ChannelRecording` named numbers. Their `repairs` list what was put right in a
file. A `MarkerFit` lays a model with a `MarkerSet` over markers; `scale_model` gives it the sizes of a
person; `smooth_motion` finds the smooth motion behind them, with velocities and accelerations;
`reconstruct_flight` finds the flight behind them by the laws of flight, with its angular momentum, and
`analyse` says what it was and what to do; `estimate_inertia` has the moments of a free rigid body, up to a
factor, from its attitudes; `Pca`, `project` and `GroupComparison` describe motions; a `ScoringModel` learns
scores, and `validate` measures how accurate they are.

| Format | Reader | Writer | Of |
|---|---|---|---|
| BVH | `read_bvh` | `write_bvh` | skeletons |
| motions of DeepMimic (JSON) | `read_joint_motion` | `write_joint_motion` | skeletons |
| C3D | `read_c3d`, `read_c3d_channels`, … | `write_c3d` | markers, channels |
| TRC | `read_trc` | `write_trc` | markers |
| CSV, TSV, also of Motive, Nexus and QTM | `read_csv` | `write_csv` | markers, channels |
| MOT, STO | `read_mot` | `write_mot` | channels |
| AMASS (SMPL, `.npz`) | `read_amass` | | skeletons |
| GLB (glTF) | | `write_glb` | skeletons, markers |
| key points (JSON) | `read_pose` | | key points |
| any of these, as the file has it | `read_file` | | |
| a list of motions with scores | `read_judged` | `JudgedSet.save` | markers |
| a table of judges' awards | `read_awards` | | |

Since no set of judged dives is public, a `SyntheticSet` makes one; all that is derived from it is labelled
SYNTHETIC.

A diver who folds, seen by noisy markers, some of them missing, and found again:

>>> import numpy as np
>>> from somersault import motion, multibody
>>> diver = multibody.diver_planar()
>>> markers = motion.MarkerSet.joint_centres(diver.model)
>>> t = np.linspace(0.0, 1.0, 30)
>>> q = np.linspace(diver.configuration("A"), diver.configuration("H"), 30)
>>> seen = motion.place_markers(markers, t, q)
>>> rng = np.random.default_rng(1)
>>> points = seen.points + rng.normal(0.0, 0.005, seen.points.shape)
>>> seen = motion.MarkerRecording(seen.names, t, points, rng.random(seen.present.shape) > 0.2)
>>> fit = motion.MarkerFit(markers, scale=1.0).fit(seen)
>>> fit.converged, bool(fit.rms < 0.01)
(True, True)

Whether it is a success is another question: joint centres do not say how head, hands and toes are turned.

>>> fit.success, fit.unknown_status[0][fit.unknowns.index("hand")]
(False, 'undetermined')
"""

from somersault._analysis import FlightAnalysis, analyse
from somersault._body_models import read_amass
from somersault._markers import low_pass, place_markers
from somersault._somersault import motion as _extension
from somersault._somersault.motion import *  # noqa: F403

__all__ = ["FlightAnalysis", "analyse", "low_pass", "place_markers", "read_amass"]
__all__ += _extension.__all__
