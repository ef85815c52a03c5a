#include "proxcgal/pipeline/distance.hpp"

#include <cmath>

namespace proxcgal {
namespace {

/// Calls `visit(link)` for the links asked for, all where none are named.
template <class Visit>
void for_links(const Robot& robot, std::span<const int> links, Visit&& visit) {
  if (links.empty()) {
    for (int link = 0; link < robot.n_links(); ++link) visit(link);
  } else {
    for (const int link : links) visit(link);
  }
}

/// Algorithm 2 of [WA], literally, on CGAL's own queries.
ClosestPair closest_pair_paper(const Robot& robot, const Posture& posture,
                               const PointsRef& points_W, std::span<const int> links) {
  ClosestPair best;
  double current_minimum = kInfinity;
  for_links(robot, links, [&](int link) {
    const MeshTree& tree = robot.tree(link);
    const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
    const Pose T_LW = T_WL.inverse();
    for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
      const Vector3 point_W = points_W.row(i).transpose();
      const Vector3 point_L = T_LW * point_W;
      const double squared = tree.reference_squared_distance(point_L);
      if (squared < current_minimum) {
        current_minimum = squared;
        best.link = link;
        // Slip of the text mended: the environment point first, then the robot point nearest to it.
        best.obstacle_W = point_W;
        best.point = static_cast<int>(i);
        best.surface_W = T_WL * tree.reference_closest(point_L).point_L;
      }
    }
  });
  best.distance = std::sqrt(current_minimum);
  return best;
}

/// Improves `best` by one link: every point is asked only for surface nearer than the best so far.
/// @param squared  of the best so far, updated
void improve(const Robot& robot, const Posture& posture, const PointsRef& points_W, int link,
             Eigen::Index first, ClosestPair& best, double& squared) {
  const MeshTree& tree = robot.tree(link);
  const Pose& T_WL = posture.T_WL[static_cast<std::size_t>(link)];
  const Eigen::Matrix3d R_LW = T_WL.linear().transpose();
  const Vector3 center_W = T_WL * tree.bounds().center;
  double reach = tree.bounds().radius + std::sqrt(squared);
  int hint = -1;
  const auto visit = [&](Eigen::Index i) {
    const Vector3 point_W = points_W.row(i).transpose();
    if (!((point_W - center_W).squaredNorm() <= reach * reach)) return;
    const Vector3 point_L = R_LW * (point_W - T_WL.translation());
    const auto found = tree.nearest(point_L, squared, hint);
    if (!found) return;
    hint = found->triangle;
    squared = found->squared_distance;
    reach = tree.bounds().radius + std::sqrt(squared);
    best.link = link;
    best.point = static_cast<int>(i);
    best.obstacle_W = point_W;
    best.surface_W = T_WL * found->point_L;
  };
  visit(first);
  for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
    if (i != first) visit(i);
  }
}

/// The point nearest to the sphere round a link: where a search starts with a good bound.
struct Start {
  Eigen::Index point = 0;
  double gap = kInfinity;  ///< [m] lower bound of the distance
};

Start start_of(const Robot& robot, const Posture& posture, const PointsRef& points_W, int link) {
  const Bounds& bounds = robot.tree(link).bounds();
  const Vector3 center_W = posture.T_WL[static_cast<std::size_t>(link)] * bounds.center;
  double nearest = kInfinity;
  Start start;
  for (Eigen::Index i = 0; i < points_W.rows(); ++i) {
    const double squared = (Vector3(points_W.row(i).transpose()) - center_W).squaredNorm();
    if (squared < nearest) {
      nearest = squared;
      start.point = i;
    }
  }
  start.gap = std::sqrt(nearest) - bounds.radius;
  return start;
}

/// The same answer with one bound carried across points and links, the likeliest link first.
ClosestPair closest_pair_fast(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                              std::span<const int> links) {
  ClosestPair best;
  if (points_W.rows() == 0) return best;
  int likeliest = -1;
  Start at;
  for_links(robot, links, [&](int link) {
    const Start start = start_of(robot, posture, points_W, link);
    if (likeliest < 0 || start.gap < at.gap) {
      likeliest = link;
      at = start;
    }
  });
  double squared = kInfinity;
  improve(robot, posture, points_W, likeliest, at.point, best, squared);
  for_links(robot, links, [&](int link) {
    if (link != likeliest) improve(robot, posture, points_W, link, at.point, best, squared);
  });
  best.distance = std::sqrt(squared);
  return best;
}

}  // namespace

ClosestPair closest_pair(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         Method method, std::span<const int> links) {
  return method == Method::kPaper ? closest_pair_paper(robot, posture, points_W, links)
                                  : closest_pair_fast(robot, posture, points_W, links);
}

void closest_pairs(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                   std::span<const int> links, std::span<ClosestPair> out) {
  std::size_t row = 0;
  for_links(robot, links, [&](int link) {
    ClosestPair& best = out[row++];
    best = ClosestPair{};
    if (points_W.rows() == 0) return;
    double squared = kInfinity;
    improve(robot, posture, points_W, link, start_of(robot, posture, points_W, link).point, best,
            squared);
    best.distance = std::sqrt(squared);
  });
}

}  // namespace proxcgal
