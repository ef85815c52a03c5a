#pragma once
#include "kernels.hpp"

/// Triangle kernels, four at a time; internal to each instruction set that includes them.
namespace proxcgal::detail {
namespace {

Double4 splat(double x) { return Double4{x, x, x, x}; }
Double4 clamp01(Double4 x) {
  x = x > 0.0 ? x : splat(0.0);
  return x < 1.0 ? x : splat(1.0);
}
Double4 dot4(const Double4 (&u)[3], const Double4 (&v)[3]) {
  return u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
}

/// Improves `best` by the block's triangles.
///
/// Each triangle offers four candidates: the nearest point of each edge, and the foot of the
/// normal where it lies inside. All of them are points of the triangle, so rounding can never
/// report less than the true distance by more than itself, not even on slivers.
void closest_in_block(const TriangleBlock& block, const double* point, Nearest& best) {
  Double4 ab[3], ac[3], ap[3];
  for (int k = 0; k < 3; ++k) {
    ab[k] = block.b[k] - block.a[k];
    ac[k] = block.c[k] - block.a[k];
    ap[k] = splat(point[k]) - block.a[k];
  }
  const Double4 ab_ab = dot4(ab, ab), ab_ac = dot4(ab, ac), ac_ac = dot4(ac, ac);
  const Double4 ap_ab = dot4(ap, ab), ap_ac = dot4(ap, ac);

  Double4 best_v = splat(0.0), best_w = splat(0.0), best_d = splat(kInfinity);
  const auto consider = [&](Double4 v, Double4 w, Mask4 valid) {
    Double4 gap[3];
    for (int k = 0; k < 3; ++k) gap[k] = ap[k] - (v * ab[k] + w * ac[k]);
    const Double4 d = dot4(gap, gap);
    const Mask4 better = valid & (d < best_d);
    best_d = better ? d : best_d;
    best_v = better ? v : best_v;
    best_w = better ? w : best_w;
  };
  const Mask4 always = splat(0.0) == splat(0.0);
  consider(clamp01(ap_ab * block.inv_ab), splat(0.0), always);
  consider(splat(0.0), clamp01(ap_ac * block.inv_ac), always);
  const Double4 t = clamp01(((ap_ac - ap_ab) + (ab_ab - ab_ac)) * block.inv_bc);
  consider(1.0 - t, t, always);
  const Double4 v = (ac_ac * ap_ab - ab_ac * ap_ac) * block.inv_gram;
  const Double4 w = (ab_ab * ap_ac - ab_ac * ap_ab) * block.inv_gram;
  consider(v, w, (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0));

  for (int lane = 0; lane < kWide; ++lane) {
    if (!(best_d[lane] < best.squared)) continue;
    best.squared = best_d[lane];
    best.triangle = block.id[lane];
    for (int k = 0; k < 3; ++k) {
      best.point[k] = block.a[k][lane] + (best_v[lane] * ab[k][lane] + best_w[lane] * ac[k][lane]);
    }
  }
}

/// Smallest t in [t_min, t_max) of a hit, or infinity.
///
/// Signed volumes of the ray with each edge (Pluecker), taken about the ray's origin: the value of
/// a shared edge is exactly opposite in both triangles, so no ray slips between them.
[[maybe_unused]] double first_hit_in_block(const TriangleBlock& block, const double* origin,
                                           const double* direction, double t_min, double t_max) {
  Double4 a[3], b[3], c[3];
  for (int k = 0; k < 3; ++k) {
    a[k] = block.a[k] - splat(origin[k]);
    b[k] = block.b[k] - splat(origin[k]);
    c[k] = block.c[k] - splat(origin[k]);
  }
  const auto edge = [&](const Double4(&p)[3], const Double4(&q)[3]) {
    Double4 sum[3], e[3];
    for (int k = 0; k < 3; ++k) {
      sum[k] = p[k] + q[k];
      e[k] = p[k] - q[k];
    }
    return (sum[1] * e[2] - sum[2] * e[1]) * direction[0] +
           (sum[2] * e[0] - sum[0] * e[2]) * direction[1] +
           (sum[0] * e[1] - sum[1] * e[0]) * direction[2];
  };
  const Double4 u = edge(c, b), v = edge(a, c), w = edge(b, a);
  const Mask4 hit = ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));

  Double4 ab[3], ac[3], n[3];
  for (int k = 0; k < 3; ++k) {
    ab[k] = b[k] - a[k];
    ac[k] = c[k] - a[k];
  }
  n[0] = ab[1] * ac[2] - ab[2] * ac[1];
  n[1] = ab[2] * ac[0] - ab[0] * ac[2];
  n[2] = ab[0] * ac[1] - ab[1] * ac[0];
  const Double4 slope = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2];
  const Double4 t = dot4(a, n) / slope;  // infinite or NaN for a parallel ray: refused below
  double best = kInfinity;
  for (int lane = 0; lane < kWide; ++lane) {
    if (hit[lane] != 0 && t[lane] >= t_min && t[lane] < t_max && t[lane] < best) best = t[lane];
  }
  return best;
}

}  // namespace
}  // namespace proxcgal::detail
