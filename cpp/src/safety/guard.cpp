#include "proxcgal/safety/guard.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

/// What `accept` names of all contradictions. @throws ConfigError  where it misses one, or names
/// what is none: a file must not go on accepting what has been mended.
std::vector<Contradiction> accepted_of(const Robot& robot, const GuardConfig& config) {
  std::vector<Contradiction> found = contradictions(robot, config);
  std::string lines, items;
  const auto is_accepted = [&](const std::string& item) {
    return std::find(config.accept.begin(), config.accept.end(), item) != config.accept.end();
  };
  for (const Contradiction& each : found) {
    items += (items.empty() ? "" : ", ") + each.item;
    if (!is_accepted(each.item))
      lines += (lines.empty() ? "" : "\n") + each.text + "; accept = [\"" + each.item +
               "\"] takes it as it is";
  }
  for (const std::string& item : config.accept) {
    const auto same = [&](const Contradiction& each) { return each.item == item; };
    if (std::any_of(found.begin(), found.end(), same)) continue;
    lines += (lines.empty() ? "" : "\n") + ("accept names " + item + ": ") +
             (items.empty() ? "there is nothing to accept" : "to accept are " + items);
  }
  if (!lines.empty()) throw ConfigError(lines);
  return found;
}

SafetyLimits limits_of(const Robot& robot, const GuardConfig& config) {
  return basic_limits(robot, config.q_reference, config.tcp_speed,
                      config.qd_max.size() > 0 ? config.qd_max : robot.qd_max(),
                      config.qdd_max.size() > 0 ? config.qdd_max : robot.qdd_max(),
                      config.timing.stop_time);
}

}  // namespace

Guard::Guard(std::shared_ptr<const Robot> robot, GuardConfig config)
    : robot_(std::move(robot)),
      config_(std::move(config)),
      accepted_(accepted_of(*robot_, config_)),
      separation_(*robot_, config_.capsules, config_.separation, config_.timing.stop_time),
      logic_(limits_of(*robot_, config_), config_.timing),
      posture_(robot_->make_posture()) {
  input_.min_distance = config_.separation.min_distance;
  input_.max_velocity = config_.separation.max_velocity;
  input_.qd.setZero(robot_->n_q());
}

double Guard::protective_distance() const {
  return proxcgal::protective_distance(config_.separation.iso, config_.tcp_speed,
                                       config_.timing.stop_time);
}

const GuardOutput& Guard::cycle(double time, const JointVector& q, const JointVector& qd,
                                bool reset, const Vector3& human_velocity_W) {
  const bool fits = q.size() == robot_->n_q() && qd.size() == robot_->n_q();
  input_.time = time;
  input_.reset = reset;
  input_.finite = fits && std::isfinite(time) && q.allFinite() && qd.allFinite() &&
                  human_velocity_W.allFinite();
  if (input_.finite) {
    robot_->update(q, posture_);
    Jacobian6 J;
    robot_->tool_jacobian(posture_, J);
    output_.tcp_speed = (J.topRows<3>() * qd).norm();
    output_.separation = separation_.update(*robot_, posture_, qd, human_velocity_W);
    input_.qd = qd;
    input_.tcp_speed = output_.tcp_speed;
    // The virtual digital IOs of Fig. 5: two booleans, and numbers only to tell.
    input_.distance_ok = output_.separation.distance_ok;
    input_.velocity_ok = output_.separation.velocity_ok;
    input_.distance = output_.separation.distance;
    input_.velocity = output_.separation.velocity;
    input_.pair = output_.separation.pair;
    input_.end = output_.separation.end;
  }
  output_.safety = logic_.cycle(input_);
  return output_;
}

}  // namespace proxcgal
