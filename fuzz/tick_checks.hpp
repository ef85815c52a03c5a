#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "perception/monotonic_clock.hpp"
#include "proxcgal/control/controller.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/limit.hpp"

/// What every tick owes, whatever it is given: goal 1 of docs/reliability.md.
namespace proxcgal::fuzz {

/// How often a promise that depends on the scene was put to the test.
struct TickCounts {
  int usable = 0;   ///< ticks whose joint state, goal and points could be used
  int inside = 0;   ///< of them, those inside d_min
  int outside = 0;  ///< joints seen outside their position limits
};

class TickChecks {
 public:
  explicit TickChecks(const Controller& controller)
      : controller_(controller),
        robot_(controller.robot()),
        posture_(robot_.make_posture()),
        last_(JointVector::Zero(robot_.n_q())),
        before_(last_),
        clock_(controller.config().period),
        limiter_({robot_.q_min(), robot_.q_max(), robot_.qd_max(), robot_.qdd_max()},
                 controller.config().limit, controller.config().period) {
    for (const TaskSpec& task : controller.config().tasks) {
      if (const auto* avoidance = std::get_if<Avoidance>(&task)) d_min_ = avoidance->d_min;
    }
  }

  /// The last command that was issued.
  const JointVector& last() const { return last_; }
  const TickCounts& counts() const { return counts_; }
  /// @param time  of the tick to come, on the caller's clock: a good one counts, by the fiftieth
  ///              part of the nominal period at least
  void before(double time) {
    before_ = last_;
    clock_.advance(time);
  }
  /// [s] that the arm has moved with the last command.
  double step() const { return clock_.elapsed(); }

  /// Did the last tick find fault with a sensor?
  bool blames_a_sensor() const {
    for (const Finding& finding : controller_.findings())
      if (finding.sensor >= 0) return true;
    return false;
  }

  /// @param q        given to the tick
  /// @param cloud_W  that the tick avoided, null where it had to refuse what it was given
  /// @return what was violated, empty for nothing
  std::string after(const JointVector& q, const Points* cloud_W, const TickOutput& out) {
    problem_.str("");
    limiter_.begin(q.size() == robot_.n_q() && q.allFinite() ? q : posture_.q, before_, step());
    if (out.qd.size() != robot_.n_q() || !out.qd.allFinite()) {
      problem_ << "command " << out.qd.transpose() << " is not finite";
      return problem_.str();
    }
    last_ = out.qd;
    const bool usable =
        cloud_W != nullptr && q.size() == robot_.n_q() && q.allFinite() && !refused();
    for (Eigen::Index j = 0; j < robot_.n_q(); ++j) {
      check_rates(j);
      if (usable) check_room(j, q[j]);
      if (!usable && std::abs(last_[j]) > std::abs(before_[j]) + kTolerance)
        problem_ << "joint " << j << " speeds up on input that cannot be used; ";
    }
    if (!usable) return problem_.str();
    ++counts_.usable;
    const bool whole_body = controller_.config().control_point == ControlPoint::kWholeBody;
    if (whole_body) check_approach(q, *cloud_W, out);
    if (!problem_.str().empty()) {
      problem_ << "q = " << q.transpose() << "; last = " << before_.transpose()
               << "; qd = " << last_.transpose() << "; mode " << static_cast<int>(out.mode);
    }
    return problem_.str();
  }

 private:
  static constexpr double kTolerance = 1e-9;

  /// [s] that the joints had to change their velocity in.
  double window() const { return std::min(step(), limiter_.max_period()); }

  bool refused() const {
    for (const Finding& finding : controller_.findings()) {
      if (brakes_only(finding.reason) || finding.reason == Reason::kPointsInvalid) return true;
    }
    return false;
  }
  bool found(Reason reason) const {
    for (const Finding& finding : controller_.findings())
      if (finding.reason == reason) return true;
    return false;
  }

  void check_rates(Eigen::Index j) {
    const double qd = last_[j], fastest = robot_.qd_max()[j];
    const double step = robot_.qdd_max()[j] * window();
    if (std::abs(qd) > fastest + kTolerance)
      problem_ << "joint " << j << " at " << qd << ", at most " << fastest << " is allowed; ";
    if (std::abs(qd - before_[j]) > step + kTolerance)
      problem_ << "joint " << j << " from " << before_[j] << " to " << qd << ", a step of at most "
               << step << " is allowed; ";
  }

