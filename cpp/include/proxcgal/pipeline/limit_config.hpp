#pragma once
#include <string>

#include "proxcgal/fields.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// Joint limits, each (n,); infinite where there is none.
struct Limits {
  JointVector q_min, q_max;  ///< [rad] or [m]
  JointVector qd_max;        ///< [rad/s] or [m/s], at least 0
  JointVector qdd_max;       ///< [rad/s^2] or [m/s^2], above 0
};

/// Settings of the limit stage, the only one after the solver that may change a velocity.
struct LimitConfig {
  bool distances = true;
  double d_stop = 0.05;
  double near_distance = 0.10;
  double near_speed = 0.05;
  double own_stop = 0.02;
  double retreat_speed = 0.25;
  double sigmas = 2.0;
  double floor = -kInfinity;
  double joint_state_age = 0.0;
  double dead_time = 0.0;
  double lag = 0.0;
  double scan_latency = 0.0;
  double period_margin = 1.5;
  double level_ratio = 0.1;
  double least_weight = 1e-2;

  /// The papers' law within the joints' limits: no approach cap on what is seen, no retreat.
  static LimitConfig papers() { return {.distances = false}; }

  /// Delay of the loop that retreat closes [s]. @param period  of the tick [s]
  double loop_delay(double period) const { return joint_state_age + period + dead_time + lag; }
  /// gain x loop delay at most 1/e: a first-order loop with that delay does not ring.
  /// @param gain  [1/s]
  /// @throws ConfigError  with the numbers
  void require_stable(double gain, double period) const;
};

template <>
inline constexpr auto fields<LimitConfig> = field_table(
    "LimitConfig", "The limit stage: the only one after the solver that may change a velocity.",
    field(&LimitConfig::distances, "distances",
          "Approach caps and retreat; false: the papers' law within the joints' limits."),
    field(&LimitConfig::d_stop, "d_stop", "m", at_least(0),
          "No link approaches a seen point nearer than this."),
    field(&LimitConfig::near_distance, "near_distance", "m", at_least(0),
          "Nearer than this a link approaches at `near_speed` at most."),
    field(&LimitConfig::near_speed, "near_speed", "m/s", above(0),
          "Fastest approach nearer than `near_distance`."),
    field(&LimitConfig::own_stop, "own_stop", "m", at_least(0),
          "No link approaches another link of the robot nearer than this."),
    field(&LimitConfig::retreat_speed, "retreat_speed", "m/s", above(0),
          "Fastest retreat nearer than `d_stop`."),
    field(&LimitConfig::sigmas, "sigmas", "", at_least(0),
          "Standard deviations of its range that an approach cap takes off a sensed distance."),
    field(&LimitConfig::floor, "floor", "m", finite().or_minus_infinite(),
          "Height in world that no link approaches nearer than `d_stop`; -inf: none."),
    field(&LimitConfig::joint_state_age, "joint_state_age", "s", between(0, 1),
          "Age of the joint state at a tick."),
    field(&LimitConfig::dead_time, "dead_time", "s", between(0, 1),
          "Time from a command to its first effect on the arm."),
    field(&LimitConfig::lag, "lag", "s", between(0, 1),
          "Time constant of the arm's velocity control."),
    field(&LimitConfig::scan_latency, "scan_latency", "s", between(0, 1),
          "Nominal age of a scan at its tick; counts in the approach caps only."),
    field(
        &LimitConfig::period_margin, "period_margin", "", between(1, 10),
        "Longest time that a command may be held, over the longest recent time between two ticks; "
        "at least 3 periods."),
    field(&LimitConfig::level_ratio, "level_ratio", "", above(0).at_most(1),
          "Weight of a level of the stack over the one above it, for the velocity nearest to the "
          "solver's."),
    field(&LimitConfig::least_weight, "least_weight", "", between(1e-6, 1),
          "Least weight of a level and of each joint's own velocity."));
void check(const LimitConfig& config, const std::string& path);

}  // namespace proxcgal
