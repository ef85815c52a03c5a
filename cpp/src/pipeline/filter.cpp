#include "proxcgal/pipeline/filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/frames.hpp"
#include "geometry/point_chunk.hpp"

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

/// Calls `visit(row, tree, T_WL)` for every point still kept that may be within its tolerance of a
/// link's surface; `visit` returns whether it is body.
template <class IsBody>
void drop_near(const Robot& robot, const Posture& posture, const PointsRef& points_W,
               std::span<const double> tolerance, std::span<bool> keep, IsBody&& is_body) {
  using detail::PointChunk;
  for (Eigen::Index begin = 0; begin < points_W.rows(); begin += PointChunk::kRoom) {
    const PointChunk chunk(points_W, begin);
    PointChunk::Limits limits;
    float widest = 0.0F;
    for (int i = 0; i < chunk.count(); ++i) {
      const double reach = tolerance[static_cast<std::size_t>(begin + i)];
      limits[static_cast<std::size_t>(i)] = detail::not_below(reach * reach);
      widest = std::max(widest, limits[static_cast<std::size_t>(i)]);
    }
    for (int link = 0; link < robot.n_links(); ++link) {
      const MeshTree& tree = robot.tree(link);
      const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
      const detail::LinkBox box(tree.bounds(), T_WL);
      if (!chunk.may_reach(box, widest)) continue;
      PointChunk::Rows rows;
      const int n = chunk.near_rows(box, limits, rows);
      for (int i = 0; i < n; ++i) {
        const auto row = static_cast<std::size_t>(begin + rows[static_cast<std::size_t>(i)]);
        if (keep[row] && is_body(row, tree, T_WL)) keep[row] = false;
      }
    }
  }
}

/// The same answer by asking less: a link explains only points near to its surface, so the others
/// are sorted out first. Is anything hit within the tolerance of the point, and if so, is nothing
/// hit before that?
void remove_body_fast(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                      const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                      std::span<bool> keep) {
  const auto explains = [&](std::size_t row, const MeshTree& tree, const Pose& T_WL) {
    const auto i = static_cast<Eigen::Index>(row);
    const Vector3 origin_W = origins_W.row(i).transpose();
    const Vector3 ray_W = Vector3(points_W.row(i).transpose()) - origin_W;
    const double length = ray_W.norm();
    if (!(length > min_hit)) return false;
    const Vector3 direction_L = T_WL.linear().transpose() * (ray_W / length);
    const Vector3 origin_L = detail::into(T_WL, origin_W);
    const double near = std::max(min_hit, length - tolerance[row]), far = length + tolerance[row];
    if (!tree.any_hit(origin_L, direction_L, near, far)) return false;
    const double before = std::nextafter(near, 0.0);
    return !(before > min_hit && tree.any_hit(origin_L, direction_L, min_hit, before));
  };
  drop_near(robot, posture, points_W, tolerance, keep, explains);
}

}  // namespace

void remove_body(const Robot& robot, const Posture& posture, const PointsRef& origins_W,
                 const PointsRef& points_W, std::span<const double> tolerance, double min_hit,
                 Method method, std::span<bool> keep) {
  const auto literal_or_fast = method == Method::kPaper ? remove_body_paper : remove_body_fast;
  literal_or_fast(robot, posture, origins_W, points_W, tolerance, min_hit, keep);
}

bool remove_near_surface(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         std::span<const double> tolerance, std::span<bool> keep,
                         std::int64_t* steps) {
  std::int64_t any = std::numeric_limits<std::int64_t>::max();
  std::int64_t& left = steps != nullptr ? *steps : any;
  const auto touches = [&](std::size_t row, const MeshTree& tree, const Pose& T_WL) {
    if (left < 0) return false;
    const Vector3 point_W = points_W.row(static_cast<Eigen::Index>(row)).transpose();
    return tree.within(detail::into(T_WL, point_W), tolerance[row], &left);
  };
  drop_near(robot, posture, points_W, tolerance, keep, touches);
  return left >= 0;
}

}  // namespace proxcgal
