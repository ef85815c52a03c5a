#pragma once
#include "proxcgal/pipeline/filter.hpp"
#include "proxcgal/robot.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal {

/// What a caller knows and wants of a search.
struct SearchOptions {
  std::span<const int> links;  ///< rows to look at; empty means all
  ClosestPair before;          ///< of a moment ago, where there is one: `fast` begins there
  double within = kInfinity;   ///< [m] only a nearer pair counts
  /// Tree nodes and leaves that `fast` may still look at, counted down where given: searches that
  /// share it share its work. Once spent, the answer is a lower bound, tight where rows of the
  /// cloud that stand together lie together.
  std::int64_t* steps = nullptr;
};

/// Algorithm 2 of [WA]: the nearest (cloud point, surface point) over the links asked for.
/// @return  `found()` is false for an empty cloud, and where none is near enough
ClosestPair closest_pair(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                         Method method, const SearchOptions& options = {});

/// The nearest pair of each link of `links` (all where empty), in that order; each by `fast`.
/// @param[in,out] pairs  one per link: where each search begins, where found; the answer
void closest_pairs(const Robot& robot, const Posture& posture, const PointsRef& points_W,
                   std::span<const int> links, std::span<ClosestPair> pairs,
                   std::int64_t* steps = nullptr);

/// How far a point is from the arm, and which way is out.
struct SignedDistance {
  double distance = kInfinity;  ///< [m] negative inside a link
  int link = -1;                ///< the nearest; inside, that in which the point is deepest
  Vector3 surface_W = Vector3::Zero();
  Vector3 normal_W = Vector3::Zero();  ///< unit, out of the link at `surface_W`
};

/// Distance to the union of all links, with its sign. Inside is where a link's surface goes round
/// the point more than half (`MeshTree::inside`).
SignedDistance signed_distance(const Robot& robot, const Posture& posture, const Vector3& point_W);

}  // namespace proxcgal
