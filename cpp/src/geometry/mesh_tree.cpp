#include "proxcgal/geometry/mesh_tree.hpp"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <string>

#include "bvh.hpp"
#include "proxcgal/error.hpp"

namespace proxcgal {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangle3 = Kernel::Triangle_3;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, std::vector<Triangle3>::const_iterator>;
using CgalTree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

constexpr std::int64_t kAnySteps = std::numeric_limits<std::int64_t>::max();

Kernel::Point_3 to_cgal(const Vector3& p) { return {p.x(), p.y(), p.z()}; }

/// Faces with area; throws on what no index can be built from.
Triangles checked(const PointsRef& vertices, const Eigen::Ref<const Triangles>& triangles) {
  if (triangles.rows() == 0) throw GeometryError("mesh has no triangle: at least one is needed");
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    if (!vertices.row(i).allFinite()) {
      throw GeometryError("vertex " + std::to_string(i) +
                          " is not finite: every coordinate must be");
    }
    if (vertices.row(i).cwiseAbs().maxCoeff() > kFarthest) {
      throw GeometryError("vertex " + std::to_string(i) + " is farther than 1e9 m from the origin");
    }
  }
  Triangles kept(triangles.rows(), 3);
  Eigen::Index n = 0;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int index = triangles(f, k);
      if (index < 0 || index >= vertices.rows()) {
        throw GeometryError("triangle " + std::to_string(f) + " uses vertex " +
                            std::to_string(index) + ": allowed are 0 to " +
                            std::to_string(vertices.rows() - 1));
      }
    }
    const Vector3 a = vertices.row(triangles(f, 0)), b = vertices.row(triangles(f, 1)),
                  c = vertices.row(triangles(f, 2));
    // Both tests: a needle has length but no area, and its square may underflow.
    if ((b - a).cross(c - a).squaredNorm() > 0.0 && (c - b).squaredNorm() > 0.0) {
      kept.row(n++) = triangles.row(f);
    }
  }
  if (n == 0) throw GeometryError("mesh has no triangle with area");
  return kept.topRows(n);
}

Bounds bounds_of(const Points& vertices, const Triangles& triangles) {
  Bounds bounds;
  bounds.low.setConstant(kInfinity);
  bounds.high.setConstant(-kInfinity);
  const auto each = [&](auto&& visit) {
    for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
      for (int k = 0; k < 3; ++k) visit(Vector3(vertices.row(triangles(f, k))));
    }
  };
  each([&](const Vector3& p) {
    bounds.low = bounds.low.cwiseMin(p);
    bounds.high = bounds.high.cwiseMax(p);
  });
  bounds.center = 0.5 * (bounds.low + bounds.high);
  each([&](const Vector3& p) {
    bounds.radius = std::max(bounds.radius, (p - bounds.center).norm());
  });
  return bounds;
}

}  // namespace

struct MeshTree::Impl {
  Points vertices;
  Triangles triangles;
  int degenerate;
  Bounds bounds;
  detail::Bvh bvh;
  // Only the literal algorithms ask CGAL's tree, so it is built at their first question.
  mutable std::once_flag begun;
  mutable std::atomic<bool> built = false;  // asked first: a look at a once_flag costs more
  mutable std::vector<Triangle3> soup;
  mutable CgalTree cgal;

  Impl(const PointsRef& v, const Eigen::Ref<const Triangles>& f)
      : vertices(v),
        triangles(checked(v, f)),
        degenerate(static_cast<int>(f.rows() - triangles.rows())),
        bounds(bounds_of(vertices, triangles)),
        bvh(vertices, triangles) {}

  const CgalTree& reference() const {
    if (built.load(std::memory_order_acquire)) return cgal;
    std::call_once(begun, [this] {
      soup.reserve(static_cast<std::size_t>(triangles.rows()));
      for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
        soup.emplace_back(to_cgal(vertices.row(triangles(f, 0))),
                          to_cgal(vertices.row(triangles(f, 1))),
                          to_cgal(vertices.row(triangles(f, 2))));
      }
      cgal.insert(soup.cbegin(), soup.cend());
      cgal.build();
      cgal.accelerate_distance_queries();  // the kd-tree as well: built late it is not thread-safe
      built.store(true, std::memory_order_release);
    });
    return cgal;
  }
};

MeshTree::MeshTree(const PointsRef& vertices_L, const Eigen::Ref<const Triangles>& triangles)
    : impl_(std::make_unique<Impl>(vertices_L, triangles)) {}
MeshTree::~MeshTree() = default;
MeshTree::MeshTree(MeshTree&&) noexcept = default;
MeshTree& MeshTree::operator=(MeshTree&&) noexcept = default;

