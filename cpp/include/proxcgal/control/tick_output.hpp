#pragma once
#include <array>
#include <optional>

#include "proxcgal/pipeline/limit.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// What one task wanted and got.
struct TaskReport {
  const char* name = "";
  RowVector rate, activation, residual;
};

struct Timings {
  double sense_us = 0, filter_us = 0;
  double memory_us = 0;    ///< memory and motion
  double distance_us = 0;  ///< closest pair, control points, task rows
  double solve_us = 0;     ///< solver and command
  double total_us = 0;
};

/// Output of one tick. Reused: copy what you keep.
struct TickOutput {
  JointVector nominal_qd;  ///< [rad/s] or [m/s] what the solver asked for
  JointVector qd;          ///< [rad/s] or [m/s] what is sent: within every limit
  /// Rows of the limit stage that made `qd` another than `nominal_qd`.
  std::span<const ActiveLimit> limited;
  /// Nearest of the links that joints can move away. In whole-body mode it drives the arm; its
  /// point is a row of `cloud_W` (`tick`) or of the points given (`tick_known`).
  std::optional<ClosestPair> pair;
  double pair_distance() const;  ///< [m] of the pair, infinity for none
  PointOrigin pair_origin;       ///< sensor and zone that saw it, where one did
  double pair_age = 0.0;         ///< [s] since it was measured, where it was
  bool pair_remembered = false;  ///< no current scan shows it any more
  /// [m] what of the pair's distance is still to be trusted: less the way that something may have
  /// come since the scan was fresh, negative where the obstacle is inside the surface.
  double trusted_distance = kInfinity;
  /// [m/s] of the pair's obstacle: as estimated (`tick`) or given (`tick_known`).
  Vector3 obstacle_velocity_W = Vector3::Zero();
  ControlPair control;  ///< what the first avoidance row acts on, with its obstacle's velocity
  LinkPair own;         ///< what the first self-collision row acts on
  Mode mode = Mode::kRun;
  int n_tasks = 0;
  std::array<TaskReport, kMaxLevels> tasks;
  Timings timings;
};

inline double TickOutput::pair_distance() const {
  if (!pair) return kInfinity;
  return pair->distance;
}

/// What is kept of one tick, for whoever asks why the arm stopped.
struct TickRecord {
  double time = 0.0;  ///< [s] the caller's
  Mode mode = Mode::kRun;
  JointVector q, qd;
  double distance = kInfinity;  ///< [m] of the pair
  int link = -1;
  PointOrigin origin;
  int n_findings = 0;  ///< all of them; the first are kept
  std::array<Finding, 8> findings{};
};
inline constexpr int kKeptTicks = 64;

}  // namespace proxcgal
