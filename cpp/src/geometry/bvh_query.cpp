#include <algorithm>
#include <cmath>

#include "bvh.hpp"
#include "triangle.hpp"

namespace proxcgal::detail {
namespace {

constexpr int kStack = 256;  // depth of the tree times three: far above what 10^7 triangles need

struct Entry {
  float key;  // lower bound that the box gives
  std::int32_t child;
};

Float4 splat(float x) { return Float4{x, x, x, x}; }
Float4 max4(Float4 a, Float4 b) { return a > b ? a : b; }
Float4 min4(Float4 a, Float4 b) { return a < b ? a : b; }

// Rounding of the query into single precision moves it by at most this much.
float allowance(const Vector3& p, double scale) {
  return static_cast<float>(4e-7 * (p.cwiseAbs().maxCoeff() + scale));
}

/// Lower bounds of the squared distance from a point to four boxes. The point is given widened to
/// [low, high]: what rounding may have moved it by.
struct PointBounds {
  Float4 low[3], high[3];
  PointBounds(const Vector3& p, double scale) {
    const float e = allowance(p, scale);
    for (int k = 0; k < 3; ++k) {
      low[k] = splat(static_cast<float>(p[k]) - e);
      high[k] = splat(static_cast<float>(p[k]) + e);
    }
  }
  Float4 operator()(const BvhNode& node) const {
    Float4 sum = splat(0.0F);
    for (int k = 0; k < 3; ++k) {
      const Float4 gap = max4(max4(node.low[k] - high[k], low[k] - node.high[k]), splat(0.0F));
      sum += gap * gap;
    }
    return sum * splat(0.999999F);
  }
};

/// Pushes the children whose key is below the bound, nearest last so that it is popped first.
int push_sorted(const BvhNode& node, Float4 key, float bound, Entry* stack, int top) {
  const int first = top;
  for (int lane = 0; lane < kWide; ++lane) {
    if (!(key[lane] < bound) || node.child[lane] == kEmpty) continue;
    int at = top++;
    while (at > first && stack[at - 1].key < key[lane]) {
      stack[at] = stack[at - 1];
      --at;
    }
    stack[at] = {key[lane], node.child[lane]};
  }
  return top;
}

float bound_above(double squared) {
  return squared >= 3e38 ? INFINITY : std::nextafter(static_cast<float>(squared), INFINITY);
}

}  // namespace

SurfacePoint Bvh::nearest(const Vector3& point, double squared_bound, int hint) const {
  SurfacePoint best;
  best.squared_distance = squared_bound;
  if (hint >= 0) {
    closest_in_block(blocks_[static_cast<std::size_t>(block_of_[static_cast<std::size_t>(hint)])],
                     point, best);
  }
  const PointBounds bounds(point, scale_);
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {0.0F, 0};
  float limit = bound_above(best.squared_distance);
  while (top > 0) {
    const Entry entry = stack[--top];
    if (!(entry.key < limit)) continue;
    if (entry.child < 0) {
      closest_in_block(blocks_[static_cast<std::size_t>(~entry.child)], point, best);
      limit = bound_above(best.squared_distance);
    } else {
      const BvhNode& node = nodes_[static_cast<std::size_t>(entry.child)];
      top = push_sorted(node, bounds(node), limit, stack, top);
    }
  }
  return best;
}

bool Bvh::within(const Vector3& point, double squared_radius) const {
  const PointBounds bounds(point, scale_);
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {0.0F, 0};
  const float limit = bound_above(squared_radius);
  SurfacePoint best;
  best.squared_distance = squared_radius;
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.child < 0) {
      closest_in_block(blocks_[static_cast<std::size_t>(~entry.child)], point, best);
      if (best.triangle >= 0) return true;
    } else {
      const BvhNode& node = nodes_[static_cast<std::size_t>(entry.child)];
      top = push_sorted(node, bounds(node), limit, stack, top);
    }
  }
  return false;
}

template <bool kAnyHit>
double Bvh::trace(const Vector3& origin, const Vector3& direction, double t_min,
                  double t_max) const {
  const float e = allowance(origin, scale_);
  Float4 near_origin[3], far_origin[3], inverse[3];
  for (int k = 0; k < 3; ++k) {
    // A zero component would make 0 * infinity; a tiny one bounds the same slab.
    const double d =
        std::abs(direction[k]) < 1e-30 ? std::copysign(1e-30, direction[k]) : direction[k];
    const auto inv = static_cast<float>(1.0 / d);
    inverse[k] = splat(inv);
    const auto o = static_cast<float>(origin[k]);
    // The slab's own side is widened, whichever way the ray runs through it.
    near_origin[k] = splat(inv >= 0.0F ? o + e : o - e);
    far_origin[k] = splat(inv >= 0.0F ? o - e : o + e);
  }
  constexpr float slack = 1e-6F;
  const auto begin = static_cast<float>(t_min);
  const float t_low = begin - slack * std::abs(begin);
  double best = t_max;
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {t_low, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (static_cast<double>(entry.key) > best) continue;
    if (entry.child < 0) {
      const TriangleBlock& block = blocks_[static_cast<std::size_t>(~entry.child)];
      const double t = first_hit_in_block(block, origin, direction, t_min, best);
      if (t < best) {
        best = t;
        if constexpr (kAnyHit) return best;
      }
      continue;
    }
    const BvhNode& node = nodes_[static_cast<std::size_t>(entry.child)];
    Float4 enter = splat(t_low);
    Float4 leave = splat(best >= 3e38 ? INFINITY : static_cast<float>(best));
    for (int k = 0; k < 3; ++k) {
      const bool forward = inverse[k][0] >= 0.0F;
      enter = max4(enter, ((forward ? node.low[k] : node.high[k]) - near_origin[k]) * inverse[k]);
      leave = min4(leave, ((forward ? node.high[k] : node.low[k]) - far_origin[k]) * inverse[k]);
    }
    const Float4 size = max4(enter, -enter);
    enter -= size * splat(slack);
    leave += max4(leave, -leave) * splat(slack);
    Float4 key;
    for (int lane = 0; lane < kWide; ++lane)
      key[lane] = enter[lane] <= leave[lane] ? enter[lane] : INFINITY;
    top = push_sorted(node, key, INFINITY, stack, top);
  }
  return best;
}

bool Bvh::any_hit(const Vector3& origin, const Vector3& direction, double t_min,
                  double t_max) const {
  // Searched with an open end: what is found at t_max itself still counts.
  const double end = std::nextafter(t_max, kInfinity);
  return trace<true>(origin, direction, t_min, end) < end;
}

double Bvh::first_hit(const Vector3& origin, const Vector3& direction, double t_min) const {
  return trace<false>(origin, direction, t_min, kInfinity);
}

}  // namespace proxcgal::detail
