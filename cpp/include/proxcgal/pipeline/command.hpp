#pragma once
#include <span>

#include "proxcgal/types.hpp"

namespace proxcgal {

/// Joint limits as the command stage needs them, each (n,); infinite where there is none.
struct Limits {
  JointVector q_min, q_max;  ///< [rad] or [m]
  JointVector qd_max;        ///< [rad/s] or [m/s], at least 0
  JointVector qdd_max;       ///< [rad/s^2] or [m/s^2], above 0
};

/// The velocities each joint may take in one tick, each (n,) [rad/s] or [m/s].
struct Admissible {
  JointVector low, high;  ///< never empty: low <= high
  /// The same without the acceleration limit. Zero is always inside: what may be kept up.
  JointVector steady_low, steady_high;
};

/// Position, velocity and acceleration limits of one tick of length `dt`, from posture `q` and
/// last command `qd`.
///
/// The position limit leaves room to brake: v is allowed where v dt + (v - a dt) dt + ... down to
/// zero still fits in the distance left, a = qdd_max. So a joint that obeyed once can always obey,
/// as long as `dt` stays. Outside its position limits a joint may only move in. Where braking in
/// time is no longer possible, the acceleration limit wins.
/// @param dt           [s] above 0
/// @param speed_scale  in [0, 1]: shrinks the velocity limit (DEGRADED)
Admissible admissible(const Limits& limits, const JointVector& q, const JointVector& qd, double dt,
                      double speed_scale = 1.0);

/// From the solver's levels to a command inside `box`. Never clips one joint alone.
///
/// The full solution, unchanged, where the box contains it. Otherwise:
/// 1. Target: the solution as far as position and velocity limits allow it in the long run. The
///    lowest level is shrunk first, down to nothing, then the one above; at last the whole.
/// 2. From the last command straight towards the target, as far as the acceleration limit allows.
/// 3. The same towards the target without its lowest levels, to which they are then added, each as
///    far as it fits. Of all these the command is taken that leaves the most important task the
///    least of A J (target - qd); ties go to the next task, then to the fuller target.
/// The last command is first brought into the box: that moves only joints that have to brake.
/// @param levels   rho of (4.8) after each level, the closing one last; at least one
/// @param tasks    one per level but the closing one
/// @param qd_last  (n,) finite
void command(std::span<const JointVector> levels, std::span<const Task> tasks,
             const JointVector& qd_last, const Admissible& box, JointVector& out);

/// From the last command straight towards rest, as far as `box` allows.
void decelerate(const JointVector& qd_last, const Admissible& box, JointVector& out);

/// Changes `qd` as little as possible (least squares, inside `box`) so that row qd >= least: the
/// arm does not approach along a distance row n'J, or no faster than braking allows.
/// @param row  (n,) derivative of the distance by the joints
/// @return     row qd, under `least` only where no velocity in the box reaches it
double keep_rate(const JointVector& row, double least, const Admissible& box, JointVector& qd);

/// Raises what `qd` does for each row of `task` towards what the target of `command` does for it.
///
/// `command` goes straight towards its target, as far as the slowest joint's acceleration limit
/// allows: where a lower level wants fast joints, a distance row gets the same small share of its
/// change as they, and stays behind although there is room for all of it. Each row makes up the
/// share a of that, its activation, changing `qd` as little as possible; what each is to have is
/// settled before one takes from another, and the first row comes last, so that it has the last
/// word: as far as the box allows it gets its share, and never loses.
/// @param task  rows whose rate is better the higher it is: distances
/// @param box   `low` = `high` = `qd` holds a joint, for a more important task; the target does not
///              depend on it
/// @param qd    inside `box`
void catch_up(std::span<const JointVector> levels, const Task& task, const Admissible& box,
              JointVector& qd);

}  // namespace proxcgal
