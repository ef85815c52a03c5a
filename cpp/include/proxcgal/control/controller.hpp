#pragma once
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal {

/// The tick: sense -> filter -> memory -> distance -> task -> solve -> limit, under the monitor.
///
/// Set-up throws; a tick never throws, allocates, locks, logs, or reads a clock for a decision.
/// Not thread-safe: one controller, one thread.
class Controller {
 public:
  /// @param robot  kept alive by the controller
  /// @throws ConfigError  every setting that is out of bounds, a sensor on an unknown link
  Controller(std::shared_ptr<const Robot> robot, Skin skin, ControllerConfig config);
  ~Controller();

  /// @param time   [s] the caller's monotonic clock
  /// @param q      (n_q,) measured
  /// @param scans  since the last tick, may be empty
  /// @param goal   T_WT
  /// @param late   the caller missed its deadline since the last tick
  /// @param q_stamp  [s] when q was measured, on the same clock; none: just now
  const TickOutput& tick(double time, const JointVector& q, std::span<const Scan> scans,
                         const Pose& goal, bool late = false,
                         std::optional<double> q_stamp = std::nullopt);
  /// The scene itself instead of scans.
  /// @param points_W      (n, 3), n <= max_points
  /// @param velocities_W  of the obstacles [m/s]: a row for each point, one for all, or none where
  ///                      they are not known
  const TickOutput& tick_known(double time, const JointVector& q, const PointsRef& points_W,
                               const Pose& goal, const PointsRef& velocities_W = Points(0, 3));

  /// @name State of the last tick
  /// @{
  std::span<const Finding> findings() const;
  /// What `tick` avoids: the filtered points of the sensors' last scans, then those remembered.
  Eigen::Map<const Points> cloud_W() const;
  std::span<const PointOrigin> cloud_origins() const;
  Eigen::Index seen_points() const;  ///< rows of `cloud_W` that the last scans show
  /// [s] since each row of `cloud_W` was measured.
  std::vector<double> cloud_ages(double time) const;
  /// Every point of the sensors' last scans before body removal, in world.
  Eigen::Map<const Points> raw_cloud_W() const;
  std::vector<double> scan_ages(double time) const;  ///< [s] per sensor, infinity where none came
  /// The last ticks, at most kKeptTicks, the oldest first. After a STOP they stay as they were when
  /// it came, until `reset`.
  std::vector<TickRecord> last_ticks() const;
  /// @}

  const Robot& robot() const;
  const Skin& skin() const;
  const ControllerConfig& config() const;
  /// Leaves STOP, only once its cause is gone, and what holds the arm off; true where it did.
  bool reset();
  /// The sensors sit where the skin says: ends the HOLD of `monitor.await_mounts`. For whoever has
  /// compared what they see of the arm itself with what they must see.
  void accept_mounts();
  /// Other values for the same tasks in the same order, from the next tick on; what was seen, what
  /// was commanded and the mode stay. Not part of the tick: it may throw, and changes nothing then.
  /// @throws ConfigError  other tasks or another order, a value out of bounds
  void retune(const std::vector<TaskSpec>& tasks);
  /// Commands go on from a velocity instead of from rest: for a controller that takes over an arm
  /// that moves. Not part of the tick.
  /// @param qd  (n_q,) commanded last [rad/s] or [m/s]
  /// @throws ConfigError  another size, not finite, above a joint's limit
  void go_on_from(const JointVector& qd);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
