#include "arm_following.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal::detail {
namespace {

constexpr double kWindow = 0.05;  // [s] and at least three ticks
constexpr double kMargin = 0.02;  // [s] of delay that no configuration names
constexpr double kLags = 3.0;     // time constants after which a first-order lag has died away
constexpr double kNoise = 0.03;   // [rad/s] or [m/s] of a mean velocity

}  // namespace

ArmFollowing::ArmFollowing(const LimitConfig& config, double period, double tolerance)
    : tolerance_(tolerance),
      window_(std::max(kWindow, 3.0 * period)),
      delay_(config.joint_state_age + config.dead_time + kLags * config.lag + period + kMargin) {}

int ArmFollowing::judge(double time, const JointVector& q) const {
  if (!std::isfinite(tolerance_)) return -1;
  const std::size_t n = std::min(count_, kKept);
  std::size_t first = 0;  // of the window
  while (first < n && time - entry(first).time < window_) ++first;
  if (first == n) return -1;
  JointVector least = entry(0).qd, most = least;
  bool reached = false;  // the arm's delay before the window is known
  for (std::size_t back = 0; back < n && !reached; ++back) {
    least = least.cwiseMin(entry(back).qd);
    most = most.cwiseMax(entry(back).qd);
    reached = entry(back).time <= entry(first).time - delay_;
  }
  if (!reached) {  // at rest before
    least = least.cwiseMin(0.0);
    most = most.cwiseMax(0.0);
  }
  const double span = time - entry(first).time;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const double mean = (q[j] - entry(first).q[j]) / span;
    const double room = kNoise + tolerance_ * std::max(std::abs(least[j]), std::abs(most[j]));
    if (mean < least[j] - room || mean > most[j] + room) return static_cast<int>(j);
  }
  return -1;
}

void ArmFollowing::command(double time, const JointVector& q, const JointVector& qd) {
  Entry& next = kept_[count_++ % kKept];
  next.time = time;
  next.q = q;
  next.qd = qd;
}

}  // namespace proxcgal::detail