const Points& MeshTree::vertices_L() const { return impl_->vertices; }
const Triangles& MeshTree::triangles() const { return impl_->triangles; }
const Bounds& MeshTree::bounds() const { return impl_->bounds; }
int MeshTree::degenerate_triangles() const { return impl_->degenerate; }

std::optional<SurfacePoint> MeshTree::nearest(const Vector3& point_L, double squared_bound,
                                              std::int64_t* steps) const {
  std::int64_t any = kAnySteps;
  const SurfacePoint found =
      impl_->bvh.nearest(point_L, squared_bound, steps != nullptr ? *steps : any);
  if (found.triangle < 0) return std::nullopt;
  return found;
}

double MeshTree::squared_lower_bound(const Vector3& point_L, int steps) const {
  return impl_->bvh.squared_lower_bound(point_L, steps);
}

bool MeshTree::within(const Vector3& point_L, double radius, std::int64_t* steps) const {
  std::int64_t any = kAnySteps;
  return impl_->bvh.within(point_L, radius * radius, steps != nullptr ? *steps : any);
}

bool MeshTree::any_hit(const Vector3& origin_L, const Vector3& direction_L, double t_min,
                       double t_max) const {
  return impl_->bvh.any_hit(origin_L, direction_L, t_min, t_max);
}

double MeshTree::first_hit(const Vector3& origin_L, const Vector3& direction_L,
                           double t_min) const {
  return impl_->bvh.first_hit(origin_L, direction_L, t_min);
}

bool MeshTree::inside(const Vector3& point_L) const {
  const Bounds& box = impl_->bounds;
  if ((point_L.array() < box.low.array() || point_L.array() > box.high.array()).any()) return false;
  return impl_->bvh.inside(point_L);
}

double MeshTree::winding_number(const Vector3& point_L) const {
  return impl_->bvh.winding_number(point_L);
}

struct PairSearch::Impl {
  detail::PairHeap heap;
};
PairSearch::PairSearch() : impl_(std::make_unique<Impl>()) {
  impl_->heap.reserve(detail::kPairHeap);
}
PairSearch::~PairSearch() = default;
PairSearch::PairSearch(PairSearch&&) noexcept = default;
PairSearch& PairSearch::operator=(PairSearch&&) noexcept = default;

double MeshTree::distance(const MeshTree& other, const Pose& T_LO, double bound, Vector3* on_this_L,
                          Vector3* on_other_L, PairSearch* search) const {
  const double squared_bound = bound * bound;
  detail::PairHeap own;
  std::int64_t any = kAnySteps;
  const detail::PairWork work{search != nullptr ? search->impl_->heap : own,
                              search != nullptr ? search->steps : any, search != nullptr};
  bool cut = false;
  const double squared = impl_->bvh.squared_distance(other.impl_->bvh, T_LO, squared_bound,
                                                     on_this_L, on_other_L, work, cut);
  if (search != nullptr) search->lower_bound = cut;
  return squared < squared_bound ? std::sqrt(squared) : kInfinity;
}

double MeshTree::reference_squared_distance(const Vector3& point_L) const {
  return impl_->reference().squared_distance(to_cgal(point_L));
}

SurfacePoint MeshTree::reference_closest(const Vector3& point_L) const {
  const auto [p, where] = impl_->reference().closest_point_and_primitive(to_cgal(point_L));
  SurfacePoint found;
  found.point_L = {p.x(), p.y(), p.z()};
  found.squared_distance = (found.point_L - point_L).squaredNorm();
  found.triangle = static_cast<int>(where - impl_->soup.cbegin());
  return found;
}

double MeshTree::reference_first_hit(const Vector3& origin_L, const Vector3& direction_L) const {
  const Kernel::Ray_3 ray(to_cgal(origin_L),
                          Kernel::Vector_3(direction_L.x(), direction_L.y(), direction_L.z()));
  const auto hit = impl_->reference().first_intersection(ray);
  if (!hit) return kInfinity;
  // A ray in a triangle's plane meets it in a segment: its nearer end counts.
  const auto along = [&](const Kernel::Point_3& p) {
    return Vector3(p.x() - origin_L.x(), p.y() - origin_L.y(), p.z() - origin_L.z())
               .dot(direction_L) /
           direction_L.squaredNorm();
  };
  if (const auto* p = boost::get<Kernel::Point_3>(&hit->first)) return along(*p);
  const auto* s = boost::get<Kernel::Segment_3>(&hit->first);
  return std::min(along(s->source()), along(s->target()));
}

}  // namespace proxcgal
