#pragma once
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "obstacle_velocities.hpp"
#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/task.hpp"
#include "proxcgal/robot.hpp"

namespace proxcgal::detail {

/// Which points of the robot avoidance moves: the choice between whole body and sensor points, and
/// which links count. Storage is made at set-up.
class ControlPoints {
 public:
  /// @throws ModelError  a link that does not exist, with the names that do
  ControlPoints(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// The nearest pair whose link joints can move away; what was passed over is noted.
  ///
  /// The link stays the same for a while: it changes at once where another is nearer by 10 mm or
  /// inside `d_min`, else at most every 100 ms.
  /// @param time            [s] of the controller's own clock
  /// @param d_min           [m]
  /// @param engaged_within  having no such link is a cause to hold when nearer than this [m]
  std::optional<ClosestPair> nearest(double time, const Robot& robot, const Posture& posture,
                                     const PointsRef& cloud_W, double d_min, double engaged_within,
                                     Monitor& monitor);
  /// The nearest of some rows of the cloud only, over the links that were not passed over.
  /// @param within  [m] only a nearer pair counts
  ClosestPair nearest_of(const Robot& robot, const Posture& posture, const PointsRef& rows_W,
                         double within);
  /// SM baseline ([WA] ref. 31): the sensor mounting point nearest to the cloud.
  std::span<const ControlPair> sensor(const Skin& skin, const Posture& posture,
                                      const PointsRef& cloud_W,
                                      const ObstacleVelocities& velocities);
  /// Searches the nearest pair of each link that counts, for `links` and `each`.
  /// @param within  [m] one per link of the robot: only a nearer pair counts
  void search_each(const Robot& robot, const Posture& posture, const PointsRef& cloud_W,
                   std::span<const double> within, Monitor& monitor);
  /// What `search_each` found, in no order; `found()` is false where nothing was near enough.
  std::span<const ClosestPair> each() const { return each_; }
  /// Of those the `count` nearest links that joints can move away, with the sign of their distance,
  /// nearest first.
  /// @param within  [m] only nearer ones count: a row that is not active changes nothing
  std::span<const ControlPair> links(const Robot& robot, const Posture& posture, int count,
                                     double within, const ObstacleVelocities& velocities);
  /// A pair that is known already.
  std::span<const ControlPair> one(const ControlPair& control);

 private:
  ClosestPair settled(double time, const Robot& robot, const Posture& posture,
                      const PointsRef& cloud_W, double d_min, const ClosestPair& nearest);

  Method method_;
  double min_row_norm_;
  std::vector<int> links_;         // rows of the links that count, the passed over ones last
  std::vector<char> passed_over_;  // [link] was it a moment ago, because its row was too small
  std::vector<ClosestPair> passed_;
  std::vector<int> sensor_link_;       // row of each sensor's link, -1 where no joint moves it
  std::int64_t steps_ = kSearchSteps;  // that this tick's searches may still take
  int link_ = -1;                      // that avoidance acted on last
  double switched_ = -kInfinity;       // [s] when that last changed
  ClosestPair before_;                 // the last that was returned: where the next search begins
  std::vector<ClosestPair> per_link_, each_;
  std::vector<ControlPair> chosen_;
};

}  // namespace proxcgal::detail
