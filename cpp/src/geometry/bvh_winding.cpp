/// How often a surface goes round a point, by a tree: far triangles count as one dipole (Barill,
/// Dickson, Schmidt, Levin & Jacobson, Fast Winding Numbers for Soups and Clouds, 2018).
#include <array>
#include <cmath>
#include <numbers>

#include "bvh.hpp"

namespace proxcgal::detail {
namespace {

constexpr double kFar = 3.0;         // radii from which on a subtree counts as one dipole
constexpr double kAmbiguous = 0.05;  // about one half: the dipoles do not decide
constexpr double kHalf = 0.5;
constexpr std::size_t kDeepest = 256;  // pending subtrees: 3 a level, and depth is bounded

/// Solid angle of a triangle over 4 pi (Van Oosterom & Strackee 1983).
double turn(const Vector3& a, const Vector3& b, const Vector3& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double volume = a.dot(b.cross(c));
  return std::atan2(volume, la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb) /
         (2.0 * std::numbers::pi);
}

Vector3 corner(const Double4 (&of)[3], int lane, const Vector3& from) {
  return Vector3(of[0][lane], of[1][lane], of[2][lane]) - from;
}

/// Short leaves repeat their last triangle.
bool repeated(const TriangleBlock& block, int lane) {
  return lane > 0 && block.id[lane] == block.id[lane - 1];
}

}  // namespace

Bvh::Dipole Bvh::add_dipoles(std::int32_t row) {
  Dipole sum;
  const auto add = [&](const Vector3& area_vector, const Vector3& center, double area) {
    sum.area_vector += area_vector;
    sum.center += area * center;
    sum.area += area;
  };
  if (row < 0) {
    const TriangleBlock& block = blocks_[static_cast<std::size_t>(~row)];
    for (int lane = 0; lane < kWide; ++lane) {
      if (repeated(block, lane)) continue;
      const Vector3 a = corner(block.a, lane, Vector3::Zero());
      const Vector3 b = corner(block.b, lane, Vector3::Zero());
      const Vector3 c = corner(block.c, lane, Vector3::Zero());
      const Vector3 area_vector = 0.5 * (b - a).cross(c - a);
      add(area_vector, (a + b + c) / 3.0, area_vector.norm());
    }
  } else {
    const auto at = static_cast<std::size_t>(row);
    for (std::size_t lane = 0; lane < kWide; ++lane) {
      const std::int32_t child = nodes_[at].child[lane];
      if (child == kEmpty) continue;
      Dipole part = add_dipoles(child);
      add(part.area_vector, part.center, part.area);
      const auto k = static_cast<int>(lane);
      for (int axis = 0; axis < 3; ++axis) {
        const double low = static_cast<double>(nodes_[at].low[axis][k]);
        const double high = static_cast<double>(nodes_[at].high[axis][k]);
        const double reach = std::max(part.center[axis] - low, high - part.center[axis]);
        part.radius += reach * reach;
      }
      part.radius = std::sqrt(part.radius);
      dipoles_[at][lane] = part;
    }
  }
  sum.center /= sum.area;
  return sum;
}

double Bvh::winding_number(const Vector3& point, double far) const {
  double winding = 0.0;
  std::array<std::int32_t, kDeepest> pending;
  std::size_t n = 0;
  pending[n++] = 0;
  while (n > 0) {
    const std::int32_t row = pending[--n];
    if (row < 0) {
      const TriangleBlock& block = blocks_[static_cast<std::size_t>(~row)];
      for (int lane = 0; lane < kWide; ++lane) {
        if (repeated(block, lane)) continue;
        winding += turn(corner(block.a, lane, point), corner(block.b, lane, point),
                        corner(block.c, lane, point));
      }
      continue;
    }
    const auto at = static_cast<std::size_t>(row);
    for (std::size_t lane = 0; lane < kWide; ++lane) {
      const std::int32_t child = nodes_[at].child[lane];
      if (child == kEmpty) continue;
      const Dipole& part = dipoles_[at][lane];
      const Vector3 apart = part.center - point;
      const double distance = apart.norm();
      if (distance > far * part.radius) {
        winding +=
            part.area_vector.dot(apart) / (4.0 * std::numbers::pi * distance * distance * distance);
      } else {
        pending[n++] = child;
      }
    }
  }
  return winding;
}

bool Bvh::inside(const Vector3& point) const {
  double around = std::abs(winding_number(point, kFar));
  if (std::abs(around - kHalf) < kAmbiguous) around = std::abs(winding_number(point, kInfinity));
  return around > kHalf;
}

}  // namespace proxcgal::detail
