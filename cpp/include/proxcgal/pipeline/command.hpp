#pragma once
#include <span>

#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Joint limits as the command stage needs them, each (n,).
struct Limits {
  JointVector q_min, q_max, qd_max, qdd_max;
};

/// The velocities each joint may take in the next `dt`, given where it is and how fast it goes.
struct Admissible {
  JointVector low, high;
};

/// Velocity limit, acceleration limit from `qd`, and a position limit that leaves room to brake:
/// v dt + v^2 / (2 a) - v dt / 2 <= distance left. Outside its limits a joint may only move in.
/// Where braking is no longer possible the acceleration limit wins.
/// @param speed_scale  in [0, 1]: shrinks the velocity limit (DEGRADED)
Admissible admissible(const Limits& limits, const JointVector& q, const JointVector& qd, double dt,
                      double speed_scale = 1.0);

/// From the solver's levels to a command inside `box`.
///
/// Never clips one joint alone: it goes from the last command straight towards a target as far as
/// the box allows. Targets are the solution with its lowest levels left out one by one; the one
/// that leaves the most important task the smallest active residual wins, ties go to the fuller.
void command(const Solution& solution, std::span<const Task> tasks, const JointVector& qd_last,
             const Admissible& box, JointVector& out);

/// The velocity nearest to rest inside `box`, along the line from the last command to zero.
void decelerate(const JointVector& qd_last, const Admissible& box, JointVector& out);

}  // namespace proxcgal
