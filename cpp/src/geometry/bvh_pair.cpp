#include <algorithm>
#include <cmath>
#include <limits>

#include "bvh.hpp"
#include "triangle.hpp"

// Distance between two surfaces: both trees walked together, nearest boxes first.
namespace proxcgal::detail {
namespace {

using Triangle = std::array<Vector3, 3>;

struct Witness {
  double squared = kInfinity;
  Vector3 here = Vector3::Zero(), there = Vector3::Zero();
  void offer(const Vector3& p, const Vector3& q) {
    const double d = (p - q).squaredNorm();
    if (d < squared) *this = {d, p, q};
  }
};

/// Nearest points of two segments (Ericson, Real-Time Collision Detection, 5.1.9).
void offer_segments(const Vector3& p, const Vector3& p_end, const Vector3& q, const Vector3& q_end,
                    Witness& out) {
  const Vector3 u = p_end - p, v = q_end - q, r = p - q;
  const double a = u.squaredNorm(), e = v.squaredNorm(), f = v.dot(r), c = u.dot(r), b = u.dot(v);
  const double denominator = a * e - b * b;
  double s =
      denominator > 1e-14 * a * e ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0.0;
  double t = (b * s + f) / e;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((b * t - c) / a, 0.0, 1.0);
  }
  out.offer(p + s * u, q + t * v);
}

/// Offers the foot of the normal from `p` where it lies inside the triangle.
void offer_foot(const Vector3& p, const Triangle& t, bool swap, Witness& out) {
  const Vector3 ab = t[1] - t[0], ac = t[2] - t[0], n = ab.cross(ac);
  const double nn = n.squaredNorm();
  if (!(nn > 0.0)) return;
  const Vector3 ap = p - t[0];
  const double v = ap.cross(ac).dot(n) / nn, w = ab.cross(ap).dot(n) / nn;
  if (v < 0.0 || w < 0.0 || v + w > 1.0) return;
  const Vector3 foot = t[0] + v * ab + w * ac;
  swap ? out.offer(foot, p) : out.offer(p, foot);
}

/// Where edge p-q crosses the triangle the distance is zero.
void offer_crossing(const Vector3& p, const Vector3& q, const Triangle& t, Witness& out) {
  const Vector3 n = (t[1] - t[0]).cross(t[2] - t[0]);
  const double dp = n.dot(p - t[0]), dq = n.dot(q - t[0]);
  if (!(dp * dq <= 0.0) || dp == dq) return;
  const Vector3 x = p + (dp / (dp - dq)) * (q - p);
  for (std::size_t i = 0; i < 3; ++i) {
    if (n.dot((t[(i + 1) % 3] - t[i]).cross(x - t[i])) < 0.0) return;
  }
  out.offer(x, x);
}

void offer_triangles(const Triangle& s, const Triangle& t, Witness& out) {
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3 &p = s[i], &p_end = s[(i + 1) % 3];
    for (std::size_t j = 0; j < 3; ++j) offer_segments(p, p_end, t[j], t[(j + 1) % 3], out);
    offer_foot(p, t, false, out);
    offer_foot(t[i], s, true, out);
    offer_crossing(p, p_end, t, out);
    offer_crossing(t[i], t[(i + 1) % 3], s, out);
  }
}

Triangle triangle_of(const TriangleBlock& block, int lane) {
  Triangle t;
  for (int k = 0; k < 3; ++k) {
    t[0][k] = block.a[k][lane];
    t[1][k] = block.b[k][lane];
    t[2][k] = block.c[k][lane];
  }
  return t;
}

double gap_squared(const PairBox& x, const PairBox& y) {
  return (x.low - y.high).cwiseMax(y.low - x.high).cwiseMax(0.0).squaredNorm();
}

PairBox box_of(const BvhNode& node, int lane) {
  PairBox box;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = static_cast<double>(node.low[k][lane]);
    box.high[k] = static_cast<double>(node.high[k][lane]);
  }
  return box;
}

PairBox moved(const PairBox& box, const Pose& T) {
  const Vector3 center = T * Vector3(0.5 * (box.low + box.high));
  const Vector3 half = T.linear().cwiseAbs() * (0.5 * (box.high - box.low));
  return {center - half, center + half};
}

/// Lower bound of the distance from a box to four triangles, by the sphere round the box: tight
/// where a few large triangles face many small ones, and boxes round the large ones say little.
double sphere_gap(const Vector3& center, double radius, const TriangleBlock& block) {
  Nearest nearest;
  closest_in_block(block, center.data(), nearest);
  return std::max(0.0, std::sqrt(nearest.squared) - radius);
}

}  // namespace

