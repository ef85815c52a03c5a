#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lanes.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"
#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// Four children: boxes in single precision, one lane a child. Queries widen them by what
/// rounding can cost, so a box never hides a triangle that double precision would find.
struct alignas(64) BvhNode {
  Float4 low[3];
  Float4 high[3];
  std::int32_t child[kWide];  ///< >= 0 a node, < 0 a leaf: ~row of its block; kEmpty for none
};
inline constexpr std::int32_t kEmpty = INT32_MIN;

/// Four triangles in double precision, one lane each; short leaves repeat their last triangle.
struct alignas(32) TriangleBlock {
  Double4 a[3], b[3], c[3];
  Double4 inv_ab, inv_ac, inv_bc;  ///< 1 / squared edge length
  Double4 inv_gram;                ///< 1 / (4 area^2), 0 for slivers: their edges serve
  std::int32_t id[kWide];
};

/// A tree as the kernels see it.
struct BvhView {
  const BvhNode* nodes;  // root first
  const TriangleBlock* blocks;
  double scale;  // largest coordinate: sets the rounding allowance
};

struct PairBox {
  Vector3 low, high;
};

/// A pair of subtrees of two trees; a negative row is a block.
struct PendingPair {
  double key;  ///< no pair of their triangles is nearer, squared
  std::int32_t here, there;
  PairBox box_here, box_there;  ///< both in the first tree's frame
};
using PairHeap = std::vector<PendingPair>;
inline constexpr std::size_t kPairHeap = 4096;  ///< pairs that a bounded search keeps at most

/// What a search between two trees may take.
struct PairWork {
  PairHeap& heap;
  std::int64_t& steps;  ///< counted down
  bool bounded;         ///< the heap grows no larger than its storage
};

/// Flat four-wide tree over a link's triangles: what the tick walks.
class Bvh {
 public:
  Bvh(const Points& vertices, const Triangles& triangles);

  /// Nearest surface point strictly within `squared_bound`; triangle -1 where there is none.
  SurfacePoint nearest(const Vector3& point, double squared_bound, std::int64_t& steps) const;
  double squared_lower_bound(const Vector3& point, int steps) const;
  bool within(const Vector3& point, double squared_radius, std::int64_t& steps) const;
  bool any_hit(const Vector3& origin, const Vector3& direction, double t_min, double t_max) const;
  double first_hit(const Vector3& origin, const Vector3& direction, double t_min) const;
  /// Squared distance to another surface whose frame has pose T_LO in this one's.
  /// @param[out] cut  the work was used up: a lower bound was returned, with the nearest points
  ///                  found so far, NaN for none
  double squared_distance(const Bvh& other, const Pose& T_LO, double squared_bound,
                          Vector3* on_this, Vector3* on_other, const PairWork& work,
                          bool& cut) const;

  /// How often the surface goes round the point: 1 or -1 inside a closed one, 0 outside.
  /// @param far  a subtree so many of its radii away counts as one dipole; infinity: none does
  double winding_number(const Vector3& point, double far = kInfinity) const;
  /// More than half round.
  bool inside(const Vector3& point) const;

  BvhView view() const { return {nodes_.data(), blocks_.data(), scale_}; }

 private:
  struct Builder;
  /// The triangles of a subtree as one.
  struct Dipole {
    Vector3 area_vector = Vector3::Zero();  ///< [m^2]
    Vector3 center = Vector3::Zero();       ///< weighted by area
    double area = 0.0;
    double radius = 0.0;  ///< [m] about `center`
  };
  Dipole add_dipoles(std::int32_t row);

  std::vector<BvhNode> nodes_;  // root first
  std::vector<TriangleBlock> blocks_;
  std::vector<std::array<Dipole, kWide>> dipoles_;  // of each node's children
  double scale_ = 0.0;  // largest coordinate: sets the rounding allowance
};

}  // namespace proxcgal::detail
