#include "task_stack.hpp"

#include <algorithm>
#include <string>

#include "proxcgal/error.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kJustBeyond = 1e-6;  // [m]
constexpr double kAtRest = 1e-4;      // [rad/s] or [m/s] of all joints
constexpr double kAsked = 0.01;       // [m/s] or [rad/s] that the goal asks for

}  // namespace

TaskStack::TaskStack(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : robot_(robot), skin_(skin), config_(config), self_collision_pairs_(robot, config) {
  for (const TaskSpec& task : config.tasks) {
    validate(task, robot);
    has_own_ = has_own_ || std::holds_alternative<SelfCollision>(task);
  }
}

void TaskStack::build_rows(const Avoidance& spec, std::size_t level, const Posture& posture,
                           const PointsRef& cloud_W, const ObstacleVelocities& velocities,
                           ControlPoints& control_points, const TrustedDistance& trusted,
                           TickOutput& out) {
  std::span<const ControlPair> controls;
  if (config_.control_point == ControlPoint::kSensor) {
    controls = control_points.sensor(skin_, posture, cloud_W, velocities);
  } else if (spec.nearest > 1) {
    controls = control_points.links(robot_, posture, spec.nearest, links_within(out), velocities);
  } else if (out.pair) {
    controls = control_points.one(trusted.control(out, velocities.of(out.pair->point)));
  }
  if (!controls.empty() && out.control.link < 0) out.control = controls.front();
  build_avoidance(spec, robot_, posture, controls, built_[level]);
  const std::size_t rows = std::min<std::size_t>(controls.size(), kMaxRows);
  for (std::size_t row = 0; row < rows; ++row) links_[level][row] = controls[row].link;
}

void TaskStack::build_rows(const SelfCollision& spec, std::size_t level, const Posture& posture,
                           TickOutput& out, Monitor& monitor) {
  const std::span<const LinkPair> pairs =
      self_collision_pairs_.nearest(spec, robot_, posture, monitor);
  own_pairs_ = pairs;
  own_spec_ = spec;
  if (!pairs.empty() && out.own.a < 0) out.own = pairs.front();
  build_self_collision(spec, robot_, posture, pairs, built_[level]);
}

void TaskStack::build(const Posture& posture, const PointsRef& cloud_W,
                      const ObstacleVelocities& velocities, const Pose& goal, double nominal,
                      ControlPoints& control_points, const TrustedDistance& trusted,
                      TickOutput& out, Monitor& monitor) {
  own_pairs_ = {};
  for (std::size_t level = 0; level < config_.tasks.size(); ++level) {
    BuiltTask& task = built_[level];
    std::visit(
        [&](const auto& spec) {
          using Spec = std::decay_t<decltype(spec)>;
          if constexpr (std::is_same_v<Spec, Avoidance>)
            build_rows(spec, level, posture, cloud_W, velocities, control_points, trusted, out);
          if constexpr (std::is_same_v<Spec, Reach>) build_reach(spec, robot_, posture, goal, task);
          if constexpr (std::is_same_v<Spec, JointLimits>)
            build_joint_limits(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, MinimumAltitude>)
            build_minimum_altitude(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, Manipulability>)
            build_manipulability(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, SelfCollision>)
            build_rows(spec, level, posture, out, monitor);
          // What the arm does on its own account; the others keep what must be kept.
          if constexpr (std::is_same_v<Spec, Reach> || std::is_same_v<Spec, Manipulability>)
            task.task.rate *= nominal;
        },
        config_.tasks[level]);
    const bool active = (task.task.activation.array() > 0.0).any();
    if (task.smallest_row_norm < kSmallRowNorm && active)
      monitor.add({.reason = Reason::kRowSmall});
    tasks_[level] = task.task;
  }
  // Own links are kept off one another in any stack.
  if (config_.limit.distances && !has_own_)
    own_pairs_ = self_collision_pairs_.nearest(own_spec_, robot_, posture, monitor);
}

void TaskStack::report(TickOutput& out) const {
  for (std::size_t level = 0; level < config_.tasks.size(); ++level) {
    const Task& task = tasks_[level];
    out.tasks[level] = {task_name(config_.tasks[level]), task.rate, task.activation,
                        residual(task, out.qd)};
  }
}

bool TaskStack::is_singular(const JointVector& qd) const {
  if (!(qd.norm() < kAtRest)) return false;
  for (std::size_t level = 0; level < config_.tasks.size(); ++level) {
    if (!std::holds_alternative<Reach>(config_.tasks[level])) {
      // What avoids or keeps a limit may well hold against the goal.
      if ((tasks_[level].activation.array() > 0.0).any()) return false;
    } else if (tasks_[level].rate.norm() > kAsked) {
      return true;
    }
  }
  return false;
}

double TaskStack::links_within(const TickOutput& out) const {
  if (config_.control_point == ControlPoint::kSensor) return 0.0;
  double within = 0.0;
  for (const TaskSpec& task : config_.tasks) {
    const auto* spec = std::get_if<Avoidance>(&task);
    if (spec == nullptr || spec->nearest == 1) continue;
    // The nearest link is reported even where nothing is active yet.
    const double nearest =
        out.pair_distance() < kInfinity ? out.pair_distance() + kJustBeyond : 0.0;
    within = std::max({within, spec->d_min + spec->buffer, nearest});
  }
  return within;
}

double TaskStack::engaged_within() const {
  double reach = 0.0;
  if (config_.control_point == ControlPoint::kSensor) return reach;  // another point is moved
  for (const TaskSpec& task : config_.tasks) {
    if (const auto* avoid = std::get_if<Avoidance>(&task))
      reach = std::max(reach, avoid->d_min + avoid->buffer);
  }
  return reach;
}

ControllerConfig retuned(const ControllerConfig& config, const std::vector<TaskSpec>& tasks,
                         const Robot& robot) {
  const std::vector<TaskSpec>& mine = config.tasks;
  const bool same =
      std::equal(tasks.begin(), tasks.end(), mine.begin(), mine.end(),
                 [](const TaskSpec& a, const TaskSpec& b) { return a.index() == b.index(); });
  if (!same) {
    std::string names;
    for (const TaskSpec& task : mine)
      names += std::string(names.empty() ? "" : ", ") + task_name(task);
    throw ConfigError("tasks: other values are taken for the same tasks in the same order: " +
                      names);
  }
  for (std::size_t level = 0; level < tasks.size(); ++level) {
    const auto* to = std::get_if<SelfCollision>(&tasks[level]);
    if (to != nullptr && to->pairs != std::get<SelfCollision>(mine[level]).pairs)
      throw ConfigError("self_collision.pairs: are chosen at set-up; the other values may change");
  }
  ControllerConfig changed = config;
  changed.tasks = tasks;
  validate(changed);
  for (const TaskSpec& task : tasks) validate(task, robot);
  return changed;
}

}  // namespace proxcgal::detail
