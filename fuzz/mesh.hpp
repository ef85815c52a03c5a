#pragma once
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "fuzz/bytes.hpp"
#include "proxcgal/error.hpp"
#include "proxcgal/geometry/mesh_tree.hpp"

/// Bytes to a mesh and questions to it: what `fuzz/mesh.cpp` and the tests run.
namespace proxcgal::fuzz {

using Exact3 = Eigen::Matrix<long double, 3, 1>;

/// Distance of a point from the segment a + t (b - a) [m].
inline long double segment_distance(const Exact3& p, const Exact3& a, const Exact3& b) {
  const Exact3 along = b - a;
  const long double length = along.squaredNorm();
  const long double t = length > 0 ? std::clamp(along.dot(p - a) / length, 0.0L, 1.0L) : 0.0L;
  return (a + t * along - p).norm();
}

/// Distance of a point from a triangle, by its plane and its sides, slowly and in long double [m].
inline long double triangle_distance(const Exact3& p, const Exact3& a, const Exact3& b,
                                     const Exact3& c) {
  const long double sides =
      std::min({segment_distance(p, a, b), segment_distance(p, b, c), segment_distance(p, c, a)});
  const Exact3 normal = (b - a).cross(c - a);
  const long double length = normal.norm();
  if (!(length > 0)) return sides;
  const auto left_of = [&](const Exact3& from, const Exact3& to) {
    return (to - from).cross(p - from).dot(normal) >= 0;
  };
  const bool above = left_of(a, b) && left_of(b, c) && left_of(c, a);
  return above ? std::min(sides, std::abs(normal.dot(p - a)) / length) : sides;
}

/// What one input did.
struct MeshRun {
  bool refused = false;  ///< by GeometryError
  int queries = 0;
  std::string violation;  ///< empty where nothing was violated
};

class MeshHarness {
 public:
  static constexpr int kMostVertices = 40, kMostTriangles = 64, kMostQueries = 16;

  explicit MeshHarness(Bytes bytes) : bytes_(bytes) {}

  /// Lets through whatever construction throws that is no GeometryError.
  MeshRun run() {
    MeshRun run;
    fill();
    try {
      const MeshTree tree(vertices_, triangles_);
      for (; run.queries < kMostQueries && run.violation.empty(); ++run.queries)
        run.violation = ask(tree) + shoot(tree);
      if (run.violation.empty()) run.violation = ask_itself(tree);
    } catch (const GeometryError&) {
      run.refused = true;
    }
    return run;
  }

 private:
  static constexpr double kRelative = 1e-9;
  // A face so thin is searched along its sides only: its inside is nearer by up to half its height.
  static constexpr double kThin = 2e-7, kThinRelative = 2e-7;
  static constexpr double kAlong = 1e-6;  // along a ray, which may be steep or flat
  static constexpr double kGrazing = 1e-4, kInside = 1e-6;
  static constexpr double kTiny = 1e-6;       // of the coordinates: such a face is a point to them
  static constexpr double kAbsolute = 1e-15;  // [m] squares of less vanish in single precision

