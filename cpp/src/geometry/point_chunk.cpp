#include "point_chunk.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace proxcgal::detail {
namespace {

// A dozen roundings to single precision, each at most 6e-8 of the largest coordinate.
constexpr float kRounding = 2e-6F;

/// Least and greatest, four at a time; what is not a number is passed over.
std::pair<float, float> extent(const float* x, int count) {
  Float4 low{INFINITY, INFINITY, INFINITY, INFINITY}, high = -low;
  for (int i = 0; i < count; i += 4) {
    Float4 next;
    std::memcpy(&next, x + i, sizeof next);
    low = next < low ? next : low;
    high = next > high ? next : high;
  }
  return {std::min({low[0], low[1], low[2], low[3]}),
          std::max({high[0], high[1], high[2], high[3]})};
}

}  // namespace

LinkBox::LinkBox(const Bounds& bounds, const Pose& T_WL) {
  const Eigen::Matrix3d R_LW = T_WL.linear().transpose();
  const Vector3 offset = R_LW * T_WL.translation() + bounds.center;
  const Vector3 half = 0.5 * (bounds.high - bounds.low);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) view_.R_LW[k][j] = static_cast<float>(R_LW(k, j));
    view_.offset[k] = static_cast<float>(offset[k]);
    view_.half[k] = static_cast<float>(half[k]);
  }
  scale_ = static_cast<float>(offset.cwiseAbs().maxCoeff() + half.maxCoeff());
}

PointChunk::PointChunk(const PointsRef& points_W, Eigen::Index begin) : begin_(begin) {
  const int count = static_cast<int>(std::min<Eigen::Index>(points_W.rows() - begin, kRoom));
  view_.count = count;
  const double* row = points_W.data() + begin * points_W.outerStride();
  for (int i = 0; i < count; ++i, row += points_W.outerStride()) {
    for (std::size_t k = 0; k < 3; ++k) view_.p_W[k][i] = static_cast<float>(row[k]);
  }
  // Eight are looked at together.
  for (int i = count; i % 8 != 0; ++i) {
    for (std::size_t k = 0; k < 3; ++k) view_.p_W[k][i] = view_.p_W[k][count - 1];
  }
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = extent(view_.p_W[k], count);
    center_W_[k] = 0.5F * (low + high);
    half_[k] = 0.5F * (high - low);
    scale_ = std::max({scale_, std::abs(low), std::abs(high)});
  }
}

float PointChunk::allowance(const LinkBox& box) const { return kRounding * (scale_ + box.scale_); }

bool PointChunk::may_reach(const LinkBox& box, float squared_limit) const {
  const float e = allowance(box);
  const LinkBoxView& view = box.view_;
  float sum = 0.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* r = view.R_LW[k];
    const float center =
        r[0] * center_W_[0] + r[1] * center_W_[1] + r[2] * center_W_[2] - view.offset[k];
    const float half = std::abs(r[0]) * half_[0] + std::abs(r[1]) * half_[1] +
                       std::abs(r[2]) * half_[2] + view.half[k] + e;
    const float gap = std::abs(center) - half;
    const float open = gap > 0.0F ? gap : 0.0F;
    sum += open * open;
  }
  // Negated, so that what overflowed is looked at.
  return !(sum * 0.999999F > squared_limit);
}

int PointChunk::near_rows(const LinkBox& box, const Limits& squared_limits, Rows& rows) const {
  return kernels().near_rows(view_, box.view_, allowance(box), squared_limits.data(), rows.data());
}

void PointChunk::squared_bounds(const LinkBox& box, Limits& out) const {
  kernels().squared_bounds(view_, box.view_, allowance(box), out.data());
}

std::pair<int, float> PointChunk::likeliest(const LinkBox& box) const {
  Limits bounds;
  squared_bounds(box, bounds);
  const auto least = std::min_element(bounds.begin(), bounds.begin() + count());
  return {static_cast<int>(least - bounds.begin()), *least};
}

std::pair<Vector3, double> PointChunk::ball() const {
  const Vector3 half(half_[0], half_[1], half_[2]);
  return {Vector3(center_W_[0], center_W_[1], center_W_[2]),
          half.norm() + static_cast<double>(kRounding * scale_)};
}

}  // namespace proxcgal::detail
