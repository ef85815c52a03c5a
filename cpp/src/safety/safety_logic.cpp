#include "proxcgal/safety/safety_logic.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

constexpr double kTimeSlack = 1e-9;  ///< [s] rounding of the caller's clock

bool positive(const JointVector& values) {
  return values.allFinite() && values.size() > 0 && values.minCoeff() > 0.0;
}

}  // namespace

const char* function_name(SafetyFunction function) {
  constexpr const char* names[kSafetyFunctions] = {"input",
                                                   "cycle",
                                                   "tcp_speed",
                                                   "joint_speed",
                                                   "joint_acceleration",
                                                   "distance",
                                                   "relative_velocity"};
  return names[static_cast<std::size_t>(function)];
}

SafetyLimits basic_limits(const Robot& robot, const JointVector& q, double tcp_speed,
                          const JointVector& qd_max, const JointVector& qdd_max, double stop_time) {
  Posture posture = robot.make_posture();
  robot.update(q, posture);
  Jacobian6 J;
  robot.tool_jacobian(posture, J);
  SafetyLimits limits{tcp_speed, qd_max, qdd_max};
  for (Eigen::Index k = 0; k < qd_max.size(); ++k) {
    const double lever = J.col(k).head<3>().norm();
    if (lever > 0.0) limits.qd[k] = std::min(qd_max[k], tcp_speed / lever);  // eq. (1)
    limits.qdd[k] = std::min(qdd_max[k], limits.qd[k] / stop_time);          // eq. (2)
  }
  return limits;
}

void check(const SafetyTiming& timing, const std::string& path) {
  require(timing.max_gap >= timing.period, path + "max_gap", detail::with_unit(timing.max_gap, "s"),
          "at least the period of " + detail::with_unit(timing.period, "s"));
}

SafetyLogic::SafetyLogic(SafetyLimits limits, SafetyTiming timing)
    : limits_(std::move(limits)), timing_(timing) {
  require(limits_.tcp_speed > 0.0, "tcp_speed", limits_.tcp_speed, "above 0 m/s");
  require(positive(limits_.qd), "joint speed bounds", limits_.qd.transpose(), "above 0 rad/s");
  require(positive(limits_.qdd) && limits_.qdd.size() == limits_.qd.size(),
          "joint acceleration bounds", limits_.qdd.transpose(), "above 0 rad/s^2, one a joint");
  validate(timing_);
  qd_last_.setZero(limits_.qd.size());
}

void SafetyLogic::violate(SafetyFunction function, double value, double limit, int row) {
  if (output_.violated == 0) found_ = {function, 0.0, value, limit, row};
  output_.violated |= 1U << static_cast<unsigned>(function);
}

void SafetyLogic::check(const SafetyInput& input) {
  output_.violated = 0;
  output_.speed_ratio = output_.acceleration_ratio = 0.0;
  if (!input.finite) return violate(SafetyFunction::kInput, 0.0, 0.0, -1);
  const double gap = input.time - time_last_;
  if (!first_ && !(gap > 0.0 && gap <= timing_.max_gap))
    violate(SafetyFunction::kCycle, gap, timing_.max_gap, -1);
  // Eq. (3), line by line.
  if (!(input.tcp_speed <= limits_.tcp_speed))
    violate(SafetyFunction::kTcpSpeed, input.tcp_speed, limits_.tcp_speed, -1);
  Eigen::Index k = 0;
  output_.speed_ratio = input.qd.cwiseAbs().cwiseQuotient(limits_.qd).maxCoeff(&k);
  if (!(output_.speed_ratio <= 1.0))
    violate(SafetyFunction::kJointSpeed, std::abs(input.qd[k]), limits_.qd[k], static_cast<int>(k));
  if (!first_ && gap > 0.0) {
    const JointVector qdd = ((input.qd - qd_last_) / gap).cwiseAbs();
    output_.acceleration_ratio = qdd.cwiseQuotient(limits_.qdd).maxCoeff(&k);
    if (!(output_.acceleration_ratio <= 1.0))
      violate(SafetyFunction::kJointAcceleration, qdd[k], limits_.qdd[k], static_cast<int>(k));
  }
  // Eq. (4), from the functional logic.
  if (!input.distance_ok)
    violate(SafetyFunction::kDistance, input.distance, input.min_distance, input.pair);
  if (!input.velocity_ok)
    violate(SafetyFunction::kRelativeVelocity, input.velocity, input.max_velocity, input.end);
}

void SafetyLogic::advance(const SafetyInput& input, bool pressed) {
  const bool rest = input.finite && input.qd.cwiseAbs().maxCoeff() <= timing_.rest_speed;
  // A clock that stands still or jumps must not hide how long a stop takes.
  since_cut_ += std::isfinite(input.time) ? std::max(timing_.period, input.time - time_seen_)
                                          : timing_.period;
  const bool in_time = since_cut_ <= timing_.stop_time + kTimeSlack;
  switch (output_.state) {
    case TorqueState::kOn:
      if (output_.violated == 0) break;
      output_.state = TorqueState::kStopping;
      output_.trip = found_;
      output_.trip.time = input.time;
      output_.stop_time = since_cut_ = 0.0;
      ++output_.trips;
      break;
    case TorqueState::kStopping:
      output_.stop_time = since_cut_;
      if (!in_time) output_.overrun = true;
      if (rest) output_.state = TorqueState::kOff;
      break;
    case TorqueState::kOff:
      if (input.finite && !rest && output_.trips > 0) {
        // Weight moves an arm until its brakes have closed, also one that stood or turned round.
        if (in_time) {
          output_.state = TorqueState::kStopping;
          output_.stop_time = since_cut_;
        } else {
          output_.overrun = true;
        }
      }
      if (pressed && rest && !first_ && output_.violated == 0 && !output_.overrun)
        output_.state = TorqueState::kOn;
      break;
  }
}

const SafetyOutput& SafetyLogic::cycle(const SafetyInput& input) {
  check(input);
  const bool pressed = input.reset && !reset_last_;
  const bool was_on = output_.state == TorqueState::kOn;
  advance(input, pressed);
  output_.torque = output_.state == TorqueState::kOn;
  output_.reset_refused = pressed && !output_.torque && !was_on;
  reset_last_ = input.reset;
  first_ = false;
  if (std::isfinite(input.time)) time_seen_ = input.time;
  if (input.finite) {
    qd_last_ = input.qd;
    time_last_ = input.time;
  }
  return output_;
}

}  // namespace proxcgal
