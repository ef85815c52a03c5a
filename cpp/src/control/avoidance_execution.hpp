#pragma once
#include <span>

#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"
#include "proxcgal/pipeline/command.hpp"
#include "task_stack.hpp"
#include "trusted_distance.hpp"

namespace proxcgal::detail {

/// What a command was made of.
struct Commanded {
  std::span<const JointVector> levels;  ///< of the solver
  const JointVector& qd_last;
  const Admissible& box;
  bool cut_back;  ///< for what is not seen: more time would not help
};

/// Did avoidance get what it asked for, and if not, for how long has that been so?
class AvoidanceExecution {
 public:
  explicit AvoidanceExecution(const ControllerConfig& config);

  /// Tells every row that the command gives less than half of its rate, and an arm that is stuck.
  /// @param time  [s] of the controller's own clock
  void judge(double time, const TaskStack& stack, const Commanded& commanded,
             const TrustedDistance& trusted, const TickOutput& out, Monitor& monitor);

 private:
  void stuck(double time, int link, Monitor& monitor);

  double stuck_after_;  // [s]
  bool whole_body_;
  double stuck_since_ = -1.0;  // [s] negative while avoidance is executed
};

}  // namespace proxcgal::detail
