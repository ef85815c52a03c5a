/// What the rows of the limit stage ask for: equations (0), (1) and the rates of (2).
#include <algorithm>
#include <cmath>

#include "proxcgal/error.hpp"
#include "proxcgal/pipeline/limit.hpp"

namespace proxcgal {
namespace {

constexpr double kForget = 0.97;        // of a long interval a tick
constexpr double kLongestPeriod = 0.5;  // [s] a longer interval is a fault of the clock
constexpr double kRetreatRise = 20.0;   // [1/s] of the bound on retreat beyond d_stop
constexpr double kContactSpeed = 0.5;   // [m/s] assumed approach in the time to contact
constexpr double kContactTime = 0.25;   // [s] at which a row's weight is half

}  // namespace

double viable_speed(double room, double a, double D) {
  if (!(room > 0.0)) return 0.0;
  if (std::isinf(room)) return kInfinity;
  if (std::isinf(a)) return room / D;
  const double steps = room / (a * D * D);
  if (!(steps < 1e12)) return std::sqrt(2.0 * a * room);  // D too small to tell from 0
  const double k = std::floor(0.5 * (std::sqrt(1.0 + 8.0 * steps) - 1.0));
  return a * D * (k + (steps - 0.5 * k * (k + 1.0)) / (k + 1.0));
}

void check(const LimitConfig& config, const std::string& path) {
  require(config.near_distance >= config.d_stop, path + "near_distance",
          detail::with_unit(config.near_distance, "m"),
          "at least d_stop = " + detail::with_unit(config.d_stop, "m"));
}

void LimitConfig::require_stable(double gain, double period) const {
  const double delay = loop_delay(period);
  require(gain * delay <= std::exp(-1.0), "gain x (joint_state_age + period + dead_time + lag)",
          gain * delay,
          "at most 1/e = 0.368: gain " + std::to_string(gain) + " 1/s, delay " +
              std::to_string(delay) + " s");
}

void PeriodBound::update(double interval) {
  longest_ *= kForget;
  if (interval > longest_) longest_ = std::min(interval, kLongestPeriod);
}

double PeriodBound::value() const { return std::max(3.0 * period_, margin_ * longest_); }

void joint_interval(const Limits& limits, const JointVector& q, const JointVector& qd_last,
                    double elapsed, double max_period, JointInterval& out) {
  // Let S(v) be the distance covered from velocity v when each command is held for D = max_period
  // and the next is slower by a D: S(v) = v D + S(v - a D), S = 0 for v <= 0. A velocity is viable
  // where S(v) <= room. S is convex and piecewise linear, its slope at v is D ceil(v / (a D)).
  //
  // Claim: S(v) - v h >= S(v - a h) for 0 <= h <= D. At h = 0 both sides agree, at h = D by
  // definition. The left side is linear in h and the right side convex in h, so between them the
  // chord, which the left side is, lies above the right side.
  //
  // So a viable command held for any h <= D leaves room' = room - v h >= S(v - a h): v - a h is
  // viable again, and the acceleration limit allows it after the time h. Any sequence of intervals
  // up to D keeps a viable command inside both. Both bounds are clamped to one and the same window
  // of acceleration and steady_low <= 0 <= steady_high, so low <= high even where no viable
  // command is within reach: then the joint brakes as hard as it may.
  const auto n = q.size();
  out.low.resize(n);
  out.high.resize(n);
  const double window = std::clamp(elapsed, 0.0, max_period);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double a = limits.qdd_max[j];
    const double low =
        -std::min(limits.qd_max[j], viable_speed(q[j] - limits.q_min[j], a, max_period));
    const double high =
        std::min(limits.qd_max[j], viable_speed(limits.q_max[j] - q[j], a, max_period));
    out.low[j] = std::clamp(low, qd_last[j] - a * window, qd_last[j] + a * window);
    out.high[j] = std::clamp(high, qd_last[j] - a * window, qd_last[j] + a * window);
  }
}

void brake_together(const Limits& limits, const JointVector& qd_last, double elapsed,
                    const JointInterval& interval, JointVector& out) {
  const double tau = (qd_last.cwiseAbs().array() / limits.qdd_max.array()).maxCoeff();
  const double rest = tau > elapsed ? 1.0 - std::max(elapsed, 0.0) / tau : 0.0;
  out = (rest * qd_last).cwiseMax(interval.low).cwiseMin(interval.high);
}

double approach_speed(const LimitConfig& config, const ApproachCap& cap, double reaction,
                      double braking_time) {
  const double room = cap.distance - cap.stop;
  if (!(room > 0.0)) return 0.0;
  const double T = reaction + 0.5 * braking_time;
  const double c = std::min(room / T, cap.speed);
  if (!(cap.near > 0.0)) return c;
  // With a lag the arm's speed nears the command's exponentially: two time constants more.
  const double beyond = cap.distance - cap.near - 2.0 * config.lag * config.near_speed;
  if (!(beyond > 0.0)) return std::min(c, config.near_speed);
  if (std::isinf(beyond)) return c;
  // c reaction + (c^2 - near_speed^2) / (2 a) = beyond, a = c / braking_time.
  const double v = config.near_speed;
  const double to_near =
      (beyond + std::sqrt(beyond * beyond + 2.0 * T * braking_time * v * v)) / (2.0 * T);
  return std::min(c, std::max(v, to_near));
}

double approach_distance(const LimitConfig& config, const ApproachCap& cap, double speed,
                         double reaction, double braking_time) {
  const double T = reaction + 0.5 * braking_time;
  const double stopped = cap.stop + speed * T;
  const double v = config.near_speed;
  if (!(cap.near > 0.0) || !(speed > v)) return stopped;
  const double beyond = speed * reaction + 0.5 * braking_time * (speed - v * v / speed);
  return std::max(stopped, cap.near + 2.0 * config.lag * v + beyond);
}

double retreat_rate(const LimitConfig& config, const RetreatRow& row) {
  const double rate = std::max(0.0, row.obstacle_rate) + row.gain * (row.d_min - row.distance);
  const double beyond = std::max(0.0, row.distance - config.d_stop);
  return std::min({rate, config.retreat_speed + kRetreatRise * beyond, row.speed});
}

double retreat_weight(const RetreatRow& row) {
  const double closing = kContactSpeed + std::max(0.0, row.obstacle_rate);
  const double contact = std::max(0.0, row.distance) / closing;
  return std::max(1e-3, kContactTime / (kContactTime + contact));
}

}  // namespace proxcgal
