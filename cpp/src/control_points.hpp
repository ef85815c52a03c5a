#pragma once
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proxcgal/controller.hpp"

namespace proxcgal::detail {

/// Which points of the robot avoidance moves: the choice between whole body and sensor points, and
/// which links count. Storage is made at set-up.
class ControlPoints {
 public:
  /// @throws ModelError  a link that does not exist, with the names that do
  ControlPoints(const Robot& robot, const Skin& skin, const ControllerConfig& config);

  /// The nearest pair whose link joints can move away; what was passed over is noted.
  /// @param engaged_within  having no such link is a cause to hold when nearer than this [m]
  std::optional<ClosestPair> nearest(const Robot& robot, const Posture& posture,
                                     const PointsRef& cloud_W, double engaged_within,
                                     Monitor& monitor);
  /// SM baseline ([WA] ref. 31): the sensor mounting point nearest to the cloud.
  std::span<const ControlPair> sensor(const Skin& skin, const Posture& posture,
                                      const PointsRef& cloud_W, const Vector3& velocity_W);
  /// The `count` nearest links that joints can move away, one pair each, nearest first.
  std::span<const ControlPair> links(const Robot& robot, const Posture& posture,
                                     const PointsRef& cloud_W, int count,
                                     const Vector3& velocity_W);
  /// A pair that is known already.
  std::span<const ControlPair> one(const ClosestPair& pair, const Vector3& velocity_W);

 private:
  Method method_;
  double min_row_norm_;
  std::vector<int> links_;         // rows of the links that count, the passed over ones last
  std::vector<char> passed_over_;  // [link] was it a moment ago, because its row was too small
  std::vector<ClosestPair> passed_;
  std::vector<int> sensor_link_;  // row of each sensor's link, -1 where no joint moves it
  ClosestPair before_;            // the last that was returned: where the next search begins
  std::vector<ClosestPair> per_link_, sorted_;
  std::vector<ControlPair> chosen_;
};

}  // namespace proxcgal::detail
