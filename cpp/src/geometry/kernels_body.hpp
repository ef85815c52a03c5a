// The innermost loops. Included by one file an instruction set: all of it has internal linkage, and
// it calls nothing of the standard library or Eigen out of line. Code for a newer processor must
// never be what the linker picks for an older one.
#include "kernels.hpp"
#include "triangle.hpp"

namespace proxcgal::detail {
namespace {

constexpr int kStack =
    256;  // three times the depth: the builder ends it below 40 for 10^7 triangles

struct Entry {
  float key;  // lower bound that the box gives
  std::int32_t child;
};

Float4 splat(float x) { return Float4{x, x, x, x}; }
Float4 max4(Float4 a, Float4 b) { return a > b ? a : b; }
Float4 min4(Float4 a, Float4 b) { return a < b ? a : b; }
double magnitude(double x) { return x < 0.0 ? -x : x; }

// Rounding of the query into single precision moves it by at most this much.
float allowance(const double* p, double scale) {
  double largest = 0.0;
  for (int k = 0; k < 3; ++k) largest = magnitude(p[k]) > largest ? magnitude(p[k]) : largest;
  return static_cast<float>(4e-7 * (largest + scale));
}

/// Lower bounds of the squared distance from a point to four boxes. The point is given widened to
/// [low, high]: what rounding may have moved it by.
struct PointBounds {
  Float4 low[3], high[3];
  PointBounds(const double* p, double scale) {
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

/// Is any of the boxes whole within the squared radius? Whatever it holds then is near enough.
bool any_box_within(const BvhNode& node, const PointBounds& p, float squared_radius) {
  Float4 sum = splat(0.0F);
  for (int k = 0; k < 3; ++k) {
    const Float4 far = max4(p.high[k] - node.low[k], node.high[k] - p.low[k]);
    sum += far * far;  // infinite where there is no child
  }
  sum *= splat(1.000001F);
  bool any = false;
  for (int lane = 0; lane < kWide; ++lane) any |= sum[lane] < squared_radius;
  return any;
}

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

void nearest(const BvhView& tree, const double* point, Nearest& best, std::int64_t& steps) {
  const PointBounds bounds(point, tree.scale);
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {0.0F, 0};
  float limit = not_below(best.squared);
  while (top > 0) {
    const Entry entry = stack[--top];
    if (!(entry.key <= limit)) continue;
    if (--steps < 0) return;
    if (entry.child < 0) {
      closest_in_block(tree.blocks[~entry.child], point, best);
      limit = not_below(best.squared);
    } else {
      const BvhNode& node = tree.nodes[entry.child];
      top = push_sorted(node, bounds(node), limit, stack, top);
    }
  }
}

double squared_lower_bound(const BvhView& tree, const double* point, int steps) {
  const PointBounds bounds(point, tree.scale);
  constexpr int room = 512;
  Entry open[room];
  int count = 0;
  open[count++] = {0.0F, 0};
  // Always the box that bounds least is opened, so that every step raises the bound.
  while (true) {
    int least = 0;
    for (int i = 1; i < count; ++i) least = open[i].key < open[least].key ? i : least;
    const Entry entry = open[least];
    if (entry.child < 0 || --steps < 0 || count + kWide > room) return entry.key;
    open[least] = open[--count];
    const BvhNode& node = tree.nodes[entry.child];
    const Float4 key = bounds(node);
    for (int lane = 0; lane < kWide; ++lane) {
      if (node.child[lane] != kEmpty) open[count++] = {key[lane], node.child[lane]};
    }
  }
}

bool within(const BvhView& tree, const double* point, double squared_radius, std::int64_t& steps) {
  const PointBounds bounds(point, tree.scale);
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {0.0F, 0};
  const float limit = not_below(squared_radius);
  const float below = limit * 0.999999F;
  Nearest best;
  best.squared = squared_radius;
  while (top > 0 && --steps >= 0) {
    const Entry entry = stack[--top];
    if (entry.child < 0) {
      closest_in_block(tree.blocks[~entry.child], point, best);
      if (best.triangle >= 0) return true;
    } else {
      const BvhNode& node = tree.nodes[entry.child];
      if (any_box_within(node, bounds, below)) return true;
      top = push_sorted(node, bounds(node), limit, stack, top);
    }
  }
  return false;
}

template <bool kAnyHit>
double trace(const BvhView& tree, const double* origin, const double* direction, double t_min,
             double t_max) {
  const float e = allowance(origin, tree.scale);
  Float4 near_origin[3], far_origin[3], inverse[3];
  for (int k = 0; k < 3; ++k) {
    // A zero component would make 0 * infinity; a tiny one bounds the same slab.
    double d = direction[k];
    if (magnitude(d) < 1e-30) d = d < 0.0 ? -1e-30 : 1e-30;
    const auto inv = static_cast<float>(1.0 / d);
    inverse[k] = splat(inv);
    const auto o = static_cast<float>(origin[k]);
    // The slab's own side is widened, whichever way the ray runs through it.
    near_origin[k] = splat(inv >= 0.0F ? o + e : o - e);
    far_origin[k] = splat(inv >= 0.0F ? o - e : o + e);
  }
  constexpr float slack = 1e-6F;
  const auto begin = static_cast<float>(t_min);
  const float t_low = begin - slack * (begin < 0.0F ? -begin : begin);
  double best = t_max;
  Entry stack[kStack];
  int top = 0;
  stack[top++] = {t_low, 0};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (static_cast<double>(entry.key) > best) continue;
    if (entry.child < 0) {
      const double t =
          first_hit_in_block(tree.blocks[~entry.child], origin, direction, t_min, best);
      if (t < best) {
        best = t;
        if constexpr (kAnyHit) return best;
      }
      continue;
    }
    const BvhNode& node = tree.nodes[entry.child];
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

double first_hit(const BvhView& tree, const double* origin, const double* direction, double t_min,
                 double t_max) {
  return trace<false>(tree, origin, direction, t_min, t_max);
}
double any_hit(const BvhView& tree, const double* origin, const double* direction, double t_min,
               double t_max) {
  return trace<true>(tree, origin, direction, t_min, t_max);
}

Float8 load8(const float* p) {
  Float8 v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}

/// Which lanes are set, one bit a lane.
unsigned bits(std::int32_t __attribute__((vector_size(32))) mask) {
#if defined(__AVX__)
  Float8 lanes;
  __builtin_memcpy(&lanes, &mask, sizeof mask);
  return static_cast<unsigned>(__builtin_ia32_movmskps256(lanes));
#elif defined(__SSE__)
  Float4 lanes[2];
  __builtin_memcpy(lanes, &mask, sizeof mask);
  return static_cast<unsigned>(__builtin_ia32_movmskps(lanes[0]) | __builtin_ia32_movmskps(lanes[1])
                                                                       << 4);
#else
  unsigned set = 0;
  for (unsigned lane = 0; lane < 8; ++lane) set |= mask[lane] != 0 ? 1U << lane : 0U;
  return set;
#endif
}

/// Eight points at a time, from `first` on.
Float8 squared_bound(const ChunkView& chunk, const LinkBoxView& box, float allowance, int first) {
  const Float8 zero{};
  const Float8 x = load8(chunk.p_W[0] + first), y = load8(chunk.p_W[1] + first),
               z = load8(chunk.p_W[2] + first);
  Float8 sum = zero;
  for (int k = 0; k < 3; ++k) {
    const float* r = box.R_LW[k];
    const Float8 p = x * r[0] + y * r[1] + z * r[2] - box.offset[k];
    Float8 gap = (p > -p ? p : -p) - (box.half[k] + allowance);
    gap = gap > zero ? gap : zero;  // what is not a number counts as near
    sum += gap * gap;
  }
  return sum * 0.999999F;
}

int near_rows(const ChunkView& chunk, const LinkBoxView& box, float allowance, const float* limits,
              std::uint8_t* rows) {
  int n = 0;
  for (int first = 0; first < chunk.count; first += 8) {
    const Float8 bound = squared_bound(chunk, box, allowance, first);
    unsigned set = bits(bound <= load8(limits + first));
    if (chunk.count - first < 8) set &= (1U << (chunk.count - first)) - 1U;
    for (; set != 0; set &= set - 1)
      rows[n++] = static_cast<std::uint8_t>(first + __builtin_ctz(set));
  }
  return n;
}

void squared_bounds(const ChunkView& chunk, const LinkBoxView& box, float allowance, float* out) {
  for (int first = 0; first < chunk.count; first += 8) {
    const Float8 bound = squared_bound(chunk, box, allowance, first);
    __builtin_memcpy(out + first, &bound, sizeof bound);
  }
}

}  // namespace

const Kernels PROXCGAL_KERNELS = {
    PROXCGAL_KERNELS_NAME, nearest, squared_lower_bound, within, first_hit, any_hit, near_rows,
    squared_bounds};

}  // namespace proxcgal::detail
