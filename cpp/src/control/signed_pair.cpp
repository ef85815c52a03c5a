#include "signed_pair.hpp"

#include <cmath>

#include "geometry/frames.hpp"

namespace proxcgal::detail {

ControlPair signed_pair(const Robot& robot, const Posture& posture, const ClosestPair& pair,
                        const ObstacleVelocities& velocities) {
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(pair.link)];
  const MeshTree& tree = robot.tree(pair.link);
  const bool inside = tree.inside(into(T_WL, pair.obstacle_W));
  return {.link = pair.link,
          .control_W = pair.surface_W,
          .obstacle_W = pair.obstacle_W,
          .obstacle_velocity_W = velocities.of(pair.point),
          .distance = inside ? -pair.distance : pair.distance,
          .fallback_normal_W = (T_WL * tree.bounds().center - pair.obstacle_W).normalized()};
}

ClosestPair other_side(const Robot& robot, const Posture& posture, const PointsRef& cloud_W,
                       const ControlPair& control, double within) {
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(control.link)];
  const MeshTree& tree = robot.tree(control.link);
  const Bounds& box = tree.bounds();
  const Vector3 away_W = normal_W(control);
  const double plane = away_W.dot(control.control_W);
  ClosestPair best;
  double bound = within * within;
  for (Eigen::Index i = 0; i < cloud_W.rows(); ++i) {
    const Vector3 point_W = cloud_W.row(i).transpose();
    if (!(away_W.dot(point_W) > plane)) continue;
    const Vector3 point_L = into(T_WL, point_W);
    const Vector3 outside = (box.low - point_L).cwiseMax(point_L - box.high).cwiseMax(0.0);
    if (!(outside.squaredNorm() < bound)) continue;
    const auto found = tree.nearest(point_L, bound);
    if (!found) continue;
    bound = found->squared_distance;
    best.link = control.link;
    best.point = static_cast<int>(i);
    best.obstacle_W = point_W;
    best.surface_W = T_WL * found->point_L;
    best.distance = std::sqrt(bound);
  }
  return best;
}

}  // namespace proxcgal::detail
