#include "avoidance_execution.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kExecuted = 0.5;   // share of the demanded rate that counts as executed
constexpr double kEngaged = 0.5;    // activation from which avoidance must be executed
constexpr double kRounding = 1e-9;  // [s] of sums of periods: it decides about no tick

}  // namespace

AvoidanceExecution::AvoidanceExecution(const ControllerConfig& config)
    : stuck_after_(config.monitor.stuck_after),
      whole_body_(config.control_point == ControlPoint::kWholeBody) {}

void AvoidanceExecution::judge(double time, const TaskStack& stack, const TrustedDistance& trusted,
                               const TickOutput& out, Monitor& monitor) {
  // Outside d_min the goal may well hold against it: there the arm may come to rest.
  // The baseline moves another point than the pair's, and is left as it is published.
  const bool may_be_stuck = whole_body_ && trusted.inside(out);
  int stuck_link = -1;
  for (std::size_t level = 0; level < stack.tasks().size(); ++level) {
    if (!stack.is_avoidance(level)) continue;
    const Task& task = stack.tasks()[level];
    const RowVector missing = residual(task, out.qd);
    for (Eigen::Index row = 0; row < task.rate.size(); ++row) {
      const double bearable = kExecuted * task.rate[row];
      const bool engaged = task.activation[row] > kEngaged && task.rate[row] > 0.0;
      if (!(engaged && missing[row] > bearable)) continue;
      monitor.add({.reason = Reason::kNotExecuted, .link = stack.link(level, row)});
      if (may_be_stuck && stuck_link < 0) stuck_link = stack.link(level, row);
    }
  }
  stuck(time, stuck_link, monitor);
}

void AvoidanceExecution::stuck(double time, int link, Monitor& monitor) {
  if (link < 0) {
    stuck_since_ = -1.0;
  } else if (stuck_since_ < 0.0) {
    stuck_since_ = time;
  } else if (time - stuck_since_ > stuck_after_ + kRounding) {
    monitor.add({.reason = Reason::kAvoidanceStuck, .link = link});
  }
}

}  // namespace proxcgal::detail