double Bvh::squared_distance(const Bvh& other, const Pose& T_LO, double squared_bound,
                             Vector3* on_this, Vector3* on_other, const PairWork& work,
                             bool& cut) const {
  Witness best;
  best.squared = squared_bound;
  const Pose T_OL = T_LO.inverse();
  const auto everything = [](const Bvh& bvh) {
    PairBox box{Vector3::Constant(kInfinity), Vector3::Constant(-kInfinity)};
    for (int lane = 0; lane < kWide; ++lane) {
      if (bvh.nodes_[0].child[lane] == kEmpty) continue;
      const PairBox part = box_of(bvh.nodes_[0], lane);
      box.low = box.low.cwiseMin(part.low);
      box.high = box.high.cwiseMax(part.high);
    }
    return box;
  };
  PairHeap& heap = work.heap;
  heap.clear();
  cut = false;
  const auto later = [](const PendingPair& x, const PendingPair& y) { return x.key > y.key; };
  const auto push = [&](std::int32_t here, std::int32_t there, const PairBox& a, const PairBox& b) {
    double key = gap_squared(a, b);
    if (!(key < best.squared)) return;
    if (there < 0 && here >= 0) {
      const Vector3 center = T_OL * Vector3(0.5 * (a.low + a.high));
      const double gap = sphere_gap(center, 0.5 * (a.high - a.low).norm(),
                                    other.blocks_[static_cast<std::size_t>(~there)]);
      key = std::max(key, gap * gap);
    } else if (here < 0 && there >= 0) {
      const double gap = sphere_gap(0.5 * (b.low + b.high), 0.5 * (b.high - b.low).norm(),
                                    blocks_[static_cast<std::size_t>(~here)]);
      key = std::max(key, gap * gap);
    }
    if (!(key < best.squared)) return;
    heap.push_back({key, here, there, a, b});
    std::push_heap(heap.begin(), heap.end(), later);
  };
  push(0, 0, everything(*this), moved(everything(other), T_LO));
  while (!heap.empty()) {
    std::pop_heap(heap.begin(), heap.end(), later);
    const PendingPair pair = heap.back();
    heap.pop_back();
    if (!(pair.key < best.squared) || best.squared == 0.0) break;
    cut = --work.steps < 0 || (work.bounded && heap.size() + kWide > kPairHeap);
    if (cut) {  // nothing that is left is nearer than the pair that comes next
      if (!(best.squared < squared_bound)) {
        best.here.setConstant(std::numeric_limits<double>::quiet_NaN());
        best.there = best.here;
      }
      best.squared = pair.key;
      break;
    }
    if (pair.here < 0 && pair.there < 0) {
      const TriangleBlock& a = blocks_[static_cast<std::size_t>(~pair.here)];
      const TriangleBlock& b = other.blocks_[static_cast<std::size_t>(~pair.there)];
      std::array<Triangle, kWide> moved_b;
      for (int j = 0; j < kWide; ++j) {
        moved_b[static_cast<std::size_t>(j)] = triangle_of(b, j);
        for (Vector3& p : moved_b[static_cast<std::size_t>(j)]) p = T_LO * p;
      }
      for (int i = 0; i < kWide; ++i) {
        if (i > 0 && a.id[i] == a.id[i - 1]) continue;
        const Triangle t = triangle_of(a, i);
        const Vector3 center = (t[0] + t[1] + t[2]) / 3.0;
        const double radius =
            std::sqrt(std::max({(t[0] - center).squaredNorm(), (t[1] - center).squaredNorm(),
                                (t[2] - center).squaredNorm()}));
        const double gap = sphere_gap(T_OL * center, radius, b);
        if (!(gap * gap < best.squared)) continue;
        for (int j = 0; j < kWide; ++j) {
          if (j > 0 && b.id[j] == b.id[j - 1]) continue;
          offer_triangles(t, moved_b[static_cast<std::size_t>(j)], best);
        }
      }
      continue;
    }
    // The larger box is opened first: that raises the bounds soonest.
    const bool open_here =
        pair.there < 0 ||
        (pair.here >= 0 && (pair.box_here.high - pair.box_here.low).maxCoeff() >=
                               (pair.box_there.high - pair.box_there.low).maxCoeff());
    const BvhNode& node = open_here ? nodes_[static_cast<std::size_t>(pair.here)]
                                    : other.nodes_[static_cast<std::size_t>(pair.there)];
    for (int lane = 0; lane < kWide; ++lane) {
      if (node.child[lane] == kEmpty) continue;
      const PairBox box = box_of(node, lane);
      open_here ? push(node.child[lane], pair.there, box, pair.box_there)
                : push(pair.here, node.child[lane], pair.box_here, moved(box, T_LO));
    }
  }
  if (on_this != nullptr) *on_this = best.here;
  if (on_other != nullptr) *on_other = T_OL * best.there;
  return best.squared;
}

}  // namespace proxcgal::detail
