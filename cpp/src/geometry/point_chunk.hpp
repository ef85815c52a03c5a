#pragma once
#include <array>

#include "kernels.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"

namespace proxcgal::detail {

/// A link's box with its pose, as chunks of points are compared with it.
class LinkBox {
 public:
  LinkBox(const Bounds& bounds, const Pose& T_WL);

 private:
  friend class PointChunk;
  LinkBoxView view_;
  float scale_;  // largest coordinate involved: sets the rounding allowance
};

/// Neighbouring rows of a cloud, side by side in single precision: about what one sensor sees.
///
/// Most points are far from most links. Here they are sorted out many at a time, the whole chunk
/// first, before any tree is asked; rounding never sorts out a point that is near.
class PointChunk {
 public:
  static constexpr int kRoom = kChunk;
  using Limits = std::array<float, kRoom>;
  using Rows = std::array<std::uint8_t, kRoom>;

  /// Takes `points_W` from row `begin` on, as many as there is room for.
  PointChunk(const PointsRef& points_W, Eigen::Index begin);

  Eigen::Index begin() const { return begin_; }
  int count() const { return view_.count; }

  /// Might any point's squared distance to the box be at most `squared_limit`?
  bool may_reach(const LinkBox& box, float squared_limit) const;

  /// Rows whose squared distance to the box may be at most their limit, counted from `begin`.
  /// @return how many
  int near_rows(const LinkBox& box, const Limits& squared_limits, Rows& rows) const;

  /// Each row's squared distance to the box, from below.
  void squared_bounds(const LinkBox& box, Limits& out) const;

  /// The row with the least lower bound, and that bound.
  std::pair<int, float> likeliest(const LinkBox& box) const;

  /// A ball that holds all points: center and radius [m].
  std::pair<Vector3, double> ball() const;

 private:
  float allowance(const LinkBox& box) const;

  Eigen::Index begin_;
  ChunkView view_;
  std::array<float, 3> center_W_, half_;  // their own box
  float scale_ = 0.0F;                    // largest coordinate
};

}  // namespace proxcgal::detail
