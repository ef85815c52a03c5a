#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <utility>

#include "proxcgal/error.hpp"
#include "proxcgal/safety/guard.hpp"

namespace proxcgal {
namespace {

constexpr double kSlack = 1e-9;  ///< [m] or [s]: 0.35 s times 1.30 m/s is 0.455 m
constexpr int kPostures = 2000;

void require_joints(const JointVector& values, Eigen::Index n, const char* field) {
  require(values.size() == n && values.allFinite(), field, values.transpose(),
          std::to_string(n) + " finite numbers, one a joint");
}

std::string text_of(std::initializer_list<std::string> parts) {
  std::string text;
  for (const std::string& part : parts) text += part;
  return text;
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(4);
  text << value;
  return text.str();
}

void add_distances(const GuardConfig& config, std::vector<Contradiction>& found) {
  const auto check = [&](const char* item, const char* name, double speed) {
    const double way = config.timing.stop_time * speed;
    if (config.separation.min_distance >= way - kSlack) return;
    found.push_back(
        {item, text_of({"min_distance = ", number(config.separation.min_distance), " m: at ", name,
                        " = ", number(speed), " m/s the arm covers ", number(way),
                        " m in the stopping time of ", number(config.timing.stop_time), " s"})});
  };
  check("stopping_distance", "tcp_speed", config.tcp_speed);
  check("closing_distance", "max_velocity", config.separation.max_velocity);
}

void add_joints(const Robot& robot, const SafetyLimits& limits, const JointVector& qdd_max,
                double stop_time, std::vector<Contradiction>& found) {
  for (Eigen::Index k = 0; k < limits.qd.size(); ++k) {
    const double needed = limits.qd[k] / qdd_max[k];
    if (needed <= stop_time + kSlack) continue;
    const std::string& name = robot.spec().joints[static_cast<std::size_t>(k)].name;
    found.push_back(
        {"joint_stop." + name,
         text_of({name, " needs ", number(needed), " s to stop from ", number(limits.qd[k]),
                  " rad/s, its bound by eq. (1), at ", number(qdd_max[k]),
                  " rad/s^2, its maximum; declared are ", number(stop_time), " s"})});
  }
}

/// The same numbers everywhere: no library's generator decides what a file may say.
class Draw {
 public:
  double operator()(double low, double high) {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return low + (high - low) * (static_cast<double>(state_ >> 11) / 9007199254740992.0);
  }

 private:
  std::uint64_t state_ = 1;
};

/// What a joint is drawn from: its range, of which one turn tells all.
std::pair<double, double> range_of(const Robot& robot, Eigen::Index k) {
  constexpr double pi = std::numbers::pi, rail = 10.0;  // [m] of one without limits
  const double low = robot.q_min()[k], high = robot.q_max()[k];
  const bool turns = robot.spec().joints[static_cast<std::size_t>(k)].type == JointType::kRevolute;
  if (turns && low <= -pi && high >= pi) return {-pi, pi};
  const double span = turns ? 2.0 * pi : rail;
  if (std::isinf(low)) return {std::min(high, 0.5 * span) - span, std::min(high, 0.5 * span)};
  return {low, turns || std::isinf(high) ? std::min(high, low + span) : high};
}

void add_pairs(const Robot& robot, const Separation& separation,
               std::vector<Contradiction>& found) {
  std::vector<double> best(separation.pairs().size(), -kInfinity);
  const double least = separation.config().min_distance;
  Posture posture = robot.make_posture();
  JointVector q(robot.n_q());
  Draw draw;
  for (int i = 0; i < kPostures; ++i) {
    for (Eigen::Index k = 0; k < q.size(); ++k) {
      const auto [low, high] = range_of(robot, k);
      q[k] = draw(low, high);
    }
    robot.update(q, posture);
    bool all_fine = true;
    for (std::size_t pair = 0; pair < best.size(); ++pair) {
      if (best[pair] >= least) continue;
      best[pair] = std::max(best[pair], separation.distance(separation.pairs()[pair], posture));
      all_fine = all_fine && best[pair] >= least;
    }
    if (all_fine) return;
  }
  for (std::size_t pair = 0; pair < best.size(); ++pair) {
    if (best[pair] >= least) continue;
    const std::string& name =
        separation.capsules()[static_cast<std::size_t>(separation.pairs()[pair])].name;
    found.push_back(
        {"pair." + name,
         text_of({name, " is at most ", number(best[pair]), " m from the operator's capsule in ",
                  std::to_string(kPostures), " postures: min_distance = ", number(least),
                  " m is violated in every one"})});
  }
}

}  // namespace

std::vector<Contradiction> contradictions(const Robot& robot, const GuardConfig& config) {
  validate(config);
  const Eigen::Index n = robot.n_q();
  require_joints(config.q_reference, n, "q_reference");
  require((config.q_reference.array() >= robot.q_min().array()).all() &&
              (config.q_reference.array() <= robot.q_max().array()).all(),
          "q_reference", config.q_reference.transpose(), "within the joints' ranges [rad]");
  const JointVector qd_max = config.qd_max.size() > 0 ? config.qd_max : robot.qd_max();
  const JointVector qdd_max = config.qdd_max.size() > 0 ? config.qdd_max : robot.qdd_max();
  require_joints(qd_max, n, "qd_max");
  require_joints(qdd_max, n, "qdd_max");
  const Separation separation(robot, config.capsules, config.separation, config.timing.stop_time);
  const SafetyLimits limits = basic_limits(robot, config.q_reference, config.tcp_speed, qd_max,
                                           qdd_max, config.timing.stop_time);
  const SafetyLogic checked(limits, config.timing);  // throws where a number can't be
  std::vector<Contradiction> found;
  add_distances(config, found);
  add_joints(robot, limits, qdd_max, config.timing.stop_time, found);
  add_pairs(robot, separation, found);
  return found;
}

}  // namespace proxcgal
