#pragma once
#include <array>
#include <span>
#include <vector>

#include "control_points.hpp"
#include "obstacle_velocities.hpp"
#include "perception/perception.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/pipeline/limit.hpp"
#include "proxcgal/robot.hpp"
#include "signed_pair.hpp"

namespace proxcgal::detail {

/// What a tick's distances are gathered from.
struct DistanceScene {
  const Posture& posture;
  const PointsRef& cloud_W;
  const ObstacleVelocities& velocities;
  const Perception* perception;  ///< of sensed points; null where they are known
  double time;                   ///< [s] of the controller's own clock
};

/// Rows of the limit stage: every distance that a link may not close too fast, or has to open.
///
/// Each link gives its nearest pair and, where that is near, the nearest one on its other side, so
/// that what it retreats from does not drive it into what is behind. Storage is made at set-up.
class DistanceRows {
 public:
  /// @param config  kept by reference: its tasks may be retuned
  DistanceRows(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// Forgets the last tick's rows.
  void begin();
  /// How far each link is to be searched: farther off nothing could limit its motion.
  /// @param fastest_obstacle  [m/s]
  void reach(const LimitState& state, const JointVector& qd_last, double elapsed,
             const Posture& posture, double fastest_obstacle);
  /// Every link is to be searched so far at least [m].
  void reach_at_least(double within);
  std::span<const double> within() const { return within_; }

  /// Caps for the nearest pair of every link, retreat rows for those that joints can open.
  void add_links(const DistanceScene& scene, ControlPoints& control_points);
  /// Keeps the pair that drives the arm from coming nearer inside d_min.
  /// @param nearest  [m] its trusted distance
  void keep_nearest(const Posture& posture, const ControlPair& pair, double nearest,
                    const LimitState& state);
  /// Retreat of the sensor's mounting point, the SM baseline's.
  void add_sensor_point(const Posture& posture, const ControlPair& control);
  /// The robot's own links.
  void add_own(const Posture& posture, const SelfCollision& spec, std::span<const LinkPair> pairs);
  void add_floor(const Posture& posture);
  /// Caps into the view of a sensor that is silent: slower and slower, up to `hold_after`.
  void add_silent_views(double time, const Posture& posture, const Perception& perception);
  /// Reports motion into the view of a sensor that has been silent for `hold_after`.
  void report_blind_motion(const JointVector& nominal, Monitor& monitor) const;

  std::span<const ApproachCap> caps() const { return caps_; }
  /// Nearest first.
  std::span<const RetreatRow> retreats();
  /// Of the first of them; -1 for none.
  int nearest_link() const { return retreats_.empty() ? -1 : retreats_.front().link; }

 private:
  void add_pair(const DistanceScene& scene, const ControlPair& control, int point);
  void add_retreat(const Avoidance& spec, const ControlPair& control, const JointVector& row);
  double shortened(const DistanceScene& scene, const ControlPair& control, int point) const;
  const Avoidance* avoidance() const;

  const Robot& robot_;
  const ControllerConfig& config_;
  bool whole_body_;
  double farthest_sigma_;          // [m] of a range at the end of the workspace
  std::array<Vector3, 5> view_S_;  // middle and corners of a field of view
  std::vector<double> within_;     // [m] per link
  std::vector<ApproachCap> caps_;
  std::vector<RetreatRow> retreats_;
  struct SilentView {
    std::size_t cap;
    int sensor;
    double silent_for;
  };
  std::vector<SilentView> silent_;
};

}  // namespace proxcgal::detail
