#pragma once
#include <array>
#include <optional>

#include "control_points.hpp"
#include "perception.hpp"
#include "proxcgal/controller.hpp"

namespace proxcgal::detail {

/// How far the nearest pair is to be trusted, and what no command may do then: come nearer inside
/// d_min, or move fast into what is not seen.
class Caution {
 public:
  Caution(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// The tasks' values have changed.
  void retune(const std::vector<TaskSpec>& tasks);

  /// Sets `trusted_distance` of a pair of known points: negative where its obstacle is inside.
  void trust_known(const Posture& posture, TickOutput& out);
  /// The same of sensed points. Where a scan is no longer fresh the distances of its points are
  /// shortened by what may have come since, so that another pair may be the nearest.
  void trust_sensed(double time, const Posture& posture, const Perception& perception,
                    ControlPoints& control_points, TickOutput& out, Monitor& monitor);

  /// The pair as avoidance takes it: the trusted distance, and a normal that never turns over.
  ControlPair control(const TickOutput& out, const Vector3& velocity_W) const;
  /// Is there a pair inside d_min?
  bool inside(const TickOutput& out) const {
    return avoidance_ && out.pair && out.trusted_distance < avoidance_->d_min;
  }
  double d_min() const { return avoidance_ ? avoidance_->d_min : 0.0; }

  /// Has the pair's zone watched, lest it lose its obstacle to the body filter. What was seen in
  /// one scan only may be noise on the body itself.
  void watch(double time, const TickOutput& out, Perception& perception);

  /// Changes the command as little as possible so that the pair inside d_min does not come nearer.
  void keep_off(const Posture& posture, const Admissible& box, TickOutput& out) const;
  /// Slows what moves into a silent sensor's view, and tells it where that has lasted.
  void slow_into_unseen(double time, const Posture& posture, const Perception& perception,
                        const Admissible& box, TickOutput& out, Monitor& monitor) const;

 private:
  Vector3 out_of_link(const ClosestPair& pair, const Posture& posture) const;

  const Robot& robot_;
  MonitorConfig config_;
  bool whole_body_;
  std::optional<Avoidance> avoidance_;   // the first of the stack
  std::array<Vector3, 5> view_S_;        // middle and corners of a field of view
  double near_since_ = 0.0;              // [s] since when a pair has been inside d_min
  Vector3 outward_W_ = Vector3::Zero();  // last normal of a pair that was surely outside
};

}  // namespace proxcgal::detail
