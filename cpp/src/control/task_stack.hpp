#pragma once
#include <array>
#include <span>
#include <vector>

#include "control_points.hpp"
#include "obstacle_velocities.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"
#include "self_collision_pairs.hpp"
#include "trusted_distance.hpp"

namespace proxcgal::detail {

/// The tasks of one tick, the most important first: their settings turned into rows.
class TaskStack {
 public:
  /// @param config  kept by reference: its tasks may be retuned
  /// @throws ConfigError, ModelError  a task that this robot cannot have
  TaskStack(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// Rows for one tick; in `out` what the first rows of avoidance and self-collision act on.
  /// @param nominal  in [0, 1]: share of their rates that the tasks of the nominal motion get
  void build(const Posture& posture, const PointsRef& cloud_W, const ObstacleVelocities& velocities,
             const Pose& goal, double nominal, ControlPoints& control_points,
             const TrustedDistance& trusted, TickOutput& out, Monitor& monitor);
  /// The pairs of the robot's own links that are near, of the last `build`.
  std::span<const LinkPair> own_pairs() const { return own_pairs_; }
  /// What they keep: the stack's task, or its defaults where it has none.
  const SelfCollision& own_spec() const { return own_spec_; }
  /// What each task wanted, and what is missing of it in the command that is issued.
  void report(TickOutput& out) const;

  std::span<const Task> tasks() const { return {tasks_.data(), config_.tasks.size()}; }
  bool is_avoidance(std::size_t level) const {
    return std::holds_alternative<Avoidance>(config_.tasks[level]);
  }
  /// The link that a row of avoidance moves.
  int link(std::size_t level, Eigen::Index row) const {
    return links_[level][static_cast<std::size_t>(row)];
  }
  /// Does the goal ask for motion that `qd` has next to nothing of, though no joint moves?
  bool is_singular(const JointVector& qd) const;
  /// Within this distance every link has a row of its own, 0 where only the nearest has one [m].
  double links_within(const TickOutput& out) const;
  /// Within this distance having nothing to move away is a cause to hold [m].
  double engaged_within() const;

 private:
  void build_rows(const Avoidance& spec, std::size_t level, const Posture& posture,
                  const PointsRef& cloud_W, const ObstacleVelocities& velocities,
                  ControlPoints& control_points, const TrustedDistance& trusted, TickOutput& out);
  void build_rows(const SelfCollision& spec, std::size_t level, const Posture& posture,
                  TickOutput& out, Monitor& monitor);

  const Robot& robot_;
  const Skin& skin_;
  const ControllerConfig& config_;
  SelfCollisionPairs self_collision_pairs_;
  std::array<BuiltTask, kMaxLevels> built_;
  std::array<Task, kMaxLevels> tasks_;
  std::array<std::array<int, kMaxRows>, kMaxLevels> links_{};
  std::span<const LinkPair> own_pairs_;
  SelfCollision own_spec_;
  bool has_own_ = false;  // the stack has a task for them
};

/// Settings with other values for the same tasks in the same order.
/// @throws ConfigError  other tasks or another order, a value out of bounds
ControllerConfig retuned(const ControllerConfig& config, const std::vector<TaskSpec>& tasks,
                         const Robot& robot);

}  // namespace proxcgal::detail
