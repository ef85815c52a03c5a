#include <algorithm>
#include <cmath>
#include <numeric>

#include "bvh.hpp"

namespace proxcgal::detail {
namespace {

struct Box {
  Vector3 low = Vector3::Constant(kInfinity);
  Vector3 high = Vector3::Constant(-kInfinity);
  void add(const Vector3& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  void add(const Box& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  double half_area() const {
    const Vector3 e = high - low;
    return e.minCoeff() < 0.0 ? 0.0 : e.x() * e.y() + e.y() * e.z() + e.z() * e.x();
  }
};

constexpr int kBins = 16;

float round_down(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) <= x ? f : std::nextafter(f, -INFINITY);
}
float round_up(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) >= x ? f : std::nextafter(f, INFINITY);
}

}  // namespace

/// Binned surface-area heuristic, two binary splits folded into one four-wide node.
struct Bvh::Builder {
  const Points& vertices;
  const Triangles& triangles;
  Bvh& out;
  std::vector<Box> boxes;
  std::vector<Vector3> centers;
  std::vector<std::int32_t> order;

  struct Range {
    int begin, end;
    int size() const { return end - begin; }
  };

  Builder(const Points& v, const Triangles& f, Bvh& bvh) : vertices(v), triangles(f), out(bvh) {
    const auto n = static_cast<std::size_t>(f.rows());
    boxes.resize(n);
    centers.resize(n);
    order.resize(n);
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = 0; i < n; ++i) {
      for (int k = 0; k < 3; ++k)
        boxes[i].add(v.row(f(static_cast<Eigen::Index>(i), k)).transpose());
      centers[i] = 0.5 * (boxes[i].low + boxes[i].high);
    }
  }

  Box bounds(Range r) const {
    Box box;
    for (int i = r.begin; i < r.end; ++i) box.add(boxes[static_cast<std::size_t>(order[i])]);
    return box;
  }

  /// Splits so that box area times count is least; by the median where no plane separates.
  std::pair<Range, Range> split(Range r) {
    Box spread;
    for (int i = r.begin; i < r.end; ++i) spread.add(centers[static_cast<std::size_t>(order[i])]);
    int best_axis = -1, best_bin = -1;
    double best_cost = kInfinity;
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = spread.high[axis] - spread.low[axis];
      if (!(extent > 0.0)) continue;
      std::array<Box, kBins> bin_box{};
      std::array<int, kBins> bin_count{};
      for (int i = r.begin; i < r.end; ++i) {
        const auto t = static_cast<std::size_t>(order[i]);
        const auto b = static_cast<std::size_t>(bin_of(centers[t][axis], spread.low[axis], extent));
        bin_box[b].add(boxes[t]);
        ++bin_count[b];
      }
      std::array<double, kBins> right_cost{};
      Box right;
      int count = 0;
      for (int b = kBins - 1; b > 0; --b) {
        right.add(bin_box[static_cast<std::size_t>(b)]);
        count += bin_count[static_cast<std::size_t>(b)];
        right_cost[static_cast<std::size_t>(b)] = count * right.half_area();
      }
      Box left;
      count = 0;
      for (int b = 1; b < kBins; ++b) {
        left.add(bin_box[static_cast<std::size_t>(b - 1)]);
        count += bin_count[static_cast<std::size_t>(b - 1)];
        if (count == 0 || count == r.size()) continue;
        const double cost = count * left.half_area() + right_cost[static_cast<std::size_t>(b)];
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = b;
        }
      }
    }
    const auto first = order.begin() + r.begin, last = order.begin() + r.end;
    auto middle = first + r.size() / 2;
    if (best_axis >= 0) {
      const double low = spread.low[best_axis], extent = spread.high[best_axis] - low;
      middle = std::partition(first, last, [&](std::int32_t t) {
        return bin_of(centers[static_cast<std::size_t>(t)][best_axis], low, extent) < best_bin;
      });
    }
    const int m = static_cast<int>(middle - order.begin());
    return {{r.begin, m}, {m, r.end}};
  }

  static int bin_of(double x, double low, double extent) {
    return std::min(kBins - 1, static_cast<int>(kBins * ((x - low) / extent)));
  }

  std::int32_t make_block(Range r) {
    TriangleBlock block{};
    for (int lane = 0; lane < kWide; ++lane) {
      const std::int32_t t = order[std::min(r.begin + lane, r.end - 1)];
      const Vector3 a = vertices.row(triangles(t, 0)), b = vertices.row(triangles(t, 1)),
                    c = vertices.row(triangles(t, 2));
      for (int k = 0; k < 3; ++k) {
        block.a[k][lane] = a[k];
        block.b[k][lane] = b[k];
        block.c[k][lane] = c[k];
      }
      const Vector3 ab = b - a, ac = c - a;
      const double gram = ab.squaredNorm() * ac.squaredNorm() - std::pow(ab.dot(ac), 2);
      block.inv_ab[lane] = 1.0 / ab.squaredNorm();
      block.inv_ac[lane] = 1.0 / ac.squaredNorm();
      block.inv_bc[lane] = 1.0 / (c - b).squaredNorm();
      const bool sliver = gram < 1e-14 * ab.squaredNorm() * ac.squaredNorm();
      block.inv_gram[lane] = sliver ? 0.0 : 1.0 / gram;
      block.id[lane] = t;
      out.block_of_[static_cast<std::size_t>(t)] = static_cast<std::int32_t>(out.blocks_.size());
    }
    out.blocks_.push_back(block);
    return ~static_cast<std::int32_t>(out.blocks_.size() - 1);
  }

  /// @return row of the node made
  std::int32_t make_node(Range r) {
    std::array<Range, kWide> part{};
    int n = 1;
    part[0] = r;
    while (n < kWide) {
      int widest = -1;
      for (int i = 0; i < n; ++i) {
        const auto& p = part[static_cast<std::size_t>(i)];
        if (p.size() > kWide &&
            (widest < 0 || p.size() > part[static_cast<std::size_t>(widest)].size()))
          widest = i;
      }
      if (widest < 0) break;
      const auto [left, right] = split(part[static_cast<std::size_t>(widest)]);
      part[static_cast<std::size_t>(widest)] = left;
      part[static_cast<std::size_t>(n++)] = right;
    }
    const auto row = static_cast<std::int32_t>(out.nodes_.size());
    out.nodes_.emplace_back();
    BvhNode node{};
    for (int lane = 0; lane < kWide; ++lane) {
      for (int k = 0; k < 3; ++k) {
        node.low[k][lane] = INFINITY;
        node.high[k][lane] = -INFINITY;
      }
      node.child[lane] = kEmpty;
      if (lane >= n) continue;
      const Range p = part[static_cast<std::size_t>(lane)];
      const Box box = bounds(p);
      for (int k = 0; k < 3; ++k) {
        node.low[k][lane] = round_down(box.low[k]);
        node.high[k][lane] = round_up(box.high[k]);
      }
      node.child[lane] = p.size() <= kWide ? make_block(p) : make_node(p);
    }
    out.nodes_[static_cast<std::size_t>(row)] = node;
    return row;
  }
};

Bvh::Bvh(const Points& vertices, const Triangles& triangles) {
  block_of_.resize(static_cast<std::size_t>(triangles.rows()));
  scale_ = vertices.cwiseAbs().maxCoeff();
  Builder builder(vertices, triangles, *this);
  builder.make_node({0, static_cast<int>(triangles.rows())});
}

}  // namespace proxcgal::detail
