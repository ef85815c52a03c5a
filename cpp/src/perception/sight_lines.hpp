#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "geometry/voxel_index.hpp"
#include "proxcgal/perception/memory.hpp"

namespace proxcgal::detail {

/// What a scan says of one point.
enum class Verdict : std::uint8_t { kNothing, kThrough, kThere };

/// The rules by which a scan tells that a remembered point is gone, or measured again; `Memory`
/// states them.
class SightLines {
 public:
  /// @param voxel  [m] edge
  SightLines(const ViewModel& model, double voxel);

  /// Is a point before the sensor, inside its field of view? @param point_S  [m]
  bool in_view(float px, float py, float pz) const {
    const float wide = border_[kSide] * pz;
    return static_cast<bool>(static_cast<int>(pz > kNearest) &
                             static_cast<int>(std::abs(px) <= wide) &
                             static_cast<int>(std::abs(py) <= wide));
  }
  /// @param point_S  inside the field of view
  /// @param voxel    that the point lies in
  Verdict judge(const ScanView& view, float px, float py, float pz, const VoxelIndex& index,
                VoxelIndex::Key voxel) const;
  /// The same of a point anywhere in the world.
  Verdict judge(const ScanView& view, const Vector3& point_W, const VoxelIndex& index) const;

 private:
  static constexpr int kSide = 8;
  static constexpr float kNearest = 0.02F;  // [m] along z: nearer than that no zone tells a range

  float margin(double along_z) const;
  bool passes(const ScanView& view, int zx, int zy, float pz, const VoxelIndex& index,
              VoxelIndex::Key voxel) const;
  bool beyond(const ScanView& view, float tx, float ty, int zx, int zy, float depth) const;

  ViewModel model_;
  double voxel_;  // [m]
  // Where the zones look, as tangents.
  std::array<float, kSide> middle_;
  std::array<float, kSide + 1> border_;
};

/// The last of ascending `bounds` at or below a tangent, -1 for none.
template <std::size_t n>
int below(const std::array<float, n>& bounds, float tangent) {
  // Tangents are nearly even: the guess is at most a step off.
  const float share = 0.5F * (tangent - bounds[0]) / -bounds[0];
  int at =
      std::clamp(static_cast<int>(share * static_cast<float>(n - 1)), 0, static_cast<int>(n) - 1);
  while (at >= 0 && bounds[static_cast<std::size_t>(at)] > tangent) --at;
  while (at + 1 < static_cast<int>(n) && bounds[static_cast<std::size_t>(at + 1)] <= tangent) ++at;
  return at;
}

inline SightLines::SightLines(const ViewModel& model, double voxel) : model_(model), voxel_(voxel) {
  const double pitch = model.field_of_view / kSide;
  for (std::size_t i = 0; i < kSide; ++i)
    middle_[i] = static_cast<float>(std::tan((static_cast<double>(i) - 3.5) * pitch));
  for (std::size_t i = 0; i <= kSide; ++i)
    border_[i] = static_cast<float>(std::tan((static_cast<double>(i) - 4.0) * pitch));
}

/// Noise of a range along z, and half a voxel for what the surface does between two rays [m].
inline float SightLines::margin(double along_z) const {
  const double sigma = std::max(model_.sigma_floor, model_.sigma_ratio * along_z);
  return static_cast<float>(model_.sigmas * sigma + 0.5 * voxel_);
}

/// Does the ray of a zone pass the voxel of a point as deep as the point is?
///
/// A zone is wider than a voxel: what it measures beside a point does not stand for the point.
/// If it did, each scan's point would take the place of the last one's, and an arm that passes
/// by slowly would drag them along and leave nothing behind.
inline bool SightLines::passes(const ScanView& view, int zx, int zy, float pz,
                               const VoxelIndex& index, VoxelIndex::Key voxel) const {
  const Vector3 on_ray_S(middle_[static_cast<std::size_t>(zx)] * pz,
                         middle_[static_cast<std::size_t>(zy)] * pz, pz);
  return index.key(view.T_WS * on_ray_S) == voxel;
}

/// Do the four rays next to a direction end beyond a depth? In the outer half of an outermost
/// zone there are no four: there it is that zone's own.
inline bool SightLines::beyond(const ScanView& view, float tx, float ty, int zx, int zy,
                               float depth) const {
  const int cx = below(middle_, tx), cy = below(middle_, ty);
  const bool outside = cx < 0 || cy < 0 || cx >= kSide - 1 || cy >= kSide - 1;
  if (outside) return view.empty_to[static_cast<std::size_t>(kSide * zy + zx)] > depth;
  for (const int corner : {0, 1, kSide, kSide + 1}) {
    const float end = view.empty_to[static_cast<std::size_t>(kSide * cy + cx + corner)];
    if (!(end > depth)) return false;
  }
  return true;
}

inline Verdict SightLines::judge(const ScanView& view, float px, float py, float pz,
                                 const VoxelIndex& index, VoxelIndex::Key voxel) const {
  const float tx = px / pz, ty = py / pz, far = margin(static_cast<double>(pz));
  const int zx = std::clamp(below(border_, tx), 0, kSide - 1);
  const int zy = std::clamp(below(border_, ty), 0, kSide - 1);
  const float seen = view.obstacle[static_cast<std::size_t>(kSide * zy + zx)];
  if (seen > 0.0F && std::abs(seen - pz) <= far)
    return passes(view, zx, zy, pz, index, voxel) ? Verdict::kThere : Verdict::kNothing;
  if (!beyond(view, tx, ty, zx, zy, pz + far)) return Verdict::kNothing;
  const float dx = (tx - middle_[static_cast<std::size_t>(zx)]) * pz;
  const float dy = (ty - middle_[static_cast<std::size_t>(zy)]) * pz;
  const auto round_voxel = static_cast<float>(0.5 * std::numbers::sqrt3 * voxel_);
  return dx * dx + dy * dy <= round_voxel * round_voxel ? Verdict::kThrough : Verdict::kNothing;
}

inline Verdict SightLines::judge(const ScanView& view, const Vector3& point_W,
                                 const VoxelIndex& index) const {
  const Vector3 point_S = view.T_WS.linear().transpose() * (point_W - view.T_WS.translation());
  const auto px = static_cast<float>(point_S.x()), py = static_cast<float>(point_S.y()),
             pz = static_cast<float>(point_S.z());
  if (!in_view(px, py, pz)) return Verdict::kNothing;
  return judge(view, px, py, pz, index, index.key(point_W));
}

}  // namespace proxcgal::detail
