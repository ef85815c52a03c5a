#include "proxcgal/pipeline/filter.hpp"

#include <algorithm>
#include <cmath>

namespace proxcgal {
namespace {

/// Algorithm 1 of [WA], literally: every link's first hit along every point's ray, by CGAL.
void remove_body_paper(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                       const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                       std::span<bool> keep) {
  for (int link = 0; link < robot.n_links(); ++link) {
    const Pose T_LW = posture.T_WL[static_cast<std::size_t>(link)].inverse();
    for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
      const auto row = static_cast<std::size_t>(i);
      const Vector3 origin_L = T_LW * Vector3(origins_W.row(i).transpose()),
                    point_L = T_LW * Vector3(points_W.row(i).transpose());
      const double length = (point_L - origin_L).norm();
      if (!(length > min_hit)) continue;
      const Vector3 direction_L = (point_L - origin_L) / length;
      // The ray starts past the emitter's own mounting.
      const double hit = min_hit + robot.tree(link).reference_first_hit(
                                       origin_L + min_hit * direction_L, direction_L);
      // Slip of the text mended: dropped when any link explains it, never added again.
      if (std::abs(hit - length) <= tolerance[row]) keep[row] = false;
    }
  }
}

/// The same answer by asking less: is anything hit within the tolerance of the point, and if so,
/// is nothing hit before that?
void remove_body_fast(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                      const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                      std::span<bool> keep) {
  for (int link = 0; link < robot.n_links(); ++link) {
    const MeshTree& tree = robot.tree(link);
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    const Vector3 center_W = T_WL * tree.bounds().center;
    const double radius = tree.bounds().radius;
    const Eigen::Matrix3d R_LW = T_WL.linear().transpose();
    for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
      const auto row = static_cast<std::size_t>(i);
      if (!keep[row]) continue;
      const Vector3 point_W = points_W.row(i).transpose();
      const double reach = radius + tolerance[row];
      if (!((point_W - center_W).squaredNorm() <= reach * reach)) continue;
      const Vector3 ray_W = point_W - Vector3(origins_W.row(i).transpose());
      const double length = ray_W.norm();
      if (!(length > min_hit)) continue;
      const Vector3 direction_L = R_LW * (ray_W / length);
      const Vector3 origin_L = R_LW * (Vector3(origins_W.row(i).transpose()) - T_WL.translation());
      const double near = std::max(min_hit, length - tolerance[row]), far = length + tolerance[row];
      if (!tree.any_hit(origin_L, direction_L, near, far)) continue;
      const double before = std::nextafter(near, 0.0);
      if (before > min_hit && tree.any_hit(origin_L, direction_L, min_hit, before)) continue;
      keep[row] = false;
    }
  }
}

}  // namespace

void remove_body(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                 const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                 Method method, std::span<bool> keep) {
  std::fill(keep.begin(), keep.end(), true);
  const auto literal_or_fast = method == Method::kPaper ? remove_body_paper : remove_body_fast;
  literal_or_fast(robot, posture, origins_W, points_W, tolerance, min_hit, keep);
}

void remove_near_surface(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         std::span<const double> tolerance, std::span<bool> keep) {
  for (int link = 0; link < robot.n_links(); ++link) {
    const MeshTree& tree = robot.tree(link);
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    const Vector3 center_W = T_WL * tree.bounds().center;
    for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
      const auto row = static_cast<std::size_t>(i);
      if (!keep[row]) continue;
      const Vector3 point_W = points_W.row(i).transpose();
      const double reach = tree.bounds().radius + tolerance[row];
      if (!((point_W - center_W).squaredNorm() <= reach * reach)) continue;
      const Vector3 point_L = T_WL.linear().transpose() * (point_W - T_WL.translation());
      if (tree.within(point_L, tolerance[row])) keep[row] = false;
    }
  }
}

}  // namespace proxcgal
