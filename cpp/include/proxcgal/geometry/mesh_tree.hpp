#pragma once
#include <memory>
#include <optional>

#include "proxcgal/types.hpp"

namespace proxcgal {

/// Axis-aligned box and the sphere round it, in the link frame.
struct Bounds {
  Vector3 low = Vector3::Zero();
  Vector3 high = Vector3::Zero();
  Vector3 center = Vector3::Zero();
  double radius = 0.0;  ///< of the smallest sphere about `center` that holds every vertex
};

/// A point of the surface and how far it is from the query.
struct SurfacePoint {
  double squared_distance = kInfinity;  ///< [m^2]
  Vector3 point_L = Vector3::Zero();
  int triangle = -1;
};

/// Tree nodes and leaves that one search may look at: a few hundred times what real scenes take,
/// and some 30 ms where a cloud is made to be slow.
inline constexpr std::int64_t kSearchSteps = 500'000;

/// Storage for searches between two surfaces, made at set-up, and what they may still take: with it
/// a search allocates nothing and its work is bounded.
class PairSearch {
 public:
  PairSearch();
  ~PairSearch();
  PairSearch(PairSearch&&) noexcept;
  PairSearch& operator=(PairSearch&&) noexcept;

  std::int64_t steps = kSearchSteps;  ///< pairs of subtrees still to be looked at, counted down
  /// The last answer is one: the search was cut short. Its witness points are the nearest found so
  /// far, NaN for none.
  bool lower_bound = false;

 private:
  friend class MeshTree;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Surface of one rigid link: indexed once, queried every tick.
///
/// All of it is in the link frame L, so moving the arm never rebuilds it: bring the cloud to L.
/// Two indices stand on the same triangles: a flat one for the hot queries, and CGAL's AABB tree
/// (`reference_*`), which the literal algorithms use and the tests trust. Queries are const, never
/// allocate unless they say so, and may run from several threads. Query points must be finite.
/// Work is bounded in steps (tree nodes and leaves looked at), not in time, so that a result
/// depends on nothing but its inputs.
class MeshTree {
 public:
  /// @param vertices_L  shape (v, 3) [m]
  /// @param triangles   vertex rows, shape (f, 3); zero-area faces are left out and counted
  /// @throws GeometryError  no face with area, non-finite vertex, index outside [0, v)
  MeshTree(const PointsRef& vertices_L, const Eigen::Ref<const Triangles>& triangles);
  ~MeshTree();
  MeshTree(MeshTree&&) noexcept;
  MeshTree& operator=(MeshTree&&) noexcept;

  const Points& vertices_L() const;
  const Triangles& triangles() const;
  const Bounds& bounds() const;
  int degenerate_triangles() const;  ///< how many faces had no area

  /// Nearest surface point within a bound, or nothing: the bound prunes the search.
  /// @param squared_bound  only surface strictly nearer counts [m^2]
  /// @param steps          counted down, where given; below 0 the nearest so far was returned
  std::optional<SurfacePoint> nearest(const Vector3& point_L, double squared_bound = kInfinity,
                                      std::int64_t* steps = nullptr) const;

  /// No surface is nearer than this: what a few steps can tell [m^2].
  double squared_lower_bound(const Vector3& point_L, int steps) const;

  /// Is any surface nearer than `radius`? Stops at the first.
  /// @param steps  counted down, where given; below 0 the answer is no for want of steps
  bool within(const Vector3& point_L, double radius, std::int64_t* steps = nullptr) const;

  /// Does the segment origin + t direction, t in [t_min, t_max], meet the surface?
  bool any_hit(const Vector3& origin_L, const Vector3& direction_L, double t_min,
               double t_max) const;

  /// Smallest t >= t_min of a hit of origin + t direction; infinity where nothing is hit.
  double first_hit(const Vector3& origin_L, const Vector3& direction_L, double t_min = 0.0) const;

  /// Is the point inside the surface: does it go round the point more than half? The one test of
  /// tick and evaluation: drawn meshes are open here and there. By the tree; where that leaves a
  /// doubt, by every triangle.
  bool inside(const Vector3& point_L) const;

  /// How often the surface goes round the point: 1 or -1 inside a closed one, 0 outside, in between
  /// where it is open (Jacobson, Kavan & Sorkine-Hornung, Robust Inside-Outside Segmentation using
  /// Generalized Winding Numbers, SIGGRAPH 2013). Asks every triangle.
  double winding_number(const Vector3& point_L) const;

  /// Distance between two surfaces, 0 where they cross.
  /// @param T_LO   pose of the other link's frame in this one
  /// @param bound  only surface nearer than this counts; infinity is returned past it [m]
  /// @param[out] on_this_L, on_other_L  the two witness points, where given
  /// @param search  without it the search allocates and goes on to its end
  double distance(const MeshTree& other, const Pose& T_LO, double bound = kInfinity,
                  Vector3* on_this_L = nullptr, Vector3* on_other_L = nullptr,
                  PairSearch* search = nullptr) const;

  /// @name CGAL's AABB tree, literally; these allocate.
  /// @{
  double reference_squared_distance(const Vector3& point_L) const;
  SurfacePoint reference_closest(const Vector3& point_L) const;
  double reference_first_hit(const Vector3& origin_L, const Vector3& direction_L) const;
  /// @}

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proxcgal
