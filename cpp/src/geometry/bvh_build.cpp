#include <algorithm>
#include <cmath>
#include <numeric>

#include "bvh.hpp"
#include "kernels.hpp"

namespace proxcgal::detail {
namespace {

constexpr int kMostBins = 16, kFewBins = 8;
constexpr float kFlat = 1e-20F;  // [m] a side so short tells nothing, and its inverse may overflow
constexpr int kDeep = 24;  // from this depth on parts are halved: the walks' stacks have an end
constexpr int kFew = 128;  // triangles for which few bins do as well

float round_down(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) <= x ? f : std::nextafter(f, -INFINITY);
}
float round_up(double x) {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) >= x ? f : std::nextafter(f, INFINITY);
}

/// Rounded outwards; the fourth lane is unused.
struct Box {
  Float4 low{INFINITY, INFINITY, INFINITY, 0.0F};
  Float4 high{-INFINITY, -INFINITY, -INFINITY, 0.0F};
  void add(const Box& other) {
    low = low < other.low ? low : other.low;
    high = high > other.high ? high : other.high;
  }
  float half_area() const {
    const Float4 e = high - low;
    return e[0] < 0.0F ? 0.0F : e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }
};

}  // namespace

/// Binned surface-area heuristic, two binary splits folded into one four-wide node.
struct Bvh::Builder {
  const Points& vertices;
  const Triangles& triangles;
  Bvh& out;
  std::vector<Box> boxes;
  std::vector<Float4> centers;
  std::vector<std::int32_t> order;

  /// Some triangles of `order`, and the box round them.
  struct Part {
    int begin = 0, end = 0;
    Box box;
    int size() const { return end - begin; }
  };

