#pragma once
#include <optional>
#include <vector>

#include "control_points.hpp"
#include "perception/perception.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/control/tick_output.hpp"

namespace proxcgal::detail {

/// How far the nearest pair is to be trusted, on which side of the surface its obstacle is, and
/// whether it is inside d_min.
class TrustedDistance {
 public:
  TrustedDistance(const Robot& robot, const ControllerConfig& config);

  /// The tasks' values have changed.
  void retune(const std::vector<TaskSpec>& tasks);

  /// Sets `trusted_distance` of a pair of known points: negative where its obstacle is inside.
  void of_known(const Posture& posture, TickOutput& out);
  /// The same of sensed points. Where a scan is no longer fresh the distances of its points are
  /// shortened by what may have come since, so that another pair may be the nearest.
  void of_sensed(double time, const Posture& posture, const Perception& perception,
                 ControlPoints& control_points, TickOutput& out, Monitor& monitor);

  /// The pair as avoidance takes it: the distance as measured, with its sign, and a normal that
  /// never turns over. What may have come since the scan limits the approach only: no assumed
  /// motion drives the arm.
  ControlPair control(const TickOutput& out, const Vector3& velocity_W) const;
  /// Is there a pair inside d_min?
  bool inside(const TickOutput& out) const {
    return avoidance_ && out.pair && out.trusted_distance < avoidance_->d_min;
  }
  double d_min() const { return avoidance_ ? avoidance_->d_min : 0.0; }

  /// Has the pair's zone watched, so that the body filter does not remove its obstacle. What was
  /// seen in one scan only may be noise on the body itself.
  void watch(double time, const TickOutput& out, Perception& perception);

 private:
  Vector3 out_of_link(const ClosestPair& pair, const Posture& posture) const;

  const Robot& robot_;
  double fresh_within_;                  // [s]
  double approach_speed_;                // [m/s]
  std::optional<Avoidance> avoidance_;   // the first of the stack
  double near_since_ = 0.0;              // [s] since when a pair has been inside d_min
  double signed_distance_ = kInfinity;   // [m] of the pair, as measured
  Vector3 outward_W_ = Vector3::Zero();  // last normal of a pair that was surely outside
};

}  // namespace proxcgal::detail
