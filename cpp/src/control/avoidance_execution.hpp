#pragma once
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"
#include "task_stack.hpp"
#include "trusted_distance.hpp"

namespace proxcgal::detail {

/// Did avoidance get what it asked for, and if not, for how long has that been so?
class AvoidanceExecution {
 public:
  explicit AvoidanceExecution(const ControllerConfig& config);

  /// Reports every row that the command gives less than half of its rate, and an arm that is stuck.
  /// @param time  [s] of the controller's own clock
  void judge(double time, const TaskStack& stack, const TrustedDistance& trusted,
             const TickOutput& out, Monitor& monitor);

 private:
  void stuck(double time, int link, Monitor& monitor);

  double stuck_after_;  // [s]
  bool whole_body_;
  double stuck_since_ = -1.0;  // [s] negative while avoidance is executed
};

}  // namespace proxcgal::detail
