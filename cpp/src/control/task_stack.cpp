#include "task_stack.hpp"

#include <algorithm>
#include <string>

#include "proxcgal/error.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kJustBeyond = 1e-6;  // [m]

}  // namespace

TaskStack::TaskStack(const Robot& robot, const Skin& skin, const ControllerConfig& config)
    : robot_(robot), skin_(skin), config_(config), self_collision_pairs_(robot, config) {
  for (const TaskSpec& task : config.tasks) validate(task, robot);
}

void TaskStack::build_rows(const Avoidance& spec, std::size_t level, const Posture& posture,
                           const PointsRef& cloud_W, const ObstacleVelocities& velocities,
                           ControlPoints& control_points, const TrustedDistance& trusted,
                           TickOutput& out, Monitor& monitor) {
  std::span<const ControlPair> controls;
  if (config_.control_point == ControlPoint::kSensor) {
    controls = control_points.sensor(skin_, posture, cloud_W, velocities);
  } else if (spec.nearest > 1) {
    // The nearest link is told even where nothing is active yet.
    const double nearest =
        out.pair_distance() < kInfinity ? out.pair_distance() + kJustBeyond : 0.0;
    const double within = std::max(spec.d_min + spec.buffer, nearest);
    controls =
        control_points.links(robot_, posture, cloud_W, spec.nearest, within, velocities, monitor);
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
  if (!pairs.empty() && out.own.a < 0) out.own = pairs.front();
  build_self_collision(spec, robot_, posture, pairs, built_[level]);
}

void TaskStack::build(const Posture& posture, const PointsRef& cloud_W,
                      const ObstacleVelocities& velocities, const Pose& goal,
                      ControlPoints& control_points, const TrustedDistance& trusted,
                      TickOutput& out, Monitor& monitor) {
  for (std::size_t level = 0; level < config_.tasks.size(); ++level) {
    BuiltTask& task = built_[level];
    std::visit(
        [&](const auto& spec) {
          using Spec = std::decay_t<decltype(spec)>;
          if constexpr (std::is_same_v<Spec, Avoidance>)
            build_rows(spec, level, posture, cloud_W, velocities, control_points, trusted, out,
                       monitor);
          if constexpr (std::is_same_v<Spec, Reach>) build_reach(spec, robot_, posture, goal, task);
          if constexpr (std::is_same_v<Spec, JointLimits>)
            build_joint_limits(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, MinimumAltitude>)
            build_minimum_altitude(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, Manipulability>)
            build_manipulability(spec, robot_, posture, task);
          if constexpr (std::is_same_v<Spec, SelfCollision>)
            build_rows(spec, level, posture, out, monitor);
        },
        config_.tasks[level]);
    const bool active = (task.task.activation.array() > 0.0).any();
    if (task.smallest_row_norm < kSmallRowNorm && active)
      monitor.add({.reason = Reason::kRowSmall});
    tasks_[level] = task.task;
  }
}

void TaskStack::catch_up(std::span<const JointVector> levels, const Admissible& box,
                         JointVector& qd) const {
  for (std::size_t level = config_.tasks.size(); level-- > 0;) {
    if (!is_avoidance(level)) continue;
    Admissible free = box;
    for (std::size_t upper = 0; upper < level; ++upper) {
      if (is_avoidance(upper)) continue;
      const Task& task = tasks_[upper];
      for (Eigen::Index row = 0; row < task.activation.size(); ++row) {
        if (!(task.activation[row] > 0.0)) continue;
        for (Eigen::Index joint = 0; joint < qd.size(); ++joint) {
          if (task.jacobian(row, joint) == 0.0) continue;
          free.low[joint] = free.high[joint] = qd[joint];
        }
      }
    }
    proxcgal::catch_up(levels, tasks_[level], free, qd);
  }
}

void TaskStack::report(TickOutput& out) const {
  for (std::size_t level = 0; level < config_.tasks.size(); ++level) {
    const Task& task = tasks_[level];
    out.tasks[level] = {task_name(config_.tasks[level]), task.rate, task.activation,
                        residual(task, out.qd)};
  }
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