  /// Braking as hard as it may, does the joint come to rest inside its position limits? Where it
  /// could not even by braking now, it must be braking now.
  void check_room(Eigen::Index j, double q) {
    const double dt = controller_.config().period, step = robot_.qdd_max()[j] * dt;
    const double qd = last_[j];
    const double sign = qd > 0.0 ? 1.0 : -1.0;
    const double room = sign > 0.0 ? robot_.q_max()[j] - q : q - robot_.q_min()[j];
    if (room < 0.0) ++counts_.outside;
    const double most = robot_.qdd_max()[j] * window();
    const bool brakes = sign * (qd - before_[j]) <= -most + kTolerance;
    const double ticks = std::floor(std::abs(qd) / step) + 1.0;
    const double way = dt * ticks * (std::abs(qd) - 0.5 * step * (ticks - 1.0));
    if (std::abs(qd) > kTolerance && !brakes && way > std::max(room, 0.0) + kTolerance) {
      problem_ << "joint " << j << " at " << q << " moves at " << qd << ": to brake takes " << way
               << ", " << room << " is left; ";
    }
  }

  /// Inside d_min nothing comes nearer along the closest direction, and nearer than d_stop no link
  /// to any point, faster than braking allows; and the pair is no farther than what the cloud
  /// holds.
  void check_approach(const JointVector& q, const Points& cloud_W, const TickOutput& out) {
    robot_.update(q, posture_);
    check_pair(cloud_W, out);
    check_stop(cloud_W);
    if (!out.pair || !(out.pair->distance < d_min_)) return;
    ++counts_.inside;
    check_row(*out.pair, "in d_min");
  }

  void check_stop(const Points& cloud_W) {
    if (cloud_W.rows() == 0 || found(Reason::kWorkBounded)) return;
    for (int link = 0; link < robot_.n_links(); ++link) {
      if (robot_.spec().links[static_cast<std::size_t>(link)].joint < 0) continue;
      const ClosestPair pair =
          closest_pair(robot_, posture_, cloud_W, Method::kFast, {.links = std::span(&link, 1)});
      if (pair.found() && pair.distance < controller_.config().limit.d_stop)
        check_row(pair, "in d_stop");
    }
  }

  void check_row(const ClosestPair& pair, const char* where) {
    if (pair.distance < 1e-6) return;  // no direction is left to tell
    const Pose& T_WL = posture_.T_WL[static_cast<std::size_t>(pair.link)];
    const bool inside = robot_.tree(pair.link).inside(T_WL.inverse() * pair.obstacle_W);
    const ControlPair control{.link = pair.link,
                              .control_W = pair.surface_W,
                              .obstacle_W = pair.obstacle_W,
                              .distance = inside ? -pair.distance : pair.distance};
    const JointVector row = opening_row(robot_, posture_, control);
    const double least = std::min(0.0, row.dot(limiter_.state().qd_brake));
    if (row.dot(last_) < least - kTolerance) {
      problem_ << "link " << pair.link << ", " << control.distance << " m from an obstacle ("
               << where << "), opens at " << row.dot(last_) << " m/s; braking gives " << least
               << "; ";
    }
  }

  void check_pair(const Points& cloud_W, const TickOutput& out) {
    if (cloud_W.rows() == 0 || found(Reason::kWorkBounded)) return;
    double nearest = kInfinity;
    int link = -1;
    for (int l = 0; l < robot_.n_links(); ++l) {
      if (robot_.spec().links[static_cast<std::size_t>(l)].joint < 0) continue;
      const ClosestPair pair =
          closest_pair(robot_, posture_, cloud_W, Method::kFast, {.links = std::span(&l, 1)});
      ControlPair control;
      control.link = l;
      control.control_W = pair.surface_W;
      control.obstacle_W = pair.obstacle_W;
      control.distance = pair.distance;
      const double norm = row_norm(robot_, posture_, control);
      // At the bound itself rounding decides.
      if (norm < controller_.config().min_row_norm * (1.0 + 1e-6) || !(pair.distance < nearest))
        continue;
      nearest = pair.distance;
      link = l;
    }
    if (!(nearest < d_min_) || (out.pair && out.trusted_distance <= nearest + kTolerance)) return;
    problem_ << "link " << link << " is " << nearest << " m from the cloud, the pair "
             << (out.pair ? out.trusted_distance : kInfinity) << "; ";
  }

  const Controller& controller_;
  const Robot& robot_;
  Posture posture_;
  JointVector last_, before_;
  detail::MonotonicClock clock_;
  Limiter limiter_;
  double d_min_ = 0.0;
  TickCounts counts_;
  std::ostringstream problem_;
};

}  // namespace proxcgal::fuzz