  Builder(const Points& v, const Triangles& f, Bvh& bvh) : vertices(v), triangles(f), out(bvh) {
    const auto n = static_cast<std::size_t>(f.rows());
    boxes.resize(n);
    centers.resize(n);
    order.resize(n);
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = 0; i < n; ++i) {
      for (int corner = 0; corner < 3; ++corner) {
        const int row = f(static_cast<Eigen::Index>(i), corner);
        Box box;
        for (int k = 0; k < 3; ++k) {
          box.low[k] = round_down(v(row, k));
          box.high[k] = round_up(v(row, k));
        }
        boxes[i].add(box);
      }
      centers[i] = (boxes[i].low + boxes[i].high) * 0.5F;
    }
  }

  Part part(int begin, int end) const {
    Part part{begin, end, {}};
    for (int i = begin; i < end; ++i) part.box.add(boxes[static_cast<std::size_t>(order[i])]);
    return part;
  }

  /// Splits along the longest side: for two leaves' worth a better plane is not worth its search.
  std::pair<Part, Part> halves(const Part& whole, Float4 extent) {
    int axis = extent[1] > extent[0] ? 1 : 0;
    if (extent[2] > extent[axis]) axis = 2;
    const auto first = order.begin() + whole.begin, last = order.begin() + whole.end;
    const auto before = [&](std::int32_t s, std::int32_t t) {
      return centers[static_cast<std::size_t>(s)][axis] <
             centers[static_cast<std::size_t>(t)][axis];
    };
    const int half = whole.size() / 2;
    std::nth_element(first, first + half, last, before);
    return {part(whole.begin, whole.begin + half), part(whole.begin + half, whole.end)};
  }

  /// Splits so that box area times count is least; by the median where no plane separates.
  std::pair<Part, Part> split(const Part& whole, int depth) {
    Box spread;
    for (int i = whole.begin; i < whole.end; ++i) {
      const Float4 center = centers[static_cast<std::size_t>(order[i])];
      spread.add({center, center});
    }
    const Float4 extent = spread.high - spread.low;
    if (whole.size() <= 2 * kWide || depth > kDeep) return halves(whole, extent);
    const int bins = whole.size() > kFew ? kMostBins : kFewBins;
    const auto n_bins = static_cast<std::size_t>(bins);
    Float4 bins_per_metre{};
    for (int k = 0; k < 3; ++k)
      bins_per_metre[k] = extent[k] > kFlat ? static_cast<float>(bins) / extent[k] : 0.0F;
    const auto bin_of = [&](std::int32_t t, int axis) {
      const Float4 at = (centers[static_cast<std::size_t>(t)] - spread.low) * bins_per_metre;
      return std::min(bins - 1, static_cast<int>(at[axis]));
    };
    std::array<std::array<Box, kMostBins>, 3> bin_box;
    std::array<std::array<int, kMostBins>, 3> bin_count;
    for (std::size_t a = 0; a < 3; ++a) {
      std::fill_n(bin_box[a].begin(), n_bins, Box{});
      std::fill_n(bin_count[a].begin(), n_bins, 0);
    }
    for (int i = whole.begin; i < whole.end; ++i) {
      const auto t = static_cast<std::size_t>(order[i]);
      const Float4 at = (centers[t] - spread.low) * bins_per_metre;
      const Box box = boxes[t];
      for (std::size_t a = 0; a < 3; ++a) {
        const auto b = static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(at[a])));
        bin_box[a][b].add(box);
        ++bin_count[a][b];
      }
    }
    int best_axis = -1, best_bin = -1;
    float best_cost = INFINITY;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(extent[axis] > kFlat)) continue;
      const auto a = static_cast<std::size_t>(axis);
      std::array<float, kMostBins> right_cost;
      Box right{}, left{};
      int count = 0;
      for (std::size_t b = n_bins - 1; b > 0; --b) {
        right.add(bin_box[a][b]);
        count += bin_count[a][b];
        right_cost[b] = static_cast<float>(count) * right.half_area();
      }
      count = 0;
      for (std::size_t b = 1; b < n_bins; ++b) {
        left.add(bin_box[a][b - 1]);
        count += bin_count[a][b - 1];
        if (count == 0 || count == whole.size()) continue;
        const float cost = static_cast<float>(count) * left.half_area() + right_cost[b];
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = static_cast<int>(b);
        }
      }
    }
    const auto first = order.begin() + whole.begin, last = order.begin() + whole.end;
    auto middle = first + whole.size() / 2;
    if (best_axis >= 0) {
      middle = std::partition(first, last,
                              [&](std::int32_t t) { return bin_of(t, best_axis) < best_bin; });
    }
    const int m = static_cast<int>(middle - order.begin());
    return {part(whole.begin, m), part(m, whole.end)};
  }

  std::int32_t make_block(const Part& r) {
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
    }
    out.blocks_.push_back(block);
    return ~static_cast<std::int32_t>(out.blocks_.size() - 1);
  }

  /// @return row of the node made
  std::int32_t make_node(const Part& whole, int depth) {
    std::array<Part, kWide> parts;
    int n = 1;
    parts[0] = whole;
    while (n < kWide) {
      int largest = -1;
      for (int i = 0; i < n; ++i) {
        const auto& p = parts[static_cast<std::size_t>(i)];
        if (p.size() > kWide &&
            (largest < 0 || p.size() > parts[static_cast<std::size_t>(largest)].size()))
          largest = i;
      }
      if (largest < 0) break;
      const auto [left, right] = split(parts[static_cast<std::size_t>(largest)], depth);
      parts[static_cast<std::size_t>(largest)] = left;
      parts[static_cast<std::size_t>(n++)] = right;
    }
    const auto row = static_cast<std::int32_t>(out.nodes_.size());
    out.nodes_.emplace_back();
    BvhNode node{};
    for (int lane = 0; lane < kWide; ++lane) {
      const Part part = lane < n ? parts[static_cast<std::size_t>(lane)] : Part{};
      for (int k = 0; k < 3; ++k) {
        node.low[k][lane] = part.box.low[k];
        node.high[k][lane] = part.box.high[k];
      }
      node.child[lane] = kEmpty;
      if (lane < n)
        node.child[lane] = part.size() <= kWide ? make_block(part) : make_node(part, depth + 1);
    }
    out.nodes_[static_cast<std::size_t>(row)] = node;
    return row;
  }
};

Bvh::Bvh(const Points& vertices, const Triangles& triangles) {
  kernels();  // what is wrong with their choice is told now, not in a tick
  scale_ = vertices.cwiseAbs().maxCoeff();
  blocks_.reserve(static_cast<std::size_t>(triangles.rows()) / 2);
  Builder builder(vertices, triangles, *this);
  builder.make_node(builder.part(0, static_cast<int>(triangles.rows())), 0);
  dipoles_.resize(nodes_.size());
  add_dipoles(0);
}

}  // namespace proxcgal::detail