  /// A surface of strips, with some vertices and indices as the bytes have them.
  void fill() {
    vertices_.resize(bytes_.below(kMostVertices + 1), 3);
    triangles_.resize(bytes_.below(kMostTriangles + 1), 3);
    constexpr std::array sizes = {1.0, 0.1, 1e-6, 1e-20, 1e-150, 1e6, 9e8, 1e30};
    const double size = sizes[static_cast<std::size_t>(bytes_.byte() % 16 % sizes.size())];
    const bool flat = bytes_.one_in_eight();
    for (Eigen::Index i = 0; i < vertices_.rows(); ++i) {
      const int kind = bytes_.byte();
      vertices_.row(i) = size * bytes_.vector(1.0).transpose();
      if (kind >= 252) vertices_(i, bytes_.below(3)) = bytes_.any();
      if (kind < 16 && i > 0) vertices_.row(i) = vertices_.row(bytes_.below(static_cast<int>(i)));
      if (kind >= 16 && kind < 32 && i > 0)  // so near that a face of it hardly has an area
        vertices_.row(i) = vertices_.row(i - 1) + 1e-12 * vertices_.row(i);
      if (flat) vertices_(i, 2) *= 1e-14;
    }
    const int n = static_cast<int>(vertices_.rows());
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const int at = bytes_.byte();
        triangles_(f, k) = n > 0 ? at % n : at;
      }
      if (bytes_.byte() == 255) triangles_(f, bytes_.below(3)) = bytes_.word() - 0x8000;
    }
  }

  Vector3 query() {
    if (bytes_.one_in_eight()) {
      const double x = bytes_.finite(), y = bytes_.finite();
      return Vector3(x, y, bytes_.finite()).cwiseMax(-1e9).cwiseMin(1e9);
    }
    const Vector3 vertex = vertices_.row(bytes_.byte() % vertices_.rows());
    const Vector3 other = vertices_.row(bytes_.byte() % vertices_.rows());
    return vertex + bytes_.between(-0.5, 2.0) * (other - vertex);
  }

  std::string ask(const MeshTree& tree) {
    const Vector3 p = query();
    std::ostringstream problem;
    problem.precision(17);
    const double expected = static_cast<double>(brute_force(p));
    const double tolerance = allowed() * std::max(expected, scale(p)) + kAbsolute;
    const auto found = tree.nearest(p);
    if (!found || !(std::abs(std::sqrt(found->squared_distance) - expected) <= tolerance)) {
      problem << "nearest says " << (found ? std::sqrt(found->squared_distance) : kInfinity);
    } else if (!(std::abs((found->point_L - p).norm() - expected) <= tolerance)) {
      problem << "the nearest point is at " << (found->point_L - p).norm();
    } else if (std::sqrt(tree.squared_lower_bound(p, bytes_.byte())) > expected + tolerance) {
      problem << "the lower bound is above the distance";
    } else {
      const double radius = bytes_.between(0.0, 2.0) * expected;
      const bool near = tree.within(p, radius);
      if (std::abs(radius - expected) > tolerance && near != (expected < radius))
        problem << "within " << radius << " m is " << near;
    }
    if (problem.str().empty()) return "";
    problem << "; " << expected << " m is right for " << p.transpose();
    return problem.str();
  }

  /// A hit lies on the surface, none before it is passed over, and `any_hit` sees it too.
  std::string shoot(const MeshTree& tree) {
    const Vector3 p = query(), direction = query() - p;
    if (grazes(p, direction)) return "";
    const double t = tree.first_hit(p, direction), way = direction.norm();
    const double tolerance = kAlong * std::max(scale(p), way) + kAbsolute;
    const double first = static_cast<double>(brute_force_hit(p, direction));
    std::ostringstream problem;
    problem.precision(17);
    if (std::isnan(t) || t < 0.0 || (t - first) * way > tolerance) {
      problem << "first_hit says " << t << ", there is a hit at " << first;
    } else if (std::isfinite(t) && way * t < 1e9 &&
               !(static_cast<double>(brute_force(p + t * direction)) <= tolerance)) {
      problem << "first_hit says " << t << ", where no surface is";
    } else if (std::isfinite(t) && !tree.any_hit(p, direction, 0.0, t)) {
      problem << "first_hit finds " << t << ", any_hit nothing";
    }
    if (problem.str().empty()) return "";
    problem << "; from " << p.transpose() << " along " << direction.transpose();
    return problem.str();
  }

  /// Two copies of the surface, of which the second stands aside.
  std::string ask_itself(const MeshTree& tree) {
    Pose T = Pose::Identity();
    T.translation() = query();
    if (smallest_face() <= kTiny * scale(T.translation())) return "";
    Vector3 here, there;
    const double d = tree.distance(tree, T, kInfinity, &here, &there);
    double most = kInfinity;  // the surfaces are no farther than their vertices
    for (Eigen::Index f = 0; f < tree.triangles().rows(); ++f) {
      const Vector3 p = T * Vector3(vertices_.row(tree.triangles()(f, 0)));
      most = std::min(most, static_cast<double>(brute_force(p)));
    }
    const double tolerance = allowed() * std::max(most, scale(T.translation())) + kAbsolute;
    if (std::isnan(d) || d < 0.0 || d > most + tolerance) {
      std::ostringstream problem;
      problem << "two surfaces are " << d << " m apart, their vertices " << most;
      return problem.str();
    }
    return "";
  }

  Exact3 vertex(Eigen::Index f, int k) const {
    return vertices_.row(triangles_(f, k)).transpose().cast<long double>();
  }
  /// Over all faces: those without area have the points of their sides, which others share or not,
  /// so only faces that the tree keeps count.
  long double brute_force(const Vector3& p) const {
    long double nearest = kInfinity;
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f) {
      if (!has_area(f)) continue;
      nearest = std::min(nearest, triangle_distance(p.cast<long double>(), vertex(f, 0),
                                                    vertex(f, 1), vertex(f, 2)));
    }
    return nearest;
  }
  /// The first clear hit, inside a face by more than rounding; infinity where there is none.
  long double brute_force_hit(const Vector3& p, const Vector3& direction) const {
    const Exact3 d = direction.cast<long double>();
    long double first = kInfinity;
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f) {
      if (!has_area(f)) continue;
      const Exact3 a = vertex(f, 0) - p.cast<long double>(), b = vertex(f, 1) - vertex(f, 0),
                   c = vertex(f, 2) - vertex(f, 0);
      const long double det = d.dot(b.cross(c));
      if (det == 0) continue;
      const long double t = a.dot(b.cross(c)) / det;
      const Exact3 at = t * d - a;
      const long double v = d.dot(at.cross(c)) / det, w = d.dot(b.cross(at)) / det;
      if (t >= 0 && std::min({v, w, 1 - v - w}) > kInside) first = std::min(first, t);
    }
    return first;
  }
  /// Nearly in the plane of a face, or the face nearly a line or a point beside the coordinates:
  /// where it is hit, and whether, is rounding's choice.
  bool grazes(const Vector3& p, const Vector3& direction) const {
    if (!(direction.norm() > 0.0) || smallest_face() <= kTiny * scale(p)) return true;
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f) {
      if (!has_area(f)) continue;
      const Exact3 b = vertex(f, 1) - vertex(f, 0), c = vertex(f, 2) - vertex(f, 0);
      const long double size = face_size(f);
      if (std::abs(direction.cast<long double>().dot(b.cross(c))) <=
          kGrazing * size * size * direction.norm())
        return true;
    }
    return false;
  }
  /// The longest side of a face [m].
  double face_size(Eigen::Index f) const {
    const Exact3 a = vertex(f, 0), b = vertex(f, 1), c = vertex(f, 2);
    return static_cast<double>(std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()}));
  }
  double smallest_face() const {
    double smallest = kInfinity;
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f)
      if (has_area(f)) smallest = std::min(smallest, face_size(f));
    return smallest;
  }
  /// Of the coordinates: how far an answer may be off.
  double allowed() const {
    for (Eigen::Index f = 0; f < triangles_.rows(); ++f) {
      if (!has_area(f)) continue;
      const Exact3 b = vertex(f, 1) - vertex(f, 0), c = vertex(f, 2) - vertex(f, 0);
      if (b.cross(c).norm() < kThin * b.norm() * c.norm()) return kThinRelative;
    }
    return kRelative;
  }
  /// As `MeshTree` has it: in double precision.
  bool has_area(Eigen::Index f) const {
    const Vector3 a = vertices_.row(triangles_(f, 0)), b = vertices_.row(triangles_(f, 1)),
                  c = vertices_.row(triangles_(f, 2));
    return (b - a).cross(c - a).squaredNorm() > 0.0 && (c - b).squaredNorm() > 0.0;
  }
  /// What rounding is relative to [m].
  double scale(const Vector3& p) const {
    return std::max(p.cwiseAbs().maxCoeff(), vertices_.cwiseAbs().maxCoeff());
  }

  Bytes bytes_;
  Points vertices_;
  Triangles triangles_;
};

inline MeshRun run_mesh(const std::uint8_t* data, std::size_t size) {
  return MeshHarness(Bytes(data, size)).run();
}

}  // namespace proxcgal::fuzz
