#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "perception/monotonic_clock.hpp"
#include "proxcgal/control/controller.hpp"
#include "proxcgal/pipeline/command.hpp"
#include "proxcgal/pipeline/distance.hpp"

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
        clock_(controller.config().period) {
    for (const TaskSpec& task : controller.config().tasks) {
      if (const auto* avoidance = std::get_if<Avoidance>(&task)) d_min_ = avoidance->d_min;
    }
  }

  /// The last command that was issued.
  const JointVector& last() const { return last_; }
  const TickCounts& counts() const { return counts_; }
  /// @param time  of the tick to come, on the caller's clock: a good one counts, by the nominal
  ///              period at most and by the fiftieth part of it at least
  void before(double time) {
    before_ = last_;
    clock_.advance(time);
    step_ = clock_.step();
  }
  /// [s] that the arm has moved with the last command.
  double step() const { return step_; }

  /// Did the last tick find fault with a sensor?
  bool blames_a_sensor() const {
    for (const Finding& finding : controller_.findings())
      if (finding.sensor >= 0) return true;
    return false;
  }

  /// @param q        given to the tick
  /// @param cloud_W  that the tick avoided, null where it had to refuse what it was given
  /// @return what was violated, empty for nothing
  std::string after(const JointVector& q, const Pose& goal, const Points* cloud_W,
                    const TickOutput& out) {
    problem_.str("");
    if (out.qd.size() != robot_.n_q() || !out.qd.allFinite()) {
      problem_ << "command " << out.qd.transpose() << " is not finite";
      return problem_.str();
    }
    last_ = out.qd;
    const bool usable = cloud_W != nullptr && q.size() == robot_.n_q() && q.allFinite() &&
                        goal.matrix().allFinite() && !refused();
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

  bool refused() const {
    for (const Finding& finding : controller_.findings()) {
      if (finding.reason == Reason::kJointStateInvalid || finding.reason == Reason::kGoalInvalid ||
          finding.reason == Reason::kPointsInvalid)
        return true;
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
    const double step = robot_.qdd_max()[j] * step_;
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
    const double most = robot_.qdd_max()[j] * step_;
    const bool brakes = sign * (qd - before_[j]) <= -most + kTolerance;
    const double ticks = std::floor(std::abs(qd) / step) + 1.0;
    const double way = dt * ticks * (std::abs(qd) - 0.5 * step * (ticks - 1.0));
    if (std::abs(qd) > kTolerance && !brakes && way > std::max(room, 0.0) + kTolerance) {
      problem_ << "joint " << j << " at " << q << " moves at " << qd << ": to brake takes " << way
               << ", " << room << " is left; ";
    }
  }

  /// Inside d_min, nothing comes nearer along the closest direction unless the limits leave no
  /// other choice; and the pair is no farther than what the cloud holds.
  void check_approach(const JointVector& q, const Points& cloud_W, const TickOutput& out) {
    robot_.update(q, posture_);
    check_pair(cloud_W, out);
    if (!out.pair || !(out.trusted_distance < d_min_)) return;
    ControlPair pair;
    pair.link = out.pair->link;
    pair.control_W = out.pair->surface_W;
    pair.obstacle_W = out.pair->obstacle_W;
    pair.distance = out.trusted_distance;
    if (out.pair->distance < 1e-6) return;  // no direction is left to tell
    ++counts_.inside;
    const JointVector row = opening_row(robot_, posture_, pair);
    const Limits limits{robot_.q_min(), robot_.q_max(), robot_.qd_max(), robot_.qdd_max()};
    // Slowed down, the limits are tighter, and leave the less choice.
    double least = 0.0;
    for (const double scale : {1.0, controller_.config().monitor.degraded_scale}) {
      Admissible box = admissible(limits, q, before_, controller_.config().period, scale);
      for (Eigen::Index j = 0; j < row.size(); ++j) {  // as much change as the time allows
        const double change = robot_.qdd_max()[j] * step_;
        box.low[j] = std::clamp(box.steady_low[j], before_[j] - change, before_[j] + change);
        box.high[j] = std::clamp(box.steady_high[j], before_[j] - change, before_[j] + change);
      }
      double best = 0.0;  // as fast outward as the box allows at all
      for (Eigen::Index j = 0; j < row.size(); ++j)
        best += row[j] * (row[j] > 0.0 ? box.high[j] : box.low[j]);
      least = std::min(least, best);
    }
    if (row.dot(last_) < least - kTolerance) {
      problem_ << "link " << pair.link << ", " << out.trusted_distance << " m from an obstacle ("
               << out.pair->distance << " measured), opens at " << row.dot(last_)
               << " m/s; at least " << least << " is possible; ";
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
  double step_ = 0.0;
  double d_min_ = 0.0;
  TickCounts counts_;
  std::ostringstream problem_;
};

}  // namespace proxcgal::fuzz
